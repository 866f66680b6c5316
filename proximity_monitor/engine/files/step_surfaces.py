"""OpenCASCADE surfaces over a rectangle of their parameters, as exact rational patches."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from OCP import Geom

from .step_curves import Profile, arc_net, back, flat_knots, profile, xyz
from .triangles import FormatError

Reals = NDArray[np.float64]


class Net(NamedTuple):
    """A rational patch over a rectangle of the surface's own parameters."""

    control: Reals
    """(nu, nv, 3), in the file's frame and millimetres."""
    weights: Reals
    """(nu, nv)."""
    knots_u: Reals
    knots_v: Reals
    arcs: tuple[int, int]
    """Number of equal arcs in u and in v (see `Trim`); 0: u or v is the surface's own parameter."""

    def rectangle(self) -> tuple[Reals, Reals]:
        """Return where the parameters (2,) begin and end."""
        ends = []
        for axis, knots in enumerate((self.knots_u, self.knots_v)):
            count = self.control.shape[axis]
            ends.append((knots[len(knots) - count - 1], knots[count]))
        low, high = np.array(ends).T
        return low, high

    def reversed_u(self) -> Net:
        """Return the same patch over -u; its normal points the other way."""
        return self._replace(
            control=self.control[::-1], weights=self.weights[::-1], knots_u=-self.knots_u[::-1]
        )

    def scaled(self, factor: float) -> Net:
        """Return the patch in another unit of length, with the same parameters."""
        return self._replace(control=self.control * factor)


