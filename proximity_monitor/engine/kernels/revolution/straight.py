"""A segment beside a solid of revolution: proof that no point of it is near, or where one is.

In the half-plane (rho, z) of its points a segment is a convex curve: rho is the root of a square of
s, its share. So a part of it is below its chord, and above both its tangents at the ends. Pairs of
a fat arc and a part of the segment are bounded by the distance of their chords, less how far both
are from these. Halving either reduces that four times. The segment is nowhere farther from the axis
than its chord. So along a normal that points away from the axis, it begins no sooner than that.

For an arc of a circle with the centre c and the radius r two bounds are exact. With u from c to a
point of the arc, no point p is nearer to it than |p - c| - r, nor than r - u . (p - c).
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.trees import NONE
from ..base.vectors import norm
from .closest import share_at
from .coaxial import circle_of, is_round
from .meridian import chord_of, from_segment, thickness
from .reach import most_in

FAR, NEARER, OPEN, CUT = 0, 1, 2, 3
"""No point of a segment is nearer than the limit; one is; neither is proven; no looks are left."""

STACK = 512
"""Room for pairs that wait."""

PAIR_MARGIN = 512.0 * DOUBLE_EPS
"""What rounding may do to a bound, as a share of P, the length that errors of arcs are a share of,
and of the segment's coordinates. Points of pieces err by 120 u P (see arcs.py), points of the
segment by less than 16 u of its coordinates, distances and sums by less than 32 u of both."""

_SLOPE = 16.0 * DOUBLE_EPS
"""Error of a slope, as a share of the segment's coordinates, its length and its inverse rho."""

SHORT = 64.0 * DOUBLE_EPS
"""What is below this share of P and the segment's coordinates is not worth another halving."""


@inlined
def _sag(p, h, s0, s1, rho0, rho1, off, size):
    """Return how far a part of a segment is from its chord in the half-plane, at most; metres.

    Between two tangents a convex curve is below its chord by at most a quarter of the part times
    the difference of the slopes. It is also between the lines of slope |h| from the foot of the
    axis and from `off` above it, so it is below its chord by at most `off`.
    """
    steep = np.sqrt(h[0] * h[0] + h[1] * h[1])
    if not steep > 0.0:
        return 0.0
    low, high, error = -steep, steep, _SLOPE * size * steep
    if rho0 > 0.0:
        slope = ((p[0] + s0 * h[0]) * h[0] + (p[1] + s0 * h[1]) * h[1]) / rho0
        low = max(low, slope - error / rho0)
    if rho1 > 0.0:
        slope = ((p[0] + s1 * h[0]) * h[0] + (p[1] + s1 * h[1]) * h[1]) / rho1
        high = min(high, slope + error / rho1)
    return min(0.25 * (s1 - s0) * max(high - low, 0.0), off)


@kernel
def _between(x0, z0, x1, z1, r0, w0, r1, w1):
    """Return the distance of two segments of a plane, and where it is on the second, 0 to 1.

    If they cross, a pair of ends that seems to be beside a line is as near to it as rounding.
    """
    hx, hz, gx, gz = x1 - x0, z1 - z0, r1 - r0, w1 - w0
    first = hx * (w0 - z0) - hz * (r0 - x0)
    last = hx * (w1 - z0) - hz * (r1 - x0)
    if first * last < 0.0:
        one = gx * (z0 - w0) - gz * (x0 - r0)
        other = gx * (z1 - w0) - gz * (x1 - r0)
        if one * other < 0.0:
            return 0.0, first / (first - last)
    best, share = from_segment(r0, w0, x0, z0, x1, z1), 0.0
    apart = from_segment(r1, w1, x0, z0, x1, z1)
    if apart < best:
        best, share = apart, 1.0
    square = gx * gx + gz * gz
    for k in range(2):
        x, z = (x0, z0) if k == 0 else (x1, z1)
        apart = from_segment(x, z, r0, w0, r1, w1)
        if apart < best:
            best, share = apart, 0.0
            if square > 0.0:
                share = min(max(((x - r0) * gx + (z - w0) * gz) / square, 0.0), 1.0)
    return best, share


