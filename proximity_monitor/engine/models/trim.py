"""The trimming loops of a patch: checked, cut into segments with certified bands, listed by rows.

A segment is a stretch of a curve. Its band is how far it may be from its chord. A frame stands for
curves along a side of the rectangle: segments outside it, at a distance of `_BEYOND`. A row is an
interval of v, with the list of the segments that may be in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.trees import FRAME, SEGMENT, TRIM, Trims
from .checks import ModelError

if TYPE_CHECKING:
    from .nurbs import Net

Reals = NDArray[np.float64]

SNAP = 1e-9
"""Control points nearer to a side than this share of the rectangle's extent are moved onto it."""
_FLAT = 1e-3
"""The widest band that a segment should have, as a share of the rectangle's extent."""
_MOST_PARTS = 64
"""The most segments of a curve."""
_MOST_ROWS = 256
_BEYOND = 1.0
"""How far outside the unit square the frame lies."""


class TrimCurve(NamedTuple):
    """A rational Bezier curve in the parameters of a patch, of degree 1 to 15."""

    control: Reals
    """(n, 2) control points u, v."""
    weights: Reals | None = None
    """(n,) above 0; None: all 1."""


class Trim:
    """What is left of a patch: the parameters inside an odd number of closed loops, or on a loop.

    Args:
        loops: closed sequences of curves. Each curve begins where the one before it ends; a gap
            between them is closed by a straight line. Coordinates u, v are the patch's parameters
            along an axis without arcs, and angles along an axis with arcs (see `arcs`).
        low: (2,) the lowest u and v of the patch.
        high: (2,) the highest u and v of the patch.
        arcs: (in u, in v) of how many equal circular arcs the patch is made along that axis; 0:
            the axis has no arcs. Each arc, of angle t, is quadratic with weights 1, cos(t/2), 1.
            The knots are the angles at the ends of the arcs, radians.

    Raises:
        ModelError: the rectangle is empty; there are no loops; a loop has no curves; a curve has a
            wrong shape, a control point that is not finite, or a weight that is not finite and
            above 0; nothing is left.

    Attributes:
        whole: whether nothing is cut off, so that the patch needs no trim.
        snapped: (2,) how far the loops were moved onto the rectangle's sides, in u and in v. The
            caller adds the distance in space that this may be to the model's deviation.
        loops: for each loop its curves, as `Part`.
    """

    __slots__ = ("loops", "nets", "record", "segments", "snapped", "whole")

    def __init__(
        self,
        loops: Sequence[Sequence[TrimCurve]],
        low: ArrayLike,
        high: ArrayLike,
        arcs: tuple[int, int] = (0, 0),
    ) -> None:
        low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        extent = high - low
        if not (extent > 0.0).all():
            raise ModelError(f"trim: rectangle from {low.tolist()} to {high.tolist()} is empty")
        if not loops:
            raise ModelError("trim: no loops")
        if not all(len(loop) for loop in loops):
            raise ModelError("trim: a loop without curves")
        self.record = np.zeros((), TRIM)
        self.record["low"], self.record["extent"], self.record["arcs"] = low, extent, arcs
        angles = extent / np.maximum(arcs, 1)
        self.record["tangent"] = np.where(np.asarray(arcs) > 0, np.tan(angles / 4.0), 1.0)
        # Rounding a parameter and mapping it err by a few u of the parameter itself.
        spread = 1.0 + float(((np.abs(low) + np.abs(high)) / extent).max())
        slack = 16.0 * DOUBLE_EPS * spread
        self.record["slack"] = slack
        self.snapped = np.zeros(2)
        rows: list[tuple] = []
        nets: list[Reals] = []
        room = 0
        self.loops = tuple(
            _closed([self._in_unit_square(curve, low, extent) for curve in loop], slack)
            for loop in loops
        )
        for loop in self.loops:
            for part in loop:
                rows += [(*row, room) for row in part.rows]
                nets.append(part.net)
                room += part.net.size
        self.snapped *= extent
        self.segments = np.zeros(len(rows), SEGMENT)
        for i, (a, b, band, begin, end, degree, net) in enumerate(rows):
            self.segments[i] = (a, b, band, begin, end, net, degree)
        self.nets = np.concatenate(nets, axis=None) if nets else np.zeros(0)
        self.whole = self._is_whole()

    def check(self, net: Net, name: str) -> None:
        """Check that the trim fits a patch.

        Raises:
            ModelError: the patch has another rectangle, or other arcs along an axis.
        """
        for i, (letter, along) in enumerate(zip("uv", net.spans, strict=True)):
            low, high = float(along.low[0]), float(along.high[-1])
            own_low, extent = float(self.record["low"][i]), float(self.record["extent"][i])
            if own_low != low or abs(own_low + extent - high) > 1e-12 * (abs(high) + extent):
                raise ModelError(
                    f"{name}: trim: its {letter} ranges from {own_low} to {own_low + extent}, "
                    f"but that of the patch from {low} to {high}"
                )
            arcs = int(self.record["arcs"][i])
            if arcs and not (arcs == len(along.low) and along.degree == 2):
                raise ModelError(
                    f"{name}: trim: {arcs} arcs in {letter} need as many pieces of degree 2, but "
                    f"the patch has {len(along.low)} of degree {along.degree}"
                )

    def swapped(self) -> Self:
        """Return the trim of the patch with u and v exchanged."""
        made = object.__new__(type(self))
        made.record, made.segments = self.record.copy(), self.segments.copy()
        for name in ("low", "extent", "tangent", "arcs"):
            made.record[name] = self.record[name][::-1]
        for name in ("a", "b"):
            made.segments[name] = self.segments[name][:, ::-1]
        made.snapped, made.whole = self.snapped[::-1].copy(), self.whole
        made.nets = _exchanged(self.nets.reshape(-1, 3)).ravel()
        made.loops = tuple(tuple(part.swapped() for part in loop) for loop in self.loops)
        return made

    def digest(self) -> bytes:
        """Return bytes that tell this trim from others."""
        return self.record.tobytes() + self.segments.tobytes() + self.nets.tobytes()

    def _in_unit_square(self, curve: TrimCurve, low: Reals, extent: Reals) -> Reals:
        """Return control points (n, 3) x, y and w of a curve; those close to a side lie on it."""
        control = np.asarray(curve.control, dtype=np.float64)
        count = len(control)
        weights = np.ones(count) if curve.weights is None else np.asarray(curve.weights)
        if control.shape != (count, 2) or weights.shape != (count,) or not 2 <= count <= 16:
            raise ModelError(
                f"trim: a curve has control points of shape {control.shape} and weights of shape "
                f"{weights.shape}, expected (n, 2) and (n,) with n from 2 to 16"
            )
        if not (np.isfinite(control).all() and (weights > 0.0).all() and weights.max() < math.inf):
            raise ModelError(
                "trim: a curve's points must be finite, its weights finite and above 0"
            )
        unit = (control - low) / extent
        sides = np.round(unit)
        near = (np.abs(unit - sides) <= SNAP) & ((sides == 0.0) | (sides == 1.0))
        moved = np.where(near, np.abs(unit - sides), 0.0).max(axis=0)
        self.snapped = np.maximum(self.snapped, moved)
        return np.column_stack([np.where(near, sides, unit), weights])

    def _is_whole(self) -> bool:
        """Tell whether all loops run along the sides; raise ModelError if nothing is left then."""
        segments = self.segments
        if (segments["band"] >= 0.0).any():
            return False
        (_, ay), (bx, by) = segments["a"].T, segments["b"].T
        # A segment of a frame passes the middle on its left or on its right.
        crossed = ((ay <= 0.5) != (by <= 0.5)) & (bx > 0.5)
        if not int(crossed.sum()) % 2:
            raise ModelError("trim: the loops leave nothing of the patch")
        return True


