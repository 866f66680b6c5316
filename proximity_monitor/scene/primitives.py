"""From a scene's body to a triangle mesh."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.description import (
    Body,
    Box,
    Compound,
    Cylinder,
    Part,
    Point,
    Primitive,
    Unit,
)
from proximity_monitor.scene.poses import rpy_matrix


def load_model(body: Body, unit: Unit, *, volume: str = "rss") -> engine.TriangleMesh:
    """Load a body's model file, or make the mesh of its primitive.

    Args:
        body: of a loaded scene, or made by hand; its scale must be greater than 0.
        unit: the length unit of model files that do not state their own.
        volume: the bounding volumes, as for engine.TriangleMesh.

    Returns:
        The mesh in metres, in the body's own frame.

    Raises:
        ValueError: the scale is not a number greater than 0.
        FileNotFoundError: the model file is gone.
        engine.ModelError: it holds no usable mesh; an unknown volume; no solid where the scene says
            that it is one: then the message names the file, line and key.
    """
    if not (math.isfinite(body.scale) and body.scale > 0.0):
        raise ValueError(f"body '{body.name}': scale must be greater than 0 (got {body.scale})")
    how = {"volume": volume, "solid": None if body.solid is True else body.solid}
    if body.primitive is None:
        model = engine.load(body.model, unit=unit.to_metre, scale=body.scale, **how)
    else:
        vertices, faces = _mesh(body.primitive)
        model = engine.TriangleMesh(vertices * body.scale, faces, name=body.name, **how)
    check_solid(body, model)
    return model


def check_solid(body: Body, model: engine.TriangleMesh) -> None:
    """Raise ModelError where a body must be a solid and its model is none; it says where."""
    if body.solid is True and not model.is_solid:
        raise engine.ModelError(
            f"{body.solid_at or 'solid'}: true, but body '{body.name}' is none: {model.not_solid}; "
            "repair the model, say 'robust', which bridges holes, or leave the key out"
        )


def _mesh(primitive: Primitive) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) in metres and faces (m, 3)."""
    if isinstance(primitive, Point):
        return np.zeros((1, 3)), np.zeros((1, 3), dtype=np.int32)
    if isinstance(primitive, Compound):
        return _joined([_placed(part) for part in primitive.parts])
    # trimesh is slow to import, and a scene of other shapes can do without it.
    from trimesh import creation

    if isinstance(primitive, Box):
        mesh = creation.box(primitive.size)
    elif isinstance(primitive, Cylinder):
        mesh = creation.cylinder(
            primitive.radius, height=primitive.height, sections=primitive.segments
        )
    else:
        mesh = creation.icosphere(primitive.subdivisions, primitive.radius)
    return mesh.vertices, mesh.faces


def _placed(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """The mesh of a part in the frame of its compound."""
    if not isinstance(part.shape, Path):
        vertices, faces = _mesh(part.shape)
    else:
        mesh = engine.load(part.shape)
        vertices, faces = mesh.vertices, mesh.faces
    if math.prod(part.scale) < 0.0:  # mirrored, which turns the outside in
        faces = faces[:, ::-1]
    if _volume(vertices, faces) * math.prod(part.scale) < 0.0:
        faces = faces[:, ::-1]  # or where this part overlaps another, both would count for nothing
    return vertices * part.scale @ rpy_matrix(part.rpy).T + part.xyz, faces


def _volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Six times what faces enclose; negative where they point inwards."""
    a, b, c = (vertices[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))


def _joined(meshes: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)
