"""Oracles for the engine's answers. Nothing here shares code with the engine.

Exact oracles use integers and fractions, for single pairs of triangles. Brute-force oracles use
numpy, for every pair of triangles of two small meshes. FCL serves for larger meshes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from proximity_monitor import engine

Corners = Sequence[Sequence[float | Fraction]]
"""Three points."""

EDGES = ((0, 1), (1, 2), (2, 0))


# Exact arithmetic. Floats are dyadic, so one power of two scales them all to integers.


def _sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _point_segment(p, a, b):
    d, r = _sub(b, a), _sub(p, a)
    t, dd = _dot(r, d), _dot(d, d)
    if t <= 0:
        return Fraction(_dot(r, r))
    if t >= dd:
        q = _sub(p, b)
        return Fraction(_dot(q, q))
    c = _cross(r, d)
    return Fraction(_dot(c, c), dd)


def _segment_segment(a, b, c, d):
    """Return the squared distance of two segments.

    Either an end is nearest, or the common perpendicular has both feet inside the segments.
    """
    least = min(
        _point_segment(a, c, d),
        _point_segment(b, c, d),
        _point_segment(c, a, b),
        _point_segment(d, a, b),
    )
    u, v, r = _sub(b, a), _sub(d, c), _sub(c, a)
    n = _cross(u, v)
    nn = _dot(n, n)
    if nn:
        s, t = _dot(_cross(r, v), n), _dot(_cross(r, u), n)
        if 0 <= s <= nn and 0 <= t <= nn:
            h = _dot(r, n)
            least = min(least, Fraction(h * h, nn))
    return least


def _above(p, a, b, c, n):
    """Return whether the foot of p on a triangle's plane, with normal n, lies on the triangle."""
    return all(_dot(_cross(_sub(y, x), _sub(p, x)), n) >= 0 for x, y in ((a, b), (b, c), (c, a)))


def _point_face(p, a, b, c):
    """Return the squared distance to the triangle's plane if the foot is on it, else None."""
    n = _cross(_sub(b, a), _sub(c, a))
    nn = _dot(n, n)
    if nn == 0 or not _above(p, a, b, c, n):
        return None
    h = _dot(_sub(p, a), n)
    return Fraction(h * h, nn)


def _pierces(p, q, a, b, c):
    """Return whether a segment meets a triangle in one point, and does not lie in its plane."""
    n = _cross(_sub(b, a), _sub(c, a))
    side_p, side_q = _dot(_sub(p, a), n), _dot(_sub(q, a), n)
    if side_p == side_q or side_p * side_q > 0:
        return False
    # The meeting point, times (side_p - side_q), which is kept positive.
    w = side_p - side_q
    x = tuple(side_p * q[i] - side_q * p[i] for i in range(3))
    if w < 0:
        w, x = -w, tuple(-value for value in x)
    return _above(x, *(tuple(w * value for value in corner) for corner in (a, b, c)), n)


def exact_squared_distance(first: Corners, second: Corners) -> Fraction:
    """Return the squared distance of two triangles without rounding; they may be degenerate."""
    numbers = [Fraction(x) for corner in (*first, *second) for x in corner]
    scale = max(x.denominator for x in numbers)  # all denominators are powers of two
    integers = [int(x * scale) for x in numbers]
    points = [tuple(integers[i : i + 3]) for i in range(0, 18, 3)]
    a, b = points[:3], points[3:]
    crossing = any(_pierces(a[i], a[j], *b) for i, j in EDGES) or any(
        _pierces(b[i], b[j], *a) for i, j in EDGES
    )
    if crossing:
        return Fraction(0)
    found = [_segment_segment(a[i], a[j], b[k], b[m]) for i, j in EDGES for k, m in EDGES]
    found += [_point_face(p, *b) for p in a] + [_point_face(p, *a) for p in b]
    return min(x for x in found if x is not None) / scale**2


