"""Models from dimensions and arrays: the shapes that a scene names, and what is made of them.

Whoever calls these knows a `Model` and not its kind, so a better kind for a shape, such as a solid
of revolution for a cylinder, is taken here alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import ModelError, checked_vertices
from .hierarchy import Solid
from .mesh import TriangleMesh
from .model import Model
from .tessellate import tessellated

_RESERVE = 1.0 + 1e-9
"""What rounding does to the corners of a tessellation is paid for by a larger deviation."""
_SUBDIVISIONS = 3
"""Of the icosahedron that stands for a ball where a mesh has to."""


class How(TypedDict, total=False):
    """What all shapes may be given; see `TriangleMesh`."""

    deviation: float
    """Metres; beside that of the shape itself."""
    volume: str
    solid: Solid


class Part(NamedTuple):
    """A model in a compound."""

    model: Model
    pose: NDArray[np.float64]
    """(4, 4) model to compound, metres."""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Factors along the model's own axes, not 0; a negative one mirrors it."""


class _Triangles(NamedTuple):
    """What a mesh consists of, metres."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    radius: float = 0.0
    deviation: float = 0.0

    def model(self, name: str, how: How) -> Model:
        deviation = self.deviation + how.get("deviation", 0.0)
        return triangles(
            self.vertices, self.faces, radius=self.radius, name=name,
            **how | {"deviation": deviation},
        )  # fmt: skip


def triangles(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    radius: float = 0.0,
    name: str = "mesh",
    **how: Unpack[How],
) -> Model:
    """Triangles (m, 3), by the indices of vertices (n, 3) in metres; see `TriangleMesh`."""
    return TriangleMesh(vertices, faces, radius=radius, name=name, **how)


def points(
    coordinates: ArrayLike, *, radius: float = 0.0, name: str = "points", **how: Unpack[How]
) -> Model:
    """Points, or with a radius spheres, as a model: each is a degenerate triangle.

    Args:
        coordinates: (n, 3) metres, model frame; n >= 1.
        radius: metres; of the spheres around them.
        name: what messages call it.
        how: see `How`.

    Raises:
        ModelError: as for TriangleMesh.
    """
    array = checked_vertices(coordinates, name)
    index = np.arange(len(array), dtype=np.int32)
    return triangles(
        array, np.stack((index, index, index), axis=1), radius=radius, name=name, **how
    )


def polyline(
    coordinates: ArrayLike, *, radius: float = 0.0, name: str = "polyline", **how: Unpack[How]
) -> Model:
    """A polyline, or with a radius a chain of capsules, as a model of degenerate triangles.

    Args:
        coordinates: (n, 3) metres, model frame; n >= 2; repeat the first point to close it.
        radius: metres; of the capsules.
        name: what messages call it.
        how: see `How`.

    Raises:
        ModelError: fewer than two points; else as for TriangleMesh.
    """
    array = checked_vertices(coordinates, name)
    if len(array) < 2:
        raise ModelError(f"{name}: a polyline needs at least two points, got {len(array)}")
    index = np.arange(len(array) - 1, dtype=np.int32)
    faces = np.stack((index, index + 1, index + 1), axis=1)
    return triangles(array, faces, radius=radius, name=name, **how)


def box(size: Sequence[float], *, name: str = "box", **how: Unpack[How]) -> Model:
    """An axis-aligned box around the origin; `size` (x, y, z) in metres."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    faces = np.concatenate((quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]))
    return triangles(corners * size, faces, name=name, **how)


def cylinder(
    radius: float, height: float, segments: int, *, name: str = "cylinder", **how: Unpack[How]
) -> Model:
    """A cylinder about z, centred on the origin; metres.

    It is a prism of `segments` sides, which deviates by ``radius * tan(pi / segments / 2) ** 2``:
    its sides are as far inside the cylinder as its edges are outside.
    """
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
    deviation = (larger - radius) * _RESERVE
    return _Triangles(vertices, faces, deviation=deviation).model(name, how)


def sphere(
    radius: float, subdivisions: int | None = None, *, name: str = "sphere", **how: Unpack[How]
) -> Model:
    """A sphere around the origin; metres.

    Args:
        radius: metres.
        subdivisions: how often an icosahedron is subdivided that stands for it; None: it is exact.
        name: what messages call it.
        how: see `How`.
    """
    if subdivisions is None:
        return points(np.zeros((1, 3)), radius=radius, name=name, **how)
    return _icosphere(radius, subdivisions).model(name, how)


def capsule(radius: float, length: float, *, name: str = "capsule", **how: Unpack[How]) -> Model:
    """All points within `radius` of a segment along z, centred on the origin; metres. Exact."""
    ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * length
    return polyline(ends, radius=radius, name=name, **how)


