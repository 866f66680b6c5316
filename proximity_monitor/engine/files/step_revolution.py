"""Recognise a part as a solid of revolution, and bound how far its faces are from that solid.

A face is a sector of a surface that a profile curve sweeps about the axis, or it is flat and across
the axis: a disc or a ring. Sectors on the same curve form a band. Each face is compared with the
sweep of its curve: a sector by its control points, a disc or ring by its loops. So the distance
found holds for every point of the faces, and for every point of the solid's boundary, which the
faces cover.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..models.bezier import product
from .step_curves import Profile, on_circle
from .step_faces import Face
from .step_surfaces import Net, around_z

Reals = NDArray[np.float64]

_EPS = float(np.finfo(np.float64).eps)
_ROUNDING = 64.0 * _EPS
"""Rounding allowance of a comparison, as a share of the largest coordinate P. Rotating a control
point takes sums of three products, and each sum errs by a few eps. So do a height above a plane and
the square of a radius. Weights that agree to 4 eps move a point by at most 8 eps times 2 P."""

_SAME_WEIGHTS = 4.0 * _EPS


class Revolution(NamedTuple):
    """A solid of revolution, in millimetres."""

    curves: list[tuple[Reals, Reals, Reals]]
    """The curves of the profile, in order: control points (n, 2), weights, knots."""
    origin: Reals
    axis: Reals
    deviation: float
    """Upper bound of the Hausdorff distance between the solid's boundary and the faces."""


class _Frame(NamedTuple):
    """A frame whose z axis is the part's axis of revolution."""

    origin: Reals
    axes: Reals
    """(3, 3) unit vectors in rows; z is the axis."""

    @classmethod
    def of(cls, place: Reals, axis: Reals) -> Self:
        """Return the frame of an axis, with its origin as near as possible to the part's origin."""
        x = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
        x = x - (x @ axis) * axis
        x /= np.linalg.norm(x)
        return cls(place - (place @ axis) * axis, np.array([x, np.cross(axis, x), axis]))

    def own(self, points: Reals) -> Reals:
        """Return points (..., 3) in this frame."""
        return (points - self.origin) @ self.axes.T


def _rotated(direction: Reals, angle: float) -> Reals:
    """Return a direction (2,) across the axis, rotated about the axis."""
    cos, sin = on_circle(angle)
    return np.array([[cos, -sin], [sin, cos]]) @ direction


class _Sector(NamedTuple):
    """A face whose first parameter is the angle about the axis."""

    net: Net
    """The face's patch, in the frame of the axis."""
    x: Reals
    """(2,) the direction across the axis at angle 0."""
    sense: int
    """1 if the angle grows counterclockwise about the axis, else -1."""

    @classmethod
    def of(cls, net: Net) -> Self | None:
        """Return the sector of a face; None if u is no angle, or the profile lies on the axis."""
        if net.arcs[0] == 0:
            return None
        rims = np.hypot(net.control[0, :, 0], net.control[0, :, 1])
        far = int(rims.argmax())
        if not rims[far] > 0.0:
            return None
        first, later = net.control[0, far, :2], net.control[1, far, :2]
        sense = 1 if first[0] * later[1] > first[1] * later[0] else -1
        low, _ = net.rectangle()
        return cls(net, _rotated(first / rims[far], -sense * low[0]), sense)

    def profile(self) -> Reals:
        """Return the control points (n, 2), rho and z, of the curve at the sector's start."""
        low, _ = self.net.rectangle()
        first = _rotated(self.x, self.sense * low[0])
        return np.column_stack([self.net.control[0, :, :2] @ first, self.net.control[0, :, 2]])

    def span(self) -> tuple[float, float]:
        """Return the start angle about the frame's axis, and the angle that the sector covers."""
        low, high = self.net.rectangle()
        begin = math.atan2(self.x[1], self.x[0]) + (low[0] if self.sense > 0 else -high[0])
        return begin % (2.0 * math.pi), float(high[0] - low[0])

    def backward(self) -> Self:
        """Return the same sector with its profile reversed."""
        net = self.net
        turned = net._replace(
            control=net.control[:, ::-1], weights=net.weights[:, ::-1], knots_v=-net.knots_v[::-1]
        )
        return self._replace(net=turned)

    def deviation(self, profile: Reals) -> float:
        """Return a bound of how far the sector is from a profile's sweep; inf if weights differ.

        If two patches have the same weights, their points at the same parameters are no farther
        apart than their control points.
        """
        low, high = self.net.rectangle()
        frame = np.eye(3)
        frame[0, :2], frame[1, :2] = self.x, self.sense * _rotated(self.x, 0.5 * math.pi)
        control = np.column_stack([profile[:, 0], np.zeros(len(profile)), profile[:, 1]])
        flat = Profile(control, self.net.weights[0], self.net.knots_v, self.net.arcs[1])
        made = around_z(flat, np.zeros(3), list(frame), low[0], high[0])
        if not np.allclose(made.weights, self.net.weights, rtol=_SAME_WEIGHTS, atol=0.0):
            return math.inf
        return float(np.linalg.norm(made.control - self.net.control, axis=2).max())