def root(x: Fraction) -> Fraction:
    """Return the square root with a relative error of at most 2^-150."""
    if x == 0:
        return x
    shift = max(0, 160 + (x.denominator.bit_length() - x.numerator.bit_length()) // 2)
    return Fraction(math.isqrt((x.numerator << 2 * shift) // x.denominator), 1 << shift)


Motion = Sequence[Sequence[float | Fraction]]
"""The rows of a pose; the first three are used."""


def exact_motion(pose_a: np.ndarray, pose_b: np.ndarray) -> list[list[Fraction]]:
    """Return the three rows that move b into the frame of a, without rounding.

    The transposed rotation of a serves as its inverse: the engine promises the distance under
    that motion.
    """
    first, second = ([[Fraction(x) for x in row] for row in p.tolist()] for p in (pose_a, pose_b))
    turned = [[row[j] for row in second[:3]] for j in range(3)]
    turned.append([b[3] - a[3] for a, b in zip(first[:3], second[:3], strict=True)])
    columns = [[row[i] for row in first[:3]] for i in range(3)]
    return [[_dot(column, each) for each in turned] for column in columns]


def exactly_moved(pose: Motion, corners: np.ndarray) -> list[list[Fraction]]:
    """Return points (n, 3) moved by a pose, without rounding."""
    rows = [[Fraction(x) for x in row] for row in pose]
    return [
        [sum(row[i] * Fraction(p[i]) for i in range(3)) + row[3] for row in rows[:3]]
        for p in corners.tolist()
    ]


# Brute force in float64 over every pair of triangles and every pair of features.


def triangles(mesh: engine.TriangleMesh, pose: np.ndarray | None = None) -> np.ndarray:
    """Return the corners (m, 3, 3) of a mesh's faces, in the world if a pose is given."""
    corners = mesh.vertices[mesh.faces]
    return corners if pose is None else corners @ pose[:3, :3].T + pose[:3, 3]


def _inner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i", a, b)


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)


def _to_segments(x: np.ndarray, p: np.ndarray, q: np.ndarray) -> np.ndarray:
    d = q - p
    t = np.clip(_ratio(_inner(x - p, d), _inner(d, d)), 0.0, 1.0)
    return np.linalg.norm(x - p - t[..., None] * d, axis=-1)


def _between_segments(p, q, r, s) -> np.ndarray:
    u, v, w = q - p, s - r, r - p
    ends = [_to_segments(p, r, s), _to_segments(q, r, s)]
    ends += [_to_segments(r, p, q), _to_segments(s, p, q)]
    n = np.cross(u, v)
    nn = _inner(n, n)
    a, b = _ratio(_inner(np.cross(w, v), n), nn), _ratio(_inner(np.cross(w, u), n), nn)
    inside = (nn > 0.0) & (a >= 0.0) & (a <= 1.0) & (b >= 0.0) & (b <= 1.0)
    middle = np.linalg.norm(w + b[..., None] * v - a[..., None] * u, axis=-1)
    return np.minimum(np.min(ends, axis=0), np.where(inside, middle, np.inf))


def _volumes(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return six times the signed volumes of tetrahedra."""
    return _inner(a - d, np.cross(b - d, c - d))


def _to_faces(x: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return distances of points to planes if the foot is on the triangle, else infinity."""
    n = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    inside = _inner(n, n) > 0.0
    for i, j in EDGES:
        inside &= _inner(np.cross(t[:, j] - t[:, i], x - t[:, i]), n) >= 0.0
    heights = np.abs(_inner(x - t[:, 0], n)) / np.linalg.norm(n, axis=1).clip(1e-300)
    return np.where(inside, heights, np.inf)


def _pairs(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pair every triangle of `first` with every triangle of `second`."""
    return np.repeat(first, len(second), axis=0), np.tile(second, (len(first), 1, 1))


def crossing(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return (n, m) whether triangles (n, 3, 3) and (m, 3, 3), in general position, cross."""
    a, b = _pairs(first, second)
    found = np.zeros(len(a), dtype=bool)
    for s, t in ((a, b), (b, a)):
        corners = t[:, 0], t[:, 1], t[:, 2]
        for i, j in EDGES:
            p, q = s[:, i], s[:, j]
            around = np.array([_volumes(p, q, corners[k], corners[m]) for k, m in EDGES])
            through = _volumes(*corners, p) * _volumes(*corners, q) < 0.0
            found |= through & ((around > 0.0).all(axis=0) | (around < 0.0).all(axis=0))
    return found.reshape(len(first), len(second))


def pairwise_distances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the distances (n, m) of triangles (n, 3, 3) and (m, 3, 3), exact up to rounding."""
    a, b = _pairs(first, second)
    found = [
        _between_segments(a[:, i], a[:, j], b[:, k], b[:, m]) for i, j in EDGES for k, m in EDGES
    ]
    found += [_to_faces(a[:, i], b) for i in range(3)] + [_to_faces(b[:, i], a) for i in range(3)]
    distances = np.min(found, axis=0)
    # Features of crossing triangles are no farther apart than the triangles are long. At larger
    # distances the signs of the volumes are only rounding noise.
    lengths = np.ptp(a, axis=1).sum(axis=1) + np.ptp(b, axis=1).sum(axis=1)
    distances[crossing(first, second).reshape(-1) & (distances <= lengths)] = 0.0
    return distances.reshape(len(first), len(second))


def exact_mesh_distance(
    a: engine.TriangleMesh,
    b: engine.TriangleMesh,
    pose_b: np.ndarray,
    pose_a: np.ndarray | None = None,
) -> Fraction:
    """Return the squared distance of two meshes without rounding; a's pose is the identity if None.

    Every pair of triangles is measured in float64, and the pairs that may be nearest exactly.
    """
    motion = exact_motion(np.eye(4) if pose_a is None else pose_a, pose_b)
    first, second = triangles(a), triangles(b)
    placed = triangles(b, np.array(motion, dtype=float))
    distances = pairwise_distances(first, placed)
    # How far rounding, and wrong signs in `crossing`, may put each distance off.
    size = np.add.outer(np.abs(first).max(axis=(1, 2)), np.abs(placed).max(axis=(1, 2)))
    doubt = 1e-9 * size
    near = np.argwhere(distances - doubt <= (distances + doubt).min())
    return min(
        exact_squared_distance(first[i].tolist(), exactly_moved(motion, second[j])) for i, j in near
    )


def exact_soup_distance(a: engine.TriangleMesh, b: engine.TriangleMesh) -> Fraction:
    """Return the squared distance of two meshes at the identity; every pair without rounding."""
    return min(
        exact_squared_distance(p, q) for p in triangles(a).tolist() for q in triangles(b).tolist()
    )


def magnitude(
    a: engine.TriangleMesh,
    b: engine.TriangleMesh,
    pose_a: np.ndarray | None = None,
    pose_b: np.ndarray | None = None,
) -> float:
    """Return the size of both models' coordinates in a's frame, metres: accuracy is relative to it.

    It is the larger of two lengths: from a's origin to a's farthest corner; and from a's origin to
    b's, plus from there to b's farthest corner.
    """
    apart = 0.0 if pose_a is None else float(np.linalg.norm(pose_b[:3, 3] - pose_a[:3, 3]))
    norms = [float(np.linalg.norm(triangles(mesh), axis=2).max()) for mesh in (a, b)]
    return max(norms[0], apart + norms[1])
