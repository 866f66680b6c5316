"""The records of a search, as the kernels see them: its state, its query and its answer.

A pair of volumes is given by two lanes, each numbered 16 node + lane. A pair is open until the
search has opened or pruned it. A pair of leaves waits until its elements (triangles, or pieces of
surfaces and curves) are compared. A ring is what an arc of a profile sweeps about its axis.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from .jit import inlined

DepthFirst = namedtuple("DepthFirst", "pairs bounds")
"""The open pairs of volumes (int32, n × 2), as lanes 16 node + lane, and their lower bounds (n,) in
metres. The last pair is taken next: it is the nearest of those from the latest opening."""

Priority = namedtuple("Priority", "pairs bounds frames")
"""The open pairs as queues, nearest first; frames (n,) where each queue below the present one
begins (see queue.py)."""

BreadthFirst = namedtuple("BreadthFirst", "pairs bounds spread_a spread_b")
"""The open pairs level by level (see levels.py); spread_a and spread_b (int32, k × 4) a few
vertices of each node, as 3 triangle + corner."""

State = namedtuple("State", "motions progress open waiting collected far")
"""The state of a search.

motions (2, 12): b to a, a to b; progress: one PROGRESS; open: one of the three types above, which
determines the order in which pairs are taken; waiting: the pairs of leaves whose elements are still
to be compared; collected (n, 3): if n > 0, every pair that may hold the minimum, as two triangles
and their distance, or as ~lane, ~lane and a lower bound; far (n,) FAR: pairs under which most was
too far (see coherence.py), of which the first `progress.far_slots` are in use; empty if each search
is independent of the one before.
"""


@inlined
def remembers(state):
    """Return whether a search may use what the search before found, as in a sequence of ticks."""
    return state.far.shape[0] > 0


Waiting = namedtuple("Waiting", "lanes bounds")
"""The waiting pairs of leaves: their lanes (int32, n × 2) and bounds (n,) in metres. They stay when
a slice ends, and their bounds count in the lower bound of the answer. Kinds of pairs whose elements
take many steps to compare have their own types for this, with the unfinished cells."""

Dividing = namedtuple(
    "Dividing", "lanes bounds pairs cells_a nets_a roots_a cells_b nets_b roots_b"
)
"""`Waiting` for elements that are divided until small enough (see `divide` in search/stubs.py).

pairs (n,) CELL_PAIR: a heap with the least bound first; and, from the end backwards, the pairs set
aside: those that may hold the minimum (if these are asked for) and are not divided any further.
For each model: cells (k,) CELL; nets (float64, flat) the control points of the cells; roots (int32)
the cell of each whole element, NONE if it has none. These three are empty for a model whose
elements are not divided. If the query is about two elements alone, lanes hold ~element.
"""

Turning = namedtuple(
    "Turning", (*Dividing._fields, "rings", "heap", "arcs_a", "arcs_b", "minima", "front")
)
"""`Dividing` for two solids of revolution, with these fields besides those for their patches:

