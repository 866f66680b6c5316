"""The nearest points of two pieces near given ones: Newton's method in the parameters' rectangles.

It makes upper bounds alone, so whatever it does is right. Parameters at the end of their range that
the gradient presses outwards are held there (an active set), so edges and corners need no more
than that; where the Hessian is not positive it is made so (Levenberg 1944, Marquardt 1963).
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.vectors import dot, moved, rotated, scaled, sub
from .evaluate import jet_at

_MOST = 24
"""Iterations at the most: from a point within the valley that leads to a minimum it takes five."""

_DONE = 1e-15
"""Share of the squared distance below which a step's gain is nothing."""

_FIRST, _LESS, _MORE = 1e-3, 0.1, 10.0
"""The damping where none was needed before, what a good step makes of it, and a bad one."""

_LITTLE = 1e-6
"""Damping below which there is none."""


@shared
def nearest_near(tree_a, element_a, from_a, tree_b, element_b, from_b, motion):
    """A local minimum of the distance of two pieces, from parameters (u, v, 0) of either.

    Returns the distance, metres, the parameters, and the way from a's point to b's in a's frame.
    """
    piece_a, piece_b = tree_a.pieces[element_a], tree_b.pieces[element_b]
    x, trial, gradient, step = on_stack(4, 0.0), on_stack(4, 0.0), on_stack(4, 0.0), on_stack(4, 0.0)
    hessian, factor = table_on_stack(4, 4, 0.0), table_on_stack(4, 4, 0.0)
    x[0], x[1], x[2], x[3] = from_a[0], from_a[1], from_b[0], from_b[1]
    way, jet_a, jet_b = _jets(piece_a, tree_a.nets, piece_b, tree_b.nets, motion, x)
    squared = dot(way, way)
    damping = 0.0
    for _ in range(_MOST):
        _derivatives(way, jet_a, jet_b, gradient, hessian)
        if not _solve(x, gradient, hessian, damping, factor, step):
            damping = max(_FIRST, _MORE * damping)
            if damping > 1e12:
                break
            continue
        gain = 0.0
        for i in range(4):
            trial[i] = min(max(x[i] + step[i], 0.0), 1.0)
            gain -= gradient[i] * (trial[i] - x[i])
        if not gain > _DONE * squared:
            break
        new_way, new_a, new_b = _jets(piece_a, tree_a.nets, piece_b, tree_b.nets, motion, trial)
        new_squared = dot(new_way, new_way)
        if new_squared < squared:
            for i in range(4):
                x[i] = trial[i]
            way, jet_a, jet_b, squared = new_way, new_a, new_b, new_squared
            damping = _LESS * damping if damping > _LITTLE else 0.0
        else:
            damping = max(_FIRST, _MORE * damping)
            if damping > 1e12:
                break
    return np.sqrt(squared), (x[0], x[1], 0.0), (x[2], x[3], 0.0), way


@kernel
def _jets(piece_a, nets_a, piece_b, nets_b, motion, x):
    """The way between two points, and their surfaces' derivatives there, in a's frame."""
    a = jet_at(piece_a, nets_a, x[0], x[1])
    b = jet_at(piece_b, nets_b, x[2], x[3])
    way = sub(moved(motion, b[0]), a[0])
    a = (a[1], a[2], a[3], a[4], a[5])
    b = (
        rotated(motion, b[1]), rotated(motion, b[2]), rotated(motion, b[3]),
        rotated(motion, b[4]), rotated(motion, b[5]),
    )  # fmt: skip
    return way, a, b


@kernel
def _derivatives(way, a, b, gradient, hessian):
    """Gradient and Hessian of half the squared distance by u, v of a and u, v of b."""
    au, av, bu, bv = scaled(a[0], -1.0), scaled(a[1], -1.0), b[0], b[1]
    gradient[0], gradient[1] = dot(way, au), dot(way, av)
    gradient[2], gradient[3] = dot(way, bu), dot(way, bv)
    hessian[0, 0] = dot(au, au) - dot(way, a[2])
    hessian[1, 0] = dot(au, av) - dot(way, a[3])
    hessian[1, 1] = dot(av, av) - dot(way, a[4])
    hessian[2, 0], hessian[2, 1] = dot(bu, au), dot(bu, av)
    hessian[2, 2] = dot(bu, bu) + dot(way, b[2])
    hessian[3, 0], hessian[3, 1] = dot(bv, au), dot(bv, av)
    hessian[3, 2] = dot(bu, bv) + dot(way, b[3])
    hessian[3, 3] = dot(bv, bv) + dot(way, b[4])


@kernel
def _solve(x, gradient, hessian, damping, factor, step):
    """Newton's step over the parameters that are free to move; False where it goes nowhere good.

    That is where the damped Hessian is not positive: by Cholesky's factors, each kept in `factor`
    with a row and column of a parameter that is held being those of the unit matrix.
    """
    scale = 0.0
    for i in range(4):
        scale = max(scale, abs(hessian[i, i]))
    for i in range(4):
        held = (x[i] <= 0.0 and gradient[i] >= 0.0) or (x[i] >= 1.0 and gradient[i] <= 0.0)
        step[i] = 0.0 if held else 1.0
    for i in range(4):
        for j in range(i + 1):
            value = 0.0
            if step[i] * step[j] > 0.0:
                value = hessian[i, j]
                if i == j:
                    value += damping * (abs(value) + 1e-3 * scale)
            elif i == j:
                value = 1.0
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i == j:
                if not value > 1e-14 * scale and step[i] > 0.0:
                    return False
                factor[i, i] = np.sqrt(value)
            else:
                factor[i, j] = value / factor[j, j]
    for i in range(4):
        value = -gradient[i] * step[i]
        for k in range(i):
            value -= factor[i, k] * step[k]
        step[i] = value / factor[i, i]
    for i in (3, 2, 1, 0):
        value = step[i]
        for k in range(i + 1, 4):
            value -= factor[k, i] * step[k]
        step[i] = value / factor[i, i]
    return True
