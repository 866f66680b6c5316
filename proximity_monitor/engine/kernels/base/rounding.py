"""Every constant of the engine that is a matter of rounding: value, unit, reason.

Two unit roundoffs appear: u = 2^-53 of float64 (coordinates, triangles, poses) and
u32 = 2^-24 of float32 (the volumes of the hierarchy).
"""

from __future__ import annotations

DOUBLE_EPS = 2.0**-53
"""Unit roundoff u of float64."""

SINGLE_EPS = 2.0**-24
"""Unit roundoff u32 of float32."""

SINGLE_MARGIN = 64.0 * SINGLE_EPS
"""What a float32 bound between two volumes is lowered by, as a share of their coordinates.

With M the sum of the lengths of both centres, all four half lengths and both radii, in the node's
own frame, along the direction n between nearest points: rounding the moved volume to float32
displaces it by at most 2 u32 M, the difference of the centres errs by u32 M; the single volume's
axes, perpendicular units but for 3 u32 an entry, are taken for a frame that keeps lengths (8 u32
M); turning a lane into it errs by 3 u32 √3 < 6 u32 M; the inner products of a support gap err by
4 u32 |n| M in any order of summation, their sum by 4 u32 |n| M more; the normalisation by 5 u32 M;
the radii by 2 u32 M. Together 32 u32 M. Along a lane's normal w there is no normalisation, but the
turned axes are longer than units by up to 14 u32 each, so w by 28 u32 and its own rounding 4 u32,
and it is perpendicular to them but for 4 u32: together 59 u32 M. Below that this count no longer
covers it; the reciprocal estimates that LLVM may use under `arcp` concern n alone, where there is
ample reserve.
"""

CROSS_MARGIN = 128.0 * SINGLE_EPS
"""The same where a whole node's volumes were moved in float32.

Beside what SINGLE_MARGIN counts: turning a centre or an axis errs by 4 u32 √3 < 7 u32 of its
length (rounding the rotation, three products, two sums), scaling and shifting by 3 u32: 10 u32 M.
The moved axes may so be longer than units by 7 u32 each, and less perpendicular by 14 u32, which
takes their frame's share from 8 to 29 u32 M and a normal's from 32 to 60 u32 M. Together less than
120 u32 M.
"""

ALONG_MARGIN = 32.0 * SINGLE_EPS
"""What a node's float32 extent along a given direction is increased by, as a share of its reach.

The reach is that of the node's volumes from its centre: |c|, both half lengths and the radius
together. Rounding the direction errs by √3 u32 |c| for a centre, its product by 3 u32 |c|; the
same for the axes, times their half lengths; the sums err by 4 u32 of the reach; comparing two
nodes' with what is left, a float32 that matters only up to both reaches, by as much again. Together
less than 14 u32 of the reach. What the direction in float64 errs by, the slack of volumes covers.
"""

SINGLE_TINY = 1e-30
"""Floor, in squared node units, under which a direction's length is not divided by.

The products stay far above float32's subnormals (1e-38). A smaller direction gives a gap too small
in magnitude, which is a weaker bound where it is positive and meaningless (below zero, hence true
of any distance) where it is negative.
"""

SINGLE_LIMIT = 1e15
"""Largest coordinate, in node units, that enters the float32 kernel: squares stay below 1e38.

A volume farther away, or larger, than that is bounded by spheres in float64 instead.
"""

FILTER_LIMIT = 1e9
"""Largest coordinate of a triangle pair, in the larger model's node units, that is filtered in
float32: a normal's length squared, times a coordinate squared, stays below 1e38."""

FILTER_MARGIN = 16.0 * SINGLE_EPS
"""What a float32 gap between two triangles is lowered by, as a share of their coordinates.

Let X be the largest norm of either's corners, seen from a corner of the first, and summed. Rounding
the corners errs by u32 X; the inner products with a direction n by 3 u32 |n| X, their difference by
u32 |n| X; the length of n by 2.5 u32 of it and the division by 2 u32, which is as much of the gap,
of X at most; the margin's own subtraction by u32 X. Together less than 11 u32 X.
"""

