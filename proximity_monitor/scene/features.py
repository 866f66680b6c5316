"""Which triangle of a model a point in the world lies on, and where on it."""

from __future__ import annotations

import numpy as np

from proximity_monitor import engine


def feature(model: engine.TriangleMesh, pose: np.ndarray, point: np.ndarray) -> engine.Feature:
    """Return the place on a model that is nearest to a point.

    Args:
        model: in metres.
        pose: (4, 4) model to world.
        point: (3,) world; a witness point, so that the place is the point itself, to rounding.
    """
    found = engine.closest_points(model, pose, point[None])
    triangle = int(found.triangles[0])
    corners = model.vertices[model.faces[triangle]]
    own = pose[:3, :3].T @ (found.points[0] - pose[:3, 3])
    return engine.Feature(triangle, _weights(corners, own))


def _weights(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (3,), not negative, of a point of a triangle, which may be flat."""
    first, second, to_point = corners[1] - corners[0], corners[2] - corners[0], point - corners[0]
    a, b, c = first @ first, first @ second, second @ second
    area = a * c - b * b
    if area > 1e-12 * a * c:
        d, e = first @ to_point, second @ to_point
        weights = np.array([0.0, c * d - b * e, a * e - b * d]) / area
        weights[0] = 1.0 - weights[1] - weights[2]
    else:  # a segment or a point: of its longest edge
        edges = [(0, 1), (0, 2), (1, 2)]
        i, j = max(edges, key=lambda ij: float(np.sum((corners[ij[1]] - corners[ij[0]]) ** 2)))
        edge = corners[j] - corners[i]
        length = edge @ edge
        weights = np.zeros(3)
        weights[j] = (point - corners[i]) @ edge / length if length > 0.0 else 0.0
        weights[i] = 1.0 - weights[j]
    weights = np.clip(weights, 0.0, None)
    return weights / weights.sum()