def compound(parts: Sequence[Part], *, name: str = "compound", **how: Unpack[How]) -> Model:
    """Several models as one.

    Parts that enclose a solid do so whatever the others are; but where ``solid="robust"``, the
    inside is that of all parts together. Where balls sweep only some parts, or are unlike, these
    parts become meshes, with a deviation.

    Raises:
        ModelError: a part that a ball sweeps is scaled by unlike factors.
    """
    placed = [_placed(part, name) for part in parts]
    if len({each.radius for each in placed}) > 1:
        placed = [_unswept(each) for each in placed]
    if how.get("solid") != "robust":
        # Open parts get each face once more, the other way round: so every edge is passed both
        # ways, they add nothing to a winding number, and their surface is the same.
        closed = [triangles(each.vertices, each.faces).is_solid for each in placed]
        if any(closed):
            placed = [
                each if is_closed else each._replace(faces=_both_ways(each.faces))
                for each, is_closed in zip(placed, closed, strict=True)
            ]
    starts = np.cumsum([0] + [len(each.vertices) for each in placed[:-1]])
    return _Triangles(
        np.concatenate([each.vertices for each in placed]),
        np.concatenate([each.faces + i for each, i in zip(placed, starts, strict=True)]),
        placed[0].radius,
        max(each.deviation for each in placed),
    ).model(name, how)


def _both_ways(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.concatenate((faces, faces[:, ::-1]))


def _placed(part: Part, name: str) -> _Triangles:
    """The triangles of a part in the frame of its compound."""
    core, scale = part.model._hierarchy, np.abs(part.scale)
    if core.swept_radius > 0.0 and np.ptp(scale) > 0.0:
        raise ModelError(
            f"{name}: {part.model.name}: scale = {part.scale}: a ball sweeps it, so all factors "
            "must be alike"
        )
    vertices = core.vertices * part.scale @ part.pose[:3, :3].T + part.pose[:3, 3]
    faces = core.faces
    if math.prod(part.scale) < 0.0:  # mirrored, which turns the outside in
        faces = faces[:, ::-1]
    if _volume(vertices, faces) < 0.0:
        faces = faces[:, ::-1]  # or where this part overlaps another, both would count for nothing
    return _Triangles(
        vertices, faces, core.swept_radius * float(scale[0]), core.deviation * float(scale.max())
    )


def _volume(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    """Six times what faces enclose; negative where they point inwards."""
    a, b, c = (vertices[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))


def _unswept(given: _Triangles) -> _Triangles:
    """The same as a mesh that nothing sweeps.

    Its corners lie on the surface and its faces within. So that it deviates half as much, to
    either side, it is made as much too large.
    """
    radius = given.radius
    if radius == 0.0:
        return given
    if len(given.faces) == 1 and not np.ptp(given.vertices, axis=0).any():
        ball = _icosphere(radius, _SUBDIVISIONS)
        return ball._replace(
            vertices=ball.vertices + given.vertices[0], deviation=ball.deviation + given.deviation
        )
    inside = tessellated(given.vertices, given.faces, radius, 0.0)[2]
    larger = 2.0 * radius**2 / (radius + inside)
    vertices, faces, _ = tessellated(given.vertices, given.faces, larger, 0.0)
    deviation = (larger - radius) * _RESERVE + given.deviation
    return _Triangles(vertices, faces, deviation=deviation)


def _icosphere(radius: float, subdivisions: int) -> _Triangles:
    """A subdivided icosahedron, whose corners are as far outside as its faces are inside."""
    vertices, faces = _icosahedron()
    for _ in range(subdivisions):
        ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, middles = np.unique(ends, axis=0, return_inverse=True)
        ab, bc, ca = (middles.reshape(-1, 3) + len(vertices)).T
        a, b, c = faces.T
        corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        faces = np.concatenate([np.stack(each, axis=1) for each in corners])
        between = vertices[edges].sum(axis=1)
        between /= np.linalg.norm(between, axis=1, keepdims=True)
        vertices = np.concatenate((vertices, between))
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    # The foot of the centre on a face is its circumcentre: all corners are as far from it.
    inside = (np.einsum("ij,ij->i", normals, a) / np.linalg.norm(normals, axis=1)).min()
    larger = 2.0 * radius / (1.0 + float(inside))
    return _Triangles(vertices * larger, faces, deviation=(larger - radius) * _RESERVE)


def _icosahedron() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Its twelve corners, of length 1, and twenty faces."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    signs = [(x, y) for x in (-1.0, 1.0) for y in (-golden, golden)]
    corners = np.array([np.roll((0.0, *each), k) for k in range(3) for each in signs])
    apart = np.linalg.norm(corners[:, None] - corners, axis=2)
    near = np.isclose(apart, 2.0)  # the length of its edges
    faces = [
        (i, j, k) if np.linalg.det(corners[[i, j, k]]) > 0.0 else (i, k, j)
        for i in range(12) for j in range(i) for k in range(j)
        if near[i, j] and near[j, k] and near[k, i]
    ]  # fmt: skip
    return corners / np.linalg.norm(corners[0]), np.array(faces)