class Part(NamedTuple):
    """A curve of a loop, in the unit square. Control points are x w, y w and w."""

    rows: list[tuple]
    """The segments, without the place of their net."""
    net: Reals
    """(n, 3) the control points; empty if the curve lies along a side."""
    outline: list[Reals]
    """The curve or, if it lies along a side, the polyline outside that stands for it."""
    edge: Reals
    """(n, 3) the curve as a boundary of what is left; along a side a line from end to end."""

    def swapped(self) -> Part:
        """Return the part with x and y exchanged."""
        rows = [(a[::-1], b[::-1], *rest) for a, b, *rest in self.rows]
        net = _exchanged(self.net) if self.net.size else self.net
        return Part(rows, net, [_exchanged(each) for each in self.outline], _exchanged(self.edge))


def _exchanged(points: Reals) -> Reals:
    """Return points (n, 3) with x and y exchanged."""
    return np.ascontiguousarray(points[:, [1, 0, 2]])


def _closed(curves: list[Reals], slack: float) -> list[Part]:
    """Return the parts of a loop, whose ends equal those of their neighbours to the last bit."""
    chain: list[Reals] = []
    for curve, following in zip(curves, [*curves[1:], curves[0]], strict=True):
        chain.append(curve)
        if np.hypot(*(curve[-1, :2] - following[0, :2])) > slack:
            chain.append(np.array([(*curve[-1, :2], 1.0), (*following[0, :2], 1.0)]))
    begins = [(float(x), float(y)) for x, y, _ in (curve[0] for curve in chain)]
    framed = [_framed(curve) for curve in chain]
    parts = []
    for i, curve in enumerate(chain):
        following = (i + 1) % len(chain)
        here, there = begins[i], begins[following]
        if framed[i]:
            before = [] if framed[i - 1] else [here]
            after = [] if framed[following] else [there]
            edge = np.column_stack([np.clip([here, there], 0.0, 1.0), np.ones(2)])
            parts.append(_frame([*before, _pushed(here), _pushed(there), *after], edge))
        else:
            parts.append(_curved_part(curve, here, there, slack))
    return parts


