"""What a search consists of, what it is asked and what it answers, as the kernels see it."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from .jit import inlined

DepthFirst = namedtuple("DepthFirst", "pairs bounds")
"""The pairs of volumes still to be looked at (int32, n × 2), as lanes 16 node + lane, and their
lower bounds (n,) in metres. The next is the last one: of those opened together the nearest."""

Priority = namedtuple("Priority", "pairs bounds frames")
"""The same as queues, the nearest first; frames (n,) where those begin that wait (see queue.py)."""

BreadthFirst = namedtuple("BreadthFirst", "pairs bounds spread_a spread_b")
"""The same level by level (see levels.py); spread_a and spread_b (int32, k × 4) vertices of each
node, as 3 triangle + corner."""

State = namedtuple("State", "motions progress open waiting collected far")
"""A search. motions (2, 12): b to a, a to b; progress, a PROGRESS; open, of one of the three types
above, which says in which order pairs are taken; waiting, the pairs of leaves whose
elements are still to be compared; collected (n, 3) every pair that may hold the minimum, where they
are asked for (n > 0): two triangles and their distance, or ~lane, ~lane and a lower bound; far
(n,) FAR, what was too far (see coherence.py), nothing where searches do not follow one another.
"""


@inlined
def remembers(state):
    """Whether a search may use what the one before found: they follow one another."""
    return state.far.shape[0] > 0


Waiting = namedtuple("Waiting", "lanes bounds")
"""Pairs of leaves: their lanes (int32, n × 2) and bounds (n,) metres. They stay where a slice ends,
and their bounds count in `lower`. A kind whose elements take many steps to compare has its own type
for this, with the unfinished cells of a pair beside their bounds."""

Dividing = namedtuple(
    "Dividing", "lanes bounds pairs cells_a nets_a roots_a cells_b nets_b roots_b"
)
"""The same, where elements are divided until they are small enough (see search/stubs.py, `divide`).

