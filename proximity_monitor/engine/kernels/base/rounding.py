"""The rounding constants that the engine shares: value, unit, reason.

Two unit roundoffs appear: u = 2^-53 for float64 (coordinates, triangles, poses) and
u32 = 2^-24 for float32 (the volumes of the hierarchy).
"""

from __future__ import annotations

DOUBLE_EPS = 2.0**-53
"""Unit roundoff u of float64."""

SINGLE_EPS = 2.0**-24
"""Unit roundoff u32 of float32."""

SINGLE_MARGIN = 64.0 * SINGLE_EPS
"""Slack of a float32 lower bound between two volumes, as a share of their coordinates M.

M is the sum of the lengths of both centres, all four half lengths and both radii, in the node's
frame. *Along the direction n between nearest points*: rounding the moved volume to float32
displaces it by at most 2 u32 M, and the difference of the centres errs by u32 M. The single
volume's axes are treated as a frame that preserves lengths, but are perpendicular units only to
3 u32 per entry: 8 u32 M. Rotating a lane into that frame errs by 3 u32 √3 < 6 u32 M. The inner
products of a support gap err by 4 u32 |n| M in any order of summation, and their sum by 4 u32 |n| M
more. The normalisation errs by 5 u32 M, the radii by 2 u32 M. Together 32 u32 M.

*Along a lane's normal w* there is no normalisation. But the rotated axes are longer than units by
up to 14 u32 each, so w by 28 u32 plus 4 u32 for its own rounding; and w is perpendicular to them
only to 4 u32. Together 59 u32 M. The margin must not be smaller. The reciprocal estimates that LLVM
may use under `arcp` affect only n, where the reserve is ample.
"""

CROSS_MARGIN = 128.0 * SINGLE_EPS
"""SINGLE_MARGIN for the case that all volumes of a node were moved in float32.

Errors in addition to those that SINGLE_MARGIN counts: rotating a centre or an axis errs by
4 u32 √3 < 7 u32 of its length (rounding the rotation, three products, two sums), scaling and
shifting by 3 u32: 10 u32 M. So the moved axes may be longer than units by 7 u32 each, and less
perpendicular by 14 u32. This raises the share of their frame from 8 to 29 u32 M, and that of a
normal from 32 to 60 u32 M. Together less than 120 u32 M.
"""

ALONG_MARGIN = 32.0 * SINGLE_EPS
"""Slack added to a node's float32 extent along a given direction, as a share of the node's reach.

The reach is how far the node's volumes reach from its centre: |c| plus both half lengths plus the
radius. For a centre, rounding the direction errs by √3 u32 |c| and the product by 3 u32 |c|; for
the axes the same, times their half lengths. The sums err by 4 u32 of the reach. The extents of two
nodes are compared with the distance that remains, a float32 that matters only up to the sum of both
reaches; this errs by as much again. Together less than 14 u32 of the reach. The slack of volumes
covers the error of the float64 direction.
"""

SINGLE_TINY = 1e-30
"""Floor, in squared node units, for the squared length that a direction is divided by.

It keeps the products far above float32's subnormals (1e-38). A smaller direction gives a gap that
is too small in magnitude. If positive, the gap is a weaker bound. If negative, it says nothing, but
is still a lower bound of any distance.
"""

SINGLE_LIMIT = 1e15
"""Largest coordinate, in node units, that enters the float32 kernel: squares stay below 1e38.

A volume that is farther away or larger is bounded by spheres in float64 instead.
"""

FILTER_LIMIT = 1e9
"""Largest coordinate, in the larger model's node units, of a triangle pair that the float32 filter
accepts: the square of a normal's length times that of a coordinate stays below 1e38."""

FILTER_MARGIN = 16.0 * SINGLE_EPS
"""Slack of a float32 gap between two triangles, as a share of their coordinates X.

Measure the corners from a corner of the first triangle. X is the sum of the largest corner norms of
both triangles. Rounding the corners errs by u32 X, the inner products with a direction n by
3 u32 |n| X, their difference by u32 |n| X. The length of n errs by 2.5 u32 and the division by
2 u32, relative to the gap, which is at most X. Subtracting the margin errs by u32 X. Together less
than 11 u32 X.
"""

POINT_MARGIN = 32.0 * DOUBLE_EPS
"""Largest error of a moved point, or of its distance to a triangle, as a share of S.

S = |relative translation| + the largest vertex norms of both models. The margin is for bounds that
need not be tight: those of volumes, single points and depths. A point moved by the float64 rotation
and translation between two poses errs by less than 11 u S (by 7 u S in the frame of a, see
MARGIN_A; the motion to the frame of b is rounded more often). Its distance to a triangle errs by
10 u S more.
"""