rings (n,) RING: pairs of rings; heap (int32, n): the places of the open ones in `rings`; arcs_a and
arcs_b (k,) ARC: arcs finer than those of the tree, numbered on from the tree's arcs; minima (m,)
MINIMUM: the minima found last; front (2 f,) RING: in one half, the pairs of rings into which the
last search divided the whole (see revolution/front.py)."""

RING = np.dtype(
    [
        ("bound", np.float64),  # lower bound of their distance, metres
        ("angle", np.float64),  # the middle of a sector about b's axis, radians
        ("half", np.float64),  # half the sector's angle
        ("sector", np.float64, (4,)),  # cosine and sine of the middle, and of half the angle
        ("way", np.float64, (4,)),  # the direction along which the bound holds, as PROGRESS.along
        ("a", np.int32),  # the arcs
        ("b", np.int32),
    ],
    align=True,
)
"""A pair of rings: what an arc of a sweeps, and what an arc of b sweeps within a sector."""

MINIMUM = np.dtype(
    [
        ("distance", np.float64),
        ("s", np.float64),  # on a's piece
        ("t", np.float64),  # on b's
        ("angle", np.float64),  # about b's axis, radians
        ("curve_a", np.int32),
        ("curve_b", np.int32),
    ],
    align=True,
)
"""A local minimum of the distance between what two pieces of profiles sweep."""

FAR = np.dtype(
    [
        ("key", np.int64),  # of the pair of lanes; NO_KEY if the entry is empty
        ("reach", np.float64),  # bound of all but the kept lanes, plus `travelled` at that time (m)
        ("kept", np.int64),  # the lanes for which that bound does not hold: see search/coherence.py
        ("least", np.float64),  # bound of the kept lanes, plus `travelled` at that time (m)
    ],
    align=True,
)
"""A pair of lanes under which all or most was too far. A bound holds less the travel since then, so
`reach` and `least` are the total travel at which it becomes 0."""

NO_KEY = -1
SOME = -1
"""Value of `kept` in place of lanes: which lanes are near is unknown, or may soon change."""

CELL = np.dtype(
    [
        ("element", np.int32),
        ("child", np.int32),  # the first cell that it is divided into; NONE while it is undivided
        ("children", np.int32),  # how many cells it is divided into
        ("splits", np.int32),  # divisions in either direction that made it
        ("side", np.int32),  # what trimming loops leave of it: INSIDE, OUTSIDE or CROSSING
        ("low", np.float64, (2,)),  # its rectangle in the element's own parameters, 0 to 1
        ("high", np.float64, (2,)),
        ("centre", np.float64, (3,)),  # mean of its corners, metres
        ("along_u", np.float64, (3,)),  # from the centre to the middle of the side of largest u
        ("along_v", np.float64, (3,)),
        ("bend_u", np.float64),  # about how far it is from straight along u, metres
        ("bend_v", np.float64),
        ("twist", np.float64),  # about how far its corners are from a parallelogram's, metres
        ("margin", np.float64),  # rounding error of its control points, metres
        ("clip", np.float64, (3,)),  # trimming leaves at most the part with clip_0 s + clip_1 t <=
        # clip_2, where s and t run from 0 to 1 over the cell; all 0: nothing is known
    ],
    align=True,
)
"""A part of an element. Its control points are three rows (x, y, z) of `PIECE.room` numbers in
`nets`. For a rational piece, four rows of homogeneous coordinates (see PIECE) follow."""

CELL_PAIR = np.dtype(
    [
        ("bound", np.float64),  # lower bound of their distance, metres
        ("normal", np.float64, (3,)),  # the unit vector along which it was found, in a's frame
        ("a", np.int32),  # a cell; or an element of a model without cells
        ("b", np.int32),
    ],
    align=True,
)

QUERY = np.dtype(
    [
        ("bodies", np.int32, (2,)),
        ("poses", np.int32, (2,)),
        ("nearest", np.int32, (2,)),  # elements to start with, in tree order; or KEEP or UNKNOWN
        ("alone", np.int32),  # whether the query is about these two elements alone
        ("rel_err", np.float64),
        ("abs_err", np.float64),
        ("stop", np.float64),  # metres: a distance at which the search may end
        ("limit", np.float64),  # metres: pairs that are farther apart do not matter
        ("param_err", np.float64),  # largest length of a collected part, in parameters
    ],
    align=True,
)
"""A query about two bodies: which models and poses, and how accurately the distance is wanted."""

KEEP, UNKNOWN = -1, -2
"""Values in place of two elements to start with. KEEP: start with the elements that the state found
last. UNKNOWN: none are known."""

PROGRESS = np.dtype(
    [
        ("distance", np.float64),  # the smallest found
        ("slack", np.float64),  # rounding allowance of the distance
        ("upper_slack", np.float64),  # that of the upper bound; 0 if elements certainly cross
        ("bound_slack", np.float64),  # rounding allowance of a moved volume
        ("limit", np.float64),  # a pair is pruned if its bound is at least this
        ("enough", np.float64),  # a pair whose bound is at least this cannot improve the answer by
        # more than was asked for; equal to `limit` unless pairs are collected
        ("rel_err", np.float64),
        ("abs_err", np.float64),
        ("stop", np.float64),  # the distance at which the search may end
        ("param_err", np.float64),  # largest length of a collected part, in parameters
        ("volumes", np.bool_),  # whether pairs of volumes may be collected
        ("radii", np.float64),  # sum of both models' swept radii
        ("deviations", np.float64),  # sum of both deviations
        ("normal_a", np.float64, (3,)),  # unit vector from the nearest point of a to that of b,
        ("normal_b", np.float64, (3,)),  # in a's frame and in b's (see direction.py)
        ("offset", np.float64),  # its product with the translation from b to a
        ("weights_a", np.float64, (3,)),  # where the nearest points lie on their elements
        ("weights_b", np.float64, (3,)),
        ("approached", np.float64),  # the distance that `approach` last reached
        ("spent", np.int64),  # bound tests of all searches since the points were last renewed
        ("travelled", np.float64),  # how far the models have moved in all
        ("step", np.float64),  # how far they have moved since the last search
        ("shape_a", np.float64),  # how often the models had been refitted
        ("shape_b", np.float64),
        ("far_slots", np.int64),  # how many slots of `far` are in use, a power of two
        ("proven", np.float64),  # lower bound of all that was pruned under the pair opened last
        ("kept", np.int64),  # the lanes under that pair that were not pruned; or SOME
        ("least", np.float64),  # the least bound of these lanes
        ("level_lower", np.float64),  # the least bound of this level and all below it
        ("next_lower", np.float64),  # the least bound of the next level
        ("element_a", np.int64),  # the nearest elements, in tree order
        ("element_b", np.int64),
        ("bound_tests", np.int64),
        ("primitive_tests", np.int64),
        ("open", np.int64),  # how many pairs of volumes are open: the place of the next one
        ("put_off", np.int64),  # how many more wait for these to be dealt with (see stack.py), or
        # NONE if none is going to
        ("waiting", np.int64),  # how many pairs of leaves wait
        ("dividing", np.int64),  # how many pairs of cells are in the heap
        ("aside", np.int64),  # how many pairs of cells are set aside
        ("narrow", np.int64),  # whether the room for cells is short (see surface/room.py)
        ("narrow_divisions", np.int64),  # how many pairs of cells were divided while room was short
        ("next_check", np.int64),  # value of `narrow_divisions` at which `look_back` checks next
        ("dividing_before", np.int64),  # how many pairs were in the heap at the last check
        ("cells_a", np.int64),  # how many cells there are of either model
        ("cells_b", np.int64),
        ("least_cells", np.float64),  # the least bound of pairs that cannot be divided any more
        ("ball", np.float64, (6,)),  # for a surface and a mesh, in the mesh's frame: centre of an
        # empty ball; least distance from it to the element `leaning`, and to all other elements of
        # the surface; and the distance known when it was found (see mesh_in_ball.py)
        ("leaning", np.int64),  # the surface's element that the ball leans on
        ("support", np.float64),  # how far it reaches along the direction that was known then
        ("plane", np.float64, (4,)),  # for a surface and a mesh, in the mesh's frame: a unit vector
        # and the farthest that the surface reaches along it; infinity if no plane is known
        ("laid", np.float64),  # the distance known when a plane was last laid
        ("futile", np.int64),  # how often planes beside parts of the mesh proved little
        ("resting", np.int64),  # in how many next searches no plane is laid beside the whole mesh
        ("beside", np.int64),  # how many pairs of arcs and parts of a mesh wait beside a solid of
        # revolution (see pairs/revolution_core.py)
        ("compared", np.int64),  # pairs of elements that have been compared
        ("due", np.int64),  # value of `compared` at which an empty ball is looked for
        ("rings", np.int64),  # how many pairs of rings are open
        ("slots", np.int64),  # how many places of `rings` are in use or were
        ("arcs_a", np.int64),  # how many finer arcs follow those of a's tree, and of b's
        ("arcs_b", np.int64),
        ("minima", np.int64),  # how many minima have been found
        ("narrowed", np.int64),  # how often a pair of rings was made smaller before a proof held
        ("front", np.int64),  # how many pairs of rings the front has, 0 if there is none; and
        ("front_half", np.int64),  # in which half of its room they are
        ("recorded", np.int64),  # how many this search keeps for the next front; NONE: no front
        ("largest_front", np.int64),  # the most pairs with which a front is still used
        ("along", np.float64, (4,)),  # the unit vector (rho, z) in a half-plane of a from its
        # nearest point to that of b; and cosine and sine of the angle of this half-plane
        ("collected", np.int64),  # how many pairs are collected
        ("steps", np.int64),  # how many steps this slice has left
        ("base", np.int64),  # where the present queue or list begins
        ("frames", np.int64),  # how many queues wait below the present one
        ("full", np.int64),  # how many pairs a list may hold
        ("level_end", np.int64),  # where the present level ends
        ("nearest_a", np.int64),  # the nearest pair of the next level
        ("nearest_b", np.int64),
    ],
    align=True,
)
"""The progress of a search. All lengths are in metres. All distances and bounds are those of the
elements, which are the cores of swept models: `finish` converts them to those of the models."""

LOWER, UPPER, POINT_A, POINT_B = 0, 1, 2, 5
FEATURE_A, FEATURE_B, TREE_A, TREE_B, TESTS, STATUS = 8, 12, 16, 17, 18, 20
RADIUS_A, RADIUS_B, SURFACE_A, SURFACE_B, ANSWER = 21, 22, 23, 26, 29
"""Offsets in an answer, one row of float64 (a record of named fields would make a call of four
microseconds half a microsecond longer): the certified bounds, metres; the nearest points of the
triangles, in the world; for each point its barycentric weights and then its face; the triangles, in
tree order; bound tests and primitive tests made; the status; the radii that sweep the triangles, by
which the points lie inside the models (see swept.py). In an answer about a depth these radii are
-1, and the points on the models' surfaces follow, because a largest ball does not touch both
surfaces on one line."""

EXACT, WITHIN_TOLERANCE, OUT_OF_TIME, INTERSECTING = 0, 1, 2, 3
"""Status of an answer: why the search stopped, in the order of `result.Status`."""

ENDED, CUT, BAD_POSE_A, BAD_POSE_B, COLLECTED_FULL, CUT_BETWEEN, CELLS_FULL = 0, 1, 2, 3, 4, 5, 6
"""Codes that a slice of a search returns. CUT_BETWEEN: the slice ended before the next search
began. CELLS_FULL: there is no room for more cells, so the search ends with the bounds it has."""

KEPT = 4
"""How many vertices a search by levels keeps of each node."""
