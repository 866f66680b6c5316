"""The profile of a solid of revolution, and the checks of its curves.

The curves lie in the half-plane (rho, z), rho >= 0. Each begins where the one before it ends. They
run from the axis to the axis, or around in a loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.revolution.axis import farthest_beyond
from ..kernels.revolution.crossing import first_crossing
from .along_axis import lies_along, off_axis
from .bezier import bernstein
from .checks import ModelError
from .nurbs import HIGHEST_DEGREE, Net, frozen
from .orientation import area_leftward, balanced, is_clear, runs_leftward
from .passing import passes

Reals = NDArray[np.float64]

JOINED = 1e-12
"""How far apart two coincident ends may be, and how far from the axis an end that lies on it, as a
share of the profile's size."""

_AREA_ROUNDING = 64.0 * DOUBLE_EPS
"""Rounding allowance of an area, as a share of the profile's size times its width plus height.

A point errs by some units of the size. Its share in the area's error is that times the distance of
its two neighbours. These distances sum to about twice the width plus height."""


class Profile(NamedTuple):
    """A checked profile; `nets` are its curves, with control points (rho, z, 0) in metres."""

    nets: tuple[Net, ...]
    closed: bool
    """Whether the profile is a loop, which starts off the axis."""
    size: float
    """Metres: the largest coordinate of a control point."""
    leftward: bool
    """Whether the solid is on the left of the curves, with rho to the right and z upward."""
    pieces: tuple[Reals, ...]
    """The Bezier pieces (s, degree + 1, 3) of each curve: rho w, z w and w of control points."""


def profile_of(nets: Sequence[Net], name: str) -> Profile:
    """Return the checked profile that curves form without their parts along the axis.

    Raises:
        ModelError: as for `checked_profile`.
    """
    kept, numbers = without_axis(nets, name)
    return checked_profile(kept, name, numbers)


def without_axis(nets: Sequence[Net], name: str) -> tuple[Sequence[Net], Sequence[int]]:
    """Return the curves of a profile without their parts along the axis, and their numbers.

    Raises:
        ModelError: there are such parts, and the curves do not form a chain.
    """
    pieces = _pieces_of(nets)
    near = JOINED * _size_of(nets)
    if not any(lies_along(own, near).any() for own in pieces):
        return nets, range(len(nets))
    # The parts that are left out must fit in, too.
    _check_curves(nets, pieces, near, range(len(nets)), name)
    numbers, kept = zip(*off_axis(nets, pieces, near), strict=True)
    return kept, numbers


def checked_profile(
    nets: Sequence[Net], name: str, numbers: Sequence[int] | None = None
) -> Profile:
    """Return the checked profile that all of the curves form.

    Args:
        nets: the curves.
        name: what messages call the model.
        numbers: the number by which messages call each curve; None: its place in the list.

    Raises:
        ModelError: a curve is out of the plane, is torn, crosses the axis or runs along it; a curve
            does not begin where the one before it ends; an open end is off the axis; the profile
            crosses itself or holds no area; it cannot be told on which side the solid is.
    """
    numbers = range(len(nets)) if numbers is None else numbers
    size, pieces = _size_of(nets), _pieces_of(nets)
    near = JOINED * size
    all_of = _check_curves(nets, pieces, near, numbers, name)
    closed = _is_loop(nets, pieces, near, numbers, name)
    _check_simple(nets, all_of, size, numbers, name)
    exact = area = area_leftward(pieces)
    if area is None:
        area = sum(_area(balanced(own), pieces[0][0, 0], closed) for own in pieces)
    wide, high, _ = np.ptp(np.concatenate([net.points for net in nets]), axis=0)
    if not abs(area) > JOINED * wide * high + _AREA_ROUNDING * size * (wide + high):
        raise ModelError(
            f"{name}: curves: they enclose no area, so there is no solid: they span {wide:.3g} m "
            f"in rho and {high:.3g} m in z; move control points until they run around an area"
        )
    _check_along_axis(nets, pieces, near, numbers, name)
    if is_clear(exact, pieces, size):
        leftward = area > 0.0
    else:
        leftward = runs_leftward(pieces, size, not closed)
    if leftward is None:
        raise ModelError(
            f"{name}: curves: cannot tell on which side of them the solid is; is it a sliver? Make "
            "it wider"
        )
    return Profile(tuple(nets), closed, size, leftward, pieces)


