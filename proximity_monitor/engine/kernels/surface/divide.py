"""The nearest points of elements that have to be divided: pairs of cells, the least bound first.

The bounding volumes of `search` lead to pairs of whole elements. From there on, the search takes
the pair with the least bound, divides its rougher cell, and bounds each part against the other cell
(Thomas et al. 2000, section 5). A bound is the gap between the control points of two cells along a
direction. First comes the direction that served the pair before. Next comes that between near
points of the parallelograms that stand for the cells (`facing.py`). If these points are too near
for a good direction, the cells' normals follow. The gap is certain for each direction. If it falls
short by less than the cells bend, the control points of their parts may suffice (`halved.py`).
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.rounding import DOUBLE_EPS
from ..base.trees import NONE
from ..base.vectors import dot, norm, rotated, scaled, turned_back
from .certificate import is_done
from .empty_ball import is_in_ball
from .facing import vector
from .falling import is_crossed, leads_to_edges
from .halved import halved_least
from .heap import add_pair, drop, put_aside
from .measure import MINIMUM_STEPS, measure_near
from .newton import MOST
from .room import PATIENCE, is_narrow
from .sides import (
    divide_side,
    element_of,
    facing,
    is_long_in,
    least_of,
    margin_of,
    normal_of,
    roughness,
    ways_to_divide,
    whole,
)
from .trim import OUTSIDE

PAIR_STEPS, DIVISION_STEPS, FALLING_STEPS = 1, 4, 4
"""Steps of a search that these take: bounding a pair of cells, dividing a cell, and a proof that
only edges are near."""

_ROUGH = 0.25
"""If two cells differ from their parallelograms by more than this share of their distance, normals
are tried as directions."""

_ALMOST = 1e-8
"""Normals are also tried if a bound falls short by less than this share of the distance found. The
way between points on flat surfaces is tilted by about as much, because that hardly lengthens it."""

_TILT = 16.0 * DOUBLE_EPS
"""Rounding moves the near points by about this share of the models' sizes. If they are as near as
1e-6 of these, that tilts the way so much that parallel planes need normals as well."""

_MISSING = 8.0
"""If a bound falls short by more than this many times what both cells bend along its direction, the
direction is poor, and cells that bend less along it would have the same. It gets better as all of
their shape gets simpler."""

_EACH, _NEAR = 16, 0.25
"""If two cells may cross, one local search is begun for every `_EACH` pairs that wait, and only if
their points are nearer than the share `_NEAR` of the distance found so far."""

_NEARER = 0.25
"""A local search is begun only for a point that is nearer by this share of the allowed error.

