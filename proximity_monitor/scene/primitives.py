"""From a scene's body to its model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.description import (
    Body,
    Box,
    Capsule,
    Compound,
    Cylinder,
    Part,
    Point,
    Primitive,
    Sphere,
    Unit,
)
from proximity_monitor.scene.poses import rpy_matrix

_SUBDIVISIONS = 3
"""Of the icosahedron that a deforming sphere is."""

_SEGMENTS = 64
"""Sides of the prism that a cylinder is where it has to be a mesh: as a deforming one, in a link
of several shapes, or with what meshes alone may have."""


def load_model(body: Body, unit: Unit, *, volume: str = "rss") -> engine.Model:
    """Load a body's model file, or make the model of its primitive.

    Args:
        body: of a loaded scene, or made by hand; its scale must be greater than 0.
        unit: the length unit of model files that do not state their own.
        volume: the bounding volumes, as for engine.TriangleMesh.

    Returns:
        The model in metres, in the body's own frame.

    Raises:
        ValueError: the scale is not a number greater than 0.
        FileNotFoundError: the model file is gone.
        engine.ModelError: it holds no usable model; an unknown volume; no solid where the scene
            says that it is one: then the message names the file, line and key.
    """
    if not (math.isfinite(body.scale) and body.scale > 0.0):
        raise ValueError(f"body '{body.name}': scale must be greater than 0 (got {body.scale})")
    how = {"volume": volume, "solid": None if body.solid is True else body.solid}
    deviation = {"deviation": body.deviation}
    if body.primitive is None:
        model = engine.load(
            body.model, unit=unit.to_metre, scale=body.scale, part=body.part, **deviation, **how
        )
    elif body.deforming:
        model = _mesh_of(body.primitive, body.scale, body.name, how)
    else:
        model = _shape(body.primitive, body.scale, name=body.name, **deviation, **how)
    check_solid(body, model)
    return model


def check_solid(body: Body, model: engine.Model) -> None:
    """Raise ModelError if a body must be a solid and its model is none."""
    if body.solid is True and not model.is_solid:
        raise engine.ModelError(
            f"{body.solid_at or 'solid'}: true, but body '{body.name}' is none: {model.not_solid}; "
            "repair the model, say 'robust', which bridges holes, or leave the key out"
        )


def _shape(primitive: Primitive, scale: float, **how: Any) -> engine.Model:
    """The model of a primitive in the body's frame; `how` is as for `engine.shapes`."""
    shapes = engine.shapes
    match primitive:
        case Box(size):
            return shapes.box([length * scale for length in size], **how)
        case Cylinder(radius, height, segments):
            if _needs_mesh(how):
                segments = segments or _SEGMENTS
            return shapes.cylinder(radius * scale, height * scale, segments, **how)
        case Sphere(radius, subdivisions):
            return shapes.sphere(radius * scale, subdivisions, **how)
        case Capsule(radius, length):
            return shapes.capsule(radius * scale, length * scale, **how)
        case Point():
            return shapes.points(np.zeros((1, 3)), **how)
        case Compound(parts):
            return shapes.compound([_part(part, scale) for part in _joined(parts, how)], **how)


def _needs_mesh(how: dict[str, Any]) -> bool:
    """Whether only a mesh can be made like that."""
    return how.get("volume", "rss") != "rss" or how.get("solid") == "robust"


def _joined(parts: Sequence[Part], how: dict[str, Any]) -> Sequence[Part]:
    """Parts that make one model: beside others, cylinders are meshes as well."""
    if len(parts) == 1 and not _needs_mesh(how):
        return parts
    return [
        replace(part, shape=replace(part.shape, segments=part.shape.segments or _SEGMENTS))
        if isinstance(part.shape, Cylinder)
        else part
        for part in parts
    ]


def _part(part: Part, scale: float) -> engine.shapes.Part:
    """A part of a compound that is `scale` times as large."""
    found = part.shape
    model = engine.load(found) if isinstance(found, Path) else _shape(found, 1.0)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rpy_matrix(part.rpy), np.multiply(part.xyz, scale)
    return engine.shapes.Part(model, pose, tuple(factor * scale for factor in part.scale))


def _mesh_of(primitive: Primitive, scale: float, name: str, how: dict[str, Any]) -> engine.Model:
    """A mesh that begins as a primitive; then its vertices go wherever they are told."""
    if isinstance(primitive, Sphere) and primitive.subdivisions is None:
        primitive = Sphere(primitive.radius, _SUBDIVISIONS)
    if isinstance(primitive, Cylinder) and primitive.segments is None:
        primitive = replace(primitive, segments=_SEGMENTS)
    vertices, faces, _ = _shape(primitive, scale).display_mesh(0.0)
    return engine.shapes.triangles(vertices, faces, name=name, **how)