def _framed(curve: Reals) -> bool:
    """Tell whether a curve runs along a side or entirely beyond one."""
    points = curve[:, :2]
    return bool(((points <= 0.0).all(axis=0) | (points >= 1.0).all(axis=0)).any())


def _pushed(point: tuple[float, float]) -> tuple[float, ...]:
    """Return a point of a side moved outward; a corner is moved away from both sides."""
    return tuple(
        -_BEYOND if each <= 0.0 else 1.0 + _BEYOND if each >= 1.0 else each for each in point
    )


def _frame(points: list[tuple[float, float]], edge: Reals) -> Part:
    """Return the part of a polyline outside the rectangle, which needs no control points."""
    rows = [(a, b, FRAME, 0.0, 1.0, 1) for a, b in pairwise(points) if a != b]
    outline = [np.array([(*a, 1.0), (*b, 1.0)]) for a, b, *_ in rows]
    return Part(rows, np.zeros(0), outline, edge)


def _curved_part(
    curve: Reals, here: tuple[float, float], there: tuple[float, float], slack: float
) -> Part:
    """Cut a curve into segments with narrow bands, as far as `_MOST_PARTS` segments allow."""
    degree = len(curve) - 1
    net = np.column_stack([curve[:, :2] * curve[:, 2:], curve[:, 2]])
    count = 1
    while True:
        points = _cutting(degree, count) @ net
        points = points[..., :2] / points[..., 2:]
        ends = np.vstack([here, points[1:, 0], there])
        bands = _bands(points, ends) + slack
        if degree == 1 or count == _MOST_PARTS or bands.max() <= _FLAT:
            break
        count *= 2
    rows = [
        (tuple(ends[i]), tuple(ends[i + 1]), float(bands[i]), i / count, (i + 1) / count, degree)
        for i in range(count)
    ]
    return Part(rows, net, [net], net)


def hull(curve: TrimCurve) -> Reals:
    """Return points (n, 2) whose bounding box holds a curve closely."""
    degree = len(curve.control) - 1
    if degree == 1:
        return curve.control
    weights = np.ones(degree + 1) if curve.weights is None else curve.weights
    net = np.column_stack([curve.control * weights[:, None], weights])
    points = _cutting(degree, 16) @ net
    return (points[..., :2] / points[..., 2:]).reshape(-1, 2)


