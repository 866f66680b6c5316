"""Exact distance between two triangles, with the points that attain it.

The nearest points of two triangles that do not cross lie on two edges, or on a vertex and a face;
fifteen candidates, of which the smallest is the answer. Every candidate is the distance between
two points *of the triangles*, so no rounding can make the answer too small by more than the
rounding of those points; each is computed so that nearly parallel edges and slivers lose nothing
(see `_normal`). Triangles that cross have an edge of one through the other.

Degenerate triangles are segments and points: their edges are candidates like any others, and
their faces, of no area, are left out.
"""

from __future__ import annotations

from ..tolerances import DOUBLE_EPS, ILL_CONDITIONED
from .jit import entry, kernel
from .precise import cross_precise, orientation, volume
from .vectors import along, cross, dot, sub


@kernel
def _normal(a, b):
    """Cross product a × b, accurate relative to its own length.

    The plain formula errs by u |a| |b|: relative to the product that is u / sin(angle). Where the
    angle is small the components are computed with twice the precision instead.
    """
    n = cross(a, b)
    if dot(n, n) < ILL_CONDITIONED * (dot(a, a) * dot(b, b)):
        n = cross_precise(a, b)
    return n


@kernel
def _clamped(x):
    return min(max(x, 0.0), 1.0)


@kernel
def segments(p, d, q, e):
    """Nearest points p + s d and q + t e of two segments; returns (s, t, squared distance).

    The lines' nearest parameter s comes from their common normal n: s = det(q - p, e, n) / |n|².
    Clamping it, then t given s, then s given t, yields the optimum over the square (Ericson 2005,
    section 5.1.9). A vanishing edge or normal leaves its parameter at 0, which the others then
    make optimal.
    """
    r = sub(q, p)
    dd, ee = dot(d, d), dot(e, e)
    n = _normal(d, e)
    nn = dot(n, n)
    s = _clamped(dot(cross(r, e), n) / nn) if nn > 0.0 else 0.0
    t = _clamped(dot(sub((s * d[0], s * d[1], s * d[2]), r), e) / ee) if ee > 0.0 else 0.0
    s = _clamped(dot(along(r, e, t), d) / dd) if dd > 0.0 else 0.0
    g = (
        r[0] + t * e[0] - s * d[0],
        r[1] + t * e[1] - s * d[1],
        r[2] + t * e[2] - s * d[2],
    )
    return s, t, dot(g, g)


@kernel
def point_face(p, a, e, f, n, nn):
    """Foot of p on the triangle a, a + e, a + f with normal n = e × f, nn = |n|² > 0.

    Returns (inside, v, w, squared distance to the plane), the foot being a + v e + w f. First w,
    the share of the height over e; then v along e from what is left: each is accurate in the
    direction in which an error would move the foot, also in a needle.
    """
    r = sub(p, a)
    w = dot(cross(e, r), n) / nn
    v = dot(along(r, f, -w), e) / dot(e, e)
    h = dot(r, n)
    return v >= 0.0 and w >= 0.0 and v + w <= 1.0, v, w, h * h / nn


@kernel
def _pierces(p, q, a, b, c):
    """Whether the segment p q meets the triangle a b c (not when all five are coplanar)."""
    side_p, side_q = orientation(a, b, c, p), orientation(a, b, c, q)
    if side_p == side_q:
        return False
    x, y, z = orientation(p, q, a, b), orientation(p, q, b, c), orientation(p, q, c, a)
    return (x >= 0 and y >= 0 and z >= 0) or (x <= 0 and y <= 0 and z <= 0)


@kernel
def _size(v):
    return abs(v[0]) + abs(v[1]) + abs(v[2])


@kernel
def _one_side(a, e, f, p, q, r):
    """Whether p, q, r certainly lie on one side of the plane of the triangle a, a + e, a + f.

    The margin pays for the plane too: e × f errs by 4 u |e| |f|, which tilts a needle's plane. A
    wrong "no" only costs time.
    """
    n = cross(e, f)
    x, y, z = sub(p, a), sub(q, a), sub(r, a)
    dx, dy, dz = dot(x, n), dot(y, n), dot(z, n)
    reach = max(max(_size(x), _size(y)), _size(z)) + _size(e) + _size(f)
    margin = 16.0 * DOUBLE_EPS * _size(e) * _size(f) * reach
    return (dx > margin and dy > margin and dz > margin) or (
        dx < -margin and dy < -margin and dz < -margin
    )


@kernel
def _apart(a, b):
    """Whether the plane of one of two triangles certainly has the other on one side."""
    if _one_side(b[0], sub(b[1], b[0]), sub(b[2], b[0]), a[0], a[1], a[2]):
        return True
    return _one_side(a[0], sub(a[1], a[0]), sub(a[2], a[0]), b[0], b[1], b[2])


@kernel
def _crossing_edge(a, b):
    """Which edge of triangle a meets triangle b; -1 where none does."""
    for i in range(3):
        if _pierces(a[i], a[(i + 1) % 3], b[0], b[1], b[2]):
            return i
    return -1


