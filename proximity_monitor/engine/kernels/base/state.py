"""What a hierarchy and a search consist of, as the kernels see them."""

from __future__ import annotations

from collections import namedtuple

Tree = namedtuple("Tree", "nodes centres children sizes triangles scale")
"""A hierarchy as the kernels see it.

nodes (float32, flat) the volumes; centres (k, 4) each node's centre and reach in node units;
children (int32, k × 16) a node, a leaf or EMPTY (see leaf.py); sizes (float32, k × 16) each
volume's extent in node units; triangles (m, 9) in tree order, metres; scale (7,) metres in a node
unit, its inverse, the largest norm of a vertex in metres, 1 where the volumes are boxes, else 0,
how often it was refitted, the radius of the ball that sweeps the triangles, and how far they may
deviate from what they stand for, both in metres.
"""

SWEPT, DEVIATION = 5, 6
"""Of `Tree.scale`."""

State = namedtuple(
    "State",
    "motions reals counts stack bounds frames collected spread_a spread_b keys reaches",
)
"""A search. motions (2, 12): b to a, a to b; reals and counts by the indices below; stack (int32,
n × 2) the pairs of volumes still to be looked at, as lanes 16 node + lane, and their lower bounds
(n,) in metres; collected (n, 3) every pair that may hold the minimum, where they are asked for
(n > 0): two triangles and their distance, or ~lane, ~lane and a lower bound; spread_a and spread_b
(int32, k × 4) vertices of each node, as 3 triangle + corner, where the order needs them; keys
(int64) and reaches (n,), which pairs of lanes were too far, and how far the models will have moved
when they no longer are (see coherence.py).
"""

DISTANCE, SLACK, BOUND_SLACK, LIMIT, REL_ERR, ABS_ERR, STOP, UPPER_SLACK = 0, 1, 2, 3, 4, 5, 6, 7
"""Reals: smallest distance found; what rounding may have done to it, and to a moved volume; bound
from which a pair is pruned; the tolerances; distance at which the search may end; rounding of
the upper bound, 0 where triangles certainly cross. All metres."""
NORMAL_A, NORMAL_B, OFFSET = 8, 11, 14
"""Reals: the unit vector from the nearest point of a to that of b, in a's frame and in b's, and its
product with the translation from b to a (see aim.py)."""
ENOUGH, LEVEL_LOWER, NEXT_LOWER = 15, 16, 17
"""Reals: bound from which a pair cannot improve the answer by more than was asked for: LIMIT, but
where pairs are collected; the least bound of this level and what follows, and of the next."""
WEIGHTS_A, WEIGHTS_B, APPROACHED = 18, 21, 24
"""Reals: barycentric weights of the nearest points, three each; and the distance from which they
were last improved (see approach.py)."""
TRAVELLED, STEP, SHAPE_A, SHAPE_B, PROVEN = 25, 26, 27, 28, 29
"""Reals: how far the models have moved in all, and since the last search, metres; how often they
had been refitted; and the bound of all pairs that were opened last, metres, if none was left."""
RADII, DEVIATIONS, REALS = 30, 31, 32
"""Reals: both models' swept radii together, and both deviations, metres. Every other real is about
the models' triangles, the cores of what is swept: `finish` makes it one of the models."""

DEPTH, TRIANGLE_A, TRIANGLE_B, BOUND_TESTS, PRIMITIVE_TESTS, COLLECTED = 0, 1, 2, 3, 4, 5
ORDER, BASE, FRAMES = 6, 7, 8
"""Counts: pairs on the stack; the nearest triangles so far, in tree order; tests made; pairs
collected; the order; where the present queue begins, and how many wait below it."""
LEVEL_END, NEAREST_A, NEAREST_B, FULL, STEPS, COUNTS = 9, 10, 11, 12, 13, 14
"""Counts of a search level by level: where the present level ends; the nearest pair of the next;
how many pairs may be listed; and, of any search, how many steps this slice has left."""

LOWER, UPPER, POINT_A, POINT_B = 0, 1, 2, 5
FEATURE_A, FEATURE_B, TREE_A, TREE_B, TESTS, STATUS = 8, 12, 16, 17, 18, 20
RADIUS_A, RADIUS_B, ANSWER = 21, 22, 23
"""An answer, one row of float64: the certified bounds, metres; the nearest points of the triangles
in the world; for each its barycentric weights and then its face; the triangles in tree order; bound
tests and primitive tests made; one of the following; and the radii that sweep the triangles, by
which the points lie inside the models (see swept.py)."""

EXACT, WITHIN_TOLERANCE, OUT_OF_TIME, INTERSECTING = 0, 1, 2, 3
"""Why a search stopped, in the order of `result.Status`."""

DEPTH_FIRST, PRIORITY, BREADTH_FIRST = 0, 1, 2
"""Orders of a search."""

ENDED, CUT, BAD_POSE_A, BAD_POSE_B, COLLECTED_FULL, CUT_BETWEEN = 0, 1, 2, 3, 4, 5
"""What a slice of a search returns; the last, where it was over before the next search began."""

KEPT = 4
"""Vertices that are kept of a node."""
