"""OpenCASCADE faces as patches with trimming loops."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d
from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from ..models.checks import ModelError
from ..models.trim import SNAP, Trim, TrimCurve, hull
from .step_curves import trim_curves, turned, xyz
from .step_surfaces import Net, apex_of, axis_of, basis, kind_of, net
from .triangles import FormatError

Reals = NDArray[np.float64]
_REVERSED = TopAbs_Orientation.TopAbs_REVERSED
_FORWARD = TopAbs_Orientation.TopAbs_FORWARD
_KINDS = TopAbs_ShapeEnum
_OVERLAP = 1e-6
"""Loops may run around a closed surface once, plus this share of its period."""
_LOOKS = 8
"""An edge is sampled between this many equal steps."""
_CLOSED = 2.0
"""A gap in a loop may be this many times the loop's tolerance."""


class Face(NamedTuple):
    """A face: an exact patch, and the trim that its loops define."""

    net: Net
    """In millimetres."""
    trim: Trim | None
    """None: the whole patch belongs to the face."""
    tolerance: float
    """Millimetres: how far the face's edges may be from the curves along which the faces meet."""
    axis: tuple[Reals, Reals] | None
    """A point (millimetres) on and the direction of the surface's axis of revolution, if any."""


def cast(shape: Any, kind: str) -> Any:
    """Cast a shape to its kind; older versions of OCP call the function by another name."""
    return (getattr(TopoDS, kind, None) or getattr(TopoDS, f"{kind}_s"))(shape)


def shapes_in(shape: Any, kind: str) -> Iterator[Any]:
    """Yield all shapes of a kind in a shape, such as the faces of a solid."""
    explorer = TopExp_Explorer(shape, getattr(_KINDS, f"TopAbs_{kind.upper()}"))
    while explorer.More():
        yield cast(explorer.Current(), kind)
        explorer.Next()


def read_face(shape: Any) -> Face:
    """Read a face.

    Raises:
        FormatError: the face cannot be represented. The message says why, and names the kind of
            surface.
    """
    face = cast(shape.Oriented(_FORWARD), "Face")
    surface = basis(BRep_Tool.Surface_s(face))
    try:
        return _read(face, surface, shape.Orientation() == _REVERSED)
    except (FormatError, ModelError) as error:
        raise FormatError(f"{kind_of(surface)}: {error}") from None


def _read(face: Any, surface: Any, backward: bool) -> Face:
    loops, tolerance = [], 0.0
    for wire in shapes_in(face, "Wire"):
        loop, gap = _loop(wire, face, surface)
        loops.append(loop)
        tolerance = max(tolerance, gap)
    low, high, beyond = _rectangle(loops, surface)
    patch = net(surface, low, high)
    tolerance += float(beyond @ _speeds(patch))
    if patch.weights.min() <= 0.0:
        raise FormatError("its weights must be above 0")
    low, high = patch.rectangle()
    if backward:
        patch = patch.reversed_u()
        loops = [[each._replace(control=each.control * [-1.0, 1.0]) for each in loop]
                 for loop in loops]  # fmt: skip
        low, high = np.array([-high[0], low[1]]), np.array([-low[0], high[1]])
    trim = Trim(loops, low, high, patch.arcs) if loops else None
    if trim is not None:
        tolerance += float(trim.snapped @ _speeds(patch))
    left = None if trim is None or trim.whole else trim
    return Face(patch, left, tolerance, axis_of(surface))


def _loop(wire: Any, face: Any, surface: Any) -> tuple[list[TrimCurve], float]:
    """Return the curves of a wire in order, and the largest of its tolerances and gaps (mm)."""
    chain: list[list[TrimCurve]] = []
    tolerance = 0.0
    for edge in shapes_in(wire, "Edge"):
        found = trim_curves(edge, face)
        if edge.Orientation() == _REVERSED:
            found = turned(found)
        tolerance = max(tolerance, *(BRep_Tool.Tolerance_s(v) for v in shapes_in(edge, "Vertex")))
        if not BRep_Tool.Degenerated_s(edge):
            own = BRep_Tool.Tolerance_s(edge)
            tolerance = max(tolerance, own, _beside(edge, face, surface, own))
        chain.append(found)
    chain = _followed(chain)
    before = [chain[-1], *chain]
    gaps = [
        _distance(surface, a[-1].control[-1], b[0].control[0])
        for a, b in zip(before, chain, strict=False)
    ]
    if max(gaps) > _CLOSED * tolerance + 1e-12:
        raise FormatError(
            f"a loop has a gap of {max(gaps):.3g} mm in the surface's parameters, "
            f"more than its tolerance of {tolerance:.3g} mm allows"
        )
    return [curve for curves in chain for curve in curves], max(tolerance, *gaps)