@kernel
def _volume(a, b, c, d):
    return dot(sub(a, d), cross(sub(b, d), sub(c, d)))


@kernel
def _meeting_point(p, q, t):
    """Where the segment p q meets the triangle t: its parameter, and weights on t.

    Ratios of signed volumes, taken with twice the precision: in float64 a grazing edge would meet
    the triangle at points that are a millionth of its length apart.
    """
    vp, vq = volume(t[0], t[1], t[2], p), volume(t[0], t[1], t[2], q)
    s = _clamped(vp / (vp - vq)) if vp != vq else 0.0
    w0 = abs(volume(p, q, t[1], t[2]))
    w1 = abs(volume(p, q, t[2], t[0]))
    w2 = abs(volume(p, q, t[0], t[1]))
    total = w0 + w1 + w2
    if total == 0.0:
        return s, (1.0, 0.0, 0.0)
    return s, (w0 / total, w1 / total, w2 / total)


@kernel
def _certainly_pierces(p, q, t, margin):
    """Whether p q meets triangle t for every choice of volumes within `margin` of the computed."""
    vp, vq = _volume(t[0], t[1], t[2], p), _volume(t[0], t[1], t[2], q)
    if not ((vp > margin and vq < -margin) or (vp < -margin and vq > margin)):
        return False
    x, y, z = _volume(p, q, t[0], t[1]), _volume(p, q, t[1], t[2]), _volume(p, q, t[2], t[0])
    return (x > margin and y > margin and z > margin) or (
        x < -margin and y < -margin and z < -margin
    )


@kernel
def certainly_cross(a, b, slack):
    """Whether two triangles cross however their corners are moved by `slack`.

    A determinant of three edges no longer than L then changes by less than 8 slack L²; what
    rounding does to it is less than that again, slack being 32 u of the coordinates.
    """
    length = 0.0
    for i in range(3):
        length += _size(sub(a[i], b[0])) + _size(sub(b[i], a[0]))
    margin = 16.0 * slack * length * length
    for i in range(3):
        if _certainly_pierces(a[i], a[(i + 1) % 3], b, margin):
            return True
        if _certainly_pierces(b[i], b[(i + 1) % 3], a, margin):
            return True
    return False


@kernel
def _face_weights(p, a, e, f, n, nn):
    """Barycentric weights of the foot of p on a triangle, none negative, their sum one."""
    _, v, w, _ = point_face(p, a, e, f, n, nn)
    v, w = _clamped(v), _clamped(w)
    return max(1.0 - v - w, 0.0), v, w


@kernel
def _corner(i):
    return (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)


@kernel
def _on_edge(i, s):
    """Barycentric weights of the point at s along edge i, from corner i to corner i + 1."""
    if i == 0:
        return (1.0 - s, s, 0.0)
    if i == 1:
        return (0.0, 1.0 - s, s)
    return (s, 0.0, 1.0 - s)


@entry
def triangle_distance(a, b, limit):
    """Squared distance of two triangles (three corners each), if it is below `limit`.

    Returns (squared distance, weights on a, weights on b): barycentric coordinates of the nearest
    points, of a common point where the triangles cross. Not below `limit`: (limit, ...) with
    weights that mean nothing.
    """
    if limit > 0.0 and not _apart(a, b):
        i = _crossing_edge(a, b)
        if i >= 0:
            s, weights = _meeting_point(a[i], a[(i + 1) % 3], b)
            return 0.0, _on_edge(i, s), weights
        i = _crossing_edge(b, a)
        if i >= 0:
            s, weights = _meeting_point(b[i], b[(i + 1) % 3], a)
            return 0.0, weights, _on_edge(i, s)
    ea = (sub(a[1], a[0]), sub(a[2], a[1]), sub(a[0], a[2]))
    eb = (sub(b[1], b[0]), sub(b[2], b[1]), sub(b[0], b[2]))
    best, kind, first, second, bs, bt = limit, -1, 0, 0, 0.0, 0.0
    for i in range(3):
        for j in range(3):
            s, t, d = segments(a[i], ea[i], b[j], eb[j])
            if d < best:
                best, kind, first, second, bs, bt = d, 0, i, j, s, t
    fa = sub(a[2], a[0])
    na = _normal(ea[0], fa)
    nna = dot(na, na)
    if nna > 0.0:
        for j in range(3):
            inside, _, _, d = point_face(b[j], a[0], ea[0], fa, na, nna)
            if inside and d < best:
                best, kind, second = d, 1, j
    fb = sub(b[2], b[0])
    nb = _normal(eb[0], fb)
    nnb = dot(nb, nb)
    if nnb > 0.0:
        for i in range(3):
            inside, _, _, d = point_face(a[i], b[0], eb[0], fb, nb, nnb)
            if inside and d < best:
                best, kind, first = d, 2, i
    if kind < 0:
        return limit, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    if kind == 0:
        return best, _on_edge(first, bs), _on_edge(second, bt)
    if kind == 1:
        return best, _face_weights(b[second], a[0], ea[0], fa, na, nna), _corner(second)
    return best, _corner(first), _face_weights(a[first], b[0], eb[0], fb, nb, nnb)
