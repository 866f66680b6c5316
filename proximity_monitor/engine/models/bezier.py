"""Convert NURBS to rational Bezier pieces, and evaluate their basis functions.

On a span between two knots a B-spline is a polynomial. Its Bezier points are values of its blossom
with the span's ends as arguments (Ramshaw 1987). Inserting both knots up to full multiplicity gives
the same points. Each is a convex combination of the degree + 1 control points that affect the span.
The coefficients depend on the knots alone. Patches are converted in u first, then in v. Control
points with weights are converted in homogeneous coordinates.
"""

from __future__ import annotations

from functools import cache, lru_cache
from math import comb, factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS, KNOT_INSERTION


class Spans(NamedTuple):
    """The s spans of a knot vector that are longer than 0."""

    first: NDArray[np.int64]
    """(s,) the number of the first control point that affects each span."""
    coefficients: NDArray[np.float64]
    """(s, degree + 1, degree + 1); [:, j, i]: the share of control point first + i in Bezier point
    j."""
    low: NDArray[np.float64]
    """(s,) the parameter at the start of each span; ascending."""
    high: NDArray[np.float64]
    """(s,) the parameter at the end of each span."""
    exact: bool
    """Whether the Bezier points are the control points themselves."""

    @property
    def degree(self) -> int:
        """The degree of the polynomials."""
        return self.coefficients.shape[1] - 1


NO_DIRECTION = Spans(
    np.zeros(1, np.int64), np.ones((1, 1, 1)), np.zeros(1), np.zeros(1), True
)  # fmt: skip
"""The single span, of degree 0, that a curve has in v."""


def spans(knots: NDArray[np.float64], degree: int, parts: int = 1) -> Spans:
    """Return the spans of a checked knot vector within its domain, each cut into equal parts.

    The domain is [knots[degree], knots[-degree - 1]].
    """
    return _spans(knots.tobytes(), degree, parts)


@lru_cache(maxsize=4096)
def _spans(data: bytes, degree: int, parts: int) -> Spans:
    t = np.frombuffer(data)
    k = np.arange(degree, len(t) - degree - 1)
    k = k[t[k] < t[k + 1]]
    low, high = t[k], t[k + 1]
    if parts > 1:
        inside = low[:, None] + (high - low)[:, None] * (np.arange(1, parts) / parts)
        edges = np.concatenate((low[:, None], inside, high[:, None]), axis=1)
        low, high, k = edges[:, :-1].ravel(), edges[:, 1:].ravel(), np.repeat(k, parts)
    inner = np.arange(degree + 1)
    # c[s, j, i]: the i-th point of the present level in the scheme for Bezier point j, as shares of
    # the control points. At level 0 the points are the control points themselves.
    c = np.broadcast_to(np.eye(degree + 1), (len(k), degree + 1, degree + 1, degree + 1)).copy()
    for level in range(1, degree + 1):
        # A blossom's arguments may have any order: for Bezier point j, first j times the span end.
        at_end = inner >= level
        x = np.where(at_end, high[:, None], low[:, None])[:, :, None]
        i = (k[:, None] - degree + np.arange(level, degree + 1))[:, None, :]
        left, right = t[i], t[i + degree + 1 - level]
        # Both shares are quotients, so both are exact if x is an end; 1 - above would not be.
        above, below = (x - left) / (right - left), (right - x) / (right - left)
        c = below[..., None] * c[:, :, :-1] + above[..., None] * c[:, :, 1:]
    c = c[:, :, 0]
    made = Spans(k - degree, c, low, high, bool((c == np.eye(degree + 1)).all()))
    for array in made[:4]:
        array.setflags(write=False)
    return made


def cut(net: NDArray[np.float64], along_u: Spans, along_v: Spans) -> NDArray[np.float64]:
    """Return the control points of all Bezier pieces of a net (n_u, n_v, c).

    Joined pieces have bitwise equal points along their joint, because both add the same terms in
    the same order. KNOT_INSERTION bounds the rounding.

    Returns:
        (s_u, s_v, degree_u + 1, degree_v + 1, c).
    """
    rows = _combined(net, along_u)  # (s_u, p_u, n_v, c)
    rows = np.moveaxis(rows, 2, 0)  # (n_v, s_u, p_u, c)
    both = _combined(rows, along_v)  # (s_v, p_v, s_u, p_u, c)
    return both.transpose(2, 0, 3, 1, 4)


def _combined(points: NDArray[np.float64], along: Spans) -> NDArray[np.float64]:
    """Return the Bezier points (s, degree + 1, ...) of control points (n, ...)."""
    if along.exact:
        index = along.first[:, None] + np.arange(along.degree + 1)
        return points[index]
    shape = (*along.coefficients.shape[:2], *(1,) * (points.ndim - 1))
    total = along.coefficients[:, :, 0].reshape(shape) * points[along.first][:, None]
    term = np.empty_like(total)  # one for all terms: new ones of this size would take longer
    for i in range(1, along.degree + 1):
        share = along.coefficients[:, :, i].reshape(shape)
        np.multiply(share, points[along.first + i][:, None], out=term)
        total += term
    total += 0.0  # makes every zero +0, which side of a joint it is on
    return total


def conversion_error(along_u: Spans, along_v: Spans, rational: bool, largest: float) -> float:
    """Return how far, in metres, rounding may move a point of a surface cut into pieces.

    `largest` is the largest norm of a control point, metres; see KNOT_INSERTION.
    """
    share = KNOT_INSERTION * sum(each.degree for each in (along_u, along_v) if not each.exact)
    if rational:
        share = 2.0 * share + 2.0 * DOUBLE_EPS
    return share * largest


def basis(along: Spans, parameters: NDArray[np.float64], order: int) -> tuple[NDArray, NDArray]:
    """Return the basis functions that are not 0 at parameters (k,) in the domain, and derivatives.

    At the joint of two spans they are those of the second span.

    Returns:
        (k,) the number of the first control point that has an effect, and the derivatives from the
        0th to the `order`-th, (k, order + 1, degree + 1).
    """
    span = np.searchsorted(along.low, parameters, side="right") - 1
    span = np.clip(span, 0, len(along.low) - 1)
    low, high = along.low[span], along.high[span]
    length = np.where(high > low, high - low, 1.0)
    s, r = (parameters - low) / length, (high - parameters) / length
    degree = along.degree
    made = np.zeros((len(parameters), order + 1, degree + 1))
    differences = np.eye(degree + 1)
    for d in range(min(order, degree) + 1):
        values = bernstein(degree - d, s, r) @ differences
        scale = factorial(degree) / factorial(degree - d) / length**d
        made[:, d] = np.einsum("kj,kji->ki", values, along.coefficients[span]) * scale[:, None]
        differences = np.diff(differences, axis=0)
    return along.first[span], made


def bernstein(degree: int, s: NDArray[np.float64], r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Bernstein polynomials (k, degree + 1) at parameters s (k,), with r = 1 - s."""
    j = np.arange(degree + 1)
    return _binomials(degree) * s[:, None] ** j * r[:, None] ** (degree - j)


@cache
def _binomials(degree: int) -> NDArray[np.float64]:
    """Return the binomial coefficients (degree + 1,), cached because many short calls need them."""
    made = np.array([comb(degree, i) for i in range(degree + 1)], np.float64)
    made.setflags(write=False)
    return made


def product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Bernstein coefficients (n + m - 1, c) of the product of a (n, c) and b (m, 1)."""
    one, other = (each.T * _binomials(len(each) - 1) for each in (a, b))
    made = np.array([np.convolve(column, other[0]) for column in one])
    return (made / _binomials(len(a) + len(b) - 2)).T
