"""Stubs shared by the pairs of which at least one model has elements that are divided."""

from __future__ import annotations

import numpy as np
from numba import int64

from ..base.jit import implements, inlined, kernel, shared
from ..base.lazy import lazy
from ..base.memory import on_stack
from ..base.motion import slack_of_bounds
from ..base.rounding import MARGIN_A, MARGIN_B, MARGIN_T, POINT_FLOOR, RESOLUTION
from ..base.state import CELLS_FULL, CUT, ENDED, Dividing, remembers
from ..base.trees import NONE, REVISION, MeshTree, SurfaceTree
from ..base.vectors import moved, norm, scaled, sub
from ..elements.errors import points_err
from ..elements.primitives import collect
from ..inside.nearest import Point, begin_nearest, nearest, walk
from ..inside.visit import ROOM, at_root, descend
from ..search import stubs
from ..search.approach import far_from_nearest
from ..surface import cell_proofs  # noqa: F401 - it implements what proofs ask of cells
from ..surface.around import Around
from ..surface.divide import add_elements, divide_nearest
from ..surface.empty_ball import find_ball, is_in_ball
from ..surface.facing import vector
from ..surface.measure import measure_near
from ..surface.newton import MOST
from ..surface.room import is_narrow, look_back, make_room
from ..surface.sides import begin_on, near
from ..tree.layout import WIDTH, first_of, last_of, row

DIVIDED = (SurfaceTree, SurfaceTree), (SurfaceTree, MeshTree), (MeshTree, SurfaceTree)
"""The pairs of tree types that share these stubs."""

_FULL = 0.5
"""If earlier searches have filled this share of the room for cells, a search begins without their
cells."""

_NEAR = 0.05
"""Share of the models' sizes. From points farther apart than that, no local minimum is looked for:
the models crossed before and have leapt, or nothing was known about them."""

_SMALL = 0.02
"""Share of the models' sizes. If the models moved less, the last nearest points are still near."""

_NEAR_STEPS = 32
"""Most steps of each query for near points, if a search with a tolerance begins with these."""

_CROSSING = 4
"""Factor for the pairs that a search compares before it looks for a ball, if some may cross."""

_FEW, _MORE = 8, 24
"""Pairs of elements that a search compares before it looks for a ball that dismisses others: a
search that remembers nothing, and one that remembers what was far (most such compare only a few).
"""

ROOM_STEPS = 256
"""Cost of making room for more cells, in steps."""


def _implements(stub):
    """Return a decorator that makes a kernel implement a stub for all pairs in DIVIDED."""

    def register(compiled):
        for kinds in DIVIDED:
            implements(stub, *kinds)(compiled)
        return compiled

    return register


@_implements(stubs.slacks)
@kernel
def slacks(tree_a, tree_b, apart, error):
    """Return what rounding may do to a distance of points, and to a bound; metres."""
    size_a, size_b = tree_a.scale[2], tree_b.scale[2]
    points = MARGIN_A * size_a + MARGIN_B * size_b + MARGIN_T * apart + POINT_FLOOR
    points += points_err(tree_a) + points_err(tree_b)
    return points, slack_of_bounds(size_a, size_b, apart, error)


@implements(stubs.resolution, Dividing)
@inlined
def resolution(waiting, tree_a, tree_b, slack):
    """Return how close the bounds of such models can come, metres."""
    # No division makes the bounds differ by less. They hold whatever this returns, but a search
    # would never reach a smaller difference. The distance found errs by one slack, and a cell's
    # bound is lowered by a second. A gap along a direction errs by GAP_SHARE of the slack's first
    # part (see `slacks`), and a cell's margin contains CONVERSION, which is in the second part,
    # `points_err`: together a third slack. The rest of a margin is at most
    # NET_SPLIT (15 MOST_SPLITS + 1) P, or 6.4e-13 P. The smallest cells, 2^-48 of a piece when
    # divided evenly, extend over 15 * 2 P / 2^48, 1.1e-13 P. RESOLUTION is 9.1e-13.
    return RESOLUTION * (tree_a.scale[2] + tree_b.scale[2]) + 3.0 * slack


@implements(stubs.prepare, Dividing)
@kernel
def _prepare(cells, tree_a, tree_b, state):
    progress = state.progress[0]
    progress.dividing, progress.aside, progress.least_cells = 0, 0, np.inf
    progress.narrow, progress.narrow_divisions = 0, 0
    progress.beside = 0
    progress.next_check, progress.dividing_before = 1, 0
    progress.ball[3], progress.ball[4], progress.ball[5] = -np.inf, -np.inf, np.inf
    progress.plane[3], progress.laid = np.inf, np.inf
    same = remembers(state)
    progress.futile = max(progress.futile - 1, 0) if same else 0
    progress.resting = max(progress.resting - 1, 0) if same else 0
    progress.compared, progress.leaning = 0, NONE
    progress.due = _MORE if same else _FEW
    # Cells are in their model's own frame, so they can be used again while its shape is the same.
    shapes = tree_a.scale[REVISION], tree_b.scale[REVISION]
    same = same and progress.shape_a == shapes[0] and progress.shape_b == shapes[1]
    most = _FULL * len(cells.cells_a)
    if not (same and 0 < progress.cells_a < most):
        progress.cells_a = 0  # this forgets the roots, too: see `root_cell`
    most = _FULL * len(cells.cells_b)
    if not (same and 0 < progress.cells_b < most):
        progress.cells_b = 0