@inlined
def _gap(x, z, hx, hz, r0, w0, r1, w1):
    """Return how far a line is beyond two points, along its normal away from the axis, metres.

    The line leads from (x, z) along (hx, hz). If it is across the axis, both normals serve.
    """
    length = np.sqrt(hx * hx + hz * hz)
    if not length > 0.0:
        return -np.inf
    first, last = hz * (x - r0) - hx * (z - w0), hz * (x - r1) - hx * (z - w1)
    if hz < 0.0 or (hz == 0.0 and first < 0.0):
        first, last = -first, -last
    return min(first, last) / length


@inlined
def _beyond(x0, z0, x1, z1, r0, w0, r1, w1):
    """Return a bound of the distance of a chord and a part of a segment whose own chord is known.

    It does not depend on how far below its chord the part of the segment is: see `_gap`.
    """
    gap = _gap(x0, z0, x1 - x0, z1 - z0, r0, w0, r1, w1)
    # The same along the normal of the segment's chord: how far both ends of the other are beyond.
    hx, hz = r1 - r0, w1 - w0
    length = np.sqrt(hx * hx + hz * hz)
    if not length > 0.0:
        return gap
    first, last = hz * (x0 - r0) - hx * (z0 - w0), hz * (x1 - r0) - hx * (z1 - w0)
    if hz < 0.0 or (hz == 0.0 and first < 0.0):
        first, last = -first, -last
    return max(gap, min(first, last) / length)


@inlined
def _from_circle(arc, r0, w0, r1, w1, sag):
    """Return a bound of the distance of a round arc and a part of a segment, metres.

    The part is below its chord by at most `sag`.
    """
    x, z, radius = circle_of(arc)
    outside = from_segment(x, z, r0, w0, r1, w1) - radius - sag
    sector = sector_around(arc)
    far = max(most_in(sector, r0 - x, w0 - z), most_in(sector, r1 - x, w1 - z))
    return max(outside, radius - far - sag * max(most_in(sector, -1.0, 0.0), 0.0)) - arc.error


@inlined
def sector_around(arc):
    """Return the sector of the unit vectors from a round arc's centre to its points."""
    half = np.sqrt(arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1])
    side = 1.0 if arc.sine > 0.0 else -1.0
    return (-side * arc.half[1] / half, side * arc.half[0] / half, arc.cosine, abs(arc.sine))


@inlined
def put(pairs, k, bound, i, t, low, high, s0, s1):
    """Write the waiting pair k: arc i, or the part of the piece ~i from low to high; s0 to s1 of t.

    It takes two rows of CELL_PAIR. The caller may write 1 to the first row's `normal[2]`: then no
    point of that pair is looked for.
    """
    one, other = pairs[2 * k], pairs[2 * k + 1]
    one.bound, one.a, one.b = bound, i, t
    one.normal[0], one.normal[1], one.normal[2] = low, high, 0.0
    other.normal[0], other.normal[1] = s0, s1


@inlined
def put_parts(tree, rows, pairs, top, bound, i, t, low, high, s0, s1):
    """Put the halves of a pair's arc, or of its part of a piece, on top; return how many there are.

    An arc without halves is replaced by the part of the piece that it is around. If rounding allows
    no halves, nothing is put. `rows` holds the control points of the part, see `chord_of`; for the
    rest see `put`.
    """
    if i < 0:
        middle = low + share_at(rows, tree.curves[~i].degree, 0.5) * (high - low)
        if not low < middle < high:
            return 0
        put(pairs, top, bound, i, t, low, middle, s0, s1)
        put(pairs, top + 1, bound, i, t, middle, high, s0, s1)
        return 2
    arc = tree.arcs[i]
    if arc.child == NONE:
        put(pairs, top, bound, ~np.int64(arc.curve), t, arc.low, arc.high, s0, s1)
        return 1
    child = np.int64(arc.child)
    put(pairs, top, bound, child, t, 0.0, 0.0, s0, s1)
    put(pairs, top + 1, bound, child + 1, t, 0.0, 0.0, s0, s1)
    return 2


@inlined
def foot_on_axis(p, h):
    """Return where p + s h is nearest to the axis, 0 <= s <= 1: rho grows on either side."""
    square = h[0] * h[0] + h[1] * h[1]
    if not square > 0.0:
        return 0.0
    return min(max(-(p[0] * h[0] + p[1] * h[1]) / square, 0.0), 1.0)


