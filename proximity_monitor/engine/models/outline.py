"""The edges of patches as curves in space: sides, and the edges that trimming loops make.

An edge along which u or v is constant, such as a side, is a rational Bezier curve. So is every edge
of a plane patch. Any other edge is a trimming curve on a surface. Its points are exact, and a bound
of its second derivative tells how far it may be from the chords between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from .bezier import basis
from .edges import breaks
from .loops import examine, split
from .nurbs import Net

Reals = NDArray[np.float64]

_FLAT = 1e-12
"""How far, as a share of its size, a patch of degree 1 may be from a parallelogram."""
_BEYOND = 1e-9
"""How far a loop may leave its patch's rectangle, as a share of it (see edges.py)."""
_LOOKS = 9
"""How many points are sampled to bound an edge on a surface by a box."""


class RationalCurve(NamedTuple):
    """A rational Bezier curve in space."""

    net: Reals
    """(n, 4) control points, homogeneous."""

    @property
    def points(self) -> Reals:
        """(n, 3) control points in space, metres; the curve lies in their hull."""
        return self.net[:, :3] / self.net[:, 3:]

    def turned(self) -> Self:
        """Return the reversed curve."""
        return self._replace(net=self.net[::-1])

    def split(self, t: float) -> tuple[Self, Self]:
        """Split the curve at a parameter."""
        return tuple(self._replace(net=each) for each in split(self.net, t))

    def at(self, t: Reals) -> Reals:
        """Return the points (k, 3) at parameters (k,)."""
        return _at(self.net, t)

    def bend(self) -> float:
        """Return an upper bound of the second derivative's length, metres."""
        _, second = _rates(self.net)
        return float(np.linalg.norm(second))


class Chart(NamedTuple):
    """A trimmed patch as a map from its unit square (see kernels/surface/trim.py) to space."""

    net: Net
    homogeneous: Reals
    """(n_u, n_v, 4) the control net in homogeneous coordinates."""
    first: Reals
    """(2,) metres: upper bounds of the first derivatives by x and y of the unit square."""
    second: Reals
    """(2, 2) metres: upper bounds of the second derivatives."""

    @classmethod
    def of(cls, net: Net) -> Self:
        """Make the chart of a trimmed patch."""
        record = net.trim.record
        steps = []
        for axis, along in enumerate(net.spans):
            width = (along.high - along.low) / record["extent"][axis]
            slope, turn = 1.0 / width, np.zeros_like(width)
            if record["arcs"][axis] > 0:  # as in kernels/surface/edge_bend.py
                tangent = float(record["tangent"][axis])
                quarter = np.arctan(tangent)
                turn = 4.0 * slope * record["arcs"][axis] * quarter**2 * (1.0 + tangent**2)
                slope = slope * quarter * (1.0 + tangent**2) / tangent
            steps.append((slope, turn))
        (su, tu), (sv, tv) = steps
        first, second = _derivatives(net.pieces())
        su, sv, tu, tv = su[:, None], sv[None], tu[:, None], tv[None]
        uv = (second[0, 1] * su * sv).max()
        uu = (second[0, 0] * su**2 + first[0] * tu).max()
        vv = (second[1, 1] * sv**2 + first[1] * tv).max()
        speeds = np.array([(first[0] * su).max(), (first[1] * sv).max()])
        return cls(net, net.homogeneous(), speeds, np.array([[uu, uv], [uv, vv]]))

    def parameters(self, axis: int, share: Reals) -> Reals:
        """Return parameters of the patch from coordinates in the unit square; see `from_unit`."""
        trim = self.net.trim.record
        share, arcs = np.clip(share, 0.0, 1.0), int(trim["arcs"][axis])
        if arcs:
            arc = np.minimum(np.floor(share * arcs), arcs - 1.0)
            tangent = float(trim["tangent"][axis])
            angle = (2.0 * (share * arcs - arc) - 1.0) * np.arctan(tangent)
            share = (arc + 0.5 + 0.5 * np.tan(angle) / tangent) / arcs
        return trim["low"][axis] + share * trim["extent"][axis]