MARGIN_A, MARGIN_B, MARGIN_T = 10.0 * DOUBLE_EPS, 17.0 * DOUBLE_EPS, 12.0 * DOUBLE_EPS
"""Largest error of the distance of two triangles: MARGIN_A |a| + MARGIN_B |b| + MARGIN_T |t|.

|a| and |b| are the largest norms of the models' vertices in their own frames, t is the relative
translation, and distances are taken in the frame of a. All norms are Euclidean. Terms in u² and the
1e-6 of an imperfect rotation are left out; there is reserve for both.

*Moving b*: v' = R v + t. The vertices of a do not move. The entries of R and t are rounded once.
An entry of R errs by u |R_ij|, so R v errs by u ‖ |R| ‖ |v| <= 5/3 u |v| (norm of the absolute
values of a 3×3 rotation), and t by u |t|. In the inner products, each product is rounded:
5/3 u |v|. Two sums are rounded, R (v0, v1, 0) and R v; neither is longer than v: u |v| each.
Adding t rounds v' itself: u (|v| + |t|). Together 6.4 u |b| + 2 u |t|.

*Evaluating*: let M = |a| + |b| + |t|; no two points of the triangles are farther apart. Let x and y
be two points on edges, and g = (r + t e) - s d with r = q - p their difference. It errs by u times
|q - p| + 2 t |e| + |y - p| + 2 s |d| + |g|, as the edges are rounded, then multiplied, and the sums
are rounded. The length of g adds 2.5 u |g|; adding the margin, comparing with a square and lowering
the limit add 2.5 u |g|. At nearest points g is perpendicular to an edge, or turns away from it at
its end, so s |d| + t |e| <= 2 √(M² - g²). In all 2 M + 4 √(M² - g²) + 6 |g|, which is at most
(2 + √52) M = 9.3 M. Points that are not nearest exceed the distance by more than their error. The
same count holds for a point and a face, with |r| + 2 (v |e| + w |f|) + |r - w f| + |g|.

*Finding the nearest points*: rounding of s, t, v and w moves the points by δ < 30 u M along their
edges and face, which adds δ² / 2h to the distance h. This is negligible if h is above TOUCHING.
Otherwise the parameters are corrected by g. There only the evaluation errs (6 u M without the terms
of g's length), and rounding the parameters moves each point by u M: 8 M. The worst case is a corner
that touches a face at its rim. Its foot is taken to be outside by 5 u M (4 u M for the g of a
point, u M for the edges), so the corner is compared with the edge, which errs by 5 u M again: 10 M.

*Crossing* triangles have distance 0 if every sign says so and is certain. If a sign is in doubt
(`orientation`), a segment passes within 9 u M of an edge or a corner, in a direction in which all
other errors are at most 7 u M.

So vertices of a count 10 u, those of b 10 + 6.4 u, the translation 10 + 2 u, each rounded up.
"""

TOUCHING = 2.0**-78
"""Squared distance of two features, as a share of their squared lengths, below which they touch.

Above it, the distance is at least 2^-39 of the lengths, and a parameter error of 30 u changes the
distance by less than 0.1 u of the lengths. A larger value only costs time.
"""

PARALLEL = 2.0**-40
"""sin² of the angle below which the nearest points of touching edges are not corrected along them.

Below it, the error of the common normal changes the distance by 30 u sin(angle), which is
negligible. Above it, no correction is longer than 2^-39 / 2^-20 of the edges, so that the
correction adds no rounding error of its own.
"""

GAP_SHARE = 0.75
"""Largest error of two triangles' gap along a given direction, as a share of the distance margin.

Let n be the direction, no longer than a unit, and the other letters as for MARGIN_A. The inner
products with a's corners err by 3 u |a|. Rotating n into b's frame errs by 3 u √3 < 5.2 u, times
b's corners. The inner products with b's corners err by 3 u |b|, that with the translation by
3 u |t|. The motion, treated as exact, errs by 5/3 u |b| and u |t|; the two sums by u (|b| + |t|)
and u (|a| + |b| + |t|). Together 4 u |a| + 11.9 u |b| + 6 u |t|, at most 0.71 of each part of the
margin.
"""