def begin_below(tree_a, tree_b, state, fresh):
    """Begin a search of a solid of revolution and a mesh with a local minimum: a stub.

    FRESH says that no points near it are known. Returns False if the search has to begin as between
    other models.
    """


@implements(stubs.settle, Dividing)
@kernel
def _settle(waiting, tree_a, tree_b, state):
    progress = state.progress[0]
    if begin_below(tree_a, tree_b, state, False):
        return
    wa, wb = progress.weights_a, progress.weights_b
    measure_near(
        tree_a, tree_b, state, progress.element_a, (wa[0], wa[1], wa[2]),
        progress.element_b, (wb[0], wb[1], wb[2]), MOST,
    )  # fmt: skip


@_implements(stubs.measure)
@kernel
def _measure(tree_a, tree_b, state, a, b, bound):
    a, from_a = begin_on(tree_a, a)
    b, from_b = begin_on(tree_b, b)
    # If these points are far apart, the search finds better ones to begin with (see `guess`).
    distance = measure_near(tree_a, tree_b, state, a, from_a, b, from_b, 0)
    if distance > _NEAR * (tree_a.scale[2] + tree_b.scale[2]) and distance < np.inf:
        return distance
    return measure_near(tree_a, tree_b, state, a, from_a, b, from_b, MOST)


@_implements(stubs.resolve)
@inlined
def _resolve(tree_a, tree_b, state, n, steps, scratch):
    progress, waiting = state.progress[0], state.waiting
    n -= 1
    bound = waiting.bounds[n]
    if bound >= progress.limit:
        return n, steps
    apart = progress.distance - progress.slack > progress.stop
    narrow = apart and progress.dividing > 0 and is_narrow(progress, waiting.pairs)
    if narrow:
        code, left = divide_some(tree_a, tree_b, state, steps, 1)
        if code == CUT:
            return n + 1, left
    steps = _add(tree_a, tree_b, state, n, bound, steps)
    if progress.compared < progress.due or _may_cross(progress, waiting):
        return n, steps
    return n, steps - min(steps, find_ball(tree_a, tree_b, state))


@inlined
def _may_cross(progress, waiting):
    """Return whether a pair of cells may cross, by its bound, and few pairs were compared so far.

    Then the search compares a few more first: if the models cross, a pair shows it and no ball can.
    """
    crosses = progress.dividing > 0 and waiting.pairs[0].bound <= 0.0
    return crosses and progress.compared < _CROSSING * progress.due


@inlined
def _add(tree_a, tree_b, state, n, bound, steps):
    """Add the elements of the waiting pair n to those to be divided; return the steps left."""
    progress, waiting = state.progress[0], state.waiting
    # A leaf of a mesh may hold two triangles.
    first_a, last_a = _elements(tree_a, waiting.lanes[n, 0])
    first_b, last_b = _elements(tree_b, waiting.lanes[n, 1])
    for a in range(first_a, last_a + 1):
        for b in range(first_b, last_b + 1):
            if is_in_ball(tree_a, tree_b, state, a, b):
                continue
            progress.compared += 1
            taken = add_elements(tree_a, tree_b, state, a, b, bound)
            if taken == NONE and make_room(state):
                taken = add_elements(tree_a, tree_b, state, a, b, bound)
            if taken == NONE:
                progress.least_cells = min(progress.least_cells, bound)
                if state.collected.shape[0] > 0:
                    collect(state, ~waiting.lanes[n, 0], ~waiting.lanes[n, 1], bound)
                taken = 1
            steps -= min(steps, taken)
    return steps


@inlined
def _elements(tree, lane):
    """Return the first and last element of a leaf; a lane ~e stands for the element e alone."""
    if lane < 0:
        return np.int64(~lane), np.int64(~lane)
    leaf = np.int64(tree.children[lane])
    return first_of(leaf), last_of(leaf)


@implements(stubs.compare, Dividing)
@inlined
def _compare(waiting, tree_a, tree_b, state, a, b):
    waiting.lanes[0, 0], waiting.lanes[0, 1], waiting.bounds[0] = ~a, ~b, -np.inf
    state.progress[0].waiting = 1


@implements(stubs.divide, Dividing)
@inlined
def _divide(waiting, tree_a, tree_b, state, steps):
    if not _has_to_divide(state.progress[0]):  # most searches compare whole elements only
        return _code(state, state.progress[0].least_cells), steps
    return divide_some(tree_a, tree_b, state, steps, 0)


@inlined
def _has_to_divide(progress):
    return progress.dividing > 0 and progress.distance - progress.slack > progress.stop


