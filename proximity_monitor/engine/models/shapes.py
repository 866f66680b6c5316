"""Make models from dimensions and arrays: the shapes of scenes, and compounds of them.

All lengths are metres, in the model frame. The functions return a `Model` without promising its
kind, so a better kind for a shape can be chosen here alone. Spheres and capsules are a point and a
segment swept by a ball. This is exact, and two to five times as fast as the same solid of
revolution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import as_count, as_reals
from ..kernels.base.rounding import LARGEST_COORDINATE
from .checks import ModelError, checked_length, checked_vertices
from .compound import Part, compound, unswept
from .facets import Facets, How, deviation_of, icosphere
from .mesh import TriangleMesh
from .model import Model
from .patch import Curve
from .revolution import SolidOfRevolution
from .surface import ParametricSurface

__all__ = [
    "How",
    "Part",
    "box",
    "capsule",
    "compound",
    "cone",
    "cylinder",
    "points",
    "polyline",
    "sphere",
    "torus",
    "triangles",
    "unswept",
]


def triangles(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    radius: float = 0.0,
    name: str = "mesh",
    **how: Unpack[How],
) -> Model:
    """Make a mesh of triangles, perhaps swept by a ball; see `TriangleMesh`.

    Args:
        vertices: (n, 3) metres, model frame.
        faces: (m, 3) indices of vertices.
        radius: metres; radius of the ball that sweeps the triangles.
        name: what messages call the model.
        how: see `How`.

    Raises:
        ModelError: as for `TriangleMesh`.
    """
    return TriangleMesh(vertices, faces, radius=radius, name=name, **how)


def points(
    coordinates: ArrayLike, *, radius: float = 0.0, name: str = "points", **how: Unpack[How]
) -> Model:
    """Make a model of points or, with a radius, of spheres. Each is a degenerate triangle.

    Args:
        coordinates: (n, 3) metres, model frame; n >= 1.
        radius: metres; radius of the spheres around the points.
        name: what messages call the model.
        how: see `How`.

    Raises:
        ModelError: as for `TriangleMesh`.
    """
    array = checked_vertices(coordinates, name)
    index = np.arange(len(array), dtype=np.int32)
    return triangles(
        array, np.stack((index, index, index), axis=1), radius=radius, name=name, **how
    )


def polyline(
    coordinates: ArrayLike, *, radius: float = 0.0, name: str = "polyline", **how: Unpack[How]
) -> Model:
    """Make a polyline or, with a radius, a chain of capsules, of degenerate triangles.

    Args:
        coordinates: (n, 3) metres, model frame; n >= 2. Repeat the first point to close it.
        radius: metres; radius of the capsules.
        name: what messages call the model.
        how: see `How`.

    Raises:
        ModelError: there are fewer than two points; else as for `TriangleMesh`.
    """
    array = checked_vertices(coordinates, name)
    if len(array) < 2:
        raise ModelError(f"{name}: a polyline needs at least two points, got {len(array)}")
    index = np.arange(len(array) - 1, dtype=np.int32)
    faces = np.stack((index, index + 1, index + 1), axis=1)
    return triangles(array, faces, radius=radius, name=name, **how)


def box(size: Sequence[float], *, name: str = "box", **how: Unpack[How]) -> Model:
    """Make an axis-aligned box centred on the origin.

    Args:
        size: (3,) metres; the lengths along x, y and z.
        name: what messages call the model.
        how: see `How`.

    Raises:
        ModelError: `size` is not three numbers from 0 to 1e45; else as for `TriangleMesh`.
    """
    given = as_reals(size, f"{name}: size", error=ModelError)
    if given.shape != (3,) or not ((given >= 0.0) & (given <= LARGEST_COORDINATE)).all():
        raise ModelError(
            f"{name}: size = {size!r}: must be three lengths from 0 to {LARGEST_COORDINATE:g} m"
        )
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    faces = np.concatenate((quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]))
    return triangles(corners * given, faces, name=name, **how)


def cylinder(
    radius: float,
    height: float,
    segments: int | None = None,
    *,
    name: str = "cylinder",
    **how: Unpack[How],
) -> Model:
    """Make a cylinder about z, centred on the origin.

    Args:
        radius: metres.
        height: metres.
        segments: the number of sides of a prism in its place, at least 3. The prism's sides are as
            far inside the cylinder as its edges are outside, so that it deviates by
            ``radius * tan(pi / segments / 2) ** 2``. None: the cylinder is exact.
        name: what messages call the model.
        how: see `How`; an exact one takes no `volume` and no solid='robust'.

    Raises:
        ModelError: a length is no number from 0 to 1e45; `segments` is less than 3; else as for
            `SolidOfRevolution` if it is exact, or for `TriangleMesh`.
        TypeError: `segments` is no whole number.
        ValueError: `segments` is less than 1.
    """
    if segments is None:
        return cone(_above_zero(radius, name, "radius"), radius, height, name=name, **how)
    if as_count(segments, "segments") < 3:
        raise ModelError(f"{name}: segments = {segments}: a prism has at least 3 sides")
    radius = checked_length(radius, name, "radius")
    height = checked_length(height, name, "height")
    larger = 2.0 * radius / (1.0 + math.cos(math.pi / segments))
    turn = np.arange(segments) * (2.0 * math.pi / segments)
    ring = np.stack((np.cos(turn), np.sin(turn), np.zeros(segments)), axis=1) * larger
    up = np.array([0.0, 0.0, 0.5 * height])
    vertices = np.concatenate((ring - up, ring + up, [-up, up]))
    low = np.arange(segments)
    beside, high, bottom, top = (low + 1) % segments, low + segments, 2 * segments, 2 * segments + 1
    corners = (
        (low, beside, beside + segments),
        (low, beside + segments, high),
        (beside, low, np.full(segments, bottom)),
        (high, beside + segments, np.full(segments, top)),
    )
    faces = np.concatenate([np.stack(each, axis=1) for each in corners])
    deviation = deviation_of(larger, radius)
    return Facets(vertices, faces, deviation=deviation).model(name, how)


def sphere(
    radius: float, subdivisions: int | None = None, *, name: str = "sphere", **how: Unpack[How]
) -> Model:
    """Make a sphere centred on the origin.

    Args:
        radius: metres.
        subdivisions: how often an icosahedron in its place is subdivided, from 0 on. None: the
            sphere is exact.
        name: what messages call the model.
        how: see `How`.

    Raises:
        ModelError: as for `TriangleMesh`.
        TypeError: `subdivisions` is no whole number.
        ValueError: `subdivisions` is negative.
    """
    if subdivisions is None:
        return points(np.zeros((1, 3)), radius=radius, name=name, **how)
    count = as_count(subdivisions, "subdivisions", least=0)
    return icosphere(radius, count).model(name, how)


def capsule(radius: float, length: float, *, name: str = "capsule", **how: Unpack[How]) -> Model:
    """Make a capsule: all points within a radius of a segment along z centred on the origin. Exact.

    Args:
        radius: metres.
        length: metres; length of the segment.
        name: what messages call the model.
        how: see `How`.

    Raises:
        ModelError: `length` is no number from 0 to 1e45; else as for `TriangleMesh`.
    """
    ends = np.array([[0, 0, -0.5], [0, 0, 0.5]]) * checked_length(length, name, "length")
    return polyline(ends, radius=radius, name=name, **how)


def cone(
    low: float, high: float, height: float, *, name: str = "cone", **how: Unpack[How]
) -> Model:
    """Make a cone about z, or a frustum, with half its height below the origin. Exact.

    Args:
        low: metres; the radius at the lower end, 0 at an apex.
        high: metres; the radius at the upper end, 0 at an apex.
        height: metres.
        name: what messages call the model.
        how: see `How`; it takes no `volume` and no solid='robust'.

    Raises:
        ModelError: a length is no number from 0 to 1e45; the height or both radii are 0; `how` asks
            for a `volume` or solid='robust'; else as for `SolidOfRevolution`.
    """
    low, high = checked_length(low, name, "low"), checked_length(high, name, "high")
    if not max(low, high) > 0.0:
        raise ModelError(f"{name}: low and high are 0: one radius must be above 0")
    end = 0.5 * _above_zero(height, name, "height")
    corners = [(0.0, -end), (low, -end), (high, end), (0.0, end)]
    proper = [pair for pair in pairwise(corners) if pair[0] != pair[1]]
    return _revolved([Curve(pair) for pair in proper], name, how)


def torus(large: float, small: float, *, name: str = "torus", **how: Unpack[How]) -> Model:
    """Make a torus about z, centred on the origin. Exact.

    Args:
        large: metres; the radius of the circle in the middle of the tube.
        small: metres; the radius of the tube, at most `large`.
        name: what messages call the model.
        how: see `How`; it takes no `volume` and no solid='robust'.

    Raises:
        ModelError: a length is no number from 0 to 1e45; `small` is 0 or above `large`; `how` asks
            for a `volume` or solid='robust'; else as for `SolidOfRevolution`.
    """
    large, small = checked_length(large, name, "large"), _above_zero(small, name, "small")
    if small > large:
        raise ModelError(f"{name}: small = {small!r}: must be at most large = {large!r} m")
    rim = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    points = [(large + small * x, small * z) for x, z in rim]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    return _revolved([Curve(points, knots, [1.0, math.sqrt(0.5)] * 4 + [1.0])], name, how)


def _above_zero(value: float, name: str, what: str) -> float:
    """Return a length in metres as a float; raises ModelError unless it is above 0."""
    if not (length := checked_length(value, name, what)) > 0.0:
        raise ModelError(f"{name}: {what} = {value!r}: must be above 0")
    return length


def _revolved(curves: Sequence[Curve], name: str, how: How) -> Model:
    """Make the solid of revolution of a profile about z; if `solid` is False, its surface alone."""
    if how.get("volume", "rss") != "rss" or how.get("solid") == "robust":
        raise ModelError(f"{name}: volume and solid='robust' are only for meshes, not for surfaces")
    made = SolidOfRevolution(curves, name=name, deviation=how.get("deviation", 0.0))
    if how.get("solid") is not False:
        return made
    return ParametricSurface.of(made.nets, name=name, deviation=made.deviation, solid=False)