class ChartCurve(NamedTuple):
    """A curve in space, given in the unit square of a chart."""

    chart: Chart
    net: Reals
    """(n, 3) control points in the unit square, homogeneous."""

    @property
    def points(self) -> Reals:
        """(11, 3) metres: points of the curve, ends first and last, and two corners of its box."""
        t = np.linspace(0.0, 1.0, _LOOKS)
        found = self.at(t)
        beyond = self.bend() / (8.0 * (_LOOKS - 1) ** 2)
        low, high = found.min(axis=0) - beyond, found.max(axis=0) + beyond
        return np.concatenate([found[:-1], [low, high], found[-1:]])

    def turned(self) -> Self:
        """Return the reversed curve."""
        return self._replace(net=self.net[::-1])

    def split(self, t: float) -> tuple[Self, Self]:
        """Split the curve at a parameter."""
        return tuple(self._replace(net=each) for each in split(self.net, t))

    def at(self, t: Reals) -> Reals:
        """Return the points (k, 3) at parameters (k,)."""
        x, y = _at(self.net, t).T
        spans = self.chart.net.spans
        first_u, in_u = basis(spans[0], self.chart.parameters(0, x), 0)
        first_v, in_v = basis(spans[1], self.chart.parameters(1, y), 0)
        rows = (first_u[:, None] + np.arange(in_u.shape[2]))[:, :, None]
        columns = (first_v[:, None] + np.arange(in_v.shape[2]))[:, None, :]
        points = self.chart.homogeneous[rows, columns]
        lines = (points * in_u[:, 0, :, None, None]).sum(axis=1)
        found = (lines * in_v[:, 0, :, None]).sum(axis=1)
        return found[:, :3] / found[:, 3:]

    def bend(self) -> float:
        """Return an upper bound of the second derivative's length, metres."""
        first, second = _rates(self.net)
        return float(first @ self.chart.second @ first + self.chart.first @ second)


class Edge(NamedTuple):
    """A directed edge; its patch lies on its left, seen against the patch's normal."""

    curve: RationalCurve | ChartCurve
    patch: int
    points: Reals
    """(n, 3) metres: points whose bounding box holds the edge; its ends are first and last."""

    @classmethod
    def of(cls, curve: RationalCurve | ChartCurve, patch: int) -> Self:
        """Make the edge of a patch along a curve."""
        return cls(curve, patch, curve.points)

    def turned(self) -> Self:
        """Return the reversed edge."""
        return self._replace(curve=self.curve.turned(), points=self.points[::-1])


class Outline(NamedTuple):
    """The edges of a patch."""

    edges: list[Edge]
    blur: float
    """Metres: how far the edges may be from the boundary of what is left of the patch."""
    reason: str
    """Why the loops are no boundary; empty if they are."""


def outline(net: Net, patch: int) -> Outline:
    """Return the edges of a patch; a curve has none."""
    if net.is_curve:
        return Outline([], 0.0, "")
    if net.trim is None:
        return Outline([Edge.of(RationalCurve(each), patch) for each in _sides(net)], 0.0, "")
    loops = examine(net.trim)
    if loops.reason:
        return Outline([], 0.0, loops.reason)
    chart = Chart.of(net)
    flat = _parallelogram(net)
    blur = (loops.blur + 8.0 * float(net.trim.record["slack"])) * float(chart.first.sum())
    if flat is not None:
        blur += _FLAT * float(np.abs(net.points).max())
    edges, beyond = [], 0.0
    for loop, turned in zip(net.trim.loops, loops.turned, strict=True):
        for part in loop:
            points = part.edge[:, :2] / part.edge[:, 2:]
            beyond = max(beyond, float(-points.min()), float(points.max()) - 1.0)
            curve = part.edge[::-1] if turned else part.edge
            edges += [Edge.of(each, patch) for each in _lifted(chart, flat, curve)]
    blur += 2.0 * min(beyond, _BEYOND) * float(chart.first.sum())
    return Outline(edges, blur, "")