@lazy((SurfaceTree,), (SurfaceTree, MeshTree), Dividing, int64, int64, nothing=(CUT, 0))
def divide_some(tree_a, tree_b, state, steps, one):
    """Divide all waiting pairs, or as many as there are steps for; return as `stubs.divide` does.

    With ONE, divide one pair, or only make room for it; return CUT then, unless there is no room.
    """
    progress = state.progress[0]
    while _has_to_divide(progress):
        if steps == 0:
            return CUT, steps
        taken = divide_nearest(tree_a, tree_b, state)
        if taken == NONE:
            if not make_room(state):
                return _code(state, -np.inf), steps
            taken = 1 if one else ROOM_STEPS
        if one:
            return CUT, steps - min(steps, max(taken, 1))
        look_back(progress)
        steps -= min(steps, taken)
    return _code(state, progress.least_cells), steps


@inlined
def _code(state, least):
    """Return how a search ended; `least` is the least bound of the pairs that found no room.

    If the upper bound is within the absolute error, 0 will do as the lower bound: no distance is
    negative.
    """
    progress = state.progress[0]
    if progress.distance - progress.slack <= progress.stop or least >= progress.enough:
        return ENDED
    near = progress.distance + progress.slack <= progress.abs_err
    return ENDED if near and state.collected.shape[0] == 0 else CELLS_FULL


@implements(stubs.least_undivided, Dividing)
@inlined
def _least_undivided(waiting, progress):
    first = waiting.pairs[0].bound if progress.dividing > 0 else np.inf
    return min(first, progress.least_cells)


@inlined
def _has_stayed(tree_a, tree_b, state):
    """Return whether the models moved so little that the last nearest points are still near."""
    few = _SMALL * (tree_a.scale[2] + tree_b.scale[2])
    return remembers(state) and state.progress[0].step < few


@inlined
def _improve_guess(tree_a, tree_b, state, found):
    if not far_from_nearest(state.progress[0]):  # else the search itself begins with that
        _approach(tree_a, tree_b, state, _NEAR_STEPS, found)


@implements(stubs.guess, SurfaceTree, (SurfaceTree, MeshTree))
@kernel
def _guess(tree_a, tree_b, state):
    if _has_stayed(tree_a, tree_b, state):
        stubs.settle(state.waiting, tree_a, tree_b, state)  # near as before; they may have crossed
        return
    if begin_below(tree_a, tree_b, state, True):
        return
    # A surface may be hollow in its middle, as a ring is, so begin with the middle of b.
    found = on_stack(WIDTH, np.float32(0.0))
    middle = moved(state.motions[0], scaled(row(tree_b.centres, 0), tree_b.scale[0]))
    # Volumes around pieces of a surface are thin: their bounds guide better than their middles.
    a, from_a = begin_on(tree_a, walk(Point(middle, 0.0, 0.0, 0.0, 0.0), tree_a, found))
    q = moved(state.motions[1], stubs.witness(tree_a, a, from_a))
    b, from_b = begin_on(tree_b, walk(Point(q, 0.0, 0.0, 0.0, 0.0), tree_b, found))
    measure_near(tree_a, tree_b, state, a, from_a, b, from_b, 0)
    _improve_guess(tree_a, tree_b, state, found)


@_implements(stubs.approach)
@shared
def _approach(tree_a, tree_b, state, steps, found):
    progress, motions = state.progress[0], state.motions
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    slack = progress.bound_slack
    a, wa = progress.element_a, vector(progress.weights_a)
    b, wb = progress.element_b, vector(progress.weights_b)
    p = moved(motions[1], stubs.witness(tree_a, a, wa))
    b, wb = near(tree_b, p, b, wb, steps, slack, stack, bounds, found)
    q = moved(motions[0], stubs.witness(tree_b, b, wb))
    a, wa = near(tree_a, q, a, wa, steps, slack, stack, bounds, found)
    apart = norm(sub(q, stubs.witness(tree_a, a, wa)))
    if a != progress.element_a or b != progress.element_b or apart < progress.distance:
        measure_near(tree_a, tree_b, state, a, wa, b, wb, MOST)


@implements(near, SurfaceTree)
@kernel
def _near(tree, p, element, weights, steps, slack, stack, bounds, found):
    way = sub(stubs.witness(tree, element, weights), p)
    answer = norm(way), np.int64(element), weights[0], weights[1]
    query = Around(p, slack)
    answer, _, _ = descend(query, tree, answer, at_root(stack, bounds), stack, bounds, found, steps)
    return answer[1], (answer[2], answer[3], 0.0)


@implements(near, MeshTree)
@kernel
def _near_triangle(tree, p, element, weights, steps, slack, stack, bounds, found):
    distance, t, top = begin_nearest(tree, p, element, stack, bounds)
    _, t, _, _ = nearest(tree, p, distance, t, top, slack, 0.0, stack, bounds, found, steps)
    return begin_on(tree, t)


@_implements(stubs.sample)
@kernel
def _sample(tree_a, tree_b, state, a, b):
    pass
