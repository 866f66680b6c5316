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

from .checks import ModelError
from .nurbs import Net, frozen

Reals = NDArray[np.float64]

JOINED = 1e-12
"""How far apart two ends may be that coincide, and an end from the axis that it lies on, as a share
of the profile's size."""

_LEAST, _MOST, _FLAT, _LOOKS = 16, 256, 1e-4, 4
"""Where it is asked whether a profile crosses itself: chords of a span, at least and at most; how
far it may be from them, as a share of the size; and how often chords that cross are looked at more
closely."""

_ASIDE = 0.1234
"""Share of a chord by which its ends are moved: lines of few digits would cross at ends of both."""


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
    chords = _chords(nets, size)
    _check_simple(nets, chords, closed, name)
    rho, z = chords.begin.T
    area = 0.5 * float((rho * np.roll(z, -1) - z * np.roll(rho, -1)).sum())
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


class _Chords(NamedTuple):
    """Chords of a profile, one after the other."""

    begin: Reals
    """(n, 2) rho and z."""
    end: Reals
    curve: NDArray[np.int64]
    """(n,) to which curve each belongs."""
    span: Reals
    """(n, 2) from which parameter of the curve to which."""


def _chords(nets: Sequence[Net], size: float) -> _Chords:
    """Chords of which the curves are nearly made up."""
    begin, end, curve, span = [], [], [], []
    for i, net in enumerate(nets):
        along, _ = net.spans
        for k, piece in enumerate(net.pieces()[:, 0, :, 0]):
            points = piece[:, :2] / piece[:, 3:]
            bend = float(np.abs(np.diff(points, 2, axis=0)).max(initial=0.0)) * len(points) ** 2
            count = int(min(max(math.sqrt(bend / (8.0 * _FLAT * size)), _LEAST), _MOST))
            share = np.linspace(0.0, 1.0, count + 1)
            share[1:-1] += _ASIDE / count
            t = along.low[k] + (along.high[k] - along.low[k]) * share
            places = _at(net, t)
            begin.append(places[:-1])
            end.append(places[1:])
            curve.append(np.full(count, i))
            span.append(np.column_stack((t[:-1], t[1:])))
    return _Chords(*map(np.concatenate, (begin, end, curve, span)))


def _at(net: Net, t: Reals) -> Reals:
    """The points (k, 2) of a curve at parameters (k,)."""
    return net.derivatives(t, np.zeros(len(t)), 0)[:, 0, 0, :2]


def _check_simple(nets: Sequence[Net], chords: _Chords, closed: bool, name: str) -> None:
    """Refuse a profile of which two chords cross that are no neighbours."""
    crossed = _crossings(chords.begin, chords.end, chords.begin, chords.end)
    n = len(crossed)
    if closed:
        crossed[0, n - 1] = False
    for i, j in np.argwhere(np.triu(crossed, 2)):
        a, b = chords.curve[i], chords.curve[j]
        if _cross(nets[a], chords.span[i], nets[b], chords.span[j], _LOOKS):
            raise ModelError(
                f"{name}: curves[{a}] and curves[{b}] cross near {chords.begin[i].tolist()}; "
                "a profile must not cross itself"
            )


def _cross(a: Net, span_a: Reals, b: Net, span_b: Reals, looks: int) -> bool:
    """Whether parts of two curves cross, whose chords do: looked at so many times as closely."""
    if looks == 0:
        return True
    t, s = _beyond(a, span_a), _beyond(b, span_b)
    at_a, at_b = _at(a, t), _at(b, s)
    crossed = np.argwhere(_crossings(at_a[:-1], at_a[1:], at_b[:-1], at_b[1:]))
    return any(_cross(a, t[i : i + 2], b, s[j : j + 2], looks - 1) for i, j in crossed[:4])


def _beyond(net: Net, span: Reals) -> Reals:
    """Parameters on a part of a curve and beside it: it may cross where its chord does not."""
    along, _ = net.spans
    low, high = 1.5 * span - 0.5 * span[::-1]
    return np.linspace(max(low, along.low[0]), min(high, along.high[-1]), 2 * _LEAST + 1)


def _crossings(a: Reals, b: Reals, c: Reals, d: Reals) -> NDArray[np.bool_]:
    """Which segments from a to b (n, 2) cross which from c to d (m, 2), as (n, m)."""
    side_c, side_d = _side(a, b, c), _side(a, b, d)
    side_a, side_b = _side(c, d, a).T, _side(c, d, b).T
    return (side_c * side_d <= 0.0) & (side_a * side_b <= 0.0) & (side_c != side_d)


def _side(a: Reals, b: Reals, c: Reals) -> Reals:
    """On which side of the line from a to b (n, 2) points (m, 2) lie, as (n, m)."""
    way, off = (b - a)[:, None], c[None] - a[:, None]
    return way[..., 0] * off[..., 1] - way[..., 1] * off[..., 0]


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