def basis(surface: Any) -> Any:
    """Return the basis surface of a surface that is trimmed to rectangles."""
    while isinstance(surface, Geom.Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    return surface


def kind_of(surface: Any) -> str:
    """Return the kind of a surface, as messages name it."""
    return type(surface).__name__.removeprefix("Geom_").removesuffix("Surface").lower()


def axis_of(surface: Any) -> tuple[Reals, Reals] | None:
    """Return a point (3,) on and the direction (3,) of a surface's axis of revolution, if any."""
    if isinstance(surface, Geom.Geom_Plane):
        return None
    if isinstance(surface, Geom.Geom_ElementarySurface | Geom.Geom_SurfaceOfRevolution):
        axis = surface.Axis()
        return xyz(axis.Location()), xyz(axis.Direction())
    return None


def apex_of(surface: Any) -> float | None:
    """Return the parameter v of a cone's apex; None if the surface is no cone."""
    if isinstance(surface, Geom.Geom_ConicalSurface):
        return -surface.RefRadius() / math.sin(surface.SemiAngle())
    return None


def net(surface: Any, low: Reals, high: Reals) -> Net:
    """Return a surface between two corners (2,) of its parameters as a patch.

    Raises:
        FormatError: this kind of surface has no exact form here.
    """
    if isinstance(surface, Geom.Geom_Plane):
        return _plane(surface, low, high)
    if isinstance(surface, Geom.Geom_BSplineSurface | Geom.Geom_BezierSurface):
        return _spline(surface, low, high)
    if isinstance(surface, Geom.Geom_SurfaceOfLinearExtrusion):
        along = profile(surface.BasisCurve(), low[0], high[0])
        return _swept(along, xyz(surface.Direction()), low[1], high[1])
    if isinstance(surface, Geom.Geom_SurfaceOfRevolution):
        axis = surface.Axis()
        around = profile(surface.BasisCurve(), low[1], high[1])
        return _revolved(around, xyz(axis.Location()), xyz(axis.Direction()), low[0], high[0])
    if isinstance(surface, Geom.Geom_ElementarySurface):
        axes = surface.Position()
        frame = [xyz(each()) for each in (axes.XDirection, axes.YDirection, axes.Direction)]
        flat = _meridian(surface, low[1], high[1])
        return around_z(flat, xyz(axes.Location()), frame, low[0], high[0])
    raise FormatError("this type of surface is not supported")


def _plane(surface: Any, low: Reals, high: Reals) -> Net:
    axes = surface.Position()
    x, y, o = xyz(axes.XDirection()), xyz(axes.YDirection()), xyz(axes.Location())
    control = np.array([[o + u * x + v * y for v in (low[1], high[1])] for u in (low[0], high[0])])
    knots = [np.repeat([low[i], high[i]], 2) for i in range(2)]
    return Net(control, np.ones((2, 2)), *knots, (0, 0))


def _meridian(surface: Any, low: float, high: float) -> Profile:
    """Return the meridian (rho, 0, z) that sweeps an elementary surface about its axis.

    Raises:
        FormatError: a cone reaches beyond its apex, or this type of surface is not read.
    """
    if isinstance(surface, Geom.Geom_CylindricalSurface | Geom.Geom_ConicalSurface):
        cone = isinstance(surface, Geom.Geom_ConicalSurface)
        radius = surface.RefRadius() if cone else surface.Radius()
        angle = surface.SemiAngle() if cone else 0.0
        ends = np.array([[radius + v * math.sin(angle), 0, v * math.cos(angle)]
                         for v in (low, high)])  # fmt: skip
        ends[np.abs(ends[:, 0]) <= 1e-15 * radius, 0] = 0.0
        if (ends[:, 0] < 0.0).any():
            raise FormatError("it runs through the apex of its cone")
        return Profile(ends, np.ones(2), np.repeat([low, high], 2), 0)
    if isinstance(surface, Geom.Geom_SphericalSurface):
        minor, major = surface.Radius(), 0.0
    elif isinstance(surface, Geom.Geom_ToroidalSurface):
        minor, major = surface.MinorRadius(), surface.MajorRadius()
    else:
        raise FormatError("this type of surface is not supported")
    unit, weights, knots, arcs = arc_net(low, high)
    control = np.column_stack([major + minor * unit[:, 0], 0.0 * unit[:, 0], minor * unit[:, 1]])
    return Profile(control, weights, knots, arcs)


def around_z(flat: Profile, origin: Reals, frame: list[Reals], low: float, high: float) -> Net:
    """Revolve a curve (rho, 0, z) about a frame's z axis; rho < 0 occurs inside a spindle torus."""
    unit, weights, knots, arcs = arc_net(low, high)
    rho, z = flat.control[:, 0], flat.control[:, 2]
    rim = unit[:, :1] * frame[0] + unit[:, 1:] * frame[1]
    control = origin + rim[:, None] * rho[:, None] + (z[:, None] * frame[2])[None]
    return Net(control, np.outer(weights, flat.weights), knots, flat.knots, (arcs, flat.arcs))


def _revolved(curve: Profile, origin: Reals, axis: Reals, low: float, high: float) -> Net:
    """Revolve a curve in space about an axis."""
    unit, weights, knots, arcs = arc_net(low, high)
    off = curve.control - origin
    foot = (off @ axis)[:, None] * axis
    out = off - foot
    side = np.cross(axis, out)
    control = origin + foot[None] + unit[:, :1, None] * out[None] + unit[:, 1:, None] * side[None]
    return Net(control, np.outer(weights, curve.weights), knots, curve.knots, (arcs, curve.arcs))


def _swept(curve: Profile, direction: Reals, low: float, high: float) -> Net:
    """Extrude a curve in space along a direction."""
    steps = np.array([low, high])[None, :, None] * direction
    control = curve.control[:, None] + steps
    weights = np.repeat(curve.weights[:, None], 2, axis=1)
    return Net(control, weights, curve.knots, np.repeat([low, high], 2), (curve.arcs, 0))


def _spline(surface: Any, low: Reals, high: Reals) -> Net:
    spline = surface.Copy()
    if isinstance(spline, Geom.Geom_BezierSurface):
        degrees = spline.UDegree(), spline.VDegree()
        if (low != 0.0).any() or (high != 1.0).any():
            spline.Segment(low[0], high[0], low[1], high[1])
        knots = [np.repeat([low[i], high[i]], degrees[i] + 1) for i in range(2)]
    else:
        turns = [
            spline.UPeriod() if spline.IsUPeriodic() else 0.0,
            spline.VPeriod() if spline.IsVPeriodic() else 0.0,
        ]
        if tuple(spline.Bounds()) != (low[0], high[0], low[1], high[1]):
            spline.Segment(low[0], high[0], low[1], high[1])
        if spline.IsUPeriodic():
            spline.SetUNotPeriodic()
        if spline.IsVPeriodic():
            spline.SetVNotPeriodic()
        flat_u = flat_knots(spline.NbUKnots(), spline.UKnot, spline.UMultiplicity)
        flat_v = flat_knots(spline.NbVKnots(), spline.VKnot, spline.VMultiplicity)
        knots = [
            back(flat_u, spline.UDegree(), low[0], turns[0]),
            back(flat_v, spline.VDegree(), low[1], turns[1]),
        ]
    size_u, size_v = range(1, spline.NbUPoles() + 1), range(1, spline.NbVPoles() + 1)
    control = np.array([[xyz(spline.Pole(i, j)) for j in size_v] for i in size_u])
    weights = np.array([[spline.Weight(i, j) for j in size_v] for i in size_u])
    return Net(control, weights, *knots, (0, 0))
