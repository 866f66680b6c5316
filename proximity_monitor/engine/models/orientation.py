"""Prove which way a simple closed curve runs.

If no piece is rational, the sign of the area to its left tells, unless the area is tiny. A proof
for all curves looks at where the curve is farthest along some direction d.

The whole curve, except a short stretch, stays below the farthest point along d. Suppose that on
this stretch every control point is to the left of the one before it, seen along a direction u with
u d >= 0. Take a point of the stretch that is above all the rest of the curve. A ray from this point
along u does not meet the curve again. So the outside is ahead, to the right of the curve. Every
stretch that is short enough has such a u, unless it holds a cusp. At a cusp, or if two places are
equally far along d, another d is tried.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .loops import split

Reals = NDArray[np.float64]

_DIRECTIONS = 12
"""How many directions d are tried."""
_TURN = 2.4
"""Radians from one direction to the next: all differ, and none is along a drawing's axes."""
_HALVINGS = 60
_MOST = 24
"""The most pieces of a stretch. If more are about equally far, the next direction is tried."""
_SLACK = 1e-13
"""Rounding allowance for points of pieces, as a share of the size."""


_CLEAR = 1e-10
"""A curve's area has the sign that was found if it is more than this times the number of pieces, as
a share of the squared size. Rounding, and ends that are 1e-12 of the size apart, change it by less:
a piece of degree n contributes a sum of at most 8 n squared sizes, and n is at most 15."""


def area_leftward(curves: Sequence[Reals]) -> float | None:
    """Return the area to the left of curves, m², closed by a line; None: a piece is rational.

    Args:
        curves: as for `runs_leftward`.
    """
    start, total = curves[0][0, 0, :2] / curves[0][0, 0, 2], 0.0
    for own in curves:
        weights = own[:, :, 2]
        if not (weights == weights[0, 0]).all():
            return None
        x, y = np.moveaxis(own[..., :2] / weights[0, 0] - start, 2, 0)
        total += float((x @ _areas(own.shape[1] - 1) * y).sum())
    return total


@lru_cache(maxsize=16)
def _areas(degree: int) -> Reals:
    """Return the matrix (degree + 1, degree + 1) A of the area x A y that a Bezier curve sweeps.

    A is half the integral of B_i B_j' - B_i' B_j, with Bernstein's polynomials B.
    """
    n, made = degree, np.zeros((degree + 1, degree + 2))
    for i in range(n + 1):
        for k in range(n):  # B_j' = n (b_(j - 1) - b_j) with the polynomials b of degree n - 1
            made[i, k + 1] = (
                0.5 * math.comb(n, i) * math.comb(n - 1, k) / math.comb(2 * n - 1, i + k)
            )
    both = -0.5 * np.diff(made, axis=1)
    return both - both.T


def balanced(pieces: Reals) -> Reals:
    """Return the pieces (..., n, 3) with parameters changed so that both end weights are equal."""
    degree = pieces.shape[-2] - 1
    ratio = (pieces[..., :1, 2:] / pieces[..., -1:, 2:]) ** (1.0 / max(degree, 1))
    return pieces * ratio ** np.arange(degree + 1.0)[:, None]


def is_clear(area: float | None, curves: Sequence[Reals], size: float) -> bool:
    """Tell whether `area_leftward` of a simple closed curve of a size certainly has its sign."""
    return area is not None and abs(area) > _CLEAR * size**2 * sum(map(len, curves))