If a local search ended too early, a pair of cells with points about as near as its bound begins
another search, and is not divided without end."""


@inlined
def add_elements(tree_a, tree_b, state, a, b, bound):
    """Add a pair of elements with a lower bound of their distance.

    Returns the steps it took, or NONE if there is no room for the pair.
    """
    progress, cells = state.progress[0], state.waiting
    if progress.dividing + progress.aside >= len(cells.pairs):
        return NONE
    first, progress.cells_a = whole(
        tree_a, a, cells.cells_a, cells.nets_a, cells.roots_a, progress.cells_a
    )
    second, progress.cells_b = whole(
        tree_b, b, cells.cells_b, cells.nets_b, cells.roots_b, progress.cells_b
    )
    if first == NONE or second == NONE:
        return NONE
    # The direction between the nearest points so far dismisses most of the pairs near them.
    normal = vector(progress.normal_a)
    gap = _gap(tree_a, tree_b, state, first, second, normal)
    return bound_pair(tree_a, tree_b, state, first, second, bound, normal, gap)


@kernel
def divide_nearest(tree_a, tree_b, state):
    """Divide the pair of cells with the least bound; the last pair if room is short (see room.py).

    Returns the steps it took, or NONE if there is no room for the parts (the pairs are unchanged).
    """
    progress, cells = state.progress[0], state.waiting
    pairs = cells.pairs
    at = 0
    if is_narrow(progress, pairs):
        if progress.narrow_divisions >= PATIENCE:
            return NONE
        progress.narrow_divisions += 1
        at = progress.dividing - 1
    a, b, bound = np.int64(pairs[at].a), np.int64(pairs[at].b), pairs[at].bound
    normal = vector(pairs[at].normal)
    if bound >= progress.limit:
        progress.dividing = at  # all pairs that follow are farther
        return 0
    if is_in_ball(
        tree_a, tree_b, state,
        element_of(tree_a, cells.cells_a, a), element_of(tree_b, cells.cells_b, b),
    ):  # fmt: skip
        progress.dividing = drop(pairs, progress.dividing, at)
        return PAIR_STEPS
    slack = progress.slack + margin_of(tree_a, cells.cells_a, a)
    slack += margin_of(tree_b, cells.cells_b, b)
    # If pairs are collected and nothing nearer can be found, divide only cells that are too long.
    collects = state.collected.shape[0] > 0
    meet = progress.distance - progress.slack <= progress.radii
    settled, steps = collects and (meet or bound >= progress.enough), 0
    # Bends along the normal weaken the bound. A proof needs cells that are small in all directions.
    along = normal if bound > 0.0 else (0.0, 0.0, 0.0)
    if not settled:
        done, holds, steps = is_done(tree_a, tree_b, state, a, b, slack)
        if holds:
            along = (0.0, 0.0, 0.0)
        if done and not collects:
            progress.dividing = drop(pairs, progress.dividing, at)
            return steps
        if done:
            bound, settled = progress.enough, True
    u_a, v_a, rough_a = ways_to_divide(tree_a, cells.cells_a, cells.nets_a, a, along)
    u_b, v_b, rough_b = ways_to_divide(
        tree_b, cells.cells_b, cells.nets_b, b, turned_back(state.motions[0], along)
    )
    bends = max(rough_a, 0.0) + max(rough_b, 0.0)
    if along != (0.0, 0.0, 0.0) and progress.limit - bound > _MISSING * bends:
        along = (0.0, 0.0, 0.0)
        u_a, v_a, rough_a = ways_to_divide(tree_a, cells.cells_a, cells.nets_a, a, along)
        u_b, v_b, rough_b = ways_to_divide(tree_b, cells.cells_b, cells.nets_b, b, along)
    if settled:
        most = progress.param_err
        u_a, v_a = is_long_in(tree_a, cells.cells_a, a, most)
        u_b, v_b = is_long_in(tree_b, cells.cells_b, b, most)
        rough_a = rough_a if u_a or v_a else -1.0
        rough_b = rough_b if u_b or v_b else -1.0
    on_edges = leads_to_edges(tree_a, tree_b, state, a, b, slack)
    if on_edges or (rough_a < 0.0 and rough_b < 0.0):
        progress.dividing = drop(pairs, progress.dividing, at)
        if not on_edges and not settled:
            progress.least_cells = min(progress.least_cells, bound)
        if not on_edges and collects:
            progress.aside = put_aside(pairs, progress.aside, a, b, bound)
        return steps + FALLING_STEPS
    if progress.dividing + progress.aside + 4 > len(pairs):
        return NONE
    of_a = rough_a >= rough_b
    if of_a:
        before, index, side = progress.cells_a, a, cells.cells_a
        progress.cells_a = divide_side(tree_a, a, side, cells.nets_a, before, u_a, v_a)
        steps += DIVISION_STEPS if progress.cells_a > before else 0
    else:
        before, index, side = progress.cells_b, b, cells.cells_b
        progress.cells_b = divide_side(tree_b, b, side, cells.nets_b, before, u_b, v_b)
        steps += DIVISION_STEPS if progress.cells_b > before else 0
    first, count = np.int64(side[index].child), np.int64(side[index].children)
    if first == NONE:
        return NONE
    progress.dividing = drop(pairs, progress.dividing, at)
    for part in range(first, first + count):
        if side[part].side == OUTSIDE:
            continue
        one, other = (part, b) if of_a else (a, part)
        gap = _gap(tree_a, tree_b, state, one, other, normal)
        steps += bound_pair(tree_a, tree_b, state, one, other, bound, normal, gap)
    return steps


@inlined
def _offset(motion, n):
    return motion[9] * n[0] + motion[10] * n[1] + motion[11] * n[2]


@kernel
def _gap(tree_a, tree_b, state, a, b, n):
    """Return how far b's control points begin beyond the end of a's along n (a's frame), metres."""
    cells, motion = state.waiting, state.motions[0]
    begin = least_of(tree_a, cells.cells_a, cells.nets_a, a, scaled(n, -1.0))
    end = least_of(tree_b, cells.cells_b, cells.nets_b, b, turned_back(motion, n))
    return begin + (end + _offset(motion, n))


@kernel
def _gap_of_parts(tree_a, tree_b, state, a, b, n):
    """As `_gap`, but from the control points that both cells would have if divided in four."""
    cells, motion = state.waiting, state.motions[0]
    begin = halved_least(tree_a, cells.cells_a, cells.nets_a, a, scaled(n, -1.0))
    end = halved_least(tree_b, cells.cells_b, cells.nets_b, b, turned_back(motion, n))
    return begin + (end + _offset(motion, n))


@kernel
def _shortened(v):
    """Scale a vector to at most unit length despite rounding; zero if it has no direction."""
    length = norm(v)
    if not 1e-140 < length < 1e140:
        return (0.0, 0.0, 0.0)
    return scaled(v, (1.0 - 4.0 * DOUBLE_EPS) / length)


@shared
def bound_pair(tree_a, tree_b, state, a, b, bound, normal, gap):
    """Bound a pair of cells, for which `bound` is a lower bound; return the steps it took.

    `gap` is the gap along `normal`. A pair that may be nearer than the limit joins the pairs that
    wait. Near points of the two cells are measured if they promise to be nearer than any before.
    """
    progress, cells = state.progress[0], state.waiting
    progress.bound_tests += 1
    slack = progress.slack + margin_of(tree_a, cells.cells_a, a)
    slack += margin_of(tree_b, cells.cells_b, b)
    bound = max(bound, gap - slack)
    if bound >= progress.limit:
        return PAIR_STEPS
    motion = state.motions[0]
    way, from_a, from_b = facing(tree_a, tree_b, cells.cells_a, cells.cells_b, a, b, motion)
    apart = norm(way)
    n = _shortened(way)
    gap = _gap(tree_a, tree_b, state, a, b, n) - slack
    if gap > bound:
        bound, normal = gap, n
    rough = roughness(tree_a, cells.cells_a, a) + roughness(tree_b, cells.cells_b, b)
    short = progress.limit - _ALMOST * progress.distance - bound
    size = tree_a.scale[2] + tree_b.scale[2]
    almost = short <= 0.0 or short * apart < _TILT * size * size
    if (almost or rough > _ROUGH * apart) and bound < progress.limit:
        bound, normal = _along_normals(tree_a, tree_b, state, a, b, way, slack, bound, normal)
    if bound < progress.limit <= bound + rough:
        gap = _gap_of_parts(tree_a, tree_b, state, a, b, normal) - slack
        bound = max(bound, gap)
    if bound >= progress.limit:
        return PAIR_STEPS
    steps = PAIR_STEPS
    share = _NEARER * max(progress.abs_err, progress.distance - progress.enough)
    # If the models cross, the bounds of many pairs are 0, and only points that are measured help.
    tries = bound <= 0.0 and _EACH * progress.primitive_tests < progress.dividing
    promising = apart + rough < progress.distance - share
    promising = promising or (tries and apart < _NEAR * progress.distance)
    # If loops cross a cell, its near points may be cut off: its parts and edges have others.
    entire = not (is_crossed(tree_a, cells.cells_a, a) or is_crossed(tree_b, cells.cells_b, b))
    if entire and promising:
        steps += MINIMUM_STEPS
        element_a = element_of(tree_a, cells.cells_a, a)
        element_b = element_of(tree_b, cells.cells_b, b)
        measure_near(tree_a, tree_b, state, element_a, from_a, element_b, from_b, MOST)
        if bound >= progress.limit:
            return steps
    progress.dividing = add_pair(cells.pairs, progress.dividing, a, b, bound, normal)
    return steps


@kernel
def _along_normals(tree_a, tree_b, state, a, b, way, slack, bound, normal):
    """Improve a bound by the gaps along either cell's normal, turned along the way from a to b.

    Turned the other way, one of the two near points already lies behind the other.
    """
    cells = state.waiting
    own = _shortened(normal_of(tree_a, cells.cells_a, a))
    other = _shortened(rotated(state.motions[0], normal_of(tree_b, cells.cells_b, b)))
    for k in range(2):
        n = own if k == 0 else other
        if dot(n, n) == 0.0:
            continue
        n = scaled(n, 1.0 if dot(n, way) >= 0.0 else -1.0)
        gap = _gap(tree_a, tree_b, state, a, b, n) - slack
        if gap > bound:
            bound, normal = gap, n
    return bound, normal