pairs (n,) CELL_PAIR, a heap with the least bound first, and from the end backwards the pairs that
are set aside: they may hold the minimum, where these are asked for, and are not divided any
further; of either model cells (k,) CELL, nets
(float64, flat) the control points of each, and roots (int32) the cell of each whole element, NONE
where it has none. A model whose elements are not divided has none of the three. Of two elements
that are asked about alone, lanes hold ~element.
"""

Turning = namedtuple(
    "Turning", (*Dividing._fields, "rings", "heap", "arcs_a", "arcs_b", "minima", "front")
)
"""The same for two solids of revolution: besides what their patches need, rings (n,) RING, where
those that are open have their places in the heap (int32, n); arcs (k,) ARC that are finer than
those of either tree, in whose order they follow; minima (m,) MINIMUM found last; and front (2 f,)
RING, what the last search parted all into, in one half (see revolution/front.py)."""

RING = np.dtype(
    [
        ("bound", np.float64),  # of their distance, metres
        ("angle", np.float64),  # the middle of a sector about b's axis, radians
        ("half", np.float64),  # half its angle
        ("sector", np.float64, (4,)),  # cosine and sine of the middle, and of half its angle
        ("way", np.float64, (4,)),  # the direction that the bound is along, as `PROGRESS.along`
        ("a", np.int32),  # the arcs
        ("b", np.int32),
    ],
    align=True,
)
"""What an arc of a sweeps, and what one of b sweeps in a sector."""

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
"""A local minimum of the distance of two pieces of profiles that turn."""

FAR = np.dtype(
    [
        ("key", np.int64),  # of a pair of lanes; NO_KEY where there is none
        ("reach", np.float64),  # how far the models will have moved when it no longer holds, metres
        ("kept", np.int64),  # the lanes of which it does not: see search/coherence.py
        ("least", np.float64),  # how far they will have moved when those may meet, metres
    ],
    align=True,
)
"""A pair of lanes under which most was too far, or all."""

NO_KEY = -1
SOME = -1
"""Instead of lanes: some of them, and which they are will soon be another question."""

CELL = np.dtype(
    [
        ("element", np.int32),
        ("child", np.int32),  # the first of those that it is divided into, NONE before
        ("children", np.int32),  # how many they are
        ("splits", np.int32),  # divisions in either direction that made it
        ("side", np.int32),  # what trimming loops leave of it: INSIDE, OUTSIDE or CROSSING
        ("low", np.float64, (2,)),  # its rectangle in the element's own parameters, 0 to 1
        ("high", np.float64, (2,)),
        ("centre", np.float64, (3,)),  # mean of its corners, metres
        ("along_u", np.float64, (3,)),  # from there to the middle of the side where u is largest
        ("along_v", np.float64, (3,)),
        ("bend_u", np.float64),  # about how far it is from straight along u, metres
        ("bend_v", np.float64),
        ("twist", np.float64),  # ... and its corners from a parallelogram's
        ("margin", np.float64),  # what rounding may have done to its control points
        ("clip", np.float64, (3,)),  # no more of it is left than where clip_0 s + clip_1 t <=
        # clip_2, s and t being 0 to 1 over it; all 0: nothing is known
    ],
    align=True,
)
"""A part of an element. Its control points are three rows (x, y, z) of `PIECE.room` numbers in
`nets`; of a rational piece, four rows of homogeneous ones (see PIECE) follow."""

CELL_PAIR = np.dtype(
    [
        ("bound", np.float64),  # of their distance, metres
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
        ("nearest", np.int32, (2,)),  # elements to begin with, in tree order; both KEEP or UNKNOWN
        ("alone", np.int32),  # whether these two elements alone are asked about
        ("rel_err", np.float64),
        ("abs_err", np.float64),
        ("stop", np.float64),  # metres: a distance at which the search may end
        ("limit", np.float64),  # metres: nothing is asked about what is farther
        ("param_err", np.float64),  # how long in its parameters a part that is collected may be
    ],
    align=True,
)
"""What is asked about two bodies: which models and poses, and how well the distance is wanted."""

KEEP, UNKNOWN = -1, -2
"""Instead of two elements to begin with: those that the state found last; whichever are near."""

PROGRESS = np.dtype(
    [
        ("distance", np.float64),  # the smallest found
        ("slack", np.float64),  # what rounding may have done to it
        ("upper_slack", np.float64),  # the same of the upper bound; 0 where elements surely cross
        ("bound_slack", np.float64),  # what rounding may have done to a moved volume
        ("limit", np.float64),  # the bound from which a pair is pruned
        ("enough", np.float64),  # the bound from which a pair cannot improve the answer by more
        # than was asked for: `limit`, but where pairs are collected
        ("rel_err", np.float64),
        ("abs_err", np.float64),
        ("stop", np.float64),  # the distance at which the search may end
        ("param_err", np.float64),  # parts of elements that are collected are no longer than that
        ("volumes", np.bool_),  # whether pairs of volumes may be collected
        ("radii", np.float64),  # both models' swept radii together
        ("deviations", np.float64),  # both deviations
        ("normal_a", np.float64, (3,)),  # unit vector from the nearest point of a to that of b,
        ("normal_b", np.float64, (3,)),  # in a's frame and in b's (see direction.py)
        ("offset", np.float64),  # its product with the translation from b to a
        ("weights_a", np.float64, (3,)),  # where the nearest points lie on their elements
        ("weights_b", np.float64, (3,)),
        ("approached", np.float64),  # the distance from which they were last improved
        ("patience", np.int64),  # bound tests after which that is tried again
        ("spent", np.int64),  # bound tests of all searches since they were last renewed
        ("travelled", np.float64),  # how far the models have moved in all
        ("step", np.float64),  # ... and since the last search
        ("shape_a", np.float64),  # how often the models had been refitted
        ("shape_b", np.float64),
        ("proven", np.float64),  # bound of what was pruned below the pair opened last
        ("kept", np.int64),  # the lanes of it that were not; or SOME
        ("least", np.float64),  # the least bound of these
        ("level_lower", np.float64),  # the least bound of this level and what follows
        ("next_lower", np.float64),  # ... and of the next level
        ("element_a", np.int64),  # the nearest elements, in tree order
        ("element_b", np.int64),
        ("bound_tests", np.int64),
        ("primitive_tests", np.int64),
        ("open", np.int64),  # how many pairs of volumes are open: where the next stands
        ("waiting", np.int64),  # how many pairs of leaves wait
        ("dividing", np.int64),  # how many pairs of cells
        ("aside", np.int64),  # how many besides are set aside
        ("narrow", np.int64),  # whether the room for cells is short (see surface/room.py)
        ("lasts", np.int64),  # how many pairs of cells have been divided meanwhile
        ("review", np.int64),  # ... when it is next looked back at
        ("crowd", np.int64),  # how many pairs of cells there were when it was looked back at last
        ("cells_a", np.int64),  # how many cells there are of either model
        ("cells_b", np.int64),
        ("least_cells", np.float64),  # the least bound of pairs that cannot be divided any more
        ("ball", np.float64, (6,)),  # of a surface and a mesh, in the mesh's frame: the centre of a
        # ball, how near one element of the surface is to that at least, and how near all others,
        # and the distance that was known then (see mesh_in_ball.py)
        ("leaning", np.int64),  # that element
        ("support", np.float64),  # how far it reaches along the direction that was known then
        ("plane", np.float64, (4,)),  # of a surface and a mesh, in the mesh's frame: a unit vector,
        # and how far along it the surface ends at the most; infinity where no plane is known
        ("laid", np.float64),  # the distance that was known when one was laid last
        ("futile", np.int64),  # how often planes beside parts of the mesh told little
        ("resting", np.int64),  # for how many searches from now on none is laid beside all of it
        ("compared", np.int64),  # pairs of elements that have been compared
        ("due", np.int64),  # ... until a ball is looked for
        ("rings", np.int64),  # how many pairs of rings are open
        ("slots", np.int64),  # how many there have been room for
        ("arcs_a", np.int64),  # how many arcs there are besides a's tree, and b's
        ("arcs_b", np.int64),
        ("minima", np.int64),  # how many minima have been found
        ("narrowed", np.int64),  # how often a pair of rings was made smaller until one was proven
        ("front", np.int64),  # how many pairs of rings the front has, 0 where there is none; and
        ("front_half", np.int64),  # in which half of its room they are
        ("parted", np.int64),  # how many the present search has for the next; NONE where not all
        ("grown", np.int64),  # how many of them are too many
        ("along", np.float64, (4,)),  # the unit vector (rho, z) of a's half-plane from its nearest
        # point to that of b, and which half-plane that is: cosine and sine
        ("collected", np.int64),  # how many are collected
        ("steps", np.int64),  # what this slice has left
        ("base", np.int64),  # where the present queue or list begins
        ("frames", np.int64),  # how many queues wait below it
        ("full", np.int64),  # how many pairs a list may hold
        ("level_end", np.int64),  # where the present level ends
        ("nearest_a", np.int64),  # the nearest pair of the next level
        ("nearest_b", np.int64),
    ],
    align=True,
)
"""How far a search is. All lengths are in metres, and about the models' elements, the cores of what
is swept: `finish` makes them such of the models."""

LOWER, UPPER, POINT_A, POINT_B = 0, 1, 2, 5
FEATURE_A, FEATURE_B, TREE_A, TREE_B, TESTS, STATUS = 8, 12, 16, 17, 18, 20
RADIUS_A, RADIUS_B, SURFACE_A, SURFACE_B, ANSWER = 21, 22, 23, 26, 29
"""An answer, one row of float64 (with a record of named fields a call would take half a
microsecond longer, of four): the certified bounds, metres; the nearest points of the triangles
in the world; for each its barycentric weights and then its face; the triangles in tree order; bound
tests and primitive tests made; one of the following; and the radii that sweep the triangles, by
which the points lie inside the models (see swept.py). Of a depth these are -1, and what follows
are the points of the models' surfaces, as a largest ball does not touch both on one line."""

EXACT, WITHIN_TOLERANCE, OUT_OF_TIME, INTERSECTING = 0, 1, 2, 3
"""Why a search stopped, in the order of `result.Status`."""

ENDED, CUT, BAD_POSE_A, BAD_POSE_B, COLLECTED_FULL, CUT_BETWEEN, CELLS_FULL = 0, 1, 2, 3, 4, 5, 6
"""What a slice of a search returns: CUT_BETWEEN where it was over before the next search began;
CELLS_FULL where there is no room for more cells, so that the search ends with the bounds it has."""

KEPT = 4
"""Vertices that are kept of a node."""