def runs_leftward(curves: Sequence[Reals], size: float, closing: bool) -> bool | None:
    """Tell whether a simple closed curve has its inside on its left; None: it cannot be told.

    This holds for any curve, but takes longer than `area_leftward`.

    Args:
        curves: the Bezier pieces (s, n, 3) of each curve: x w, y w and w. Each piece begins where
            the one before it ends.
        size: the largest coordinate.
        closing: whether a straight line from the last end to the first start closes the curve.
    """
    slack = _SLACK * size
    pieces = [piece for own in curves for piece in balanced(own)]
    if closing:
        pieces.append(np.stack([pieces[-1][-1], pieces[0][0]]))
    points = [piece[:, :2] / piece[:, 2:] for piece in pieces]
    whole = [i for i, each in enumerate(points) if np.ptp(each, axis=0).max() > slack]
    starts = np.cumsum([0] + [len(points[i]) for i in whole])
    flat = np.concatenate([points[i] for i in whole])
    for k in range(_DIRECTIONS):
        along = np.array([math.cos(_TURN * k + 0.3), math.sin(_TURN * k + 0.3)])
        reach = flat @ along
        best = float(max(reach[starts[:-1]].max(), reach[starts[1:] - 1].max()))
        far = np.flatnonzero(np.maximum.reduceat(reach, starts[:-1]) >= best - slack)
        if len(far) > _MOST:
            continue
        gaps = np.flatnonzero(np.diff(far, append=far[0] + len(whole)) > 1)
        far = np.roll(far, -int(gaps[0]) - 1) if len(gaps) else far
        follows = np.diff(far, prepend=-2) % len(whole) == 1
        found = _turn([pieces[whole[i]] for i in far], follows, along, best, slack)
        if found is not None:
            return found
    return None


def _turn(
    stretch: list[Reals], follows: NDArray[np.bool_], along: Reals, best: float, slack: float
) -> bool | None:
    """Tell whether the pieces that are farthest along d run leftward; None: it cannot be told.

    Args:
        stretch: the m pieces in their order along the curve.
        follows: (m,) whether each begins where the one before it ends; the first one does not.
        along: (2,) d.
        best: how far the farthest end of a piece is along d; all other pieces are below.
        slack: rounding allowance.
    """
    for _ in range(_HALVINGS):
        points = [piece[:, :2] / piece[:, 2:] for piece in stretch]
        if follows[1:].all() and len(points) > 1:
            steps = np.concatenate([np.diff(each, axis=0) for each in points])
            ways = np.array([each[-1] - each[0] for each in points])
            is_best = np.array([each[-1] for each in points[:-1]]) @ along >= best
            first, last = _unit(steps), _unit(steps[::-1])
            for u in (along, np.array([first[1] + last[1], -first[0] - last[0]])):
                found = _side(u if u @ along >= 0.0 else -u, steps, ways, is_best, slack)
                if found is not None:
                    return found
        stretch = [half for piece in stretch for half in split(balanced(piece))]
        reach = [piece[:, :2] @ along / piece[:, 2] for piece in stretch]
        best = max(best, *(float(max(each[0], each[-1])) for each in reach))
        far = np.flatnonzero([each.max() >= best - slack for each in reach])
        if len(far) > _MOST:
            return None
        joined = np.repeat(follows, 2)
        joined[1::2] = True
        follows = joined[far] & (np.diff(far, prepend=-2) == 1)
        stretch = [stretch[i] for i in far]
    return None


def _side(
    u: Reals, steps: Reals, ways: Reals, is_best: NDArray[np.bool_], slack: float
) -> bool | None:
    """Tell whether a stretch runs leftward, seen along u; None: u does not tell.

    Args:
        u: (2,) no piece outside of the stretch lies ahead of the farthest point along u.
        steps: (k, 2) from each control point to the next.
        ways: (m, 2) from the start of each piece to its end.
        is_best: (m - 1,) whether the joint behind each piece but the last is a farthest point.
        slack: rounding allowance.
    """
    rounding = slack * float(np.abs(u).max())
    left = u[0] * steps[:, 1] - u[1] * steps[:, 0]
    side = 1.0 if left.sum() > 0.0 else -1.0
    if not (side * left >= -rounding).all():
        return None
    away = side * (u[0] * ways[:, 1] - u[1] * ways[:, 0])
    # Steps may go back within rounding, but all together they cannot go back as far as this.
    clear = np.minimum(away[:-1], away[1:]) > 4.0 * len(steps) * rounding
    return side > 0.0 if (clear & is_best).any() else None


def _unit(ways: Reals) -> Reals:
    """Return the unit vector along the first of vectors (k, 2) that is not 0."""
    lengths = np.hypot(*ways.T)
    i = int(np.argmax(lengths > 0.0))
    return ways[i] / max(float(lengths[i]), 1e-300)
