"""Whether patches close up: each edge must be passed as often one way as the other.

The edges of a patch are rational Bezier curves. Two may be one curve whose parameter runs
otherwise, s = l t / (1 - t + l t), as the weights w_i l^i in place of w_i make it; l is found from
the derivatives where they begin. Then their difference is a rational Bezier curve as well, and no
longer than the longest of its control points. Where edges meet others in between, as beside smaller
patches or other knots, they are cut.

An edge that a trimming loop makes on a curved patch is no rational curve. Then points along the one
and those of the other next to them tell: between two such points each is no farther from its chord
than its second derivative allows, and the chords are nowhere farther apart than at their ends.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from .bezier import product
from .nurbs import Net
from .outline import ChartCurve, Edge, RationalCurve, outline

Curve = RationalCurve | ChartCurve

_SIZE_SHARE = 1e-12
"""How far apart edges may be that coincide, as a share of the largest coordinate."""

_TRIMMED_SHARE = 1e-6
"""The same where patches are trimmed: such curves only come near to where surfaces intersect."""

_BEND_SHARE, _MOST_CHORDS = 1e-8, 4096
"""How far an edge on a curved patch may be from chords, as a share of the largest coordinate, or by
a tenth of the gap that is allowed, where so many chords suffice."""

GAP_ROUNDING = 512.0 * DOUBLE_EPS
"""What is added to the gaps that were measured, as a share of the largest coordinate P.

