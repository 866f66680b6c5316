"""Every constant of the engine that is a matter of rounding: value, unit, reason.

Two unit roundoffs appear: u = 2^-53 of float64 (coordinates, triangles, poses) and
u32 = 2^-24 of float32 (the volumes of the hierarchy).
"""

from __future__ import annotations

DOUBLE_EPS = 2.0**-53
"""Unit roundoff u of float64."""

SINGLE_EPS = 2.0**-24
"""Unit roundoff u32 of float32."""

SINGLE_MARGIN = 32.0 * SINGLE_EPS
"""What a float32 bound between two volumes is lowered by, as a share of their coordinates.

With M the sum of the lengths of both centres, all four half edges and both radii, in the node's
own frame: rounding the moved volume to float32 displaces it by at most u32 M; each of the five
inner products of a support gap errs by 3 u32 |n| M in any order of summation, their sum by 4 u32
|n| M more; the normalisation by 5 u32 M; a lane's normal taken for perpendicular to its edges by
4 u32 M; the radii by 2 u32 M. Together less than 20 u32 M; the rest is reserve for the reciprocal
estimates that LLVM may use under `arcp`. Below 20 this count no longer covers it.
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

POINT_MARGIN = 32.0 * DOUBLE_EPS
"""What a distance between moved triangles may err by, as a share of the coordinates' magnitude.

With S = |relative translation| + the largest vertex norms of both models: the relative translation
errs by 5 u S, the relative rotation moves a vertex by 5 u S, its product errs by 4 u S, an edge by
u S, the nearest points (convex combinations) by 5 u S on each side, the length of their
difference by 4 u S. Together less than 32 u S.
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

Above it the plain cross product errs by less than 4 u of its length; below it that error grows as
1/sin, and the closest points of nearly parallel edges would move by 1e-8 of their length.
"""

POINT_FLOOR = 1e-45
"""Metres. Added to every margin: products of six lengths below it would underflow."""

LARGEST_COORDINATE = 1e45
"""Metres. Products of six lengths below it do not overflow; a model beyond it is refused."""

LARGEST_INVERSE = 1e30
"""Cap on 1/|u|², in node units: above it float32 would overflow. Serves directions alone."""