def _size_of(nets: Sequence[Net]) -> float:
    """Return the largest coordinate of a control point, metres."""
    return max(float(np.abs(net.points).max()) for net in nets)


def _pieces_of(nets: Sequence[Net]) -> tuple[Reals, ...]:
    """Return the Bezier pieces (s, degree + 1, 3) of each curve: see `Profile`."""
    return tuple(frozen(net.pieces()[:, 0, :, 0][..., [0, 1, 3]]) for net in nets)


class _Pieces(NamedTuple):
    """The Bezier pieces of all curves of a profile, one after the other, as kernels take them."""

    nets: Reals
    """(n, 16, 3) rho w, z w and w of control points; rows beyond degree + 1 are unused."""
    degrees: NDArray[np.int64]
    curves: NDArray[np.int64]
    """(n,) the curve of each piece."""


def _together(pieces: Sequence[Reals]) -> _Pieces:
    """Join the pieces of all curves into one array."""
    counts = [len(own) for own in pieces]
    padded = np.ones((sum(counts), HIGHEST_DEGREE + 1, 3))
    for own, end in zip(pieces, np.cumsum(counts).tolist(), strict=True):
        padded[end - len(own) : end, : own.shape[1]] = own
    degrees = np.repeat([own.shape[1] - 1 for own in pieces], counts)
    return _Pieces(padded, degrees, np.repeat(np.arange(len(pieces)), counts))


def _check_curves(
    nets: Sequence[Net], pieces: Sequence[Reals], near: float, numbers: Sequence[int], name: str
) -> _Pieces:
    """Return all pieces; refuse curves that leave the half-plane or do not join end to begin."""
    for k, net in zip(numbers, nets, strict=True):
        if net.control[..., 2].any():
            i = int(np.flatnonzero(net.points[:, 2])[0])
            raise ModelError(
                f"{name}: curves[{k}]: control[{i}] = {net.points[i].tolist()}: not in the plane; "
                "give (rho, z) or (rho, z, 0)"
            )
    all_of = _together(pieces)
    _check_axis(nets, all_of, near, numbers, name)
    _check_ends(nets, pieces, near, numbers, name)
    return all_of


def _check_axis(
    nets: Sequence[Net], all_of: _Pieces, near: float, numbers: Sequence[int], name: str
) -> None:
    """Refuse curves with a point beyond the axis by more than `near` metres."""
    if all((net.points[:, 0] >= -near).all() for net in nets):
        return
    i, share, rho = farthest_beyond(all_of.nets, all_of.degrees, near)
    if i >= 0:
        k, t = _parameter(nets, all_of, i, share)
        z = float(nets[k].derivatives(np.array([t]), np.zeros(1), 0)[0, 0, 0, 1])
        raise ModelError(
            f"{name}: curves[{numbers[k]}]: crosses the axis: rho = {rho:.6g} m at t = {t:.6g}, "
            f"z = {z:.6g} m; move its control points so that it stays where rho >= 0"
        )


def _parameter(nets: Sequence[Net], all_of: _Pieces, i: int, share: float) -> tuple[int, float]:
    """Return the curve that a piece is part of, and its parameter at a share of the piece."""
    k = int(all_of.curves[i])
    along, _ = nets[k].spans
    own = i - int(np.searchsorted(all_of.curves, k))
    return k, float((1.0 - share) * along.low[own] + share * along.high[own])


