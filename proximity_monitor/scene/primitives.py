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
        engine.ModelError: it holds no usable mesh; an unknown volume.
    """
    if not (math.isfinite(body.scale) and body.scale > 0.0):
        raise ValueError(f"body '{body.name}': scale must be greater than 0 (got {body.scale})")
    if body.primitive is None:
        return engine.load(body.model, unit=unit.to_metre, scale=body.scale, volume=volume)
    vertices, faces = _mesh(body.primitive)
    return engine.TriangleMesh(vertices * body.scale, faces, name=body.name, volume=volume)


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
    return vertices * part.scale @ rpy_matrix(part.rpy).T + part.xyz, faces


def _joined(meshes: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)