POINT_MARGIN = 32.0 * DOUBLE_EPS
"""What a moved point, or its distance to a triangle, may err by, as a share of the coordinates.

For bounds that need not be tight: those of volumes, of single points and of depths, as a share of
S = |relative translation| + the largest vertex norms of both models. A point moved by the float64
rotation and translation between two poses errs by less than 11 u S (7 u S in the frame of a, see
MARGIN_A; the motion to the frame of b is rounded more often), its distance to a triangle by 10 u S
more.
"""

MARGIN_A, MARGIN_B, MARGIN_T = 10.0 * DOUBLE_EPS, 17.0 * DOUBLE_EPS, 12.0 * DOUBLE_EPS
"""What the distance of two triangles may err by: MARGIN_A |a| + MARGIN_B |b| + MARGIN_T |t|.

|a| and |b| are the largest norms of the models' vertices in their own frames, t the relative
translation; distances are taken in the frame of a. All norms are Euclidean, terms in u² are left
out, and so is an imperfect rotation's 1e-6 (there is reserve for both).

*Moving b*: v' = R v + t. The vertices of a do not move. The entries of R and t are rounded once:
an entry of R errs by u |R_ij|, so R v by u ‖ |R| ‖ |v| <= 5/3 u |v| (the norm of a 3×3 rotation's
absolute values), t by u |t|. Of the inner products each product is rounded, 5/3 u |v|, and two sums
are: R (v0, v1, 0) and R v, which are no longer than v, u |v| each. Adding t rounds v' itself:
u (|v| + |t|). Together 6.4 u |b| + 2 u |t|.

*Evaluating*: let M = |a| + |b| + |t|, which no two points of the triangles are farther apart than.
The difference of two points on edges, g = (r + t e) - s d with r = q - p, errs by u times
|q - p| + 2 t |e| + |y - p| + 2 s |d| + |g|, x and y being the points: the edges are rounded, then
multiplied, the sums are rounded. Its length takes 2.5 u |g| more; adding the margin, comparing with
a square and lowering the limit 2.5 u |g|. At nearest points g is perpendicular to an edge or turns
away from it at its end, so s |d| + t |e| <= 2 √(M² - g²): in all 2 M + 4 √(M² - g²) + 6 |g|, which
is at most (2 + √52) M = 9.3 M. Points that are no nearest ones lose more than they err by. The same
count holds for a point and a face, of |r| + 2 (v |e| + w |f|) + |r - w f| + |g|.

*Finding the nearest points*: what rounding does to s, t, v and w moves the points by δ < 30 u M
along their edges and face, which adds δ² / 2h to the distance h: above TOUCHING that is nothing.
Below, the parameters are corrected by what g says, in which only the evaluation errs, 6 u M with
g's own length gone, and rounded, which moves each point by u M: 8 M. The worst is a corner that
touches a face at its rim: its foot is taken for outside by 5 u M (4 u M for a point's g, u M for
the edges), and it is compared with the edge instead, by 5 u M again: 10 M.

*Crossing* triangles are at distance 0 where every sign says so, which are certain; where one is in
doubt (`orientation`), a segment passes within 9 u M of an edge or a corner, in a direction in which
only 7 u M remain to be lost otherwise.

So a's vertices count 10 u, those of b 10 + 6.4 u, the translation 10 + 2 u, each rounded up.
"""

TOUCHING = 2.0**-78
"""Squared distance of two features, as a share of their squared lengths, below which they touch.

Above, the distance is at least 2^-39 of the lengths, and 30 u of parameters' errors change it by
less than 0.1 u of them. A larger value only costs time.
"""

PARALLEL = 2.0**-40
"""sin² of the angle below which the nearest points of touching edges are not corrected along them.

The error of a common normal then changes the distance by 30 u sin(angle), nothing; and no
correction is longer than 2^-39 / 2^-20 of the edges, so that it adds no rounding of its own.
"""

GAP_SHARE = 0.75
"""How much of the margin of two triangles' distance their gap along a given direction may err by.

Let n be the direction, no longer than a unit, and the letters as for MARGIN_A. The inner products
with a's corners err by 3 u |a|. Turning n into b's frame errs by 3 u √3 < 5.2 u, which b's corners
multiply; their own products err by 3 u |b|, that of the translation by 3 u |t|; the motion that is
taken for exact by 5/3 u |b| and u |t|; the two sums by u (|b| + |t|) and u (|a| + |b| + |t|).
Together 4 u |a| + 11.9 u |b| + 6 u |t|, at most 0.71 of each part of the margin.
"""

