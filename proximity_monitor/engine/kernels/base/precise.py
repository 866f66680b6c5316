"""Arithmetic with twice the precision of float64, for the few signs and normals that need it.

A number is a pair (high, low) with high = fl(high + low). The error-free transformations are
Knuth's sum (as in Shewchuk 1997, section 2.3) and a product by fused multiply-add. They require
strict IEEE arithmetic, so nothing here is compiled with fast-math flags.
"""

from __future__ import annotations

from .jit import kernel
from .lanes import fma
from .rounding import DOUBLE_EPS, ILL_CONDITIONED
from .vectors import cross, dot, sub


@kernel
def two_sum(a, b):
    """Return a + b exactly, as (rounded sum, rounding error)."""
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


@kernel
def two_product(a, b):
    """Return a * b exactly, as (rounded product, rounding error)."""
    p = a * b
    return p, fma(a, b, -p)


@kernel
def difference_of_products(a, b, c, d):
    """Return a b - c d, accurate to about one unit in the last place (Kahan's method)."""
    p, e = two_product(a, b)
    q, f = two_product(c, d)
    s, g = two_sum(p, -q)
    return s + (g + (e - f))


@kernel
def cross_precise(a, b):
    """Return a × b with every component accurate, however close to parallel a and b are."""
    return (
        difference_of_products(a[1], b[2], a[2], b[1]),
        difference_of_products(a[2], b[0], a[0], b[2]),
        difference_of_products(a[0], b[1], a[1], b[0]),
    )


@kernel
def accurate_cross(a, b):
    """Return a × b, accurate relative to its own length.

    The plain formula errs by u |a| |b|, which is u / sin(angle) relative to the product. If the
    angle is small, the components are computed with twice the precision instead.
    """
    n = cross(a, b)
    if dot(n, n) < ILL_CONDITIONED * (dot(a, a) * dot(b, b)):
        n = cross_precise(a, b)
    return n


@kernel
def dot_precise(a, b, c):
    """Return a · (b + c) as if computed with twice the precision and rounded once; |c| <= u |b|.

    This is the compensated product of Ogita, Rump and Oishi 2005 (algorithm 5.3). Apart from the
    last rounding it errs by 8 u² |a| |b|.
    """
    x, d = two_product(a[0], b[0])
    y, e = two_product(a[1], b[1])
    z, f = two_product(a[2], b[2])
    x, g = two_sum(x, y)
    x, h = two_sum(x, z)
    return x + ((d + e + f) + (g + h) + (a[0] * c[0] + a[1] * c[1] + a[2] * c[2]))


@kernel
def _times(a, b):
    p, e = two_product(a[0], b[0])
    return two_sum(p, e + (a[0] * b[1] + a[1] * b[0]))


@kernel
def _plus(a, b):
    s, e = two_sum(a[0], b[0])
    return two_sum(s, e + (a[1] + b[1]))


@kernel
def _minus(a, b):
    return _plus(a, (-b[0], -b[1]))


@kernel
def _minor(a, b, c, d):
    return _minus(_times(a, b), _times(c, d))


@kernel
def orientation(a, b, c, d):
    """Return the sign of (a - d) . ((b - d) x (c - d)): the side of the plane a, b, c that holds d.

    Returns -1, 0 or 1. A float64 filter nearly always decides. Otherwise the determinant is
    computed with twice the precision. 0 means that the sign is in doubt: the determinant is at most
    2^-101 of its terms.
    """
    ad, bd, cd = sub(a, d), sub(b, d), sub(c, d)
    m0 = bd[1] * cd[2]
    m1 = bd[2] * cd[1]
    m2 = bd[2] * cd[0]
    m3 = bd[0] * cd[2]
    m4 = bd[0] * cd[1]
    m5 = bd[1] * cd[0]
    value = ad[0] * (m0 - m1) + ad[1] * (m2 - m3) + ad[2] * (m4 - m5)
    terms = (
        abs(ad[0]) * (abs(m0) + abs(m1))
        + abs(ad[1]) * (abs(m2) + abs(m3))
        + abs(ad[2]) * (abs(m4) + abs(m5))
    )
    # Shewchuk 1997, section 4.3: 7 u (1 + 8 u) of the terms suffices; 8 u is simpler.
    if abs(value) > 8.0 * DOUBLE_EPS * terms:
        return 1 if value > 0.0 else -1
    # The differences are exact. `_times` errs by 8 u² of its product, `_plus` by 3 u² of its terms.
    # Each of the six products thus errs by 8 + 3 + 8 + 3 + 3 = 25 u².
    precise = volume(a, b, c, d)
    if abs(precise) <= 32.0 * DOUBLE_EPS * DOUBLE_EPS * terms:
        return 0
    return 1 if precise > 0.0 else -1


@kernel
def volume(a, b, c, d):
    """Return (a - d) . ((b - d) x (c - d)), with twice the precision and rounded at the end."""
    ax, ay, az = two_sum(a[0], -d[0]), two_sum(a[1], -d[1]), two_sum(a[2], -d[2])
    bx, by, bz = two_sum(b[0], -d[0]), two_sum(b[1], -d[1]), two_sum(b[2], -d[2])
    cx, cy, cz = two_sum(c[0], -d[0]), two_sum(c[1], -d[1]), two_sum(c[2], -d[2])
    xy = _plus(_times(ax, _minor(by, cz, bz, cy)), _times(ay, _minor(bz, cx, bx, cz)))
    return _plus(xy, _times(az, _minor(bx, cy, by, cx)))[0]
