"""The shapes of primitives: triangles, the ball that sweeps them, and how far they deviate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.description import (
    Box,
    Capsule,
    Compound,
    Cylinder,
    Part,
    Point,
    Primitive,
    Sphere,
)
from proximity_monitor.scene.poses import rpy_matrix

_SUBDIVISIONS = 3
"""Of the icosahedron that stands for a sphere where a mesh has to."""
_RESERVE = 1.0 + 1e-9
"""What rounding does to the corners of a tessellation is paid for by a larger deviation."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles, and what `engine.TriangleMesh` is to know about them; metres."""

    vertices: np.ndarray
    faces: np.ndarray
    radius: float = 0.0
    deviation: float = 0.0

    def model(
        self, name: str, scale: float, deviation: float, how: dict[str, Any]
    ) -> engine.TriangleMesh:
        """The model `scale` times as large, which deviates by so much more, metres."""
        return engine.TriangleMesh(
            self.vertices * scale,
            self.faces,
            name=name,
            radius=self.radius * scale,
            deviation=self.deviation * scale + deviation,
            **how,
        )

    def tessellated(self) -> Shape:
        """The same as a mesh that nothing sweeps.

        Its corners lie on the surface and its faces within. So that it deviates half as much, to
        either side, it is made as much too large.
        """
        if self.radius == 0.0:
            return self
        core = engine.TriangleMesh(self.vertices, self.faces, radius=self.radius)
        if len(self.faces) == 1 and not np.ptp(self.vertices, axis=0).any():
            ball = _icosphere(self.radius, _SUBDIVISIONS)
            return replace(ball, vertices=ball.vertices + self.vertices[0])
        rough = core.tessellated()
        inside = self._least(rough.vertices, rough.faces)
        larger = replace(self, radius=2.0 * self.radius**2 / (self.radius + inside))
        mesh = engine.TriangleMesh(
            larger.vertices, larger.faces, radius=larger.radius
        ).tessellated()
        return Shape(mesh.vertices, mesh.faces, deviation=(larger.radius - self.radius) * _RESERVE)

    def _least(self, vertices: np.ndarray, faces: np.ndarray) -> float:
        """How near the faces of a mesh come to the triangles, metres; certified."""
        still = np.eye(4)
        a, b = (
            engine.TriangleMesh(*each, solid=False)
            for each in ((self.vertices, self.faces), (vertices, faces))
        )
        return engine.distance(a, still, b, still).lower


def shape_of(primitive: Primitive, *, robust: bool = False) -> Shape:
    """The shape of a primitive in the body's frame.

    Parts of a compound that enclose a solid do so whatever the others are; but where its inside is
    to be a `robust` one, it is that of all parts together.
    """
    if isinstance(primitive, Compound):
        shapes = _alike([_placed(part) for part in primitive.parts])
        return _joined(shapes if robust else _closed(shapes))
    if isinstance(primitive, Point):
        return Shape(np.zeros((1, 3)), np.zeros((1, 3), int))
    if isinstance(primitive, Sphere):
        if primitive.subdivisions is not None:
            return _icosphere(primitive.radius, primitive.subdivisions)
        return Shape(np.zeros((1, 3)), np.zeros((1, 3), int), primitive.radius)
    if isinstance(primitive, Capsule):
        ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * primitive.length
        return Shape(ends, np.array([[0, 1, 1]]), primitive.radius)
    # trimesh is slow to import, and a scene of other shapes can do without it.
    from trimesh import creation

    if isinstance(primitive, Box):
        mesh = creation.box(primitive.size)
        return Shape(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert isinstance(primitive, Cylinder)
    cosine = math.cos(math.pi / primitive.segments)
    # Sides and corners of the prism are as far inside as outside.
    radius = 2.0 * primitive.radius / (1.0 + cosine)
    mesh = creation.cylinder(radius, height=primitive.height, sections=primitive.segments)
    deviation = (radius - primitive.radius) * _RESERVE
    return Shape(np.asarray(mesh.vertices), np.asarray(mesh.faces), deviation=deviation)


def _icosphere(radius: float, subdivisions: int) -> Shape:
    """A subdivided icosahedron, whose corners are as far outside as its faces are inside."""
    from trimesh import creation

    mesh = creation.icosphere(subdivisions, 1.0)
    # The foot of the centre on a face is its circumcentre: all corners are as far from it.
    inside = float(np.abs(np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles[:, 0])).min())
    larger = 2.0 * radius / (1.0 + inside)
    return Shape(
        np.asarray(mesh.vertices) * larger,
        np.asarray(mesh.faces),
        deviation=(larger - radius) * _RESERVE,
    )


def _placed(part: Part) -> Shape:
    """The shape of a part in the frame of its compound."""
    if isinstance(part.shape, Path):
        mesh = engine.load(part.shape)
        shape = Shape(mesh.vertices, mesh.faces)
    else:
        shape = shape_of(part.shape)
    vertices, faces = shape.vertices, shape.faces
    if math.prod(part.scale) < 0.0:  # mirrored, which turns the outside in
        faces = faces[:, ::-1]
    if _volume(vertices, faces) * math.prod(part.scale) < 0.0:
        faces = faces[:, ::-1]  # or where this part overlaps another, both would count for nothing
    placed = vertices * part.scale @ rpy_matrix(part.rpy).T + part.xyz
    return replace(shape, vertices=placed, faces=faces)


def _volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Six times what faces enclose; negative where they point inwards."""
    a, b, c = (vertices[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))


def _alike(shapes: list[Shape]) -> list[Shape]:
    """Shapes that one ball sweeps; where balls sweep only some, or are unlike, they are meshes."""
    if len({shape.radius for shape in shapes}) > 1:
        return [shape.tessellated() for shape in shapes]
    return shapes


def _closed(shapes: list[Shape]) -> list[Shape]:
    """Shapes that enclose a solid together, if one of them does by itself.

    Open ones get each face once more, the other way round: so every edge is passed both ways, they
    add nothing to a winding number, and their surface is the same.
    """
    enclosing = [engine.TriangleMesh(shape.vertices, shape.faces).is_solid for shape in shapes]
    if not any(enclosing):
        return shapes
    return [
        shape
        if closed
        else replace(shape, faces=np.concatenate((shape.faces, shape.faces[:, ::-1])))
        for shape, closed in zip(shapes, enclosing, strict=True)
    ]


def _joined(shapes: list[Shape]) -> Shape:
    """Several shapes as one."""
    starts = np.cumsum([0] + [len(shape.vertices) for shape in shapes[:-1]])
    return Shape(
        np.concatenate([shape.vertices for shape in shapes]),
        np.concatenate([shape.faces + i for shape, i in zip(shapes, starts, strict=True)]),
        shapes[0].radius,
        max(shape.deviation for shape in shapes),
    )
