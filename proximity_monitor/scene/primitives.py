"""Makes the model of a scene's body."""

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
    Cone,
    Cylinder,
    Part,
    Point,
    Primitive,
    Sphere,
    Torus,
    Unit,
)
from proximity_monitor.scene.poses import rpy_matrix

_SAME = 1e-9
"""Fraction of a cylinder's height by which a ball's centre may be off the cylinder's end."""

_SEGMENTS = 64
"""Sides of the prism that stands for a cylinder if it must be a mesh: a deforming cylinder, one in
a link of several shapes, or one with options that only meshes have."""


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
        engine.ModelError: the file holds no usable model; the volume is unknown; or the scene says
            that the body is a solid and it is none (the message then names file, line and key).
    """
    if not (math.isfinite(body.scale) and body.scale > 0.0):
        raise ValueError(f"body '{body.name}': scale must be greater than 0 (got {body.scale})")
    solid = None if body.solid is True else body.solid
    how = {"volume": volume, "solid": solid, "deviation": body.deviation}
    if body.primitive is None:
        model = engine.load(body.model, unit=unit.to_metre, scale=body.scale, part=body.part, **how)
    elif body.deforming and not isinstance(body.primitive, Cone | Torus):
        model = _mesh_of(body.primitive, body.scale, body.name, how)
    else:
        model = _shape(body.primitive, body.scale, name=body.name, **how)
    check_solid(body, model)
    return model


def check_solid(body: Body, model: engine.Model) -> None:
    """Raise ModelError if a body must be a solid but its model is none."""
    if body.solid is True and not model.is_solid:
        raise engine.ModelError(
            f"{body.solid_at or 'solid'}: true, but body '{body.name}' is not a solid: "
            f"{model.not_solid}; repair the model, write 'solid: robust', "
            "which bridges holes, or remove the key"
        )


def _shape(primitive: Primitive, scale: float, **how: Any) -> engine.Model:
    """Return the model of a primitive in the body's frame; `how` is as for `engine.shapes`."""
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
        case Cone(radius, height, top_radius):
            return shapes.cone(radius * scale, top_radius * scale, height * scale, **how)
        case Torus(radius, tube):
            return shapes.torus(radius * scale, tube * scale, **how)
        case Point():
            return shapes.points(np.zeros((1, 3)), **how)
        case Compound(parts):
            parts, off = _with_capsules(parts)
            how["deviation"] = how.get("deviation", 0.0) + off * scale
            return shapes.compound([_part(part, scale) for part in _joinable(parts, how)], **how)


def _needs_mesh(how: dict[str, Any]) -> bool:
    """Return whether only a mesh can have these options."""
    return how.get("volume", "rss") != "rss" or how.get("solid") == "robust"


def _with_capsules(parts: Sequence[Part]) -> tuple[list[Part], float]:
    """Replace each cylinder that has a ball of the same radius at both ends by a capsule.

    Robot descriptions write a capsule in this way. Return the parts, and how far a capsule may be
    from the three parts that it replaces, metres.
    """
    made, known, off = [], [], 0.0
    for part in parts:
        balls = _balls_at_ends(part, parts)
        if balls is None:
            made.append(part)
            continue
        made.append(replace(part, shape=Capsule(part.shape.radius, part.shape.height)))
        known += [ball for ball, _ in balls]
        off = max(off, *(away for _, away in balls))
    return [part for part in made if not any(part is ball for ball in known)], off


def _balls_at_ends(part: Part, parts: Sequence[Part]) -> list[tuple[Part, float]] | None:
    """Return the balls at both ends of a cylinder, with their distances from the ends in metres.

    Return None if the part is no exact cylinder, or if an end has no ball.
    """
    if not isinstance(part.shape, Cylinder) or part.shape.segments is not None:
        return None
    half = 0.5 * part.shape.height * rpy_matrix(part.rpy)[:, 2]
    found = []
    for end in (part.xyz - half, part.xyz + half):
        balls = [
            (math.dist(each.xyz, end), k)
            for k, each in enumerate(parts)
            if each.shape == Sphere(part.shape.radius)
        ]
        away, k = min(balls, default=(math.inf, 0))
        if not away <= _SAME * part.shape.height:
            return None
        found.append((parts[k], away))
    return found


def _joinable(parts: Sequence[Part], how: dict[str, Any]) -> Sequence[Part]:
    """Return parts that can make one model: a cylinder beside other parts becomes a prism."""
    if len(parts) == 1 and not _needs_mesh(how):
        return parts
    return [
        replace(part, shape=replace(part.shape, segments=part.shape.segments or _SEGMENTS))
        if isinstance(part.shape, Cylinder)
        else part
        for part in parts
    ]


def _part(part: Part, scale: float) -> engine.shapes.Part:
    """Return the engine's part for a part of a compound that is enlarged by `scale`."""
    found = part.shape
    model = engine.load(found) if isinstance(found, Path) else _shape(found, 1.0)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rpy_matrix(part.rpy), np.multiply(part.xyz, scale)
    return engine.shapes.Part(model, pose, tuple(factor * scale for factor in part.scale))


def _mesh_of(primitive: Primitive, scale: float, name: str, how: dict[str, Any]) -> engine.Model:
    """Return a mesh in the shape of a primitive, whose vertices can then be moved freely."""
    if isinstance(primitive, Cylinder) and primitive.segments is None:
        primitive = replace(primitive, segments=_SEGMENTS)
    return engine.shapes.unswept(_shape(primitive, scale), name=name, **how)
