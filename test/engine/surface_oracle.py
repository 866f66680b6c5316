"""Minimum distances of NURBS models: samples, Newton's method from many of them, then 30 digits.

The oracle shares no code with the engine. It evaluates B-splines by the triangular scheme of Piegl
and Tiller (The NURBS Book, 1997, A2.2) on the knots of each span, makes no Bezier pieces, and finds
near samples by a k-d tree. A triangle is a patch of degree 1 with a collapsed edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import mpmath
import numpy as np
from scipy.spatial import cKDTree

DIGITS = 30
_STARTS = 96
"""Most pairs of samples from which Newton's method starts: the nearest pairs, one per block."""


def _derivative_rows(values, window, degree, order):
    """Return derivatives, given the B-splines (k, degree - order + 1) of `order` degrees less."""
    for raised in range(degree - order + 1, degree + 1):
        made = np.zeros((len(values), raised + 1), values.dtype)
        for i in range(raised + 1):
            left, right = degree - raised + i, degree + i
            if i > 0:
                share = window[:, right - 1] - window[:, left - 1]
                made[:, i] = made[:, i] + raised * values[:, i - 1] / share
            if i < raised:
                share = window[:, right] - window[:, left]
                made[:, i] = made[:, i] - raised * values[:, i] / share
        values = made
    return values


def basis(window, degree, t):
    """Return the nonzero B-splines of a span and two derivatives of them, (k, 3, degree + 1).

    `window` (k, 2 degree) holds the knots around each span, which lies between the middle two.
    """
    values = np.ones((len(t), 1), t.dtype)
    rows = [values]
    for raised in range(1, degree + 1):
        made = np.zeros((len(t), raised + 1), t.dtype)
        for i in range(raised):
            right, left = window[:, degree + i], window[:, degree - raised + i]
            share = values[:, i] / (right - left)
            made[:, i] = made[:, i] + (right - t) * share
            made[:, i + 1] = made[:, i + 1] + (t - left) * share
        values = made
        rows.append(values)
    found = np.zeros((len(t), 3, degree + 1), t.dtype)
    for order in range(min(degree, 2) + 1):
        found[:, order] = _derivative_rows(rows[degree - order], window, degree, order)
    return found


@dataclass
class Spans:
    """Polynomial spans (s,) of the same degrees."""

    degrees: tuple[int, int]
    low: np.ndarray  # (s, 2)
    high: np.ndarray
    windows: tuple[np.ndarray, np.ndarray]  # (s, 2 p) and (s, 2 q)
    control: np.ndarray  # (s, p + 1, q + 1, 3), model frame
    weights: np.ndarray  # (s, p + 1, q + 1)
    labels: np.ndarray  # (s,) number of the patch or curve

    def points(self, which, at, digits=False):
        """Return the points (k, 3), model frame, of spans at parameters (k, 2)."""
        return self.jets(which, at, digits)[:, 0]

    def jets(self, which, at, digits=False):
        """Return points and derivatives by u, v, uu, uv and vv (k, 6, 3) of spans at parameters."""
        kind = np.vectorize(mpmath.mpf, otypes=[object]) if digits else np.asarray
        p, q = self.degrees
        in_u, in_v = (
            basis(kind(window[which]), degree, at[:, axis])
            for axis, (window, degree) in enumerate(zip(self.windows, (p, q), strict=True))
        )
        weights = kind(self.weights[which])
        rows = np.concatenate(
            (kind(self.control[which]) * weights[..., None], weights[..., None]), axis=-1
        )
        h = np.empty((len(at), 6, 4), rows.dtype)
        for k, (i, j) in enumerate(((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))):
            along_v = (rows * in_v[:, None, j, :, None]).sum(axis=2)
            h[:, k] = (along_v * in_u[:, i, :, None]).sum(axis=1)
        w = h[:, :, 3:]
        jet = np.empty((len(at), 6, 3), rows.dtype)
        jet[:, 0] = h[:, 0, :3] / w[:, 0]
        for k in (1, 2):
            jet[:, k] = (h[:, k, :3] - w[:, k] * jet[:, 0]) / w[:, 0]
        for k, (i, j) in ((3, (1, 1)), (4, (1, 2)), (5, (2, 2))):
            mixed = w[:, i] * jet[:, j] + w[:, j] * jet[:, i] + w[:, k] * jet[:, 0]
            jet[:, k] = (h[:, k, :3] - mixed) / w[:, 0]
        return jet


