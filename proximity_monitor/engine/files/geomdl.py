"""Reader and writer for geomdl JSON (NURBS-Python): curves, surfaces and solids of revolution.

In the file, control points are not multiplied by their weights, and the index along v runs fastest.
Volumes are refused. So are trimmed surfaces: without the trim, the model would keep the parts that
the trim cuts off. A solid of revolution is an extension of this package: an object ``revolution``
with a ``profile``, a list of geomdl curves whose points are (rho, z), and an optional ``axis``
that has an ``origin`` and a ``direction``.
"""

from __future__ import annotations

import json
import math
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models.checks import ModelError
from ..models.patch import Curve, Patch
from ..models.revolution import SolidOfRevolution
from ..models.surface import ParametricSurface, Surface
from .json import json_of
from .triangles import FormatError, Reals

if TYPE_CHECKING:
    from ..models.nurbs import Net
    from .readers import Reading

_KINDS = {"curve": ("",), "surface": ("_u", "_v")}
"""Suffixes of the keys for each parametric direction, by kind of shape."""


def read_geomdl(data: bytes, file: Path, how: Reading) -> Surface:
    """Read a geomdl JSON file as one patch or curve, a surface of several, or a revolution."""
    if how.volume != "rss":
        raise FormatError(f"volume = {how.volume!r}: must be 'rss' for parametric surfaces")
    if how.solid == "robust":
        raise FormatError("solid = 'robust': only for meshes; use True, False or None")
    tree = json_of(data)
    if isinstance(tree, dict) and "revolution" in tree:
        if "shape" in tree:
            raise FormatError("has both 'shape' and 'revolution': put them into two files")
        return _revolution(_need(tree, "revolution", dict, ""), file, how)
    shape = _need(tree, "shape", dict, "")
    kind = _need(shape, "type", str, "shape.")
    if kind not in _KINDS:
        raise FormatError(f"shape.type = {kind!r}: must be {' or '.join(map(repr, _KINDS))}")
    made = _shapes(shape, "data", _KINDS[kind], "shape", how)
    if shape.get("count", len(made)) != len(made):
        raise FormatError(f"shape.count = {shape['count']!r}, but shape.data has {len(made)}")
    if len(made) == 1 and not how.solid:
        return made[0]
    return ParametricSurface(
        made, name=str(file), deviation=how.deviation, solid=how.solid
    )  # fmt: skip


def _revolution(item: dict[str, Any], file: Path, how: Reading) -> Surface:
    """Return the solid of revolution that an object describes, or a surface if `solid` is False."""
    curves = _shapes(item, "profile", _KINDS["curve"], "revolution", how)
    axis, place = _need({"axis": {}} | item, "axis", dict, "revolution."), {}
    for key, name, factor in (("origin", "origin", how.unit * how.scale), ("direction", "axis", 1)):
        if key in axis:
            place[name] = _reals(axis[key], f"revolution.axis.{key}", 1) * factor
    try:
        made = SolidOfRevolution(curves, **place, name=str(file), deviation=how.deviation)
    except ModelError as error:
        raise FormatError(str(error).replace("curves[", "revolution.profile[")) from None
    if how.solid is not False:
        return made
    return ParametricSurface.of(made.nets, name=made.name, deviation=made.deviation, solid=False)


def _shapes(
    item: dict[str, Any], key: str, ends: tuple[str, ...], at: str, how: Reading
) -> list[Surface]:
    """Return the patches or curves of a list of objects."""
    made = []
    for i, each in enumerate(_need(item, key, list, f"{at}.")):
        name = f"{at}.{key}[{i}]"
        if not isinstance(each, dict):
            raise FormatError(f"{name}: expected an object, got {type(each).__name__}")
        try:
            made.append(_shape(each, ends, name, how))
        except ModelError as error:
            raise FormatError(str(error)) from None
    return made