TRAVEL_SHARE = 64.0 * DOUBLE_EPS
"""Share by which the travel of models is increased, and by which a bound kept with it is lowered.

It covers a sum with two roundings, one more rounding in a comparison, and the products, roots and
sums of a displacement, which err by less than 30 u of it. Where these cancel, they err by 20 u S
(see POINT_MARGIN), and the motions themselves by 11 u S each. The slacks of volumes before and
after the motion, 64 u S, cover both.
"""

OFFSET_MARGIN = 8.0 * DOUBLE_EPS
"""Share by which a bound is widened: of the cores' distance d, and of the R subtracted from it.

R is the sum of two radii and two deviations; its three roundings change it by less than 3 u R.
There are at most two differences, which err by u (d + R) each. Subtracting the margin errs by as
much. Together less than 4 u d + 7 u R.
"""

OFFSET_RESERVE = 32.0 * DOUBLE_EPS
"""Share by which a limit l and R are increased before they limit the cores' distance.

Let L = l + R. When the limit becomes a bound again, OFFSET_MARGIN subtracts at most
8 u (L + R) <= 16 u L, and the sum L errs by less than 4 u L.
"""

RIGID_TOLERANCE = 1e-6
"""Share by which a pose may change lengths: the precision of six-digit files and float32 messages.

The transposed rotation serves as the inverse, so within the tolerance the answer is the distance up
to this share. Beyond it the matrix scales, shears or is broken, and the caller gets an error.
"""

POSE_MARGIN = 8.0
"""Largest error of a volume moved by an imperfect rotation, as a multiple of |RᵀR - I| S.

Let E be the largest entry of |RᵀR - I| of a pose. The transpose of the relative rotation differs
from its inverse by 3 E for each pose (norm of a 3×3 matrix), so a moved point errs by 3.1 E S.
Lengths in b's frame, at most 2 S, differ from those in a's by 1.5 E of them. Together less than
8 E S for each pose.
"""

ILL_CONDITIONED = 1.0 / 16.0
"""sin² of the angle below which two edges' common normal is computed with twice the precision.

Above it, the plain cross product errs by less than 7 u of its length (√2 / sin + 1). Below it, this
error grows as 1/sin, and the closest points of nearly parallel edges would move by 1e-8 of their
length.
"""

POINT_FLOOR = 1e-45
"""Metres. Added to every margin: products of six lengths below it would underflow."""

LARGEST_COORDINATE = 1e45
"""Largest coordinate (m) of a vertex in its model, and of a model in the world; more is refused.

Lengths are then at most 8 √3 times as large, and products of six of them do not overflow.
"""

KNOT_INSERTION = 8.0 * DOUBLE_EPS
"""Largest error of a spline's Bezier point per degree, as a share of the sum of its terms.

A Bezier point is a sum of control points with coefficients c, which de Boor's scheme computes level
by level. A share of a knot span is the quotient of two differences and errs by 3 u. Its product and
the sum are rounded, so each level adds 5 u to a coefficient; no coefficient is negative. Then there
are degree + 1 products and sums: in all (6 degree + 1) u. The rest covers terms in u². For two
directions, one after the other, the shares e add up.

With weights w, the sum of c w |x| is at most P times the sum of c w, where P is the largest norm of
a control point x. So the first sum errs by e P and the second by e, both relative to the second.
Their quotient errs by 2 e P, whatever the weights are. Rounding w x adds u P. If the spline is
already a Bezier curve, the coefficients are 0 and 1, and nothing errs.
"""

NET_POINT = 384.0 * DOUBLE_EPS
"""Largest error of a point of a piece, as a share of the largest norm P of a control point.

The point is a mean of control points, weighted by Bernstein polynomials. For degrees p and q of at
most 15 these err by 3 (p + q) u of themselves. With sums of at most 16 and then 16 products, the
mean of w |x| and that of w err by 125 u each. So the quotient errs by 250 u P, whatever the weights
w are. Rounding the quotient and the products of three coordinates with w adds less than 8 u P.
"""

NET_SPLIT = 4.0 * DOUBLE_EPS
"""Largest error that subdivision adds to control points per degree, as a share of P.

Subdivision takes midpoints `degree` times over. Each is a sum, rounded once and halved, which errs
by u w P in w x and by u w in w. So each moves a projected point by 2 u P, a vector by less than
4 u P.
"""

RESOLUTION = 2.0**-40
"""Largest difference of the bounds of an exact answer about surfaces, as a share of both sizes.

The bound of a cell approaches the distance with each subdivision, but never equals it.
"""