def _said(place: Reals) -> str:
    """Return rho and z as text."""
    return f"[{place[0]:.6g}, {place[1]:.6g}] m"


def _check_along_axis(
    nets: Sequence[Net], pieces: Sequence[Reals], near: float, numbers: Sequence[int], name: str
) -> None:
    """Refuse pieces that run along the axis, because a boundary there would be inside the solid."""
    for k, own in enumerate(pieces):
        along = lies_along(own, near) & (np.ptp(own[..., 1] / own[..., 2], axis=1) > near)
        if along.any():
            i = int(along.argmax())
            spans, z = nets[k].spans[0], own[i, [0, -1], 1] / own[i, [0, -1], 2]
            raise ModelError(
                f"{name}: curves[{numbers[k]}]: runs along the axis from t = {spans.low[i]:.6g} to "
                f"{spans.high[i]:.6g} (z = {z[0]:.6g} to {z[1]:.6g} m), inside the solid; leave "
                "that part out: a profile may begin and end on the axis, and the solids on both "
                "sides of that part make a compound"
            )


def _check_ends(
    nets: Sequence[Net], pieces: Sequence[Reals], near: float, numbers: Sequence[int], name: str
) -> None:
    """Refuse curves that are torn, or do not begin where the one before them ends."""
    for k, own in enumerate(pieces):
        # A curve may be torn at a knot that is repeated degree + 1 times.
        begins, ends = (own[1:, 0, :2] / own[1:, 0, 2:], own[:-1, -1, :2] / own[:-1, -1, 2:])
        gaps = np.linalg.norm(begins - ends, axis=1)
        if gaps.max(initial=0.0) > near:
            i = int(gaps.argmax())
            t = nets[k].spans[0].low[i + 1]
            raise ModelError(
                f"{name}: curves[{numbers[k]}]: is discontinuous at t = {t:.6g}: it jumps by "
                f"{gaps[i]:.3g} m from {_said(ends[i])} to {_said(begins[i])}; let the control "
                f"points coincide there, or repeat this knot {own.shape[1] - 1} times at most"
            )
    ends = _ends_of(pieces)
    for i in range(1, len(ends)):
        (begin, far), (_, end) = ends[i], ends[i - 1]
        gap = float(np.linalg.norm(begin - end))
        if gap > near:
            turned = float(np.linalg.norm(far - end)) <= near
            hint = f"reverse curves[{numbers[i]}]" if turned else "let it begin there"
            (t, _), (_, s) = _domain(nets[i]), _domain(nets[i - 1])
            raise ModelError(
                f"{name}: curves[{numbers[i]}] begins at {_said(begin)} (t = {t:.6g}), {gap:.3g} m "
                f"from {_said(end)}, where curves[{numbers[i - 1]}] ends (t = {s:.6g}); {hint}"
            )


def _domain(net: Net) -> tuple[float, float]:
    """Return the lowest and the highest parameter of a curve."""
    along, _ = net.spans
    return float(along.low[0]), float(along.high[-1])


def _ends_of(pieces: Sequence[Reals]) -> list[tuple[Reals, Reals]]:
    """Return the start and the end of each curve, rho and z."""
    return [(own[0, 0, :2] / own[0, 0, 2], own[-1, -1, :2] / own[-1, -1, 2]) for own in pieces]


def _is_loop(
    nets: Sequence[Net], pieces: Sequence[Reals], near: float, numbers: Sequence[int], name: str
) -> bool:
    """Tell whether the curves are a loop, or run from axis to axis; refuse other open ends."""
    ends = _ends_of(pieces)
    first, last = ends[0][0], ends[-1][1]
    if first[0] <= near and last[0] <= near:
        return False
    if np.linalg.norm(first - last) <= near:
        return True
    whole = []
    for what, k, end in (("begins", 0, first), ("ends", -1, last)):
        off = "on the axis" if end[0] <= near else f"{end[0]:.6g} m off the axis"
        t = _domain(nets[k])[k]
        whole.append(f"{what} at {_said(end)} (curves[{numbers[k]}], t = {t:.6g}), {off}")
    gap = np.linalg.norm(last - first)
    raise ModelError(
        f"{name}: curves: the profile is open: it {' and '.join(whole)}; its ends are {gap:.6g} m "
        "apart. Move both ends to the axis, or both to one place"
    )


