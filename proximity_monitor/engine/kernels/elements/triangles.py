"""Exact distance between two triangles, with the points that attain it.

The nearest points of two triangles that do not cross lie on two edges, or on a vertex and a face.
These are fifteen candidates; the smallest distance is the answer. Every candidate is the distance
between two points *of the triangles*, so the answer is too small by at most the rounding of these
points. The computation loses no accuracy on nearly parallel edges or slivers (see `accurate_cross`,
and MARGIN_A for the full error count). If triangles cross, an edge of one passes through the other.

Degenerate triangles are segments or points. Their edges are candidates like any others. Their
faces have no area and are left out.
"""

from __future__ import annotations

from ..base.jit import kernel
from ..base.memory import on_stack
from ..base.precise import accurate_cross, orientation, volume
from ..base.rounding import DOUBLE_EPS, PARALLEL, TOUCHING
from ..base.vectors import along, clamped, cross, dot, sub
from .edges import LANES, edge_pairs


@kernel
def _approach(s, t, g, d, e, n, nn, dd, ee):
    """Return the parameters of two segments' nearest points, starting from s and t.

    g is the difference of the points at s and t. The lines' nearest parameter comes from their
    common normal n: s + det(g, e, n) / |n|². Clamp it, then find t given s, then s given t: the
    result is the optimum over the square (Ericson 2005, section 5.1.9). A vanishing edge or normal
    leaves its parameter unchanged; the other steps then make the result optimal.
    """
    x = clamped(s + dot(cross(g, e), n) / nn) if nn > 0.0 else s
    g = along(g, d, s - x)
    y = clamped(t - dot(g, e) / ee) if ee > 0.0 else t
    g = along(g, e, y - t)
    return (clamped(x + dot(g, d) / dd) if dd > 0.0 else x), y


@kernel
def segments(p, d, q, e):
    """Find the nearest points p + s d and q + t e of two segments; return (s, t, squared distance).

    If they touch, the rounding of s and t is not negligible beside the distance. Then repeat the
    step from the points found. Their difference g is tiny there, and so is the rounding of the new
    result. The repeated step ignores the normal of nearly parallel edges: it would lead far away,
    while along parallels any point is as near.
    """
    r, dd, ee = sub(q, p), dot(d, d), dot(e, e)
    n = accurate_cross(d, e)
    nn = dot(n, n)
    s, t = _approach(0.0, 0.0, r, d, e, n, nn, dd, ee)
    g = along(along(r, e, t), d, -s)
    gg = dot(g, g)
    if gg < TOUCHING * (dd + ee):
        nn = nn if nn > PARALLEL * (dd * ee) else 0.0
        x, y = _approach(s, t, g, d, e, n, nn, dd, ee)
        g = along(along(g, e, y - t), d, s - x)
        s, t, gg = x, y, dot(g, g)
    return s, t, gg


@kernel
def point_face(p, a, e, f, n, nn):
    """Find the foot of p on the plane of triangle a, a + e, a + f, with n = e × f, nn = |n|² > 0.

    Returns (inside the triangle, v, w, squared distance to the foot); the foot is a + v e + w f.
    First find w, the share of the height over e, then v along e from the remainder. Each is
    accurate in the direction in which its error would move the foot, even in a needle. If p touches
    the plane, repeat from the foot as in `segments`, and take the distance along the normal alone.
    """
    r, ee = sub(p, a), dot(e, e)
    w = dot(cross(e, r), n) / nn
    g = along(r, f, -w)
    v = dot(g, e) / ee
    g = along(g, e, -v)
    gg = dot(g, g)
    if gg < TOUCHING * (ee + dot(f, f)):
        x = dot(cross(e, g), n) / nn
        v, w = v + dot(along(g, f, -x), e) / ee, w + x
        h = dot(g, n)
        gg = h * h / nn
    return v >= 0.0 and w >= 0.0 and v + w <= 1.0, v, w, gg


@kernel
def _pierces(p, q, a, b, c):
    """Return whether the segment p q certainly passes through the inside of the triangle a b c.

    If a sign is in doubt, they touch at a corner or an edge, or miss each other. Then the distances
    of corners and edges give the answer.
    """
    if orientation(a, b, c, p) * orientation(a, b, c, q) >= 0:
        return False
    x = orientation(p, q, a, b)
    return x != 0 and x == orientation(p, q, b, c) and x == orientation(p, q, c, a)


