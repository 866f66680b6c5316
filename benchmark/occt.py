"""OCCT (`cadquery-ocp`) behind the interface of peers.py: faces, and their distances.

Timed is `BRepExtrema_DistShapeShape` alone, constructed and performed for one query: shapes are
moved to their poses before. Its deflection is left at its default; a looser one changes nothing
that was measured here. Only one thread works (`SetMultiThread(False)`).
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module, metadata
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine


def version() -> str | None:
    """Which one is installed, if any."""
    return metadata.version("cadquery-ocp") if find_spec("OCP") else None


def _arrays() -> ModuleType:
    """Where its arrays are: OCCT 8 moved them."""
    return import_module("OCP.collections" if find_spec("OCP.collections") else "OCP.TColgp")


def _array(kind: str, values: NDArray[np.float64], make: Callable = float) -> Any:
    """One of its arrays, counted from 1; of numbers, or of points where the last axis is 3."""
    if find_spec("OCP.collections"):
        types = {"double": "double", "int": "int", "points": "gp_Pnt"}
        shape = values.shape[: -1 if kind == "points" else None]
        array = getattr(_arrays(), f"Array{len(shape)}_{types[kind]}")
    else:
        module, name = {
            "double": ("TColStd", "Real"),
            "int": ("TColStd", "Integer"),
            "points": ("TColgp", "Pnt"),
        }[kind]
        shape = values.shape[: -1 if kind == "points" else None]
        array = getattr(
            import_module(f"OCP.{module}"),
            f"{module}_Array{len(shape)}Of{name}",
        )
    made = array(*(end for length in shape for end in (1, length)))
    for place in np.ndindex(*shape):
        made.SetValue(*(i + 1 for i in place), make(*np.atleast_1d(values[place])))
    return made


def face(net: Any) -> Any:
    """A face of a patch's control net: of all of its surface."""
    gp = import_module("OCP.gp")
    geom = import_module("OCP.Geom")
    p, q = net.degrees
    weights = np.ones(net.control.shape[:2]) if net.weights is None else net.weights
    (knots_u, times_u), (knots_v, times_v) = (
        np.unique(knots, return_counts=True) for knots in (net.knots_u, net.knots_v)
    )
    surface = geom.Geom_BSplineSurface(
        _array("points", net.control, lambda *x: gp.gp_Pnt(*map(float, x))),
        _array("double", weights), _array("double", knots_u), _array("double", knots_v),
        _array("int", times_u, int), _array("int", times_v, int), p, q,
    )  # fmt: skip
    builder = import_module("OCP.BRepBuilderAPI")
    return builder.BRepBuilderAPI_MakeFace(surface, 1e-9).Face()


def shape(model: engine.ParametricSurface) -> Any:
    """All patches of a model as one compound; a single one as its face."""
    faces = [face(net) for net in model.nets]
    if len(faces) == 1:
        return faces[0]
    topods = import_module("OCP.TopoDS")
    compound = topods.TopoDS_Compound()
    builder = import_module("OCP.BRep").BRep_Builder()
    builder.MakeCompound(compound)
    for each in faces:
        builder.Add(compound, each)
    return compound


def torus(major: float, minor: float) -> Any:
    """A torus about z, of its own toroidal surface."""
    return import_module("OCP.BRepPrimAPI").BRepPrimAPI_MakeTorus(major, minor).Shape()


def point(place: NDArray[np.float64]) -> Any:
    """A vertex."""
    gp = import_module("OCP.gp")
    builder = import_module("OCP.BRepBuilderAPI")
    return builder.BRepBuilderAPI_MakeVertex(gp.gp_Pnt(*map(float, place))).Vertex()


def placed(shape: Any, pose: NDArray[np.float64]) -> Any:
    """A shape at a pose."""
    gp = import_module("OCP.gp")
    location = import_module("OCP.TopLoc")
    motion = gp.gp_Trsf()
    motion.SetValues(*map(float, pose[:3].ravel()))
    return shape.Moved(location.TopLoc_Location(motion))


def query(a: Any, b: Any) -> Callable[[], float]:
    """A function that answers the distance of two shapes."""
    extrema = import_module("OCP.BRepExtrema")

    def ask() -> float:
        found = extrema.BRepExtrema_DistShapeShape()
        found.SetMultiThread(False)
        found.LoadS1(a)
        found.LoadS2(b)
        found.Perform()
        return float(found.Value()) if found.IsDone() else float("nan")

    return ask
