"""Polygons to triangles: as a fan, or by ear clipping if the fan would fold."""

from __future__ import annotations

import numpy as np

from .triangles import FormatError, Ints, Reals, Where, fans, first

_Point = tuple[float, float]

_BENT = 0.5
"""Largest height difference of a polygon's corners along its normal, as a share of its size. The
choice of the cut can move the surface by as much."""
_ROUNDING = float(np.finfo(np.float32).eps)
"""Relative rounding error of coordinates in most files, which store float32."""


def cut_polygons(vertices: Reals, corners: Ints, sizes: Ints, where: Where) -> Ints:
    """Cut polygons into triangles (m, 3): fans from the first corner, or ears if fans would fold.

    A fan folds if a triangle faces against the normal of the polygon's plane of best fit, which is
    the sum of the triangles' area vectors.

    Args:
        vertices: (n, 3).
        corners: (k,) indices of vertices, one polygon after the other.
        sizes: how many corners each polygon has.
        where: names the place of a polygon.

    Raises:
        FormatError: a polygon crosses itself, seen along its normal, or is far from flat; its
            meaning is unclear.
    """
    triangles = fans(corners, sizes, len(vertices), where)
    if (sizes == 3).all():
        return triangles
    owner, begins = np.repeat(np.arange(len(sizes)), sizes - 2), np.cumsum(sizes) - sizes
    starts = np.cumsum(sizes - 2) - (sizes - 2)
    with np.errstate(all="ignore"):  # vertices that are not finite are refused after reading
        a, b, c = vertices[triangles].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        whole = np.add.reduceat(normals, starts, axis=0)
        turns = np.einsum("ij,ij->i", normals, whole[owner])
        length = np.linalg.norm(whole, axis=1)
        units = whole / np.where(length > 0.0, length, 1.0)[:, None]
        points = vertices[corners] - np.repeat(vertices[corners[begins]], sizes, axis=0)
        heights = np.einsum("ij,ij->i", points, np.repeat(units, sizes, axis=0))
        extents = _spread(points, begins).max(axis=1)
        # A spike, whose area is within rounding, defines no plane. A fold as narrow as rounding is
        # not intended either.
        aside = _ROUNDING * np.maximum.reduceat(np.abs(vertices[corners]).max(axis=1), begins)
        slight = aside * extents
        bends = _spread(heights, begins)
        bent = first((bends > _BENT * extents) & (length > slight) & (sizes > 3))
    if bent is not None:
        raise FormatError(f"{where(bent)}a polygon is far from flat: export triangles instead")
    cut = triangles.copy()
    for polygon in np.unique(owner[turns < 0.0]).tolist():
        own = slice(starts[polygon], starts[polygon] + sizes[polygon] - 2)
        around = slice(begins[polygon], begins[polygon] + sizes[polygon])
        ring, normal = corners[around], units[polygon]
        flat = points[around] - heights[around, None] * normal
        axis = int(np.abs(normal).argmax())
        flat = np.roll(flat, -axis - 1, axis=1)[:, :2]
        found = _ears(flat if normal[axis] > 0.0 else flat[:, ::-1])
        if found is not None:
            cut[own] = ring[found]
        elif turns[own].min() < -slight[polygon] * length[polygon]:
            raise FormatError(f"{where(polygon)}a polygon crosses itself: export triangles instead")
    return cut


def _spread(values: Reals, begins: Ints) -> Reals:
    """Return the range (maximum minus minimum) of the values of each polygon."""
    return np.maximum.reduceat(values, begins) - np.minimum.reduceat(values, begins)


def _ears(points: Reals) -> Ints | None:
    """Cut a counterclockwise polygon (n, 2) into triangles (n - 2, 3) by clipping its ears.

    Return None if the polygon crosses itself. A corner on a straight line becomes a triangle
    without area, so that neighbouring faces still share its vertex. Such a corner is cut off only
    when no other one can be.
    """
    n, at = len(points), 0
    before, after = list(range(-1, n - 1)), [*range(1, n), 0]
    before[0] = n - 1
    place: list[_Point] = [(x, y) for x, y in points.tolist()]
    areas = [_area(place[before[i]], place[i], place[after[i]]) for i in range(n)]
    inward = np.array(areas) <= 0.0  # the corners that can lie in the triangle of an ear
    found, passed, straight = [], 0, None
    while len(found) < n - 3:
        a, b, c = place[before[at]], place[at], place[after[at]]
        if areas[at] > 0.0 and not _any_within(points[inward], a, b, c):
            cut = at
        else:
            if areas[at] == 0.0 and _dot(a, b, c) <= 0.0:
                straight = at
            at, passed = after[at], passed + 1
            if passed < n - len(found):
                continue
            if straight is None:
                return None
            cut = straight
        last, following = before[cut], after[cut]
        found.append((last, cut, following))
        inward[cut], after[last], before[following] = False, following, last
        for i in (last, following):
            areas[i] = _area(place[before[i]], place[i], place[after[i]])
            inward[i] = areas[i] <= 0.0
        at, passed, straight = last, 0, None
    left = (before[at], at, after[at])
    return np.array([*found, left]) if _area(*(place[i] for i in left)) >= 0.0 else None


def _any_within(others: Reals, *corners: _Point) -> bool:
    """Return whether any of the points (n, 2) lies in a triangle but at none of its corners."""
    x, y = others.T
    within = np.ones(len(others), np.bool_)
    for (px, py), (qx, qy) in zip(corners, corners[1:] + corners[:1], strict=True):
        within &= (qx - px) * (y - py) - (qy - py) * (x - px) >= 0.0
        within &= (x != px) | (y != py)
    return bool(within.any())


def _area(a: _Point, b: _Point, c: _Point) -> float:
    """Return twice the signed area of a triangle, negative if it is clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _dot(a: _Point, b: _Point, c: _Point) -> float:
    """Return (a - b) . (c - b). For points on a line, it is negative if b is between a and c."""
    return (a[0] - b[0]) * (c[0] - b[0]) + (a[1] - b[1]) * (c[1] - b[1])