@kernel
def _size(v):
    return abs(v[0]) + abs(v[1]) + abs(v[2])


@kernel
def _one_side(a, e, f, p, q, r):
    """Return whether p, q, r certainly lie on one side of the plane of triangle a, a + e, a + f.

    The margin covers the plane too: e × f errs by 4 u |e| |f|, which tilts a needle's plane. A
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
    """Return whether the plane of one triangle certainly has the other triangle on one side."""
    if _one_side(b[0], sub(b[1], b[0]), sub(b[2], b[0]), a[0], a[1], a[2]):
        return True
    return _one_side(a[0], sub(a[1], a[0]), sub(a[2], a[0]), b[0], b[1], b[2])


@kernel
def _crossing_edge(a, b):
    """Return which edge of triangle a certainly crosses triangle b, or -1 if none does."""
    for i in range(3):
        if _pierces(a[i], a[(i + 1) % 3], b[0], b[1], b[2]):
            return i
    return -1


@kernel
def _volume(a, b, c, d):
    return dot(sub(a, d), cross(sub(b, d), sub(c, d)))


@kernel
def _meeting_point(p, q, t):
    """Return where the segment p q meets the triangle t: the segment's parameter and weights on t.

    Both are ratios of signed volumes in twice the precision: in float64, the two points computed
    for a grazing edge could be a millionth of its length apart. The volumes err by a share of the
    cubed edge lengths. For a sliver that is more than the volumes themselves: see `_nearer`.
    """
    vp, vq = volume(t[0], t[1], t[2], p), volume(t[0], t[1], t[2], q)
    s = clamped(vp / (vp - vq)) if vp != vq else 0.0
    w0 = abs(volume(p, q, t[1], t[2]))
    w1 = abs(volume(p, q, t[2], t[0]))
    w2 = abs(volume(p, q, t[0], t[1]))
    total = w0 + w1 + w2
    weights = (1.0, 0.0, 0.0)
    if total > 0.0:
        weights = (w0 / total, w1 / total, w2 / total)
    d = sub(q, p)
    gap = _apart_by(p, d, s, t, weights)
    room = 4.0 * DOUBLE_EPS
    if gap <= room * room * (dot(p, p) + dot(d, d) + dot(t[0], t[0])):
        return s, weights  # rounding alone explains the gap
    return _nearer(p, d, t, s, weights, gap)


@kernel
def _nearer(p, d, t, s, weights, gap):
    """Improve the result (s, weights) of `_meeting_point`; `gap` is its `_apart_by`.

    Move the point p + s d along d to the triangle's plane, then find the triangle's point nearest
    to it. Do so three times and return the nearest pair of points seen.
    """
    e, f = sub(t[1], t[0]), sub(t[2], t[0])
    n = accurate_cross(e, f)
    nn, dn = dot(n, n), dot(d, n)
    if not nn > 0.0:
        return s, weights
    x = s
    for _ in range(3):
        if dn != 0.0:
            x = clamped(x - dot(sub(along(p, d, x), t[0]), n) / dn)
        y = along(p, d, x)
        inside, v, w, _ = point_face(y, t[0], e, f, n, nn)
        if inside:
            other = (max(1.0 - v - w, 0.0), v, w)
            rest = _apart_by(p, d, x, t, other)
            if rest < gap:
                s, weights, gap = x, other, rest
        for i in range(3):
            k = sub(t[(i + 1) % 3], t[i])
            kk = dot(k, k)
            other = _on_edge(i, clamped(dot(sub(y, t[i]), k) / kk) if kk > 0.0 else 0.0)
            rest = _apart_by(p, d, x, t, other)
            if rest < gap:
                s, weights, gap = x, other, rest
    return s, weights


@kernel
def _apart_by(p, d, s, t, w):
    """Return the squared distance of p + s d and the point of triangle t that has weights w."""
    a, e, f = t[0], sub(t[1], t[0]), sub(t[2], t[0])
    g = along(along(sub(along(p, d, s), a), e, -w[1]), f, -w[2])
    return dot(g, g)


@kernel
def _certainly_pierces(p, q, t, margin):
    """Return whether p q meets triangle t for all volumes within `margin` of those computed."""
    vp, vq = _volume(t[0], t[1], t[2], p), _volume(t[0], t[1], t[2], q)
    if not ((vp > margin and vq < -margin) or (vp < -margin and vq > margin)):
        return False
    x, y, z = _volume(p, q, t[0], t[1]), _volume(p, q, t[1], t[2]), _volume(p, q, t[2], t[0])
    return (x > margin and y > margin and z > margin) or (
        x < -margin and y < -margin and z < -margin
    )


@kernel
def certainly_cross(a, b, slack):
    """Return whether two triangles cross even if each corner moves by up to `slack`.

    Such a motion changes a determinant of three edges no longer than L by less than 8 slack L².
    Rounding changes it by less than as much again, because slack is at least 10 u of the
    coordinates.
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
    """Return barycentric weights of the foot of p on a triangle: none negative, their sum one."""
    _, v, w, _ = point_face(p, a, e, f, n, nn)
    v, w = clamped(v), clamped(w)
    return max(1.0 - v - w, 0.0), v, w