def _sides(net: Net) -> Iterator[Reals]:
    """Yield the edges of a patch's pieces that are not shared with the piece beside, directed."""
    made = net.pieces()
    for turned in (False, True):
        # The second pass exchanges u and v, which reverses all directions.
        each = made.transpose(1, 0, 3, 2, 4) if turned else made
        low, high = each[:, :, :, 0], each[:, :, :, -1]
        torn = (low[:, 1:] != high[:, :-1]).any(axis=(2, 3))
        always = np.ones((len(each), 1), np.bool_)
        begins = low[np.concatenate((always, torn), axis=1)]
        ends = high[np.concatenate((torn, always), axis=1)]
        yield from (curve[:: -1 if turned else 1] for curve in begins)
        yield from (curve[:: 1 if turned else -1] for curve in ends)


def _parallelogram(net: Net) -> Reals | None:
    """Return origin and both sides (3, 3) of a patch that is a parallelogram, else None.

    None as well if its unit square is not mapped linearly: weights, higher degrees, arcs.
    """
    if net.weights is not None or net.control.shape[:2] != (2, 2) or net.trim.record["arcs"].any():
        return None
    (a, b), (c, d) = net.control
    if np.abs(a - b - c + d).max() > 0.5 * _FLAT * np.abs(net.points).max():
        return None
    return np.array([a, c - a, b - a])


def _lifted(chart: Chart, flat: Reals | None, curve: Reals) -> Iterator[RationalCurve | ChartCurve]:
    """Yield a curve (n, 3) of the unit square as curves in space, each on one piece."""
    net = chart.net
    if flat is not None:
        frame = np.array([[*flat[1], 0.0], [*flat[2], 0.0], [*flat[0], 1.0]])
        yield RationalCurve(curve @ frame)
        return
    (ax, ay), (bx, by) = curve[[0, -1], :2] / curve[[0, -1], 2:]
    slack = float(net.trim.record["slack"])
    if len(curve) == 2 and min(abs(bx - ax), abs(by - ay)) <= slack:
        axis = 0 if abs(bx - ax) <= slack else 1
        ends = ((ay, by), (ax, bx))[axis]
        yield from _isoparametric(chart, axis, (ax, ay)[axis], *ends)
        return
    knots = []
    for axis, along in enumerate(net.spans):
        low, extent = net.trim.record["low"][axis], net.trim.record["extent"][axis]
        knots.append((along.low[1:] - low) / extent)
    begin, left = 0.0, ChartCurve(chart, curve)
    for t in breaks(curve, knots)[1:-1]:
        first, left = left.split((t - begin) / (1.0 - begin))
        yield first
        begin = t
    yield left


def _isoparametric(
    chart: Chart, axis: int, share: float, begin: float, end: float
) -> Iterator[RationalCurve]:
    """Yield the curves, one per piece, along which coordinate `axis` of the unit square is `share`.

    The other coordinate runs from `begin` to `end`.
    """
    made = chart.net.pieces()
    if axis == 1:
        made = made.transpose(1, 0, 3, 2, 4)
    fixed, along = chart.net.spans[axis], chart.net.spans[1 - axis]
    value = float(chart.parameters(axis, np.array(share)))
    k = int(np.clip(np.searchsorted(fixed.low, value, side="right") - 1, 0, len(fixed.low) - 1))
    t = (value - fixed.low[k]) / (fixed.high[k] - fixed.low[k])
    level = made[k].swapaxes(0, 1)  # (degree + 1, pieces, points, 4)
    while len(level) > 1:
        level = (1.0 - t) * level[:-1] + t * level[1:]
    low, high = chart.parameters(1 - axis, np.sort([begin, end]))
    found = []
    for piece, net in enumerate(level[0]):
        bounds = np.array([along.low[piece], along.high[piece]])
        a, b = (np.clip([low, high], *bounds) - bounds[0]) / (bounds[1] - bounds[0])
        if a < b:
            part = split(net, b)[0] if b < 1.0 else net
            found.append(split(part, a / b)[1] if a > 0.0 else part)
    if begin > end:
        found = [each[::-1] for each in reversed(found)]
    yield from map(RationalCurve, found)


