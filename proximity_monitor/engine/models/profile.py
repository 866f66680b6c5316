"""The profile of a solid of revolution: what its curves have to be.

They lie in the half-plane (rho, z), rho >= 0, and run one after the other: from the axis to the
axis, or around in a loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.revolution.crossing import first_crossing
from .checks import ModelError
from .nurbs import HIGHEST_DEGREE, Net, frozen

Reals = NDArray[np.float64]

JOINED = 1e-12
"""How far apart two ends may be that coincide, and an end from the axis that it lies on, as a share
of the profile's size."""


class Profile(NamedTuple):
    """A checked profile; `nets` are its curves, with (rho, z, 0) as control points."""

    nets: tuple[Net, ...]
    closed: bool
    """Whether it is a loop, which does not touch the axis where it begins."""
    size: float
    """Metres: the largest coordinate of a control point."""
    leftward: bool
    """Whether the solid is on the left of the curves, with rho to the right and z upward."""


def checked_profile(nets: Sequence[Net], name: str) -> Profile:
    """The profile that curves make up.

    Raises:
        ModelError: a curve is out of the plane, or crosses the axis; curves that do not follow each
            other; open ends off the axis; a profile that crosses itself, or holds no area.
    """
    for i, net in enumerate(nets):
        if net.control[..., 2].any():
            raise ModelError(f"{name}: curves[{i}]: not in the plane; give (rho, z) or (rho, z, 0)")
    size = max(float(np.abs(net.points).max()) for net in nets)
    near = JOINED * size
    for i, net in enumerate(nets):
        _check_axis(net, near, f"{name}: curves[{i}]")
    closed = _check_ends(nets, near, name)
    _check_simple(nets, size, name)
    area = _area(nets)
    if not abs(area) > near * size:
        raise ModelError(f"{name}: curves: they enclose no area, so there is no solid")
    return Profile(tuple(nets), closed, size, area > 0.0)


def _check_axis(net: Net, near: float, what: str) -> None:
    """Refuse a curve of which a point is beyond the axis, by more than what is `near`."""
    rho = net.points[:, 0]
    if (rho >= 0.0).all():
        return
    along, _ = net.spans
    pieces = net.pieces()[:, 0, :, 0]
    for k, piece in enumerate(pieces):
        low, high = along.low[k], along.high[k]
        t = np.linspace(low, high, 16 * len(piece) + 1)
        found = _at(net, t)[:, 0]
        worst = int(found.argmin())
        if found[worst] < -near:
            raise ModelError(
                f"{what}: crosses the axis: rho = {found[worst]:.6g} m at t = {t[worst]:.6g}; "
                "a profile stays where rho >= 0"
            )


def _check_ends(nets: Sequence[Net], near: float, name: str) -> bool:
    """Whether the curves are a loop; else they begin and end on the axis."""
    ends = [_ends(net) for net in nets]
    for i in range(1, len(nets)):
        gap = float(np.linalg.norm(ends[i][0] - ends[i - 1][1]))
        if gap > near:
            turned = float(np.linalg.norm(ends[i][1] - ends[i - 1][1])) <= near
            hint = f"; turn curves[{i}] around" if turned else ""
            raise ModelError(
                f"{name}: curves[{i}] begins at {ends[i][0].tolist()}, {gap:.3g} m from "
                f"{ends[i - 1][1].tolist()}, where the curve before it ends{hint}"
            )
    first, last = ends[0][0], ends[-1][1]
    if first[0] <= near and last[0] <= near:
        return False
    if np.linalg.norm(first - last) <= near:
        return True
    for where, end in (("begins", first), ("ends", last)):
        if end[0] > near:
            raise ModelError(
                f"{name}: curves: the profile {where} at {end.tolist()}, {end[0]:.6g} m off the "
                "axis; it must run from the axis to the axis, or around in a loop"
            )
    raise AssertionError("one of both ends is off the axis")


def _ends(net: Net) -> tuple[Reals, Reals]:
    along, _ = net.spans
    first, last = _at(net, np.array([along.low[0], along.high[-1]]))
    return first, last


def _at(net: Net, t: Reals) -> Reals:
    """The points (k, 2) of a curve at parameters (k,)."""
    return net.derivatives(t, np.zeros(len(t)), 0)[:, 0, 0, :2]


def _check_simple(nets: Sequence[Net], size: float, name: str) -> None:
    """Refuse a profile that crosses itself."""
    pieces = [piece for net in nets for piece in net.pieces()[:, 0, :, 0]]
    curves = np.repeat(np.arange(len(nets)), [len(net.spans[0].low) for net in nets])
    padded = np.ones((len(pieces), HIGHEST_DEGREE + 1, 3))
    for row, piece in zip(padded, pieces, strict=True):
        row[: len(piece)] = piece[:, [0, 1, 3]]
    degrees = np.array([len(piece) - 1 for piece in pieces])
    i, j, rho, z = first_crossing(padded, degrees, size)
    if i >= 0:
        raise ModelError(
            f"{name}: curves[{curves[i]}] and curves[{curves[j]}] cross near [{rho:.6g}, {z:.6g}]; "
            "a profile must not cross itself"
        )


def _area(nets: Sequence[Net]) -> float:
    """About the area to the left of the curves, closed along the axis, square metres."""
    found = 0.0
    for net in nets:
        along, _ = net.spans
        ends = np.append(along.low, along.high[-1])
        spans = np.arange(len(ends))
        points = _at(net, np.interp(np.linspace(0.0, spans[-1], 8 * len(ends)), spans, ends))
        (rho, z), (rho_next, z_next) = points[:-1].T, points[1:].T
        found += 0.5 * float((rho * z_next - z * rho_next).sum())
    return found


_RIM = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
_RIM_WEIGHTS = np.array([1.0, math.sqrt(0.5)] * 4 + [1.0])
QUARTERS = np.repeat(np.arange(5.0), [3, 2, 2, 2, 3])
"""The knots around the axis: from one to the next a quarter turn, as a rational quadratic."""


def revolved(net: Net, frame: Reals) -> Net:
    """The patch of a curve (rho, z, 0) that is revolved about the axis z of a frame (4, 4).

    u is the curve's parameter, v runs around: see QUARTERS. Piegl and Tiller, The NURBS Book, 1997,
    section 8.5. The weight of the corners of a quarter is sqrt(1/2) to half a unit in the last
    place, which moves no point by more than 1e-16 rho.
    """
    rho, z = net.points[:, 0], net.points[:, 1]
    x, y, axis, origin = frame[:3, :3].T[0], frame[:3, 1], frame[:3, 2], frame[:3, 3]
    rim = _RIM[:, :1] * x + _RIM[:, 1:] * y
    control = origin + rho[:, None, None] * rim + (z[:, None] * axis)[:, None]
    weights = np.ones(len(rho)) if net.weights is None else net.weights[:, 0]
    both = weights[:, None] * _RIM_WEIGHTS
    return Net(frozen(control), frozen(both), net.knots_u, frozen(QUARTERS.copy()), False)
