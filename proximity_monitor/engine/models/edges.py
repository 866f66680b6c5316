"""Elements of the tree for trimmed patches: the pieces that their loops leave, and their edges."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.trees import NET_WIDTH, PIECE, Trims
from ..kernels.surface.edges import EDGE_POINTS, fit_edges
from ..kernels.surface.trim import INSIDE, OUTSIDE, to_unit
from ..kernels.surface.trim_entries import classify_points, classify_rectangles
from .checks import ModelError
from .trim import stretch

Reals = NDArray[np.float64]

_ROOTS = 1e-9
"""How far from the real axis a root may be to count, and a loop from the unit square."""
_DEEP = 50
"""The most halvings of a stretch that lies on no single piece."""


def with_edges(pieces: NDArray, nets: Reals, trims: Trims) -> tuple[NDArray, Reals, float]:
    """Drop the pieces that loops cut off entirely, and append the edges.

    Args:
        pieces: (m,) PIECE of all patches, one patch after the other.
        nets: (flat) the pieces' control nets.
        trims: the loops.

    Returns:
        The remaining pieces and the edges, their nets, and how far rounding may move an edge,
        metres.

    Raises:
        ModelError: a loop leaves the rectangle of its patch.
    """
    if not trims.trims["rows"].any():
        return pieces, nets, 0.0
    pieces = pieces.copy()
    for patch in np.flatnonzero(trims.trims["rows"]):
        of = np.flatnonzero(pieces["patch"] == patch)
        corners = np.hstack([pieces["low"][of], pieces["high"][of]])
        pieces["side"][of] = _sides(classify_rectangles, trims, patch, corners)
    pieces = pieces[pieces["side"] != OUTSIDE]
    pieces["face"] = np.arange(len(pieces))
    edges = np.zeros(0, PIECE)
    for patch in np.flatnonzero(trims.trims["rows"]):
        of = np.flatnonzero(pieces["patch"] == patch)
        own = _edges_of(trims, patch, pieces, of)
        middles = 0.5 * (pieces["low"][of] + pieces["high"][of])
        cut_off = _sides(classify_points, trims, patch, middles) != INSIDE
        # If a piece's middle is cut off, searches begin on an edge: one on the piece, if any.
        first = len(pieces) + len(edges)
        pieces["face"][of[cut_off]] = first
        on_these = np.isin(own["face"], of[cut_off])
        pieces["face"][own["face"][on_these]] = first + np.flatnonzero(on_these)
        edges = np.concatenate([edges, own])
    room = 4 * NET_WIDTH
    edges["net"] = len(nets) + room * np.arange(len(edges))
    pieces = np.concatenate([pieces, edges])
    nets = np.concatenate([nets, np.zeros(room * len(edges))])
    return pieces, nets, float(fit_edges(pieces, nets, trims))


def _sides(classify, trims: Trims, patch: int, places: Reals) -> NDArray[np.int8]:
    found = np.empty(len(places), np.int8)
    classify(trims, int(patch), np.ascontiguousarray(places), found)
    return found


def _edges_of(trims: Trims, patch: int, pieces: NDArray, of: NDArray[np.int64]) -> NDArray:
    """Return the edges of a patch without their nets; `of` holds the numbers of its pieces."""
    trim = trims.trims.view(np.recarray)[patch]
    low = [_unit(trim, axis, pieces["low"][of, axis]) for axis in range(2)]
    high = [_unit(trim, axis, pieces["high"][of, axis]) for axis in range(2)]
    knots = [np.unique(np.concatenate([low[axis], high[axis]])) for axis in range(2)]
    slack = float(trim.slack)
    made: list[tuple] = []
    first, end = int(trim.first), int(trim.end)
    segments = trims.segments[first:end]
    curves = np.flatnonzero(segments["band"] >= 0.0)
    _, begins = np.unique(segments["net"][curves], return_index=True)
    for k in curves[begins]:
        degree, net = int(segments["degree"][k]), int(segments["net"][k])
        control = trims.nets[net : net + 3 * (degree + 1)].reshape(-1, 3)
        found = breaks(control, knots)
        for begin, stop in pairwise(found):
            for a, b, middle, box in _stretches(control, begin, stop, low, high, slack, 0):
                if (box[0] < -_ROOTS).any() or (box[1] > 1.0 + _ROOTS).any():
                    raise ModelError(f"patch {patch}: a trimming loop leaves the patch's rectangle")
                on = (low[0] <= middle[0]) & (middle[0] <= high[0])
                on &= (low[1] <= middle[1]) & (middle[1] <= high[1])
                if on.any():  # else rounding puts it on a piece that was dropped
                    made.append((first + int(k), int(of[on.argmax()]), a, b))
    edges = np.zeros(len(made), PIECE)
    edges["patch"], edges["side"], edges["points"] = patch, INSIDE, EDGE_POINTS
    edges["room"], edges["degree_u"] = NET_WIDTH, EDGE_POINTS - 1
    for edge, (segment, face, a, b) in zip(edges, made, strict=True):
        edge["edge"], edge["face"], edge["low"][0], edge["high"][0] = segment, face, a, b
    return edges


def _unit(trim: np.record, axis: int, values: Reals) -> Reals:
    return np.array([to_unit.py_func(trim, axis, value) for value in values])


def breaks(control: Reals, knots: list[Reals]) -> Reals:
    """Return the parameters, ascending from 0 to 1, at which a curve passes from piece to piece.

    Args:
        control: (n, 3) homogeneous control points in the unit square.
        knots: the borders of the pieces along each axis.
    """
    found = [0.0, 1.0]
    degree = len(control) - 1
    power = _to_powers(degree)
    for axis in range(2):
        values = control[:, axis] / control[:, 2]
        low, high = values.min(), values.max()
        for knot in knots[axis][(knots[axis] > low) & (knots[axis] < high)]:
            crossing = power @ (control[:, axis] - knot * control[:, 2])
            roots = np.polynomial.polynomial.polyroots(np.trim_zeros(crossing, "b"))
            real = roots.real[np.abs(roots.imag) < _ROOTS]
            found += [t for t in real if 0.0 < t < 1.0]
    return np.unique(found)


def _to_powers(degree: int) -> Reals:
    """Return the matrix from Bernstein coefficients to power coefficients, ascending."""
    rows = np.eye(degree + 1)
    made, scale = np.empty((degree + 1, degree + 1)), 1.0
    for k in range(degree + 1):
        made[k] = scale * rows[0]
        scale *= (degree - k) / (k + 1)
        rows = np.diff(rows, axis=0)
    return made


def _stretches(
    control: Reals, a: float, b: float, low: list[Reals], high: list[Reals], slack: float, deep: int
) -> Iterator[tuple[float, float, Reals, tuple[Reals, Reals]]]:
    """Cut a curve from a to b into parts that each lie on one piece, to rounding.

    Yields the start and end of each part, its middle, and the corners of a box around it.
    """
    points = stretch(control, a, b)
    middle = stretch(control, 0.5 * (a + b), b)[0]
    box = points.min(axis=0), points.max(axis=0)
    inside = np.ones(len(low[0]), bool)
    for axis in range(2):
        inside &= (low[axis] - slack <= box[0][axis]) & (box[1][axis] <= high[axis] + slack)
    t = 0.5 * (a + b)
    if inside.any() or deep == _DEEP or not a < t < b:
        yield a, b, middle, box
        return
    yield from _stretches(control, a, t, low, high, slack, deep + 1)
    yield from _stretches(control, t, b, low, high, slack, deep + 1)