def _at(net: Reals, t: Reals) -> Reals:
    """Return the points (k, c) at parameters (k,) of homogeneous control points (n, c + 1)."""
    level = np.broadcast_to(net[:, None], (len(net), len(t), net.shape[1]))
    while len(level) > 1:
        level = (1.0 - t[:, None]) * level[:-1] + t[:, None] * level[1:]
    return level[0, :, :-1] / level[0, :, -1:]


def _rates(net: Reals) -> tuple[Reals, Reals]:
    """Return bounds (c,) of the first and of the second derivative of a curve, by coordinate.

    Its control points (n, c + 1) are homogeneous. Seen from the middle of the curve, r = N / w has
    r' = (N' - w' r) / w and r'' = (N'' - 2 w' r' - w'' r) / w.
    """
    degree, weights = len(net) - 1, net[:, -1]
    points = net[:, :-1] / weights[:, None]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach, light = 0.5 * np.ptp(points, axis=0), weights.min()
    about = net[:, :-1] - middle * weights[:, None]

    def most(values: Reals, times: int) -> Reals | float:
        steps = np.abs(np.diff(values, times, axis=0))
        return steps.max(axis=0) if len(steps) else np.zeros(values.shape[1:])

    first = degree * (most(about, 1) + most(weights, 1) * reach) / light
    second = degree * (degree - 1) * (most(about, 2) + most(weights, 2) * reach)
    second = (second + 2.0 * degree * most(weights, 1) * first) / light
    return first * (1.0 + 1e-9), second * (1.0 + 1e-9)


def _derivatives(pieces: Reals) -> tuple[Reals, Reals]:
    """Return bounds of the first and second derivatives of pieces over 0..1, metres.

    The pieces are (s_u, s_v, p + 1, q + 1, 4), the bounds (2, s_u, s_v) and (2, 2, s_u, s_v). See
    `_rates`.
    """
    weights = pieces[..., 3]
    points = pieces[..., :3] / weights[..., None]
    middle = points.mean(axis=(2, 3), keepdims=True)
    reach = np.linalg.norm(points - middle, axis=-1).max(axis=(2, 3))
    about, light = pieces[..., :3] - middle * weights[..., None], weights.min(axis=(2, 3))
    degrees = np.array(weights.shape[2:]) - 1

    def most(*axes: int) -> tuple[Reals, Reals]:
        vectors, scalars, factor, left = about, weights, 1.0, list(degrees)
        for axis in axes:
            vectors, scalars = np.diff(vectors, axis=2 + axis), np.diff(scalars, axis=2 + axis)
            factor *= left[axis]
            left[axis] -= 1
        if not scalars.size:
            return np.zeros(reach.shape), np.zeros(reach.shape)
        lengths = np.linalg.norm(vectors, axis=-1).max(axis=(2, 3))
        return factor * lengths, factor * np.abs(scalars).max(axis=(2, 3))

    slopes, turns = zip(*(most(axis) for axis in range(2)), strict=True)
    first = np.array([(n + w * reach) / light for n, w in zip(slopes, turns, strict=True)])
    second = np.empty((2, 2, *reach.shape))
    for i in range(2):
        for j in range(2):
            n, w = most(i, j)
            second[i, j] = (n + turns[i] * first[j] + turns[j] * first[i] + w * reach) / light
    return first * (1.0 + 1e-9), second * (1.0 + 1e-9)