def stretch(control: Reals, begin: float, end: float) -> Reals:
    """Return control points (n, 2) of a stretch of a curve with points (n, 3): x w, y w and w."""
    degree = len(control) - 1
    points = np.array([_blossom(degree, begin, end, j) for j in range(degree + 1)]) @ control
    return points[:, :2] / points[:, 2:]


def _bands(points: Reals, ends: Reals) -> Reals:
    """Return (k,) how far the control points (k, n, 2) of segments are from their chords at most.

    All points within a distance of a chord form a convex set, so it holds the curve if it holds
    the control points.
    """
    a, d = ends[:-1, None], (ends[1:] - ends[:-1])[:, None]
    square = (d * d).sum(axis=-1)
    share = ((points - a) * d).sum(axis=-1) / np.where(square > 0.0, square, 1.0)
    foot = a + np.clip(share, 0.0, 1.0)[..., None] * d
    return np.sqrt(((points - foot) ** 2).sum(axis=-1)).max(axis=-1)


@cache
def _cutting(degree: int, count: int) -> Reals:
    """Return the matrices (count, n, n) from a curve's control points to those of equal parts."""
    made = np.empty((count, degree + 1, degree + 1))
    for part in range(count):
        for j in range(degree + 1):
            made[part, j] = _blossom(degree, part / count, (part + 1) / count, j)
    made.setflags(write=False)
    return made


def _blossom(degree: int, begin: float, end: float, ends: int) -> Reals:
    """Return (n,) the control points' weights in the blossom of `ends` times end, else begin."""
    rows = np.eye(degree + 1)
    for step in range(degree):
        t = end if step < ends else begin
        rows = (1.0 - t) * rows[:-1] + t * rows[1:]
    return rows[0]


def joined(trims: Sequence[Trim | None]) -> Trims:
    """Return the trims of a model's patches as the kernels see them; None: the patch is whole."""
    records = np.zeros(len(trims), TRIM)
    rows: list[NDArray[np.int32]] = [np.zeros(1, np.int32)]
    entries, segments, nets = [], [], []
    count = room = lists = listed = 0
    for i, trim in enumerate(trims):
        if trim is None or trim.whole:
            continue
        own = trim.segments.copy()
        own["net"] += room
        starts, ranked = _in_rows(own, float(trim.record["slack"]))
        records[i] = trim.record
        records[i]["first"], records[i]["end"] = count, count + len(own)
        records[i]["rows"], records[i]["first_row"] = len(starts) - 1, lists
        rows.append((starts[1:] + listed).astype(np.int32))
        entries.append((ranked + count).astype(np.int32))
        segments.append(own)
        nets.append(trim.nets)
        count, room = count + len(own), room + trim.nets.size
        lists, listed = lists + len(starts) - 1, listed + len(ranked)
    table = Trims(
        records,
        np.concatenate(rows),
        np.concatenate(entries) if entries else np.zeros(1, np.int32),
        np.concatenate(segments) if segments else np.zeros(1, SEGMENT),
        np.concatenate(nets) if nets else np.zeros(1),
    )
    for array in table:
        array.setflags(write=False)
    return table


def _in_rows(
    segments: NDArray[np.void], slack: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where the list of each row begins (rows + 1,), and the lists of segment indices."""
    reach = np.maximum(segments["band"], 0.0) + 2.0 * slack
    low = np.minimum(segments["a"][:, 1], segments["b"][:, 1]) - reach
    high = np.maximum(segments["a"][:, 1], segments["b"][:, 1]) + reach
    rows = min(len(segments), _MOST_ROWS)
    inside = np.flatnonzero((high >= 0.0) & (low <= 1.0))
    first = np.clip(np.floor(low[inside] * rows), 0, rows - 1).astype(np.int64)
    last = np.clip(np.floor(high[inside] * rows), 0, rows - 1).astype(np.int64)
    counts = last - first + 1
    index = np.repeat(inside, counts)
    offsets = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    row = np.repeat(first, counts) + offsets
    order = np.argsort(row, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=rows))])
    return starts, index[order]
