"""Brute force in numpy: the largest ball inside two solids, and a surface's deepest point."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from engine_oracles import triangles

from proximity_monitor import engine

MANY = 20_000
"""Most points that one step of a search may evaluate."""

Depths = Callable[[np.ndarray], np.ndarray]


def winding_numbers(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return winding numbers: the sum of the triangles' solid angles over 4 pi, not rounded.

    The solid angles are those of Van Oosterom and Strackee 1983.
    """
    a, b, c = (corners[None, :, i] - points[:, None] for i in range(3))
    x, y, z = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    volume = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
    below = x * y * z
    for p, q, r in ((a, b, z), (b, c, x), (c, a, y)):
        below = below + np.einsum("ijk,ijk->ij", p, q) * r
    return (2.0 * np.arctan2(volume, below)).sum(axis=1) / (4.0 * math.pi)


def point_distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the distances (k,) of points (k, 3) to the nearest of the triangles (m, 3, 3)."""
    squared = np.full(len(points), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for a, b, c in corners:
            n = np.cross(b - a, c - a)
            inside = np.full(len(points), n @ n > 0.0)
            for p, q in ((a, b), (b, c), (c, a)):
                e = q - p
                s = np.clip(np.nan_to_num((points - p) @ e / (e @ e)), 0.0, 1.0)
                squared = np.minimum(squared, ((points - p - s[:, None] * e) ** 2).sum(axis=1))
                inside &= (points - p) @ np.cross(n, e) >= 0.0
            height = (points - a) @ n / math.sqrt(n @ n) if n @ n > 0.0 else np.inf
            squared = np.where(inside, np.minimum(squared, height * height), squared)
    return np.sqrt(squared)


def depths_in(model: engine.TriangleMesh, pose: np.ndarray) -> Depths:
    """Return a function that tells how deep points lie inside a model; negative outside."""
    corners = triangles(model, pose)

    def depths(points: np.ndarray) -> np.ndarray:
        away = point_distances(points, corners)
        if model.swept_radius > 0.0 and len(np.unique(corners.reshape(-1, 3), axis=0)) < 3:
            return model.swept_radius - away
        inside = np.abs(winding_numbers(points, corners)) > 0.5
        return model.swept_radius + np.where(inside, away, -away)

    return depths


def largest(low: np.ndarray, high: np.ndarray, depths: list[Depths], steps: int = 6):
    """Find, over the points of a box, the largest of the smallest of several depths.

    Depths change by no more than points move (Lipschitz bound). Returns the largest value found,
    which is a lower bound, and an upper bound on what any unsearched cell may hold.
    """
    centres, half = ((low + high) / 2.0)[None], (high - low) / 2.0
    best, left = 0.0, math.inf
    offsets = np.array(np.meshgrid(*3 * [[-1.0, 1.0]])).reshape(3, -1).T
    for _ in range(steps):
        if len(centres) * 8 > MANY:
            break
        half = half / 2.0
        centres = (centres[:, None] + offsets * half).reshape(-1, 3)
        values = np.full(len(centres), np.inf)
        for each in depths:
            values = np.minimum(values, each(centres))
        best = max(best, float(values.max()))
        reach = float(np.linalg.norm(half))
        centres = centres[values + reach > best]
        left = max(float(values.max()) + reach, 0.0)
        if not len(centres):
            return best, left
    return best, left


def depth_of_solids(a, pose_a, b, pose_b, steps: int = 6) -> tuple[float, float]:
    """Return bounds of the diameter of the largest ball inside both solids."""
    boxes = []
    for model, pose in ((a, pose_a), (b, pose_b)):
        points = triangles(model, pose).reshape(-1, 3)
        boxes.append((points.min(axis=0) - model.swept_radius, points.max(axis=0)))
        boxes[-1] = boxes[-1][0], boxes[-1][1] + model.swept_radius
    low, high = np.maximum(boxes[0][0], boxes[1][0]), np.minimum(boxes[0][1], boxes[1][1])
    if not (low <= high).all():
        return 0.0, 0.0
    shallow, deep = largest(low, high, [depths_in(a, pose_a), depths_in(b, pose_b)], steps)
    return 2.0 * shallow, 2.0 * deep


def deepest_of_surface(solid, pose_solid, surface, pose_surface, cuts: int = 5):
    """Return bounds of the depth of a surface's deepest point, from points on its triangles."""
    depths = depths_in(solid, pose_solid)
    s, t = np.meshgrid(*2 * [np.arange(cuts + 1) / cuts])
    s, t = s[s + t <= 1.0 + 1e-9], t[s + t <= 1.0 + 1e-9]
    corners = triangles(surface, pose_surface)
    a, e, f = corners[:, :1], corners[:, 1:2] - corners[:, :1], corners[:, 2:] - corners[:, :1]
    found = depths((a + s[:, None] * e + t[:, None] * f).reshape(-1, 3)).reshape(len(corners), -1)
    reach = np.linalg.norm([e[:, 0], f[:, 0], f[:, 0] - e[:, 0]], axis=2).max(axis=0) / cuts
    return max(float(found.max()), 0.0), max(float((found.max(axis=1) + reach).max()), 0.0)
