"""OCCT (`cadquery-ocp`) behind an interface like that of peers.py: shapes, and their distances.

Only the construction and `Perform` of `BRepExtrema_DistShapeShape` for one query are timed: shapes
are moved to their poses before. The deflection keeps its default; a looser one changed no result
measured here. OCCT uses one thread (`SetMultiThread(False)`).
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
    """Return the installed version of cadquery-ocp, or None."""
    return metadata.version("cadquery-ocp") if find_spec("OCP") else None


def _arrays() -> ModuleType:
    """Return the module of OCCT's arrays, which OCCT 8 moved."""
    return import_module("OCP.collections" if find_spec("OCP.collections") else "OCP.TColgp")


def _array(kind: str, values: NDArray[np.float64], make: Callable = float) -> Any:
    """Return an OCCT array, indexed from 1, of numbers or of points (last axis: x, y, z)."""
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
    """Return a face that covers the whole surface of a patch's control net."""
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
    """Return all patches of a model as one compound, or a single patch as its face."""
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
    """Return a torus about z, as OCCT's own toroidal surface."""
    return import_module("OCP.BRepPrimAPI").BRepPrimAPI_MakeTorus(major, minor).Shape()


def point(place: NDArray[np.float64]) -> Any:
    """Return a vertex at a place."""
    gp = import_module("OCP.gp")
    builder = import_module("OCP.BRepBuilderAPI")
    return builder.BRepBuilderAPI_MakeVertex(gp.gp_Pnt(*map(float, place))).Vertex()


def placed(shape: Any, pose: NDArray[np.float64]) -> Any:
    """Return a shape moved to a pose."""
    gp = import_module("OCP.gp")
    location = import_module("OCP.TopLoc")
    motion = gp.gp_Trsf()
    motion.SetValues(*map(float, pose[:3].ravel()))
    return shape.Moved(location.TopLoc_Location(motion))


def query(a: Any, b: Any) -> Callable[[], float]:
    """Return a function that computes the distance of two shapes; NaN if OCCT fails."""
    extrema = import_module("OCP.BRepExtrema")

    def ask() -> float:
        found = extrema.BRepExtrema_DistShapeShape()
        found.SetMultiThread(False)
        found.LoadS1(a)
        found.LoadS2(b)
        found.Perform()
        return float(found.Value()) if found.IsDone() else float("nan")

    return ask
