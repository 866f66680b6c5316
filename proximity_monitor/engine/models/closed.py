"""Whether patches close up: each edge must be passed as often one way as the other.

The edges of a patch are rational Bezier curves. Two may be one curve whose parameter runs
otherwise, s = l t / (1 - t + l t), as the weights w_i l^i in place of w_i make it; l is found from
the derivatives where they begin. Then their difference is a rational Bezier curve as well, and no
longer than the longest of its control points. Where edges meet others in between, as beside smaller
patches or other knots, they are cut.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from .nurbs import Net

_SIZE_SHARE = 1e-12
"""How far apart edges may be that coincide, as a share of the largest coordinate."""

_ROUNDING = 512.0 * DOUBLE_EPS
"""What is added to the gaps that were measured, as a share of the largest coordinate P.

Two edges of degree 15 have a difference whose coefficients are sums of at most 16 products of three
numbers, each term of no more than 2 P times what the weights' products are: 40 u P in all. The
weights of the one were multiplied by powers up to the 15th, which errs by 17 u of each and moves
its points by 34 u P. Cutting an edge in two errs by 2 u P for each degree.
"""

_SAMPLES = np.linspace(0.0, 1.0, 65)
_NEWTON = 20


class Joints(NamedTuple):
    """How patches close up."""

    reason: str
    """Why they do not; empty where they do."""
    gap: float
    """Metres: surfaces no farther from the patches than this fill all that is open between them.

    A strip between two edges that coincide is no wider than these are apart. What is open besides
    are closed ways along the ends of strips and along edges that are taken for points: each stays
    near one corner.
    """


class _Edge(NamedTuple):
    """A directed edge, on whose left its patch lies, seen from where the normal points to."""

    curve: NDArray[np.float64]
    """(n, 4) control points in homogeneous coordinates."""
    patch: int

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3) the control points in space."""
        return self.curve[:, :3] / self.curve[:, 3:]

    def turned(self) -> _Edge:
        """The other way."""
        return self._replace(curve=self.curve[::-1])


def find_joints(nets: Sequence[Net], deviation: float) -> Joints:
    """How patches close up, and why not. Curves beside them are passed over.

    Edges coincide if they are as near to each other as the deviation, metres, and 1e-12 of the
    largest coordinate allow.
    """
    reason, gap = _opening(nets, deviation)
    return Joints(reason, gap)


def _opening(nets: Sequence[Net], deviation: float) -> tuple[str, float]:
    """Why they do not close up, and the gap that is left where they do."""
    if all(net.is_curve for net in nets):
        return "it consists of curves alone", 0.0
    trimmed = [i for i, net in enumerate(nets) if net.trim is not None]
    if trimmed:
        text = "the inside of trimmed patches is not known yet"
        return f"patch {trimmed[0]} is trimmed, and {text}", 0.0
    size = max(float(np.abs(net.points).max()) for net in nets)
    gap = deviation + _SIZE_SHARE * size
    widths = _Widths()
    edges = [edge for i, net in enumerate(nets) for edge in _outline(net, i)]
    edges = _unmatched(_proper(edges, gap, widths), gap, widths)
    edges = _unmatched(_proper(_cut(edges, gap), gap, widths), gap, widths)
    if not edges:
        return "", widths.total() + _ROUNDING * size
    first = edges[0]
    ends = f"{first.points[0].tolist()} and {first.points[-1].tolist()}"
    where = f"the first of patch {first.patch} between {ends}"
    turned = edges[:1] + [edge.turned() for edge in edges[1:]]
    if len(_unmatched(turned, gap, widths)) < len(turned):
        return f"its patches are of unlike orientation at {len(edges)} edges, {where}", 0.0
    return f"its patches do not close up: {len(edges)} open edges, {where}", 0.0


class _Widths:
    """How wide the gaps are that were taken for none, metres."""

    def __init__(self) -> None:
        self.strip = 0.0  # between edges that coincide
        self.corner = 0.0  # between ends that are together
        self.point = 0.0  # of edges that are taken for points

    def total(self) -> float:
        """No strip is wider, nor is what is open at any corner."""
        return self.strip + self.corner + self.point


def _outline(net: Net, patch: int) -> list[_Edge]:
    """The edges of a patch's pieces that are not also those of the piece beside."""
    if net.is_curve:
        return []
    made = net.pieces()
    edges = []
    for turned in (False, True):
        # The second time as if u were v, which turns all directions.
        each = made.transpose(1, 0, 3, 2, 4) if turned else made
        low, high = each[:, :, :, 0], each[:, :, :, -1]
        torn = (low[:, 1:] != high[:, :-1]).any(axis=(2, 3))
        always = np.ones((len(each), 1), np.bool_)
        begins = low[np.concatenate((always, torn), axis=1)]
        ends = high[np.concatenate((torn, always), axis=1)]
        edges += [_Edge(curve[:: -1 if turned else 1], patch) for curve in begins]
        edges += [_Edge(curve[:: 1 if turned else -1], patch) for curve in ends]
    return edges


