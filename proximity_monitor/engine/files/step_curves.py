"""OpenCASCADE curves as rational Bezier and B-spline nets, for profiles of surfaces and trims."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from OCP import Geom, Geom2d, GeomAbs
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d
from OCP.Geom2dConvert import Geom2dConvert, Geom2dConvert_BSplineCurveToBezierCurve
from OCP.GeomConvert import GeomConvert

from ..models.trim import TrimCurve
from .triangles import FormatError

Reals = NDArray[np.float64]
_TYPES = GeomAbs.GeomAbs_CurveType
_BY_ANGLE = (_TYPES.GeomAbs_Circle, _TYPES.GeomAbs_Ellipse)
_BY_POLES = (_TYPES.GeomAbs_BezierCurve, _TYPES.GeomAbs_BSplineCurve)
_HIGHEST_DEGREE = 15
_AXES_OF = (Geom.Geom_Circle, Geom.Geom_Ellipse)


class Profile(NamedTuple):
    """A curve in space over an interval, as a net of control points."""

    control: Reals
    """(n, 3)."""
    weights: Reals
    """(n,)."""
    knots: Reals
    arcs: int
    """Number of equal arcs that the net consists of, with their angles as knots (see `Trim`).
    0: the net has the curve's own parameter."""


def xyz(point: Any) -> Reals:
    """Return the coordinates (3,) of an OpenCASCADE point or vector."""
    return np.array([point.X(), point.Y(), point.Z()])


def xy(point: Any) -> Reals:
    """Return the coordinates (2,) of an OpenCASCADE point or vector in the plane."""
    return np.array([point.X(), point.Y()])


def on_circle(angle: float) -> tuple[float, float]:
    """Return cosine and sine, exact at quarter turns.

    So full turns close, and poles lie on the axis.
    """
    quarters = angle / (0.5 * math.pi)
    whole = round(quarters)
    if abs(quarters - whole) <= 1e-15 * max(1.0, abs(quarters)):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[whole % 4]
    return math.cos(angle), math.sin(angle)


def arc_net(low: float, high: float) -> tuple[Reals, Reals, Reals, int]:
    """Return the arc of a unit circle between two angles, as equal arcs of at most a quarter turn.

    Returns:
        Control points (2 k + 1, 2), weights, knots (the angles), and the number k of arcs.
    """
    arcs = max(1, math.ceil((high - low) / (0.5 * math.pi) - 1e-9))
    ends = [low + (high - low) * (i / arcs) for i in range(arcs)] + [high]
    middle = math.cos(0.5 * (high - low) / arcs)
    points = []
    for begin, end in pairwise(ends):
        cos, sin = on_circle(0.5 * (begin + end))
        points += [on_circle(begin), (cos / middle, sin / middle)]
    points.append(on_circle(high))
    weights = np.ones(2 * arcs + 1)
    weights[1::2] = middle
    knots = np.concatenate([[low], np.repeat(ends, 2), [high]])
    return np.array(points), weights, knots, arcs


def profile(curve: Any, low: float, high: float) -> Profile:
    """Return a Geom_Curve between two of its parameters as a net.

    Raises:
        FormatError: this kind of curve has no exact form as a net here.
    """
    while isinstance(curve, Geom.Geom_TrimmedCurve):
        curve = curve.BasisCurve()
    if isinstance(curve, Geom.Geom_Line):
        ends = np.array([xyz(curve.Value(low)), xyz(curve.Value(high))])
        return Profile(ends, np.ones(2), np.array([low, low, high, high]), 0)
    if isinstance(curve, _AXES_OF):
        circle = isinstance(curve, Geom.Geom_Circle)
        long = curve.Radius() if circle else curve.MajorRadius()
        short = curve.Radius() if circle else curve.MinorRadius()
        axes = curve.Position()
        unit, weights, knots, arcs = arc_net(low, high)
        x, y = long * xyz(axes.XDirection()), short * xyz(axes.YDirection())
        control = xyz(axes.Location()) + unit[:, :1] * x + unit[:, 1:] * y
        return Profile(control, weights, knots, arcs)
    if isinstance(curve, (Geom.Geom_BezierCurve, Geom.Geom_BSplineCurve)):
        spline = GeomConvert.CurveToBSplineCurve_s(curve)
        turn = spline.Period() if spline.IsPeriodic() else 0.0
        if spline.FirstParameter() != low or spline.LastParameter() != high:
            spline.Segment(low, high)
        if spline.IsPeriodic():
            spline.SetNotPeriodic()
        count = range(1, spline.NbPoles() + 1)
        flat = flat_knots(spline.NbKnots(), spline.Knot, spline.Multiplicity)
        return Profile(
            np.array([xyz(spline.Pole(i)) for i in count]),
            np.array([spline.Weight(i) for i in count]),
            back(flat, spline.Degree(), low, turn),
            0,
        )
    kind = type(curve).__name__.removeprefix("Geom_")
    raise FormatError(f"its profile has the type {kind}, which is not supported")


