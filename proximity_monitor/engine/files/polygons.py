"""Polygons as triangles: fans, and where a fan would fold, what ears leave."""

from __future__ import annotations

import numpy as np

from .triangles import FormatError, Ints, Reals, Where, fans

_FLAT = 1e-4
"""Corners are in one plane if they are no farther from it than so much of the polygon's size."""
_ROUNDING = float(np.finfo(np.float32).eps)
"""Of coordinates in most files."""


def cut_polygons(vertices: Reals, corners: Ints, sizes: Ints, where: Where) -> Ints:
    """Polygons as triangles (m, 3): fans from the first corner, or the same number where they fold.

    Args:
        vertices: (n, 3).
        corners: (k,) indices of vertices, one polygon after the other.
        sizes: how many corners each polygon has.
        where: names the place of a polygon.

    Raises:
        FormatError: a concave polygon that is not flat or crosses itself: what it means is unclear.
    """
    triangles = fans(corners, sizes, len(vertices), where)
    if (sizes == 3).all():
        return triangles
    owner = np.repeat(np.arange(len(sizes)), sizes - 2)
    with np.errstate(all="ignore"):  # what is not finite is refused when all is read
        a, b, c = vertices[triangles].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        starts = np.cumsum(sizes - 2) - (sizes - 2)
        whole = np.add.reduceat(normals, starts, axis=0)
        turns = np.einsum("ij,ij->i", normals, whole[owner])
    cut, begins = triangles.copy(), np.cumsum(sizes) - sizes
    for polygon in np.unique(owner[turns < 0.0]).tolist():
        own = slice(starts[polygon], starts[polygon] + sizes[polygon] - 2)
        ring = corners[begins[polygon] : begins[polygon] + sizes[polygon]]
        points, normal = vertices[ring], whole[polygon]
        length = float(np.linalg.norm(normal))
        points = points - points[0]
        size = float(np.abs(points).max())
        found = None
        if float(np.abs(points @ normal).max()) <= _FLAT * size * length:
            axis = int(np.abs(normal).argmax())
            flat = np.roll(points, -axis - 1, axis=1)[:, :2]
            found = _ears(flat if normal[axis] > 0.0 else flat[:, ::-1])
        # A fold that is no wider than coordinates are rounded is none that anybody meant.
        aside = _ROUNDING * float(np.abs(vertices[ring]).max()) * size * length
        if found is not None:
            cut[own] = ring[found]
        elif turns[own].min() < -aside:
            raise FormatError(
                f"{where(polygon)}a concave polygon that is not flat or crosses itself: "
                "export triangles instead"
            )
    return cut


def _ears(points: Reals) -> Ints | None:
    """A polygon (n, 2) that turns left, as triangles (n - 2, 3); None: it crosses itself.

    Corners on a straight line make triangles without area, so that its neighbours still meet it.
    """
    left, found = list(range(len(points))), []
    while len(left) > 3:
        at = _ear(points, left)
        if at is None:
            return None
        found.append((left[at - 1], left[at], left[(at + 1) % len(left)]))
        del left[at]
    return np.array([*found, left]) if _area(*points[left]) >= 0.0 else None


def _ear(points: Reals, left: list[int]) -> int | None:
    """Where a corner may be cut off; one on a straight line if no other may."""
    straight = None
    for at, corner in enumerate(left):
        a, b, c = points[left[at - 1]], points[corner], points[left[(at + 1) % len(left)]]
        area = _area(a, b, c)
        if area == 0.0 and (a - b) @ (c - b) <= 0.0:
            straight = at
        if area <= 0.0:
            continue
        others = points[left]
        sides = [_area(p, q, others) for p, q in ((a, b), (b, c), (c, a))]
        own = [(others == each).all(axis=1) for each in (a, b, c)]
        if not (np.all(np.array(sides) >= 0.0, axis=0) & ~np.any(own, axis=0)).any():
            return at
    return straight


def _area(a: Reals, b: Reals, c: Reals) -> Reals:
    """Twice the area of a triangle, below 0 where it turns right; of several c (n, 2): each."""
    return (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])
