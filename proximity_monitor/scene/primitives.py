"""From a scene's body to its model."""

from __future__ import annotations

import math

from proximity_monitor import engine
from proximity_monitor.scene.description import Body, Unit
from proximity_monitor.scene.shapes import shape_of


def load_model(body: Body, unit: Unit, *, volume: str = "rss") -> engine.TriangleMesh:
    """Load a body's model file, or make the mesh of its primitive.

    Args:
        body: of a loaded scene, or made by hand; its scale must be greater than 0.
        unit: the length unit of model files that do not state their own.
        volume: the bounding volumes, as for engine.TriangleMesh.

    Returns:
        The model in metres, in the body's own frame.

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
        how["deviation"] = body.deviation
        model = engine.load(body.model, unit=unit.to_metre, scale=body.scale, **how)
    elif body.deforming:  # its vertices are what is given, whatever they were taken from
        shape = shape_of(body.primitive).tessellated()
        model = engine.TriangleMesh(shape.vertices * body.scale, shape.faces, name=body.name, **how)
    else:
        shape = shape_of(body.primitive, robust=body.solid == "robust")
        model = shape.model(body.name, body.scale, body.deviation, how)
    check_solid(body, model)
    return model


def check_solid(body: Body, model: engine.TriangleMesh) -> None:
    """Raise ModelError where a body must be a solid and its model is none; it says where."""
    if body.solid is True and not model.is_solid:
        raise engine.ModelError(
            f"{body.solid_at or 'solid'}: true, but body '{body.name}' is none: {model.not_solid}; "
            "repair the model, say 'robust', which bridges holes, or leave the key out"
        )