def _spans_of(knots, degree):
    """Return the spans (s,) that are not empty: first control point, ends, surrounding knots."""
    if degree == 0:
        return np.zeros(1, int), np.zeros(1), np.zeros(1), np.zeros((1, 0))
    i = np.arange(degree, len(knots) - degree - 1)
    i = i[knots[i] < knots[i + 1]]
    windows = knots[i[:, None] + np.arange(1 - degree, degree + 1)]
    return i - degree, knots[i], knots[i + 1], windows


class Shape:
    """A model as the oracle sees it: spans grouped by degrees, and samples of all spans.

    Args:
        model: a model of patches and curves; control points, weights and knots are taken as given.
        triangles: triangles (m, 3, 3), metres, in place of a model.
        samples: number in each direction of a patch's span; a curve's span has its square.
    """

    def __init__(self, model=None, triangles=None, samples=8):
        groups = {}
        if triangles is not None:
            triangles = np.asarray(triangles, float)
            control = triangles[:, [[0, 0], [1, 2]]]
            ones, count = np.ones((len(triangles), 2)), len(triangles)
            window = np.tile([0.0, 1.0], (count, 1))
            weights = np.ones((count, 2, 2))
            groups[1, 1] = [[0 * ones, ones, window, window, control, weights, np.arange(count)]]
        for label, net in enumerate(() if model is None else model.nets):
            p, q = net.degrees
            u, v = _spans_of(net.knots_u, p), _spans_of(net.knots_v, q)
            i, j = (
                x.ravel() for x in np.meshgrid(range(len(u[0])), range(len(v[0])), indexing="ij")
            )
            rows = u[0][i][:, None, None] + np.arange(p + 1)[:, None]
            columns = v[0][j][:, None, None] + np.arange(q + 1)
            weights = np.ones(net.control.shape[:2]) if net.weights is None else net.weights
            low, high = (np.stack((u[k][i], v[k][j]), axis=1) for k in (1, 2))
            part = [low, high, u[3][i], v[3][j], net.control[rows, columns], weights[rows, columns]]
            groups.setdefault((p, q), []).append([*part, np.full(len(i), label)])
        self.groups = []
        for degrees, parts in groups.items():
            joined = [np.concatenate(each) for each in zip(*parts, strict=True)]
            low, high, window_u, window_v, *rest = joined
            self.groups.append(Spans(degrees, low, high, (window_u, window_v), *rest))
        self.size = max(np.linalg.norm(g.control, axis=-1).max() for g in self.groups)
        self._sample(samples)

    def _sample(self, count):
        """Set the sample points and the group, span, parameters and block of each sample."""
        points, group, span, at, block = [], [], [], [], []
        used = 0
        for g, spans in enumerate(self.groups):
            each = count if spans.degrees[1] else count * count
            share = [np.linspace(0.0, 1.0, each if degree else 1) for degree in spans.degrees]
            u, v = (x.ravel() for x in np.meshgrid(*share, indexing="ij"))
            which = np.repeat(np.arange(len(spans.low)), len(u))
            share = np.tile(np.stack((u, v), axis=1), (len(spans.low), 1))
            where = spans.low[which] + share * (spans.high[which] - spans.low[which])
            where = np.clip(where, spans.low[which], spans.high[which])
            points.append(spans.points(which, where))
            group.append(np.full(len(which), g))
            span.append(which)
            at.append(where)
            place = np.minimum((3 * share).astype(int), 2)
            block.append(used + 9 * which + 3 * place[:, 0] + place[:, 1])
            used += 9 * len(spans.low)
        names = ("points", "group", "span", "at", "block")
        for name, parts in zip(names, (points, group, span, at, block), strict=True):
            setattr(self, name, np.concatenate(parts))

    def jets(self, group, span, at, digits=False):
        """Return `Spans.jets` of each row, from the row's own group."""
        found = np.empty((len(at), 6, 3), object if digits else float)
        for g in np.unique(group):
            here = group == g
            found[here] = self.groups[g].jets(span[here], at[here], digits)
        return found

    def box(self, group, span):
        """Return the least and the largest parameters (k, 2) of spans."""
        low = np.array([self.groups[g].low[s] for g, s in zip(group, span, strict=True)])
        return low, np.array([self.groups[g].high[s] for g, s in zip(group, span, strict=True)])

    def misses(self, feature, pose, point):
        """Return how far a point of the world is from the point of a feature, in rounding units.

        The feature's parameters are rounded too, so the unit grows with the steepness of the
        surface. At a knot where a patch tears, its parameters name two points.
        """
        at = np.append(feature.parameters, 0.0)[:2]
        if feature.kind not in ("patch", "curve"):
            triangle = self.groups[0].control[feature.index][[0, 1, 1], [0, 0, 1]]
            own, steep = feature.parameters @ triangle, 0.0
            misses = np.linalg.norm(_moved(pose, own) - point)
        else:
            misses, steep = np.inf, 0.0
            for spans in self.groups:
                inside = (spans.labels == feature.index) & (at >= spans.low).all(axis=1)
                inside &= (at <= spans.high).all(axis=1)
                for which in np.flatnonzero(inside):
                    assert (feature.kind == "curve") == (spans.degrees[1] == 0)
                    jet = spans.jets(np.array([which]), at[None])[0]
                    ends = np.maximum(abs(spans.low[which]), abs(spans.high[which]))
                    wide = ends + spans.high[which] - spans.low[which]
                    steep = max(steep, float(np.linalg.norm(jet[1:3], axis=1) @ wide))
                    far = np.linalg.norm(_moved(pose, jet[0]) - point)
                    misses = min(misses, far)
        reach = 20.0 * self.size + np.linalg.norm(pose[:3, 3])
        return misses / (1e-15 * (reach + steep) + 1e-300)