def _proper(edges: list[_Edge], gap: float, widths: _Widths) -> list[_Edge]:
    """Those that are more than a point."""
    found = []
    for edge in edges:
        extent = float(np.linalg.norm(edge.points - edge.points[0], axis=1).max())
        if extent > gap:
            found.append(edge)
        else:
            widths.point = max(widths.point, extent)
    return found


def _unmatched(edges: list[_Edge], gap: float, widths: _Widths) -> list[_Edge]:
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
            if j != i and (apart := _apart(edges[i].turned(), edges[j])) <= gap:
                widths.strip = max(widths.strip, apart)
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


def _apart(a: _Edge, b: _Edge) -> float:
    """An upper bound of how far each of two edges is from the other."""
    ways = [edge.points[1] - edge.points[0] for edge in (a, b)]
    speeds = [
        np.linalg.norm(way) * (len(edge.curve) - 1) * edge.curve[1, 3] / edge.curve[0, 3]
        for way, edge in zip(ways, (a, b), strict=True)
    ]
    ends = [
        (edge.curve[0, 3] / edge.curve[-1, 3]) ** (1.0 / (len(edge.curve) - 1)) for edge in (a, b)
    ]
    # Where curves begin with a cusp, the other choice is that both end with the same weight.
    found = [speeds[0] / speeds[1]] if min(speeds) > 0.0 else []
    return min(_difference(a.curve, b.curve, each) for each in (*found, ends[1] / ends[0]))


def _difference(a: NDArray[np.float64], b: NDArray[np.float64], faster: float) -> float:
    """An upper bound of the distance of two curves (n, 4) at any parameter, b's running faster.

    Let them be X / w and Y / x. Their difference (X x - Y w) / w x has positive weights, so it is
    no longer than its control points.
    """
    b = b * faster ** np.arange(len(b))[:, None]
    x, w = _product(a[:, :3], b[:, 3:]), _product(a[:, 3:], b[:, 3:])
    return float(np.linalg.norm((x - _product(b[:, :3], a[:, 3:])) / w, axis=1).max())


def _product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The Bernstein coefficients (n + m - 1, c) of the product of polynomials (n, c) and (m, 1)."""
    scaled = [
        each * np.array([[float(math.comb(len(each) - 1, i))] for i in range(len(each))])
        for each in (a, b)
    ]
    size = len(a) + len(b) - 2
    columns = [np.convolve(column, scaled[1][:, 0]) for column in scaled[0].T]
    return np.stack(columns, axis=1) / [[float(math.comb(size, k))] for k in range(size + 1)]


def _cut(edges: list[_Edge], gap: float) -> list[_Edge]:
    """The edges, cut where others begin or end."""
    corners = np.array([edge.points[[0, -1]] for edge in edges]).reshape(-1, 3)
    made = []
    for edge in edges:
        inside = (corners >= edge.points.min(axis=0) - gap) & (
            corners <= edge.points.max(axis=0) + gap
        )
        curve, begin = edge.curve, 0.0
        for t in _parameters(curve, corners[inside.all(axis=1)], gap):
            first, curve = _halves(curve, (t - begin) / (1.0 - begin))
            made.append(_Edge(first, edge.patch))
            begin = t
        made.append(_Edge(curve, edge.patch))
    return made


def _parameters(curve: NDArray[np.float64], points: NDArray[np.float64], gap: float) -> list[float]:
    """Where points (k, 3) lie on a curve between its ends, in ascending order, each once."""
    found: list[float] = []
    samples = _at(curve, _SAMPLES)
    for point in points:
        t = float(_SAMPLES[np.linalg.norm(samples - point, axis=1).argmin()])
        for _ in range(_NEWTON):
            step = 1e-6
            low, here, high = _at(curve, np.array([t - step, t, t + step]))
            slope = (high - low) / (2.0 * step)
            if not (steep := float(slope @ slope)) > 0.0:
                break
            t = min(max(t + float(slope @ (point - here)) / steep, 0.0), 1.0)
        here = _at(curve, np.array([0.0, t, 1.0, *found]))
        apart = np.linalg.norm(here - here[1], axis=1)
        if np.linalg.norm(here[1] - point) <= gap and np.delete(apart, 1).min() > gap:
            found.append(t)
    return sorted(found)


def _at(curve: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points (k, 3) of homogeneous control points at parameters (k,)."""
    level = np.broadcast_to(curve[:, None], (len(curve), len(t), 4))
    while len(level) > 1:
        level = (1.0 - t[:, None]) * level[:-1] + t[:, None] * level[1:]
    return level[0, :, :3] / level[0, :, 3:]


def _halves(
    curve: NDArray[np.float64], t: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The curves before and behind a parameter (de Casteljau)."""
    first, last = [curve[0]], [curve[-1]]
    while len(curve) > 1:
        curve = (1.0 - t) * curve[:-1] + t * curve[1:]
        first.append(curve[0])
        last.append(curve[-1])
    return np.array(first), np.array(last[::-1])
