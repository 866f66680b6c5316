"""A proof that the two cells with the nearest points found hold nothing nearer than the limit.

See `form.py`. A point on a joint, or on an edge between triangles, lies in several cells: each pair
of them needs its own proof.
"""

from __future__ import annotations

from ..base.jit import kernel
from ..base.memory import table_on_stack
from ..base.vectors import moved, norm, sub, turned_back
from .facing import vector
from .form import SIDE, direction, falls_by, surpasses
from .measure import MINIMUM_STEPS, measure_near
from .newton import MOST
from .sides import element_of

PROOF_STEPS = 4
"""A proof takes as long as this many steps of a search."""

_FALLS = 1e-6
"""If the distance falls by this share of itself beyond an element's end, a search begins there."""


def can_be_proven(tree, cells, index):
    """Tell whether a cell can take part in such a proof: a stub."""


def find_in(tree, cells, index, element, weights):
    """Find a point of an element, perhaps of a neighbouring element, in a cell: a stub.

    Returns whether the cell holds it, its weights on the cell's own element, and the point, metres,
    in its model's frame.
    """


def put_point(tree, cells, index, weights, side):
    """Write the entries of a Side that are about one point of a cell: a stub.

    For a triangle, the choice of its two parameters depends on the point.
    """


def put_ranges(tree, cells, nets, index, d, side):
    """Write the entries of a Side about a whole cell; d is n in its model's frame: a stub."""


@kernel
def is_done(tree_a, tree_b, state, a, b, slack):
    """Prove that two cells which hold the nearest points found so far hold nothing nearer.

    Returns whether that is proven, whether the cells hold these points (there is no proof for other
    cells), and the steps it took. `slack` is the error of the pair's bound, metres.
    """
    progress, waiting, motion = state.progress[0], state.waiting, state.motions[0]
    if not (
        progress.distance > progress.slack
        and can_be_proven(tree_a, waiting.cells_a, a)
        and can_be_proven(tree_b, waiting.cells_b, b)
    ):
        return False, False, 0
    at_a, at_b = vector(progress.weights_a), vector(progress.weights_b)
    found, at_a, p = find_in(tree_a, waiting.cells_a, a, progress.element_a, at_a)
    if not found:
        return False, False, 0
    found, at_b, q = find_in(tree_b, waiting.cells_b, b, progress.element_b, at_b)
    if not found:
        return False, False, 0
    way = sub(moved(motion, q), p)
    distance = norm(way)
    if not distance - slack > progress.enough:
        return False, True, 1
    sides = table_on_stack(2, SIDE, 0.0)
    put_point(tree_a, waiting.cells_a, a, at_a, sides[0])
    put_point(tree_b, waiting.cells_b, b, at_b, sides[1])
    n = direction(sides, motion, way, distance, progress.slack)
    put_ranges(tree_a, waiting.cells_a, waiting.nets_a, a, n, sides[0])
    put_ranges(tree_b, waiting.cells_b, waiting.nets_b, b, turned_back(motion, n), sides[1])
    limit = progress.enough + slack
    element_a = element_of(tree_a, waiting.cells_a, a)
    element_b = element_of(tree_b, waiting.cells_b, b)
    other = element_a != progress.element_a or element_b != progress.element_b
    if surpasses(sides, n, motion, way, distance, progress.slack, limit):
        return True, True, PROOF_STEPS
    if other and falls_by(sides, n, motion) < -_FALLS * distance:
        # The points are at the end of an element, and the distance falls further beyond it.
        measure_near(tree_a, tree_b, state, element_a, at_a, element_b, at_b, MOST)
        return False, True, PROOF_STEPS + MINIMUM_STEPS
    return False, True, PROOF_STEPS