def _shape(item: dict[str, Any], ends: tuple[str, ...], name: str, how: Reading) -> Surface:
    """Return the patch or curve that an object describes."""
    at = f"{name}."
    trims = item.get("trims")
    if trims and trims != {"count": 0, "data": []} and trims != {"count": 0}:
        raise FormatError(f"{at}trims: trimmed surfaces are not supported in this format")
    net = _need(item, "control_points", dict, at)
    inside = f"{at}control_points."
    points = _reals(_need(net, "points", list, inside), f"{inside}points", 2)
    knots = [_reals(_need(item, f"knotvector{end}", list, at), f"{at}knotvector{end}", 1)
             for end in ends]  # fmt: skip
    sizes = [len(points)]
    if len(ends) == 2:
        sizes = [_need(item, f"size{end}", int, at) for end in ends]
    if min(sizes) < 1 or math.prod(sizes) != len(points):
        wanted = " x ".join(map(str, sizes))
        raise FormatError(
            f"{inside}points: {len(points)} points, but size_u and size_v require {wanted}"
        )
    for end, vector, size in zip(ends, knots, sizes, strict=True):
        degree = _need(item, f"degree{end}", int, at)
        if len(vector) != size + degree + 1:
            raise FormatError(
                f"{at}knotvector{end}: {len(vector)} knots, but {size} control points of degree "
                f"{degree} need {size + degree + 1}"
            )
    weights = net.get("weights")
    if weights is not None:
        weights = _reals(weights, f"{inside}weights", 1)
        if len(weights) != len(points):
            raise FormatError(f"{inside}weights: {len(weights)} weights for {len(points)} points")
        weights = weights.reshape(sizes)
    with np.errstate(over="ignore"):  # the model refuses infinite values, with their index
        control = (points * (how.unit * how.scale)).reshape(*sizes, -1)
    kind = Patch if len(ends) == 2 else Curve
    return kind(control, *knots, weights, name=name, deviation=how.deviation)


def _need(item: Any, key: str, kind: type, at: str) -> Any:
    """Return the value of a required key, checked for its type."""
    if not isinstance(item, dict) or key not in item:
        raise FormatError(f"{at}{key} is missing")
    value = item[key]
    if not isinstance(value, kind) or isinstance(value, bool):
        raise FormatError(f"{at}{key}: expected {kind.__name__}, got {type(value).__name__}")
    return value


def _reals(values: Any, what: str, dimensions: int) -> Reals:
    """Return numbers as an array with the given number of dimensions."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise FormatError(f"{what}: the rows have different lengths") from None
    if array.dtype.kind not in "iuf":
        raise FormatError(f"{what}: must contain only numbers")
    if array.ndim != dimensions:
        raise FormatError(f"{what}: shape {array.shape}, expected {dimensions} dimensions")
    return array.astype(np.float64)


def save_geomdl(model: Surface, path: str | PathLike[str]) -> None:
    """Write a `Patch`, a `Curve`, a `ParametricSurface` or a `SolidOfRevolution`, in metres.

    The file is geomdl JSON. A solid of revolution uses this package's extension, with its profile
    as geomdl curves. Reading the file back restores knots and control points exactly, and weights
    up to a common factor. The file cannot store a deviation.

    Raises:
        TypeError: the model is of another kind.
        ModelError: the model has both patches and curves; one file cannot hold both.
        OSError: the file cannot be written.
    """
    if not isinstance(model, Surface):
        raise TypeError(f"model: expected a parametric surface, got {type(model).__name__}")
    if isinstance(model, SolidOfRevolution):
        axis = {"origin": model.origin.tolist(), "direction": model.axis.tolist()}
        profile = [_item(net, 2) for net in model.profile.nets]
        tree: dict[str, Any] = {"revolution": {"profile": profile, "axis": axis}}
    else:
        if len({net.is_curve for net in model.nets}) > 1:
            raise ModelError(
                f"{model.name}: has patches and curves; a geomdl JSON file holds only one kind"
            )
        kind = "curve" if model.nets[0].is_curve else "surface"
        items = [_item(net, 3) for net in model.nets]
        tree = {"shape": {"type": kind, "count": len(items), "data": items}}
    Path(path).write_text(json.dumps(tree, indent=1), encoding="utf-8")


def _item(net: Net, dimension: int) -> dict[str, Any]:
    """Return the JSON object of a patch or curve, with `dimension` coordinates a control point."""
    points: dict[str, Any] = {"points": net.points[:, :dimension].tolist()}
    if net.weights is not None:
        points["weights"] = net.weights.ravel().tolist()
    item = {
        "type": "spline", "rational": net.weights is not None, "dimension": dimension,
        "control_points": points,
    }  # fmt: skip
    directions = zip(
        _KINDS["curve" if net.is_curve else "surface"], net.degrees, (net.knots_u, net.knots_v),
        net.control.shape, strict=False,
    )  # fmt: skip
    for end, degree, knots, size in directions:
        item |= {f"degree{end}": degree, f"knotvector{end}": knots.tolist()}
        item |= {} if net.is_curve else {f"size{end}": size}
    return item