def _points(pieces: Reals, count: int) -> Reals:
    """Return points (s, count, 2) of pieces (s, degree + 1, 3) at equal steps of the parameter."""
    found = _shares(pieces.shape[1] - 1, count) @ pieces
    return found[..., :2] / found[..., 2:]


@lru_cache(maxsize=64)
def _shares(degree: int, count: int) -> Reals:
    """Return the Bernstein polynomials (count, degree + 1) at equal steps from 0 to 1."""
    s = np.linspace(0.0, 1.0, count)
    return frozen(bernstein(degree, s, 1.0 - s))


def _check_simple(
    nets: Sequence[Net], all_of: _Pieces, size: float, numbers: Sequence[int], name: str
) -> None:
    """Refuse a profile that crosses itself."""
    i, j, rho, z = first_crossing(all_of.nets, all_of.degrees, size)
    if i < 0:
        return
    place = np.array([rho, z])
    one, other = (all_of.nets[k][: all_of.degrees[k] + 1] for k in (i, j))
    shares = passes(one, place, 2) if i == j else passes(one, place, 1) + passes(other, place, 1)
    places = (_parameter(nets, all_of, *each) for each in zip((i, j), shares, strict=True))
    both = " and ".join(f"curves[{numbers[k]}] at t = {t:.6g}" for k, t in places)
    raise ModelError(
        f"{name}: {both} cross near {_said(place)}; a profile must not cross itself: move control "
        "points until they stay apart"
    )


def _area(pieces: Reals, first: Reals, closed: bool) -> float:
    """Estimate the area to the left of a curve's pieces, m², from triangles with a common corner.

    For a loop this corner is its start, so that the area of a very thin ring is not lost in
    rounding. Any other profile is closed along the axis; its corner is the point of the axis at the
    height of its start.
    """
    place = first[:2] / first[2] * [float(closed), 1.0]
    rho, z = np.moveaxis(_points(pieces, 9) - place, 2, 0)
    return 0.5 * float((rho[:, :-1] * z[:, 1:] - z[:, :-1] * rho[:, 1:]).sum())


_RIM = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
_RIM_WEIGHTS = np.array([1.0, math.sqrt(0.5)] * 4 + [1.0])
QUARTERS = np.repeat(np.arange(5.0), [3, 2, 2, 2, 3])
"""The knots around the axis; each span is a quarter turn, a rational quadratic."""


def revolved(net: Net, frame: Reals) -> Net:
    """Revolve a curve (rho, z, 0) about the z axis of a frame (4, 4); return the patch.

    u is the curve's parameter, v runs around the axis: see QUARTERS. Piegl and Tiller, The NURBS
    Book, 1997, section 8.5. The weight of a quarter's middle control point is sqrt(1/2) to half a
    unit in the last place. This error moves no point by more than 1e-16 rho.
    """
    rho, z = net.points[:, 0], net.points[:, 1]
    x, y, axis, origin = frame[:3, :3].T[0], frame[:3, 1], frame[:3, 2], frame[:3, 3]
    rim = _RIM[:, :1] * x + _RIM[:, 1:] * y
    control = origin + rho[:, None, None] * rim + (z[:, None] * axis)[:, None]
    weights = np.ones(len(rho)) if net.weights is None else net.weights[:, 0]
    both = weights[:, None] * _RIM_WEIGHTS
    return Net(frozen(control), frozen(both), net.knots_u, frozen(QUARTERS.copy()), False)
