"""Find out whether patches close up: every edge must be passed as often one way as the other.

The edges of a patch are rational Bezier curves. Two edges may be the same curve with different
parameters, s = l t / (1 - t + l t). Weights w_i l^i in place of w_i make this change. The factor l
follows from the derivatives at the start of both edges. Then the difference of the edges is a
rational Bezier curve too, and no longer than the longest of its control points. If an edge meets
others between its ends, as beside smaller patches or other knots, it is cut there.

An edge that a trimming loop makes on a curved patch is no rational Bezier curve. Then points of one
edge are compared with the nearest points of the other edge. Between two such points each edge is no
farther from its chord than its second derivative allows. The chords are farthest apart at an end.
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
"""How far apart coincident edges may be, as a share of the largest coordinate."""

_TRIMMED_SHARE = 1e-6
"""The same for trimmed patches, whose curves only approximate the intersection of surfaces."""

_BEND_SHARE, _MOST_CHORDS = 1e-8, 4096
"""How far an edge on a curved patch should be from its chords, as a share of the largest coordinate
(or a tenth of the allowed gap, if that is more), and the most chords that are used."""

GAP_ROUNDING = 512.0 * DOUBLE_EPS
"""Rounding allowance that is added to the measured gaps, as a share of the largest coordinate P.

