"""What a kind of pair has to say for itself: stubs that the search calls and `pairs` implements.

A tree is of a type of its own for each kind of model. Numba sees from the types of two trees, when
it compiles, which implementation is meant: so all else of the search is shared, and nothing is
asked while it runs. A kind of pair implements each of these once, in the order in which its entry
takes models of unlike kinds (see pairs/entries.py).
"""

from __future__ import annotations


def slacks(tree_a, tree_b, apart, error):
    """What rounding may do to a distance, and to a volume that was moved, metres.

    The distance is that of two elements, or of two points of theirs as `witness` returns them.

    The models' origins are `apart` metres apart, and `error` is how far the poses are from rigid.
    """


def lane_bounds(fixed, tree, lane, motion, node, slack, reach, inherited, scratch):
    """Bound one lane of the tree `fixed` against the sixteen of a node of `tree`.

    Writes sixteen lower bounds in the units of `tree` to scratch.found; those of empty lanes are
    beyond every distance, and bounds above `reach` need not be tight. `motion` moves `fixed` into
    the frame of `tree`, and errs by `slack` metres. Returns a lower bound of all pairs, metres:
    `inherited` is one.
    """


def cross_leaves(tree, fixed, node, lane, motion, flip, state, inherited, limit, scratch, n):
    """Append to state.waiting the pairs of leaves of two lowest nodes that may be below `limit`.

    One is of the node `node` of `tree`, the other of that under `lane` of `fixed`; `motion` moves
    the former into the latter's frame, `flip` says that `tree` is b. `inherited` is a bound of all
    pairs; where none is left, PROVEN is as good a one or better. Returns how many pairs are waiting
    then, of n before; or -1 to have them opened one by one.
    """


def measure(tree_a, tree_b, state, a, b, bound):
    """Find the distance of two elements, metres, and keep their points where they are nearest.

    Of elements that are divided, that of two points that are near each other. `bound` is a lower
    bound of it: where it is positive, they certainly do not cross.
    """


def resolve(tree_a, tree_b, state, n, steps, scratch):
    """Compare the elements of some of the last of n waiting pairs of leaves.

    Those that are near enough to matter are measured, and collected where that is asked for.
    Returns how many pairs wait, and how many steps are left: of either, or both, fewer than before.
    """


def guess(tree_a, tree_b, state):
    """Measure two elements that may well be near each other, where none are known and it is cheap.

    They are kept where they are nearer than those found so far.
    """


def approach(tree_a, tree_b, state, steps, found):
    """Measure the element of b nearest to the nearest point of a, then one of a in the same way.

    Each is looked for in so many steps at most; `found` is room for sixteen float32.
    """


def sample(tree_a, tree_b, state, a, b):
    """Keep the nearest two of a few points of two volumes, where nothing nearer is known.

    Their distance errs by no more than what `slacks` says. Only a search by levels asks for this.
    """


def witness(tree, element, weights):
    """The point of an element that `weights`, three numbers, tell of; metres, the tree's frame."""


def parameters(tree, element, weights):
    """What an answer says of where these weights are: three numbers, as `Feature.parameters`."""


# What differs by whether elements are divided, and so by the type of what waits.


def resolution(waiting, tree_a, tree_b, slack):
    """Metres by which the upper bound of an exact answer may exceed the bounds that prune.

    0 where elements are measured as a whole. `slack` is what rounding may do to a distance.
    """


def prepare(waiting, tree_a, tree_b, state):
    """Make what waits in a state ready for another search."""


def settle(waiting, tree_a, tree_b, state):
    """Move the nearest points, those of the search before, to where they are nearest now.

    Where elements are measured as a whole that is found out soon enough, but for searches with a
    tolerance: see `approach.renew`.
    """


def compare(waiting, tree_a, tree_b, state, a, b):
    """Take up two elements, whose nearest points are asked for alone; they have been measured."""


def divide(waiting, tree_a, tree_b, state, steps):
    """Compare the parts of elements that are divided, when all other pairs are dealt with.

    Where all that may be nearest is collected, these pairs stay.
    Returns ENDED, CUT or CELLS_FULL, and how many of the steps are left.
    """


def look_ahead(waiting, tree_a, tree_b, state):
    """Find out, where a search is not a short one, what dismisses many pairs of volumes together.

    Returns the steps that it took; 0 in most calls.
    """


def open_whole(waiting, tree_a, tree_b, state, a, b, bound, scratch):
    """Open a pair of a model as a whole and a volume of the other, where there is a way of its own.

    The pairs that survive are open then. Returns whether the pair is dealt with, and the steps that
    it took.
    """


def least_undivided(waiting, progress):
    """The least bound of all pairs of parts that wait, or could not be compared, metres."""


# How a search keeps the pairs of volumes that are open: each order implements these.


def push(open_pairs, state, first, top, a, b, bound):
    """Add a pair of lanes to the open ones, of which there are `top`.

    Those from `first` on came from the same opening.
    """


def take(open_pairs, tree_a, tree_b, state):
    """Take the next pair; returns its place, or -1 where it is pruned."""


def least_open(open_pairs, state):
    """The least bound of all pairs that are open, metres; infinity where none is."""