@dataclass
class _Band:
    """The faces that a curve of the profile sweeps: one, or several side by side about the axis."""

    sectors: list[_Sector]
    control: Reals
    """(n, 2) rho and z."""
    outward: int
    """1 if the normals of the faces are on the right of the curve, else -1."""

    @classmethod
    def of(cls, sector: _Sector, outward: int) -> Self:
        """Return the band of one face."""
        return cls([sector], sector.profile(), outward)

    @property
    def weights(self) -> Reals:
        """(n,)."""
        return self.sectors[0].net.weights[0]

    @property
    def knots(self) -> Reals:
        """The knots of the curve."""
        return self.sectors[0].net.knots_v

    def takes(self, other: Self, tolerance: float) -> bool:
        """Take over the faces of another band if it has the same curve; return whether it has."""
        if self.control.shape != other.control.shape or self.outward != other.outward:
            return False
        alike = np.allclose(self.weights, other.weights, rtol=_SAME_WEIGHTS, atol=0.0)
        if not alike or np.abs(self.control - other.control).max() > tolerance:
            return False
        self.sectors += other.sectors
        return True

    def deviation(self, control: Reals) -> float:
        """Return a bound of how far the faces are from the sweep of a curve over the full turn."""
        spans = sorted(sector.span() for sector in self.sectors)
        ends = [*spans[1:], (spans[0][0] + 2.0 * math.pi, 0.0)]
        left = max(abs(b - (a + width)) for (a, width), (b, _) in zip(spans, ends, strict=True))
        radius = float(np.abs(control[:, 0]).max())
        return max(sector.deviation(control) for sector in self.sectors) + left * radius


@dataclass
class _Ring:
    """A flat face across the axis: a disc, or a disc with a round hole."""

    radii: list[tuple[float, float]]
    """Least and greatest radius of the inner and the outer loop; (0, 0) if there is no hole."""
    heights: Reals
    """(4,) heights of the corners of a parallelogram that holds the face."""
    outward: int
    """See `_Band`."""
    control: Reals = field(init=False)
    weights = np.ones(2)
    knots = np.repeat([0.0, 1.0], 2)

    def __post_init__(self) -> None:
        middle = float(self.heights.mean())
        self.control = np.array([[0.5 * (low + high), middle] for low, high in self.radii])

    def deviation(self, control: Reals) -> float:
        """Return a bound of how far the face and the sweep of a line are from each other.

        The points of the plane between the greatest radius of the inner loop and the least radius
        of the outer loop belong to the face. Points inside the inner loop's least radius or outside
        the outer loop's greatest radius do not.
        """
        across = max(
            max(abs(rho - low), abs(high - rho))
            for rho, (low, high) in zip(control[:, 0], self.radii, strict=True)
        )
        return across + float(np.abs(control[:, 1:] - self.heights).max())


def find_revolution(faces: Sequence[Face]) -> Revolution | None:
    """Return the solid of revolution that has these faces; None if there is none.

    The faces must be no farther from the solid's boundary than the largest of their tolerances.
    """
    about = [face.axis for face in faces if face.axis is not None]
    if not about:
        return None
    frame = _Frame.of(*about[0])
    tolerance = max(face.tolerance for face in faces)
    pieces = _pieces(faces, frame, tolerance)
    ordered = _in_order(pieces, 2.0 * tolerance)
    if not ordered:
        return None
    curves = _joined(ordered, 2.0 * tolerance)
    deviation = max(
        piece.deviation(control[::-1] if backward else control)
        for (piece, backward), control in zip(ordered, curves, strict=True)
    )
    size = max(float(np.abs(face.net.control).max()) for face in faces)
    deviation += _ROUNDING * size
    if not deviation <= tolerance + _ROUNDING * size:
        return None
    profile = [
        (control, piece.weights[::-1], -piece.knots[::-1])
        if backward
        else (control, piece.weights, piece.knots)
        for (piece, backward), control in zip(ordered, curves, strict=True)
    ]
    return Revolution(profile, frame.origin, frame.axes[2], deviation)


_Piece = _Band | _Ring


def _pieces(faces: Sequence[Face], frame: _Frame, tolerance: float) -> list[_Piece]:
    """Return the bands and rings of the faces; an empty list if a face fits neither."""
    bands: list[_Band] = []
    rings: list[_Ring] = []
    for face in faces:
        net = face.net._replace(control=frame.own(face.net.control))
        if _is_plane(net):
            ring = _ring(net, face)
            if ring is None:
                return []
            rings.append(ring)
            continue
        sector = None if face.trim is not None else _Sector.of(net)
        if sector is None:
            return []
        band = _Band.of(sector, sector.sense)
        if band.sectors[0].deviation(band.control) > tolerance:
            return []
        other = _Band.of(sector.backward(), -sector.sense)
        if not any(each.takes(made, tolerance) for each in bands for made in (band, other)):
            bands.append(band)
    return [*bands, *rings]