@kernel
def segment_beside(tree, p, h, limit, pairs, top, room):
    """Look for a point p + s h, 0 <= s <= 1, nearer to a solid's boundary than `limit` metres.

    Parts of the segment wait in `pairs`, the last of which is number `top` - 1. All below them are
    of other segments, and stay. Each part is on one side of the point nearest to the axis. All is
    in the profile's frame.

    Args:
        tree: the solid.
        p: a point, metres.
        h: a vector, metres.
        limit: metres.
        pairs: the pairs of arcs and parts of segments that wait; see `put`.
        top: how many these are.
        room: how many pairs may be bounded.

    Returns:
        FAR if no part is nearer than `limit`, and none waits any more; NEARER if the last pair has
        a point that is, or may be and cannot be halved; OPEN if neither can be proven; CUT if there
        is no room. Then the s near which to look for the point; how many pairs wait; and how many
        were bounded.
    """
    arcs, rows = tree.arcs, table_on_stack(16, 3, 0.0)
    size = norm(p) + norm(h) + tree.frame[4, 0]
    margin, short = PAIR_MARGIN * size, SHORT * size
    foot = foot_on_axis(p, h)
    x, y = p[0] + foot * h[0], p[1] + foot * h[1]
    off = np.sqrt(x * x + y * y) + 16.0 * DOUBLE_EPS * size
    t, looks = np.int64(pairs[2 * top - 2].b), 0
    while top > 0 and pairs[2 * top - 2].b == t:
        if looks >= room:
            return CUT, 0.0, top, looks
        pair, more = pairs[2 * top - 2], pairs[2 * top - 1]
        i, low, high = np.int64(pair.a), pair.normal[0], pair.normal[1]
        s0, s1, bound = more.normal[0], more.normal[1], pair.bound
        top -= 1
        if bound >= limit:
            continue
        x, y = p[0] + s0 * h[0], p[1] + s0 * h[1]
        r0, w0 = np.sqrt(x * x + y * y), p[2] + s0 * h[2]
        x, y = p[0] + s1 * h[0], p[1] + s1 * h[1]
        r1, w1 = np.sqrt(x * x + y * y), p[2] + s1 * h[2]
        sag = _sag(p, h, s0, s1, r0, r1, off, size)
        rounded = -np.inf
        if i >= 0:
            arc = arcs[i]
            x0, z0 = arc.middle[0] - arc.half[0], arc.middle[1] - arc.half[1]
            x1, z1 = arc.middle[0] + arc.half[0], arc.middle[1] + arc.half[1]
            thick = thickness(arc)
            if is_round(arc):
                rounded = _from_circle(arc, r0, w0, r1, w1, sag)
        else:
            x0, z0, x1, z1, thick = chord_of(tree.curves[~i], low, high, rows)
        apart, share = _between(x0, z0, x1, z1, r0, w0, r1, w1)
        looks += 1
        bound = max(bound, max(apart - thick - sag, rounded) - margin)
        if bound >= limit:
            continue
        if sag > 0.0:
            gap = _beyond(x0, z0, x1, z1, r0, w0, r1, w1)
            bound = max(bound, gap - thick - margin)
            if bound >= limit:
                continue
        s = s0 + share * (s1 - s0)
        # A short pair is about as near as the limit, which is less than the distance known.
        last = top + 2 > STACK or max(thick, sag) <= short
        if pair.normal[2] == 0.0 and (last or apart + thick + sag + margin < limit):
            pair.bound = bound
            return NEARER, s, top + 1, looks
        if last:
            pair.bound = bound
            return OPEN, s, top + 1, looks
        if sag > thick:
            middle = 0.5 * (s0 + s1)
            put(pairs, top, bound, i, t, low, high, s0, middle)
            put(pairs, top + 1, bound, i, t, low, high, middle, s1)
            top += 2
            continue
        added = put_parts(tree, rows, pairs, top, bound, i, t, low, high, s0, s1)
        if added == 0:
            pair.bound = bound
            return OPEN, s, top + 1, looks
        top += added
    return FAR, 0.0, top, looks