def _moved(pose, points):
    return points @ pose[:3, :3].T + pose[:3, 3]


def _starts(a, pose_a, b, pose_b):
    """Return pairs of samples, as indices into both, and the least distance of any two samples."""
    found = {}
    p, q = _moved(pose_a, a.points), _moved(pose_b, b.points)
    for from_a in (True, False):
        own, other, blocks = (p, q, a.block) if from_a else (q, p, b.block)
        distances, nearest = cKDTree(other).query(own)
        best = {}
        for i in np.argsort(distances, kind="stable"):
            best.setdefault(blocks[i], i)
        for i in best.values():
            pair = (i, nearest[i]) if from_a else (nearest[i], i)
            found[pair] = distances[i]
    pairs = sorted(found, key=found.get)[:_STARTS]
    return np.array(pairs), min(found.values())


def _gradient(way, jet_a, jet_b):
    """Return gradient (k, 4) and Hessian (k, 4, 4) of half the squared distance."""
    jacobian = np.concatenate((-jet_a[:, 1:3], jet_b[:, 1:3]), axis=1)
    gradient = (jacobian * way[:, None]).sum(axis=-1)
    hessian = (jacobian[:, :, None] * jacobian[:, None]).sum(axis=-1)
    second_a = -(jet_a[:, 3:] * way[:, None]).sum(axis=-1)
    second_b = (jet_b[:, 3:] * way[:, None]).sum(axis=-1)
    for first, second in ((0, second_a), (2, second_b)):
        for i, j, k in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
            hessian[:, first + i, first + j] += second[:, k]
    return gradient, hessian


