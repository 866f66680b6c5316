"""The parts of a search that depend on the kind of pair: stubs that `pairs` implements.

Each kind of model has its own tree type. When numba compiles, it chooses the implementation by the
types of the two trees. So all kinds share the rest of the search, and the choice costs nothing at
run time. A kind of pair implements each stub once, for the order in which its entry takes models of
different kinds (see pairs/entries.py).
"""

from __future__ import annotations


def slacks(tree_a, tree_b, apart, error):
    """Return the rounding allowances (m) of a distance, and of a volume that was moved.

    The distance is that of two elements, or of two of their points as `witness` returns them. The
    models' origins are `apart` metres apart. `error` is the sum of both poses' `deviation`.
    """


def lane_bounds(fixed, tree, lane, motions, node, slack, reach, inherited, scratch):
    """Bound one lane of the tree `fixed` against the sixteen of a node of `tree`.

    Writes sixteen lower bounds, in the units of `tree`, to scratch.found. Those of empty lanes are
    beyond every distance, and bounds above `reach` need not be tight. The first of the
    two `motions` moves `fixed` into the frame of `tree`, the second moves it back; they err by
    `slack` metres. `inherited` is a lower bound of all pairs;
    returns one that is as good or better, metres.
    """


def cross_leaves(tree, fixed, node, lane, motion, flip, state, inherited, limit, scratch, n):
    """Append to state.waiting the pairs of leaves of two lowest nodes that may be below `limit`.

    One lowest node is `node` of `tree`, the other is the node under `lane` of `fixed`. `motion`
    moves `tree` into the frame of `fixed`. `flip` says that `tree` is b. `inherited` is a lower
    bound of all pairs. If no pair is left, `progress.proven` becomes a bound that is as good or
    better. Returns how many pairs wait now (n waited before), or -1 if the caller must open the
    lanes one by one.
    """


def measure(tree_a, tree_b, state, a, b, bound):
    """Find the distance (m) of two elements, and keep their nearest points if they are the nearest.

    For elements that are divided, take the distance of two points that are near each other. `bound`
    is a lower bound of the distance. If it is positive, the elements certainly do not cross.
    """


def resolve(tree_a, tree_b, state, n, steps, scratch):
    """Compare the elements of some of the last of n waiting pairs of leaves.

    Measure the elements that are near enough to matter, and collect them if that is asked for.
    Returns how many pairs wait and how many steps are left; at least one of these is lower than
    before.
    """


def guess(tree_a, tree_b, state):
    """Guess two elements that are probably near each other, if that is cheap, and measure them.

    Keep them if they are nearer than those found so far.
    """


def approach(tree_a, tree_b, state, steps, found):
    """Measure the element of b nearest to the nearest point of a, then one of a in the same way.

    Look for each in at most `steps` steps. `found` is scratch for sixteen float32.
    """


def sample(tree_a, tree_b, state, a, b):
    """Measure a few points of two volumes, and keep the nearest two if nothing nearer is known.

    Their distance errs by no more than `slacks` returns. Only a search by levels calls this.
    """


def witness(tree, element, weights):
    """Return the point of an element given by `weights` (three numbers); metres, tree's frame."""


def parameters(tree, element, weights):
    """Return three numbers for an answer that locate the weights, as `Feature.parameters`."""


# These depend on whether elements are divided, and so on the type of `State.waiting`.


def resolution(waiting, tree_a, tree_b, slack):
    """Return by how many metres the upper bound of an exact answer may exceed the pruning bounds.

    This is 0 if elements are measured as a whole. `slack` is the rounding allowance of a distance.
    """


def prepare(waiting, tree_a, tree_b, state):
    """Make `state.waiting` ready for another search."""


def settle(waiting, tree_a, tree_b, state):
    """Move the nearest points of the search before to where the elements are nearest now.

    If elements are measured as a whole, the search finds these points soon enough.
    """


def compare(waiting, tree_a, tree_b, state, a, b):
    """Take up the only two elements that the query is about; they have been measured already."""


def divide(waiting, tree_a, tree_b, state, steps):
    """Compare the parts of elements that are divided, after all other pairs are dealt with.

    If everything that may be nearest is collected, these pairs stay.
    Returns ENDED, CUT or CELLS_FULL, and how many of the steps are left.
    """


def look_ahead(waiting, tree_a, tree_b, state):
    """Look for something that dismisses many pairs of volumes at once, unless the search is short.

    Returns the steps that it took; 0 in most calls.
    """


def open_whole(waiting, tree_a, tree_b, state, a, b, bound, scratch):
    """Open a pair of a whole model and a volume of the other, if its kind has a special way.

    Surviving pairs become open. Returns whether the pair is dealt with, and the steps that it took.
    """


def least_undivided(waiting, progress):
    """Return the least bound (m) of all pairs of parts that wait or could not be compared."""


# Each order of the search implements these: they keep the open pairs of volumes.


def push(open_pairs, state, first, top, a, b, bound):
    """Add a pair of lanes to the `top` open pairs; pairs from `first` on are of the same opening.

    `bound` (m) is the lower bound of the pair.
    """


def take(open_pairs, tree_a, tree_b, state):
    """Take the next pair; return its place, or -1 if it is pruned."""


def least_open(open_pairs, state):
    """Return the least bound (m) of all open pairs; infinity if none is open."""
