"""The nearest points of two elements near given ones: Newton's method in their parameters.

It makes upper bounds only, so any result is right. If a parameter is at an end of its range and the
gradient presses it outwards, it is held there (an active set), so edges and corners need nothing
more. If the Hessian is not positive, it is made so (Levenberg 1944, Marquardt 1963).

If a step leads farther away, one more step is tried from where it led, before the step is shortened
(the watchdog technique of Chamberlain, Powell, Lemarechal and Pedersen 1982). Second derivatives
jump where a triangle's point reaches an edge: there a step within the face leads across the edge,
and only the next step takes the edge into account. Shortened steps would zigzag along the edge.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.trees import SurfaceTree
from ..base.vectors import dot

JETS = 56
"""Numbers that an implementation may store in `prepare` and `way_at`, for `derivatives`."""

MOST = 48
"""Most iterations. From a point within the valley that leads to a minimum, five are enough."""

_QUICK = 0.1
"""If a step leaves less than this share of the squared distance, iterations may go on, up to twice
`most`."""

_DONE = 1e-16
"""A step's gain below this share of the squared distance is nothing."""

LEAST_DAMPED, POSITIVE = 1e-3, 1e-14
"""Shares of the Hessian's largest diagonal element: what damping adds to the size of each element;
and the least pivot that counts as positive."""

_FIRST, _LESS, _MORE, _LEAST, _LARGEST = 1e-3, 0.1, 10.0, 1e-6, 1e12
"""The first damping; its factor after a good step, and after a bad one; the damping below which it
becomes 0, and that above which the search ends."""


def way_at(tree_a, tree_b, element_a, element_b, motion, x, jets):
    """Return the way from a's point at x[0], x[1] to b's point at x[2], x[3], in a's frame: a stub.

    Writes to `jets` what else `derivatives` needs. An element without parameters, such as a
    triangle, uses its point nearest to the other element's point, and its part of x stays 0.
    """


def derivatives(tree_a, tree_b, way, jets, gradient, hessian):
    """Write gradient and Hessian (lower half) of half the squared distance, by the four: a stub."""


def weights_at(tree, x, first, jets):
    """Return the weights of an element's point, from its part of x or from `jets`: a stub."""


def begin_at(tree, weights):
    """Return an element's part of x, from weights: a stub."""


def prepare(tree_a, tree_b, element_a, element_b, motion, jets):
    """Write to `jets` what all calls of `way_at` for two elements have in common: a stub."""


def solve(tree_a, tree_b, x, gradient, hessian, damping, factor, step):
    """Write Newton's step over free parameters; False if the Hessian is not positive: a stub.

    A parameter is held if it is at an end of its range and the gradient presses it outwards.
    """


@shared
def nearest_near(tree_a, tree_b, element_a, element_b, from_a, from_b, motion, most, meet):
    """Find points of two elements that are nearest among those near by, from given weights on.

    `most` is the most iterations; points that are no farther apart than `meet` are near enough.

    Returns their distance, metres, the weights of both, and the way between them in a's frame.
    """
    x, trial, gradient, step = (
        on_stack(4, 0.0),
        on_stack(4, 0.0),
        on_stack(4, 0.0),
        on_stack(4, 0.0),
    )
    hessian, factor = table_on_stack(4, 4, 0.0), table_on_stack(4, 4, 0.0)
    jets = on_stack(JETS, 0.0)
    x[0], x[1] = begin_at(tree_a, from_a)
    x[2], x[3] = begin_at(tree_b, from_b)
    prepare(tree_a, tree_b, element_a, element_b, motion, jets)
    way = way_at(tree_a, tree_b, element_a, element_b, motion, x, jets)
    squared = dot(way, way)
    weights_a, weights_b = weights_at(tree_a, x, 0, jets), weights_at(tree_b, x, 2, jets)
    damping, fresh, quick, tried = 0.0, True, False, False
    for k in range(2 * most):
        if squared <= meet * meet or (k >= most and not quick):
            break
        if fresh:
            derivatives(tree_a, tree_b, way, jets, gradient, hessian)
        fresh = False
        if not solve(tree_a, tree_b, x, gradient, hessian, damping, factor, step):
            damping = max(_FIRST, _MORE * damping)
            if damping > _LARGEST:
                break
            continue
        gain = 0.0
        for i in range(4):
            trial[i] = min(max(x[i] + step[i], 0.0), 1.0)
            gain -= gradient[i] * (trial[i] - x[i])
        if not gain > _DONE * squared:
            break
        new_way = way_at(tree_a, tree_b, element_a, element_b, motion, trial, jets)
        new_squared = dot(new_way, new_way)
        if not tried and not new_squared < squared:
            tried = True
            derivatives(tree_a, tree_b, new_way, jets, gradient, hessian)
            if solve(tree_a, tree_b, trial, gradient, hessian, 0.0, factor, step):
                for i in range(4):
                    trial[i] = min(max(trial[i] + step[i], 0.0), 1.0)
                new_way = way_at(tree_a, tree_b, element_a, element_b, motion, trial, jets)
                new_squared = dot(new_way, new_way)
            if not new_squared < squared:  # go back, to restore what `derivatives` needs
                way_at(tree_a, tree_b, element_a, element_b, motion, x, jets)
                fresh = True
        quick = new_squared < _QUICK * squared
        if new_squared < squared:
            for i in range(4):
                x[i] = trial[i]
            way, squared, fresh, tried = new_way, new_squared, True, False
            weights_a, weights_b = weights_at(tree_a, x, 0, jets), weights_at(tree_b, x, 2, jets)
            damping = _LESS * damping if damping > _LEAST else 0.0
        else:
            damping = max(_FIRST, _MORE * damping)
            if damping > _LARGEST:
                break
    return np.sqrt(squared), weights_a, weights_b, way


@inlined
def is_held(x, gradient, i):
    """Tell whether a parameter is at an end of its range, and the gradient presses it outwards."""
    return (x[i] <= 0.0 and gradient[i] >= 0.0) or (x[i] >= 1.0 and gradient[i] <= 0.0)


@implements(solve, SurfaceTree, SurfaceTree)
@kernel
def _solve(tree_a, tree_b, x, gradient, hessian, damping, factor, step):
    """Solve by Cholesky factors. A held parameter has a row and a column of the unit matrix."""
    scale = 0.0
    for i in range(4):
        step[i] = 0.0 if is_held(x, gradient, i) else 1.0
        if step[i] > 0.0:
            scale = max(scale, abs(hessian[i, i]))
    for i in range(4):
        for j in range(i + 1):
            value = 0.0
            if step[i] * step[j] > 0.0:
                value = hessian[i, j]
                if i == j:
                    value += damping * (abs(value) + LEAST_DAMPED * scale)
            elif i == j:
                value = 1.0
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i == j:
                if step[i] > 0.0 and not value > POSITIVE * scale:
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