Two edges of degree 15 have a difference whose coefficients are sums of at most 16 products of three
numbers, each term of no more than 2 P times what the weights' products are: 40 u P in all. The
weights of the one were multiplied by powers up to the 15th, which errs by 17 u of each and moves
its points by 34 u P. Cutting an edge in two errs by 2 u P for each degree, a point of a patch by
some 100 u P.
"""

_SAMPLES = np.linspace(0.0, 1.0, 65)
_NEWTON, _STEP = 20, 1e-6


class Joints(NamedTuple):
    """How patches close up."""

    reason: str
    """Why they do not; empty where they do."""
    gap: float
    """Metres: surfaces no farther from the patches than this fill all that is open between them.

    A strip between two edges that coincide is no wider than these are apart. What is open besides
    are closed ways along the ends of strips and along edges that are taken for points: each stays
    near one corner. What trimming loops leave may be unlike what they bound as far as they blur.
    """


def find_joints(nets: Sequence[Net], deviation: float) -> Joints:
    """How patches close up, and why not. Curves beside them are passed over.

    Edges coincide if they are as near to each other as the deviation, metres, and 1e-12 of the
    largest coordinate allow; where patches are trimmed, twice the deviation and 1e-6.
    """
    reason, gap = _opening(nets, deviation)
    return Joints(reason, gap)


def _opening(nets: Sequence[Net], deviation: float) -> tuple[str, float]:
    """Why they do not close up, and the gap that is left where they do."""
    if all(net.is_curve for net in nets):
        return "it consists of curves alone", 0.0
    size = max(float(np.abs(net.points).max()) for net in nets)
    trimmed = any(net.trim is not None for net in nets)
    gap = 2.0 * deviation + _TRIMMED_SHARE * size if trimmed else deviation + _SIZE_SHARE * size
    widths = _Widths(max(0.1 * gap, _BEND_SHARE * size))
    edges: list[Edge] = []
    for i, net in enumerate(nets):
        found = outline(net, i)
        if found.reason:
            return f"patch {i}: {found.reason}", 0.0
        edges += found.edges
        widths.blur = max(widths.blur, found.blur)
    edges = _unmatched(_proper(edges, gap, widths), gap, widths)
    edges = _unmatched(_proper(_cut(edges, gap), gap, widths), gap, widths)
    if not edges:
        return "", widths.total() + GAP_ROUNDING * size
    first = edges[0]
    ends = f"{first.points[0].tolist()} and {first.points[-1].tolist()}"
    where = f"the first of patch {first.patch} between {ends}"
    turned = edges[:1] + [edge.turned() for edge in edges[1:]]
    if len(_unmatched(turned, gap, widths)) < len(turned):
        return f"its patches are of unlike orientation at {len(edges)} edges, {where}", 0.0
    wide = _opening_at(edges)
    where += f", {wide:.3g} m from the nearest other one" if wide < np.inf else ""
    return f"its patches do not close up: {len(edges)} open edges, {where}", 0.0


def _opening_at(edges: Sequence[Edge]) -> float:
    """About how far the middle of the first edge is from the nearest other one, metres."""
    middle = edges[0].curve.at(np.array([0.5]))
    found = [np.linalg.norm(each.curve.at(_SAMPLES) - middle, axis=1).min() for each in edges[1:]]
    return float(min(found, default=np.inf))


class _Widths:
    """How wide the gaps are that were taken for none, metres."""

    def __init__(self, bend: float) -> None:
        self.bend = bend  # that is allowed between the points of edges on curved patches
        self.strip = 0.0  # between edges that coincide
        self.corner = 0.0  # between ends that are together
        self.point = 0.0  # of edges that are taken for points
        self.blur = 0.0  # between edges and what they bound

    def total(self) -> float:
        """No strip is wider, nor is what is open at any corner."""
        return self.strip + self.corner + self.point + 2.0 * self.blur


def _proper(edges: list[Edge], gap: float, widths: _Widths) -> list[Edge]:
    """Those that are more than a point."""
    found = []
    for edge in edges:
        extent = float(np.linalg.norm(edge.points - edge.points[0], axis=1).max())
        if extent > gap:
            found.append(edge)
        else:
            widths.point = max(widths.point, extent)
    return found


def _unmatched(edges: list[Edge], gap: float, widths: _Widths) -> list[Edge]:
    """The edges that lie on no other one that goes the other way; each serves one other."""
    points = np.array([edge.points[[0, -1]] for edge in edges]).reshape(-1, 3)
    ends = _welded(points, gap)
    # Those together with one end are within a ball around it: no two are farther than its diameter.
    aside = np.linalg.norm(points - points[ends], axis=1).max(initial=0.0)
    widths.corner = max(widths.corner, 2.0 * float(aside))
    left: dict[tuple[int, int], list[int]] = defaultdict(list)
    for i, (begin, end) in enumerate(ends.reshape(-1, 2).tolist()):
        others = left[end, begin]
        for j in others:
            if i == j:
                continue
            apart, bends = _apart(edges[i].turned().curve, edges[j].curve, widths.bend)
            if apart <= gap:
                widths.strip = max(widths.strip, apart + bends)
                others.remove(j)
                break
        else:
            left[begin, end].append(i)
    return [edges[i] for i in sorted(i for each in left.values() for i in each)]


def _welded(points: NDArray[np.float64], gap: float) -> NDArray[np.int64]:
    """For each point (n, 3) the number of one of those that are together with it."""
    along = points @ (0.54, 0.65, 0.53)  # no longer than 1, and along no face of a usual part
    order = np.argsort(along)
    group = np.arange(len(points))
    for k in range(1, len(points)):
        before, behind = order[:-k], order[k:]
        near = along[behind] - along[before] <= gap
        if not near.any():
            break
        before, behind = before[near], behind[near]
        together = np.linalg.norm(points[before] - points[behind], axis=1) <= gap
        for i, j in zip(before[together].tolist(), behind[together].tolist(), strict=True):
            a, b = _first(group, i), _first(group, j)
            group[max(a, b)] = min(a, b)
    return np.array([_first(group, i) for i in range(len(points))], np.int64)


def _first(group: NDArray[np.int64], i: int) -> int:
    """The number of those that are together with i so far."""
    while (above := int(group[i])) != i:
        group[i] = group[above]
        i = above
    return i


def _apart(a: Curve, b: Curve, bend: float) -> tuple[float, float]:
    """Two numbers whose sum is no less than how far each of two edges is from the other.

    The second is what they may differ by between the points that are compared, about `bend`.
    """
    if isinstance(a, ChartCurve) or isinstance(b, ChartCurve):
        return _apart_at_points(a, b, bend)
    speeds = []
    for edge in (a, b):
        way = np.linalg.norm(edge.points[1] - edge.points[0])
        speeds.append(way * (len(edge.net) - 1) * edge.net[1, 3] / edge.net[0, 3])
    ends = [(each.net[0, 3] / each.net[-1, 3]) ** (1.0 / (len(each.net) - 1)) for each in (a, b)]
    # Where curves begin with a cusp, the other choice is that both end with the same weight.
    found = [speeds[0] / speeds[1]] if min(speeds) > 0.0 else []
    return min(_difference(a.net, b.net, each) for each in (*found, ends[1] / ends[0])), 0.0


def _apart_at_points(a: Curve, b: Curve, bend: float) -> tuple[float, float]:
    """As `_apart`, from points of both that follow each other in the same order."""
    if _far(a, b):
        return np.inf, 0.0
    bends = a.bend(), b.bend()
    count = min(max(int(np.sqrt(max(bends) / (8.0 * bend))) + 1, 16), _MOST_CHORDS)
    t = np.linspace(0.0, 1.0, count + 1)
    coarse = np.linspace(0.0, 1.0, 17)
    along = _near(b, a.at(coarse), coarse, _NEWTON)
    points = a.at(t)
    along = _near(b, points, np.interp(t, coarse, along), 2)
    along[0], along[-1] = 0.0, 1.0
    along = np.maximum.accumulate(along)  # any order that is the same on both will do
    apart = float(np.linalg.norm(points - b.at(along), axis=1).max())
    steps = 1.0 / count, float(np.diff(along).max())
    return apart, sum(0.125 * each * step * step for each, step in zip(bends, steps, strict=True))


def _far(a: Curve, b: Curve) -> bool:
    """Whether the middles of two edges with common ends are farther apart than is worth a look."""
    here, there = a.at(_SAMPLES[::8]), b.at(_SAMPLES[::8])
    length = np.linalg.norm(np.diff(here, axis=0), axis=1).sum()
    apart = np.linalg.norm(here[len(here) // 2] - there, axis=1).min()
    return bool(apart > 0.25 * length)


def _near(curve: Curve, points: NDArray[np.float64], t: NDArray[np.float64], rounds: int):
    """Parameters (k,) where a curve is nearest to points (k, 3), from some nearby (Newton)."""
    for _ in range(rounds):
        low, here, high = np.split(curve.at(np.concatenate([t - _STEP, t, t + _STEP])), 3)
        slope = (high - low) / (2.0 * _STEP)
        steep = (slope * slope).sum(axis=1)
        step = (slope * (points - here)).sum(axis=1) / np.where(steep > 0.0, steep, np.inf)
        t = np.clip(t + step, 0.0, 1.0)
        if (np.abs(step) <= 1e-12).all():
            break
    return t


def _difference(a: NDArray[np.float64], b: NDArray[np.float64], faster: float) -> float:
    """An upper bound of the distance of two curves (n, 4) at any parameter, b's running faster.

    Let them be X / w and Y / x. Their difference (X x - Y w) / w x has positive weights, so it is
    no longer than its control points.
    """
    b = b * faster ** np.arange(len(b))[:, None]
    x, w = product(a[:, :3], b[:, 3:]), product(a[:, 3:], b[:, 3:])
    return float(np.linalg.norm((x - product(b[:, :3], a[:, 3:])) / w, axis=1).max())


def _cut(edges: list[Edge], gap: float) -> list[Edge]:
    """The edges, cut where others begin or end."""
    corners = np.array([edge.points[[0, -1]] for edge in edges]).reshape(-1, 3)
    made = []
    for edge in edges:
        points = edge.points
        inside = (corners >= points.min(axis=0) - gap) & (corners <= points.max(axis=0) + gap)
        curve, begin = edge.curve, 0.0
        for t in _parameters(curve, corners[inside.all(axis=1)], gap):
            first, curve = curve.halved((t - begin) / (1.0 - begin))
            made.append(Edge.of(first, edge.patch))
            begin = t
        made.append(edge if begin == 0.0 else Edge.of(curve, edge.patch))
    return made


def _parameters(curve: Curve, points: NDArray[np.float64], gap: float) -> list[float]:
    """Where points (k, 3) lie on a curve between its ends, in ascending order, each once."""
    ends = curve.at(np.array([0.0, 1.0]))
    points = points[(np.linalg.norm(points[:, None] - ends, axis=2) > gap).all(axis=1)]
    if not len(points):
        return []
    samples = curve.at(_SAMPLES)
    away = np.linalg.norm(samples[:, None] - points, axis=2)
    t = _near(curve, points, _SAMPLES[away.argmin(axis=0)], _NEWTON)
    here = curve.at(t)
    near = np.linalg.norm(here - points, axis=1) <= gap
    found: list[float] = []
    places = list(ends)
    for place, at in zip(here[near], t[near].tolist(), strict=True):
        if np.linalg.norm(np.array(places) - place, axis=1).min() > gap:
            found.append(at)
            places.append(place)
    return sorted(found)