TRAVEL_SHARE = 64.0 * DOUBLE_EPS
"""By what share the way that models have moved is increased, and a bound kept with it lowered.

A sum of two roundings, one more where they are compared, and the products, roots and sums of a
displacement, less than 30 u of it. Where these cancel they err by 20 u S (see POINT_MARGIN), the
motions themselves by 11 u S each: the slacks of volumes before and after, 64 u S, cover that.
"""

OFFSET_MARGIN = 8.0 * DOUBLE_EPS
"""By what share of the cores' distance d and of what is subtracted from it, R, a bound is widened.

R is the sum of two radii and two deviations, which three roundings change by less than 3 u R; the
differences err by u (d + R) each, of which there are two at most, the margin's own subtraction by
as much. Together less than 4 u d + 7 u R.
"""

OFFSET_RESERVE = 32.0 * DOUBLE_EPS
"""By what share a limit l and R are increased before they limit the cores' distance.

Of the sum L of both, OFFSET_MARGIN takes at most 8 u (L + R) <= 16 u L when the limit becomes a
bound again, and adding up L errs by less than 4 u L.
"""

RIGID_TOLERANCE = 1e-6
"""By what share a pose may change lengths: what six-digit files and float32 messages hold.

The transposed rotation is taken for the inverse, so within the tolerance the answer is the
distance up to that share. Beyond it a matrix scales, shears or is broken, and the caller should
hear of it.
"""

POSE_MARGIN = 8.0
"""What a volume moved by an imperfect rotation may err by, as a multiple of |RᵀR - I| S.

Let E be the largest entry of |RᵀR - I| of either pose. The transpose of the relative rotation
differs from its inverse by 3 E for each pose (norm of a 3×3 matrix), so a moved point errs by
3.1 E S; lengths in b's frame differ from those in a's by 1.5 E of at most 2 S. Together less than
8 E S for each pose.
"""

ILL_CONDITIONED = 1.0 / 16.0
"""sin² of the angle below which two edges' common normal is computed in twice the precision.

Above it the plain cross product errs by less than 7 u of its length (√2 / sin + 1); below it that
error grows as 1/sin, and the closest points of nearly parallel edges would move by 1e-8 of their
length.
"""

POINT_FLOOR = 1e-45
"""Metres. Added to every margin: products of six lengths below it would underflow."""

LARGEST_COORDINATE = 1e45
"""Metres, of a vertex in its model and of a model in the world; what lies beyond is refused.

Lengths are then at most 8 √3 times as large, and products of six of them do not overflow.
"""

KNOT_INSERTION = 8.0 * DOUBLE_EPS
"""What a Bezier point of a spline may err by, for each degree, as a share of its terms' sum.

It is a sum of control points with coefficients c that de Boor's scheme makes level by level. A
share of a knot span is the quotient of two differences, 3 u; its product and the sum are rounded,
so each level adds 5 u to a coefficient, none of which is negative. Then there are degree + 1
products and sums: in all (6 degree + 1) u, the rest pays for terms in u². In two directions, one
after the other, the shares e add up.

With weights w, the sum of c w |x| is at most P times the sum of c w, where P is the largest norm of
a control point x. So the one errs by e P and the other by e of itself, and their quotient by 2 e P,
whatever the weights are; w x itself was rounded, u P. A Bezier curve's coefficients are 0 and 1,
which is exact.
"""

NET_POINT = 384.0 * DOUBLE_EPS
"""What a point of a piece may err by, as a share of the largest norm P of a control point.

It is the mean of control points by Bernstein polynomials, which err by 3 (p + q) u of themselves
for degrees p and q of at most 15, in sums of at most 16 and then 16 products: 125 u of the mean of
w |x|, and of w. So the quotient errs by 250 u P whatever the weights w are, and its rounding and
that of three coordinates' products with w by less than 8 u P more.
"""

NET_SPLIT = 4.0 * DOUBLE_EPS
"""What a division may do to control points, as a share of P, for each degree.

It is `degree` midpoints on top of each other, each a sum rounded once and halved: u of w P, and u
of w; so a projected point moves by 2 u P for each, a vector by less than 4 u P.
"""

RESOLUTION = 2.0**-40
"""Share of both models' sizes up to which the bounds of an exact answer about surfaces may differ.

A cell's bound comes nearer to the distance with each division, but never equals it.
"""