def _followed(edges: list[list[TrimCurve]]) -> list[list[TrimCurve]]:
    """Order the curves of edges so that each begins where the previous one ends."""
    chain, left = [edges[0]], edges[1:]
    while left:
        end = chain[-1][-1].control[-1]
        steps = [float(np.linalg.norm(each[0].control[0] - end)) for each in left]
        chain.append(left.pop(int(np.argmin(steps))))
    return chain


def _beside(edge: Any, face: Any, surface: Any, tolerance: float) -> float:
    """Return how far an edge's curve in space may be from its curve on the surface (mm).

    Return 0 if samples agree within the edge's own tolerance. This tolerance should hold along the
    whole edge. But programs find it from samples, and in many files it is too small. If samples
    exceed it, return twice the largest distance of finer samples: an estimate, not a bound.
    """
    curve = BRepAdaptor_Curve(edge)
    flat = BRepAdaptor_Curve2d(edge, face)
    low, high = curve.FirstParameter(), curve.LastParameter()

    def seen(looks: int) -> float:
        apart = 0.0
        for i in range(1, looks):
            t = low + (high - low) * i / looks
            place = flat.Value(t)
            apart = max(apart, curve.Value(t).Distance(surface.Value(place.X(), place.Y())))
        return apart

    return 0.0 if seen(_LOOKS) <= tolerance else 2.0 * seen(8 * _LOOKS)


def _distance(surface: Any, a: Reals, b: Reals) -> float:
    """Return the distance of two points of a surface; inf if they are on different turns of it."""
    turns = [
        (surface.IsUPeriodic() and abs(a[0] - b[0]) > 0.5 * surface.UPeriod()),
        (surface.IsVPeriodic() and abs(a[1] - b[1]) > 0.5 * surface.VPeriod()),
    ]
    if any(turns):
        return math.inf
    return float(np.linalg.norm(xyz(surface.Value(*a)) - xyz(surface.Value(*b))))


def _rectangle(loops: list[list[TrimCurve]], surface: Any) -> tuple[Reals, Reals, Reals]:
    """Return the smallest rectangle of parameters certain to hold the loops, within the surface's.

    Returns:
        Its two corners (2,), and by how much loops around a closed surface overlap (2,).
    """
    beyond = np.zeros(2)
    umin, umax, vmin, vmax = surface.Bounds()
    low, high = np.array([umin, vmin]), np.array([umax, vmax])
    if loops:
        points = np.vstack([hull(curve) for loop in loops for curve in loop])
        inner = points.min(axis=0), points.max(axis=0)
        low[1], high[1] = _one_nappe(surface, low[1], high[1], inner[0][1], inner[1][1])
        for axis, period in enumerate(_periods(surface)):
            if period:
                beyond[axis] = max(inner[1][axis] - inner[0][axis] - period, 0.0)
                if beyond[axis] > _OVERLAP * period:
                    raise FormatError("it goes around the surface more than once")
                low[axis], high[axis] = inner[0][axis], inner[1][axis]
                if high[axis] - low[axis] > period * (1.0 - 1e-9):
                    high[axis] = low[axis] + period
            else:
                low[axis] = max(low[axis], inner[0][axis])
                high[axis] = min(high[axis], inner[1][axis])
    if not (np.isfinite([low, high]).all() and (np.abs([low, high]) < 1e99).all()):
        raise FormatError("it is unbounded")
    if not (high > low).all():
        raise FormatError("its loops enclose no area")
    return low, high, beyond


def _one_nappe(
    surface: Any, low: float, high: float, begin: float, end: float
) -> tuple[float, float]:
    """Return the bounds of v; on a cone, end them at the apex if loops pass it only by rounding."""
    apex = apex_of(surface)
    if apex is None:
        return low, high
    reach = SNAP * (end - begin)
    return (
        apex if abs(begin - apex) <= reach else low,
        apex if abs(end - apex) <= reach else high,
    )


def _periods(surface: Any) -> tuple[float, float]:
    return (
        surface.UPeriod() if surface.IsUPeriodic() else 0.0,
        surface.VPeriod() if surface.IsVPeriodic() else 0.0,
    )


def _speeds(patch: Net) -> Reals:
    """Return upper bounds (2,) of the speed in u and in v, mm per unit of it (Floater 1992)."""
    speeds = []
    for axis, knots in enumerate((patch.knots_u, patch.knots_v)):
        degree = len(knots) - patch.control.shape[axis] - 1
        spread = knots[degree + 1 : -1] - knots[1 : -degree - 1]
        steps = np.linalg.norm(np.diff(patch.control, axis=axis), axis=-1).max(axis=1 - axis)
        speeds.append(degree * float((steps / np.where(spread > 0.0, spread, np.inf)).max()))
    ratio = patch.weights.max() / patch.weights.min()
    return np.array(speeds) * ratio * ratio