def _is_plane(net: Net) -> bool:
    """Return whether a patch is a parallelogram that is linear in u and in v."""
    if net.control.shape != (2, 2, 3) or np.ptp(net.weights) > 0.0:
        return False
    (a, b), (c, d) = net.control
    return bool(np.abs(a - b - c + d).max() <= _ROUNDING * np.abs(net.control).max())


def _ring(net: Net, face: Face) -> _Ring | None:
    """Return a plane face as a ring; None if its loops are not round about the axis."""
    corner, u, v = net.control[0, 0], *(net.control[[1, 0], [0, 1]] - net.control[0, 0])
    if face.trim is None or len(face.trim.loops) > 2:
        return None
    radii = []
    for loop in face.trim.loops:
        nets = [part.edge for part in loop]
        found = _round([_placed(each, corner[:2], np.array([u[:2], v[:2]])) for each in nets])
        if found is None:
            return None
        radii.append(found)
    radii.sort()
    if len(radii) == 1:
        radii = [(0.0, 0.0), *radii]
    if radii[0][1] >= radii[1][0]:
        return None
    up = u[0] * v[1] - u[1] * v[0]
    return _Ring(radii, net.control[..., 2].ravel(), -1 if up > 0.0 else 1)


def _placed(curve: Reals, corner: Reals, sides: Reals) -> Reals:
    """Return the homogeneous control points (n, 3) in the plane of a curve in the unit square."""
    return np.column_stack([curve[:, 2:] * corner + curve[:, :2] @ sides, curve[:, 2]])


def _round(curves: list[Reals]) -> tuple[float, float] | None:
    """Return radii between which a closed loop of curves runs around the origin once, or None.

    The square of a radius is a quotient of two polynomials, and lies between the least and greatest
    quotient of their coefficients. If all control points of a curve are on one side of a line
    through the origin, the curve turns about the origin by the angle between its ends.
    """
    turn, low, high = 0.0, math.inf, 0.0
    for curve in curves:
        lengths = np.hypot(curve[[0, -1], 0], curve[[0, -1], 1])
        if not (lengths > 0.0).all():
            return None
        begin, end = curve[[0, -1], :2] / lengths[:, None]
        if not (curve[:, :2] @ (begin + end) > 0.0).all():
            return None
        turn += math.atan2(begin[0] * end[1] - begin[1] * end[0], float(begin @ end))
        weights = product(curve[:, 2:], curve[:, 2:])
        x, y = curve[:, :1], curve[:, 1:2]
        squares = (product(x, x) + product(y, y)) / weights
        low, high = min(low, float(squares.min())), max(high, float(squares.max()))
    if abs(abs(turn) - 2.0 * math.pi) > 1.0 or not low > 0.0:
        return None
    return math.sqrt(low), math.sqrt(high)


def _in_order(pieces: Sequence[_Piece], near: float) -> list[tuple[_Piece, bool]]:
    """Return the pieces in order along the profile, each with whether it runs backward.

    The first piece begins on the axis, or the pieces form a closed loop. Return an empty list if
    the pieces do not connect, or the normals of their faces point to different sides.
    """
    if not pieces:
        return []
    ends = np.array([piece.control[i] for piece in pieces for i in (0, -1)])
    away = np.linalg.norm(ends[:, None] - ends, axis=2)
    np.fill_diagonal(away, math.inf)
    free = np.flatnonzero(away.min(axis=1) > near)
    if len(free) not in (0, 2) or (np.abs(ends[free, 0]) > near).any():
        return []
    at = int(free[0]) if len(free) else 0
    ordered: list[tuple[_Piece, bool]] = []
    left = set(range(len(pieces)))
    while True:
        left.remove(at // 2)
        ordered.append((pieces[at // 2], at % 2 == 1))
        if not left:
            break
        others = np.array([2 * i + side for i in left for side in (0, 1)])
        end, at = at ^ 1, int(others[away[at ^ 1, others].argmin()])
        if away[end, at] > near:
            return []
    sides = {piece.outward * (-1 if backward else 1) for piece, backward in ordered}
    return ordered if len(sides) == 1 else []


def _joined(ordered: Sequence[tuple[_Piece, bool]], near: float) -> list[Reals]:
    """Return the control points of each curve along the profile, with connected ends made equal.

    Ends that meet are moved to their midpoint. If the profile is open, its two ends are moved onto
    the axis.
    """
    curves = [
        piece.control[::-1].copy() if backward else piece.control.copy()
        for piece, backward in ordered
    ]
    for before, after in pairwise(curves):
        before[-1] = after[0] = 0.5 * (before[-1] + after[0])
    first, last = curves[0][0], curves[-1][-1]
    if np.linalg.norm(first - last) <= near:
        first[:] = last[:] = 0.5 * (first + last)
    else:
        first[0] = last[0] = 0.0
    return curves