def _refined(a, pose_a, b, pose_b, starts, rounds=60):
    """Return local minima within the starts' spans: parameters (k, 4), distances, spans, limits."""
    names = [(a.group[i], a.span[i], b.group[j], b.span[j]) for i, j in starts]
    group_a, span_a, group_b, span_b = np.array(names).T
    x = np.concatenate((a.at[starts[:, 0]], b.at[starts[:, 1]]), axis=1)
    (low_a, high_a), (low_b, high_b) = a.box(group_a, span_a), b.box(group_b, span_b)
    low, high = np.concatenate((low_a, low_b), axis=1), np.concatenate((high_a, high_b), axis=1)
    wide = np.where(high > low, high - low, 1.0)  # the unit of each parameter is its span

    def jets(x, where):
        jet_a = a.jets(group_a[where], span_a[where], x[:, :2]) @ pose_a[:3, :3].T
        jet_b = b.jets(group_b[where], span_b[where], x[:, 2:]) @ pose_b[:3, :3].T
        way = jet_b[:, 0] - jet_a[:, 0] + (pose_b[:3, 3] - pose_a[:3, 3])
        return way, jet_a, jet_b

    way, jet_a, jet_b = jets(x, np.arange(len(x)))
    squared = (way**2).sum(axis=1)
    share, active = np.ones(len(x)), np.ones(len(x), bool)
    for _ in range(rounds):
        (here,) = np.nonzero(active)
        if not len(here):
            break
        gradient, hessian = _gradient(way[here], jet_a[here], jet_b[here])
        gradient *= wide[here]
        hessian *= wide[here][:, :, None] * wide[here][:, None]
        held = (x[here] <= low[here]) & (gradient >= 0.0) | (x[here] >= high[here]) & (
            gradient <= 0.0
        )
        free = ~held
        hessian *= free[:, :, None] & free[:, None]
        gradient *= free
        values, vectors = np.linalg.eigh(hessian)
        floor = 1e-13 * np.abs(values).max(axis=1, keepdims=True) + 1e-300
        along = (vectors * gradient[:, :, None]).sum(axis=1) / np.maximum(np.abs(values), floor)
        step = -(vectors * along[:, None]).sum(axis=2) * free * wide[here]
        trial = np.clip(x[here] + share[here, None] * step, low[here], high[here])
        new_way, new_a, new_b = jets(trial, here)
        new = (new_way**2).sum(axis=1)
        better = new < squared[here]
        kept = here[better]
        x[kept], way[kept], squared[kept] = trial[better], new_way[better], new[better]
        jet_a[kept], jet_b[kept] = new_a[better], new_b[better]
        share[here] = np.where(better, np.minimum(4.0 * share[here], 1.0), 0.25 * share[here])
        active[here] = share[here] > 1e-6
    spans = np.stack((group_a, span_a, group_b, span_b), axis=1)
    return x, np.sqrt(squared), spans, low, high


def _in_digits(a, pose_a, b, pose_b, x, spans, low, high):
    """Return the distance at a local minimum to 30 digits, by Newton's method in that precision."""
    big = np.vectorize(mpmath.mpf, otypes=[object])
    pose_a, pose_b, x = big(pose_a), big(pose_b), big(x)
    group_a, span_a, group_b, span_b = (np.array([each]) for each in spans)

    def at(x):
        jet_a = a.jets(group_a, span_a, x[None, :2], True) @ pose_a[:3, :3].T
        jet_b = b.jets(group_b, span_b, x[None, 2:], True) @ pose_b[:3, :3].T
        way = jet_b[:, 0] - jet_a[:, 0] + (pose_b[:3, 3] - pose_a[:3, 3])
        return way, jet_a, jet_b, (way * way).sum()

    way, jet_a, jet_b, squared = at(x)
    for _ in range(12):
        gradient, hessian = (each[0] for each in _gradient(way, jet_a, jet_b))
        free = [
            i
            for i in range(4)
            if low[i] < x[i] < high[i]
            or (x[i] == low[i] < high[i] and gradient[i] < 0)
            or (x[i] == high[i] > low[i] and gradient[i] > 0)
        ]
        if not free:
            break
        matrix = mpmath.matrix([[hessian[i, j] for j in free] for i in free])
        scale = max(abs(matrix[i, i]) for i in range(len(free)))
        for i in range(len(free)):
            matrix[i, i] += scale * mpmath.mpf(10) ** -24  # if shapes cross, minima are not unique
        try:
            step = mpmath.lu_solve(matrix, mpmath.matrix([-gradient[i] for i in free]))
        except ZeroDivisionError:
            break
        trial = x.copy()
        for k, i in enumerate(free):
            trial[i] = min(max(x[i] + step[k], mpmath.mpf(low[i])), mpmath.mpf(high[i]))
        new = at(trial)
        if not new[3] < squared * (1 - mpmath.mpf(10) ** -26):
            break
        x, (way, jet_a, jet_b, squared) = trial, new
    return mpmath.sqrt(squared)


def reference(a, pose_a, b, pose_b):
    """Return the minimum distance of two shapes (an mpf), and the least of any two samples."""
    pose_a, pose_b = np.asarray(pose_a, float), np.asarray(pose_b, float)
    starts, sampled = _starts(a, pose_a, b, pose_b)
    x, found, *rest = _refined(a, pose_a, b, pose_b, starts)
    with mpmath.workdps(DIGITS):
        best = None
        for k in np.argsort(found, kind="stable")[:8]:
            near = found[k] <= found.min() * (1.0 + 1e-9) + 1e-13 * (a.size + b.size)
            if best is None or (near and best > mpmath.mpf(10) ** -25):
                this = _in_digits(a, pose_a, b, pose_b, x[k], *(each[k] for each in rest))
                best = this if best is None else min(best, this)
    return best, sampled