def flat_knots(count: int, knot: Any, multiplicity: Any) -> Reals:
    """Return the knots, each repeated by its multiplicity."""
    return np.repeat(
        [knot(i) for i in range(1, count + 1)], [multiplicity(i) for i in range(1, count + 1)]
    )


def back(knots: Reals, degree: int, low: float, period: float) -> Reals:
    """Shift knots by whole periods, so that they begin nearest to the parameter `low`.

    OpenCASCADE sometimes cuts a segment out of another turn.
    """
    if period > 0.0:
        return knots + period * round((low - knots[degree]) / period)
    return knots


def trim_curves(edge: Any, face: Any) -> list[TrimCurve]:
    """Return an edge's curve in a face's parameters, as rational Bezier curves.

    They run in the direction of the edge's curve, whatever the orientation of the edge.

    Raises:
        FormatError: the edge has no such curve, or one that has no exact form here.
    """
    if BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0) is None:
        raise FormatError("an edge has no curve on the surface")
    curve = BRepAdaptor_Curve2d(edge, face)
    low, high, kind = curve.FirstParameter(), curve.LastParameter(), curve.GetType()
    if kind == _TYPES.GeomAbs_Line:
        return [TrimCurve(np.array([xy(curve.Value(low)), xy(curve.Value(high))]))]
    if kind in _BY_ANGLE:
        circle = kind == _TYPES.GeomAbs_Circle
        shape = curve.Circle() if circle else curve.Ellipse()
        long = shape.Radius() if circle else shape.MajorRadius()
        short = shape.Radius() if circle else shape.MinorRadius()
        unit, weights, _, arcs = arc_net(low, high)
        x, y = long * xy(shape.XAxis().Direction()), short * xy(shape.YAxis().Direction())
        control = xy(shape.Location()) + unit[:, :1] * x + unit[:, 1:] * y
        parts = [slice(2 * i, 2 * i + 3) for i in range(arcs)]
        return [TrimCurve(control[part], weights[part]) for part in parts]
    if kind == _TYPES.GeomAbs_Hyperbola:
        return _hyperbola(curve.Hyperbola(), low, high)
    if kind == _TYPES.GeomAbs_Parabola:
        middle = 2.0 * xy(curve.Value(0.5 * (low + high)))
        ends = xy(curve.Value(low)), xy(curve.Value(high))
        return [TrimCurve(np.array([ends[0], middle - 0.5 * (ends[0] + ends[1]), ends[1]]))]
    if kind in _BY_POLES:
        stored = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
        spline = Geom2dConvert.CurveToBSplineCurve_s(Geom2d.Geom2d_TrimmedCurve(stored, low, high))
        if spline.Degree() > _HIGHEST_DEGREE:
            raise FormatError(
                f"a trimming curve has degree {spline.Degree()}, more than {_HIGHEST_DEGREE}"
            )
        parts = Geom2dConvert_BSplineCurveToBezierCurve(spline)
        return [_bezier(parts.Arc(i)) for i in range(1, parts.NbArcs() + 1)]
    kind = str(kind).rpartition("_")[2]
    raise FormatError(f"a trimming curve has the type {kind}, which is not supported")


def _hyperbola(shape: Any, low: float, high: float) -> list[TrimCurve]:
    """Return an arc of a hyperbola: as of an ellipse, with cosh and sinh for cos and sin."""
    count = max(1, math.ceil(high - low))
    ends = np.linspace(low, high, count + 1)
    weight = math.cosh(0.5 * (high - low) / count)
    x = shape.MajorRadius() * xy(shape.XAxis().Direction())
    y = shape.MinorRadius() * xy(shape.YAxis().Direction())
    made = []
    for begin, end in pairwise(ends):
        places = np.array([begin, 0.5 * (begin + end), end])
        reach = np.array([1.0, weight, 1.0])[:, None]
        cosh, sinh = np.cosh(places)[:, None], np.sinh(places)[:, None]
        control = xy(shape.Location()) + (cosh * x + sinh * y) / reach
        made.append(TrimCurve(control, reach[:, 0]))
    return made


def _bezier(curve: Any) -> TrimCurve:
    count = range(1, curve.NbPoles() + 1)
    return TrimCurve(
        np.array([xy(curve.Pole(i)) for i in count]), np.array([curve.Weight(i) for i in count])
    )


def turned(curves: list[TrimCurve]) -> list[TrimCurve]:
    """Return the curves reversed, in reversed order."""
    return [
        TrimCurve(each.control[::-1], None if each.weights is None else each.weights[::-1])
        for each in reversed(curves)
    ]
