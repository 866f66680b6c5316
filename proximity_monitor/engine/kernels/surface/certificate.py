"""A proof that nothing in two cells is nearer than the limit, where they hold the nearest points.

See `form.py`. Points of joints and of edges between triangles lie in several cells: each has its
own proof.
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
"""Steps of a search that a proof takes as long as."""

_FALLS = 1e-6
"""Share of the distance by which that has to fall beyond the end of an element to be looked for."""


def can_be_proven(tree, cells, index):
    """Whether a cell can be taken in such a proof: a stub."""


def find_in(tree, cells, index, element, weights):
    """Whether a cell holds a point of an element, perhaps of a neighbour: a stub.

    Returns also its weights on the cell's own element, and the point, metres, in its model's frame.
    """


def put_point(tree, cells, index, weights, side):
    """Write what a Side says of a point of a cell: a stub.

    Of a triangle, which parameters these are depends on the point.
    """


def put_ranges(tree, cells, nets, index, d, side):
    """Write what a Side says of a cell as a whole; d is n in its model's frame: a stub."""


@kernel
def is_done(tree_a, tree_b, state, a, b, slack):
    """Whether two cells that hold the nearest points found so far hold nothing that is nearer.

    Returns also whether they hold these points, as of other cells it is not known, and the steps
    that it took. `slack` is what their bound may err by.
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
        # They were found at the end of an element, and beyond it the distance falls further.
        measure_near(tree_a, tree_b, state, element_a, at_a, element_b, at_b, MOST)
        return False, True, PROOF_STEPS + MINIMUM_STEPS
    return False, True, PROOF_STEPS