@kernel
def corner_weights(i):
    """Return the barycentric weights of a triangle's corner i."""
    return (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)


@kernel
def _on_edge(i, s):
    """Return barycentric weights of the point at s along edge i, from corner i to corner i + 1."""
    if i == 0:
        return (1.0 - s, s, 0.0)
    if i == 1:
        return (0.0, 1.0 - s, s)
    return (s, 0.0, 1.0 - s)


@kernel
def _beyond(p, a, n, nn, squared):
    """Return whether p is certainly farther than √squared from the plane at a with normal n.

    nn is |n|². The inner product errs by at most 12 u |p - a| |n|, and nn by 17 u. A wrong "no"
    only costs time.
    """
    r = sub(p, a)
    height = abs(dot(r, n)) - 16.0 * DOUBLE_EPS * _size(r) * _size(n)
    return height > 0.0 and height * height > (1.0 + 32.0 * DOUBLE_EPS) * squared * nn


@kernel
def distance_apart(a, b, limit):
    """Do the same as `triangle_distance` for triangles that certainly do not cross."""
    ea = (sub(a[1], a[0]), sub(a[2], a[1]), sub(a[0], a[2]))
    eb = (sub(b[1], b[0]), sub(b[2], b[1]), sub(b[0], b[2]))
    s, t = on_stack(LANES, 0.0), on_stack(LANES, 0.0)
    squared, touching = on_stack(LANES, 0.0), on_stack(LANES, 0.0)
    edge_pairs(a, ea, b, eb, s, t, squared, touching)
    best, kind, first, second, bs, bt = limit, -1, 0, 0, 0.0, 0.0
    for i in range(3):
        for j in range(3):
            k = 3 * i + j
            x, y, d = s[k], t[k], squared[k]
            if d < touching[k]:
                x, y, d = segments(a[i], ea[i], b[j], eb[j])
            if d < best:
                best, kind, first, second, bs, bt = d, 0, i, j, x, y
    fa = sub(a[2], a[0])
    na = accurate_cross(ea[0], fa)
    nna = dot(na, na)
    if nna > 0.0:
        for j in range(3):
            if _beyond(b[j], a[0], na, nna, best):
                continue
            inside, _, _, d = point_face(b[j], a[0], ea[0], fa, na, nna)
            if inside and d < best:
                best, kind, second = d, 1, j
    fb = sub(b[2], b[0])
    nb = accurate_cross(eb[0], fb)
    nnb = dot(nb, nb)
    if nnb > 0.0:
        for i in range(3):
            if _beyond(a[i], b[0], nb, nnb, best):
                continue
            inside, _, _, d = point_face(a[i], b[0], eb[0], fb, nb, nnb)
            if inside and d < best:
                best, kind, first = d, 2, i
    if kind < 0:
        return limit, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    if kind == 0:
        return best, _on_edge(first, bs), _on_edge(second, bt)
    if kind == 1:
        return best, _face_weights(b[second], a[0], ea[0], fa, na, nna), corner_weights(second)
    return best, corner_weights(first), _face_weights(a[first], b[0], eb[0], fb, nb, nnb)


@kernel
def triangle_distance(a, b, limit):
    """Find the squared distance of two triangles (three corners each) if it is below `limit`.

    Returns (squared distance, weights on a, weights on b). The weights are barycentric coordinates
    of the nearest points, or of a common point if the triangles cross. If the squared distance is
    not below `limit`, returns (limit, ...) with weights that mean nothing.
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
    return distance_apart(a, b, limit)
