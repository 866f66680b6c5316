"""Recognise a profile that is one circle, as of a sphere or a torus, and measure the circle."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS

if TYPE_CHECKING:
    from .profile import Profile

_ALIKE = 1e-11
"""How far points of a circle may be from it, as a share of its radius."""
_ROUNDED = 16.0 * DOUBLE_EPS
"""How far rounding moves points of it, as a share of the profile's size."""

_FEWEST = 3
"""The fewest pieces of a loop that is examined: three joints define a circle."""

_NONE = 0.0, 0.0, 0.0


def tube_of(profile: Profile) -> tuple[float, float, float]:
    """Return z of a circle's centre, a radius within which the whole profile lies, and the rho.

    All are metres. The profile must be a half circle about a point of the axis (rho is 0) or a
    circle that is a loop. For any other profile all three are 0. A point of the profile is C / w,
    with C relative to the centre. |C|² and w² are polynomials in Bernstein's basis. The largest
    quotient of their coefficients bounds the squared distance of every point from the centre.
    """
    if (circle := _circle(profile)) is None:
        return _NONE
    rho, height, radius = circle
    alike = _alike(profile, radius)
    least, most, largest = math.inf, 0.0, 0.0
    for pieces in profile.pieces:
        x, z, w = np.moveaxis(pieces, 2, 0)
        x, z = x - rho * w, z - height * w
        square = (x[:, 0] ** 2 + z[:, 0] ** 2) / w[:, 0] ** 2
        if not np.allclose(square, radius**2, rtol=0.0, atol=alike):
            return _NONE
        quotients = (_squared(x) + _squared(z)) / _squared(w)
        least, most = min(least, quotients.min()), max(most, quotients.max())
        largest = max(largest, float((np.hypot(x, z) / w).max()))
    if not most - least <= 2.0 * alike:
        return _NONE
    # Let X be the largest |C| / w. Each coefficient of |C|² is a mean of products of control points
    # and weights; its terms add up to at most 2 X² times the coefficient of w². Subtracting the
    # centre moves a control point by at most 3 u size w, hence a coefficient by 6 u size X (w²),
    # twice. The products, sums and quotients err by less than 4 (degree + 4) u of the coefficient,
    # and w² by as much of itself. `spare` is more than twice all this.
    count = 16 * (max(own.shape[1] for own in profile.pieces) + 4)
    spare = count * DOUBLE_EPS * 2.0 * largest * (largest + profile.size)
    return height, math.sqrt(most + spare), rho


def _circle(profile: Profile) -> tuple[float, float, float] | None:
    """Return rho and z of the centre and the radius of the circle that a profile may be, metres.

    For most other profiles this is None, and found quickly: profiles may deform at frame rate.
    """
    first, last = profile.pieces[0], profile.pieces[-1]
    if not profile.closed:
        low, high = (z / w for _, z, w in (first[0][0], last[-1][-1]))
        rho, height, radius = 0.0, 0.5 * (low + high), 0.5 * abs(high - low)
    else:
        joints = np.concatenate([own[:, 0] for own in profile.pieces])
        points = joints[:, :2] / joints[:, 2:]
        if len(points) < _FEWEST:
            return None
        # The circle through three joints: its centre is where the bisectors of two chords meet.
        one, other = points[len(points) // 3] - points[0], points[2 * len(points) // 3] - points[0]
        area = 2.0 * float(one[0] * other[1] - one[1] * other[0])
        if area == 0.0:
            return None
        squares = float(one @ one), float(other @ other)
        x = (other[1] * squares[0] - one[1] * squares[1]) / area
        z = (one[0] * squares[1] - other[0] * squares[0]) / area
        rho, height, radius = points[0, 0] + x, points[0, 1] + z, math.hypot(x, z)
        if not rho > 0.0:
            return None
    x, z, w = last[-1, 0].tolist()
    far = (x - rho * w) ** 2 + (z - height * w) ** 2
    if not abs(far - (radius * w) ** 2) <= _alike(profile, radius) * w**2:
        return None
    return float(rho), float(height), float(radius)


def _alike(profile: Profile, radius: float) -> float:
    """Return by how much squared distances from the centre may differ from radius², metres²."""
    return 2.0 * radius * (_ALIKE * radius + _ROUNDED * profile.size)


def _squared(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squares (n, 2 degree + 1) of polynomials (n, degree + 1), in Bernstein's basis."""
    weights = _binomials(rows.shape[1] - 1)
    scaled = rows * weights
    made = np.zeros((len(rows), 2 * rows.shape[1] - 1))
    for i in range(rows.shape[1]):
        made[:, i : i + rows.shape[1]] += scaled[:, i : i + 1] * scaled
    return made / _binomials(made.shape[1] - 1)


@lru_cache(maxsize=32)
def _binomials(degree: int) -> NDArray[np.float64]:
    return np.array([math.comb(degree, k) for k in range(degree + 1)], float)