The difference of two edges of degree 15 has coefficients that are sums of at most 16 products of
three numbers. Each term is at most 2 P times the product of the weights: 40 u P in all. The weights
of one edge were multiplied by powers up to the 15th. This errs by 17 u of each weight and moves the
edge's points by 34 u P. Cutting an edge in two errs by 2 u P for each degree. A point of a patch
errs by some 100 u P.
"""

_SAMPLES = np.linspace(0.0, 1.0, 65)
_NEWTON, _STEP = 20, 1e-6


class Joints(NamedTuple):
    """Whether patches close up, and with which gap."""

    reason: str
    """Why they do not close up; empty if they do."""
    gap: float
    """Metres: surfaces within this distance of the patches can fill every opening between them.

    A strip between two coincident edges is no wider than the distance of the edges. The other
    openings are closed paths along the ends of strips and along edges that count as points. Each of
    these paths stays near one corner. What trimming loops leave of a patch may differ from what
    they bound, within the blur of the loops.
    """


def find_joints(nets: Sequence[Net], deviation: float) -> Joints:
    """Find out whether patches close up, and with which gap. Curves among the nets are ignored.

    Edges coincide if they are no farther apart than the deviation (metres) plus 1e-12 of the
    largest coordinate; if any patch is trimmed, than twice the deviation plus 1e-6 of it.
    """
    reason, gap = _opening(nets, deviation)
    return Joints(reason, gap)


def _opening(nets: Sequence[Net], deviation: float) -> tuple[str, float]:
    """Return why patches do not close up (empty if they do), and the remaining gap, metres."""
    if all(net.is_curve for net in nets):
        return "it consists only of curves", 0.0
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
        return f"its patches have opposite orientations at {len(edges)} edges, {where}", 0.0
    wide = _opening_at(edges)
    where += f", {wide:.3g} m from the nearest other edge" if wide < np.inf else ""
    return f"its patches do not close up: {len(edges)} open edges, {where}", 0.0


def _opening_at(edges: Sequence[Edge]) -> float:
    """Estimate how far the middle of the first edge is from the nearest other edge, metres."""
    middle = edges[0].curve.at(np.array([0.5]))
    found = [np.linalg.norm(each.curve.at(_SAMPLES) - middle, axis=1).min() for each in edges[1:]]
    return float(min(found, default=np.inf))


class _Widths:
    """The widths of the gaps that count as closed, metres."""

    def __init__(self, chord_deviation: float) -> None:
        self.chord_deviation = chord_deviation  # of edges on curved patches, at most
        self.strip = 0.0  # between coincident edges
        self.corner = 0.0  # between ends of one group
        self.point = 0.0  # extent of edges that count as points
        self.blur = 0.0  # between edges and what they bound

    def total(self) -> float:
        """Return a bound of the width of every strip and of every opening at a corner, metres."""
        return self.strip + self.corner + self.point + 2.0 * self.blur


def _proper(edges: list[Edge], gap: float, widths: _Widths) -> list[Edge]:
    """Return the edges that extend farther than the gap; the others count as points."""
    found = []
    for edge in edges:
        extent = float(np.linalg.norm(edge.points - edge.points[0], axis=1).max())
        if extent > gap:
            found.append(edge)
        else:
            widths.point = max(widths.point, extent)
    return found


def _unmatched(edges: list[Edge], gap: float, widths: _Widths) -> list[Edge]:
    """Return the edges that coincide with no edge the opposite way; each can match only one."""
    points = np.array([edge.points[[0, -1]] for edge in edges]).reshape(-1, 3)
    ends = _welded(points, gap)
    # The ends of a group lie in a ball around one of them, so no two are farther than its diameter.
    aside = np.linalg.norm(points - points[ends], axis=1).max(initial=0.0)
    widths.corner = max(widths.corner, 2.0 * float(aside))
    left: dict[tuple[int, int], list[int]] = defaultdict(list)
    for i, (begin, end) in enumerate(ends.reshape(-1, 2).tolist()):
        others = left[end, begin]
        for j in others:
            apart, bends = _distance_parts(
                edges[i].turned().curve, edges[j].curve, widths.chord_deviation
            )
            if apart <= gap:
                widths.strip = max(widths.strip, apart + bends)
                others.remove(j)
                break
        else:
            left[begin, end].append(i)
    return [edges[i] for i in sorted(i for each in left.values() for i in each)]


def _welded(points: NDArray[np.float64], gap: float) -> NDArray[np.int64]:
    """Return for each point (n, 3) the first point of its group; steps <= gap link points."""
    along = points @ (0.54, 0.65, 0.53)  # shorter than 1, and parallel to no face of a usual part
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
    """Return the first point of the group that i belongs to so far."""
    while (above := int(group[i])) != i:
        group[i] = group[above]
        i = above
    return i


def _distance_parts(a: Curve, b: Curve, chord_deviation: float) -> tuple[float, float]:
    """Return two lengths, metres, whose sum bounds how far either of two edges is from the other.

    The second bounds what the compared points miss, about `chord_deviation`; it is 0 for rational
    curves.
    """
    if isinstance(a, ChartCurve) or isinstance(b, ChartCurve):
        return _distance_parts_at_points(a, b, chord_deviation)
    speeds = []
    for edge in (a, b):
        way = np.linalg.norm(edge.points[1] - edge.points[0])
        speeds.append(way * (len(edge.net) - 1) * edge.net[1, 3] / edge.net[0, 3])
    ends = [(each.net[0, 3] / each.net[-1, 3]) ** (1.0 / (len(each.net) - 1)) for each in (a, b)]
    # A curve that begins with a cusp has no speed. The other choice of l equalises the end weights.
    found = [speeds[0] / speeds[1]] if min(speeds) > 0.0 else []
    return min(_difference(a.net, b.net, each) for each in (*found, ends[1] / ends[0])), 0.0


def _distance_parts_at_points(a: Curve, b: Curve, chord_deviation: float) -> tuple[float, float]:
    """Do as `_distance_parts`, from pairs of points that are in the same order on both edges."""
    if _far(a, b):
        return np.inf, 0.0
    bends = a.bend(), b.bend()
    count = min(max(int(np.sqrt(max(bends) / (8.0 * chord_deviation))) + 1, 16), _MOST_CHORDS)
    t = np.linspace(0.0, 1.0, count + 1)
    coarse = np.linspace(0.0, 1.0, 17)
    along = _near(b, a.at(coarse), coarse, _NEWTON)
    points = a.at(t)
    along = _near(b, points, np.interp(t, coarse, along), 2)
    along[0], along[-1] = 0.0, 1.0
    along = np.maximum.accumulate(along)  # any pairs are valid if their order is the same on both
    apart = float(np.linalg.norm(points - b.at(along), axis=1).max())
    steps = 1.0 / count, float(np.diff(along).max())
    return apart, sum(0.125 * each * step * step for each, step in zip(bends, steps, strict=True))


def _far(a: Curve, b: Curve) -> bool:
    """Tell whether two edges with common ends are too far apart at a's middle to be compared."""
    here, there = a.at(_SAMPLES[::8]), b.at(_SAMPLES[::8])
    length = np.linalg.norm(np.diff(here, axis=0), axis=1).sum()
    apart = np.linalg.norm(here[len(here) // 2] - there, axis=1).min()
    return bool(apart > 0.25 * length)


def _near(curve: Curve, points: NDArray[np.float64], t: NDArray[np.float64], rounds: int):
    """Return parameters (k,) where a curve is nearest to points (k, 3): Newton's method from t."""
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
    """Return an upper bound of the distance of two curves (n, 4) at equal parameters, metres.

    The parameter of b is changed first, with l = `faster`. Let a be X / w and b be Y / x. Their
    difference (X x - Y w) / (w x) has positive weights, so its control points bound its length.
    """
    b = b * faster ** np.arange(len(b))[:, None]
    x, w = product(a[:, :3], b[:, 3:]), product(a[:, 3:], b[:, 3:])
    return float(np.linalg.norm((x - product(b[:, :3], a[:, 3:])) / w, axis=1).max())


def _cut(edges: list[Edge], gap: float) -> list[Edge]:
    """Return the edges, cut where other edges begin or end."""
    corners = np.array([edge.points[[0, -1]] for edge in edges]).reshape(-1, 3)
    made = []
    for edge in edges:
        points = edge.points
        inside = (corners >= points.min(axis=0) - gap) & (corners <= points.max(axis=0) + gap)
        curve, begin = edge.curve, 0.0
        for t in _parameters(curve, corners[inside.all(axis=1)], gap):
            first, curve = curve.split((t - begin) / (1.0 - begin))
            made.append(Edge.of(first, edge.patch))
            begin = t
        made.append(edge if begin == 0.0 else Edge.of(curve, edge.patch))
    return made


def _parameters(curve: Curve, points: NDArray[np.float64], gap: float) -> list[float]:
    """Return where points (k, 3) lie on a curve between its ends: ascending, each place once."""
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
