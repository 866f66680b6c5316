"""Whether a profile is of one circle, as a sphere's and a torus's are, and how large that is."""

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
"""Share of a circle's radius within which its points are as far from its centre."""
_ROUNDED = 16.0 * DOUBLE_EPS
"""The same as a share of the profile's size, which rounding moves points by."""

_FEWEST = 3
"""Pieces of a loop that is looked at: through as many joints there is one circle."""

_NONE = 0.0, 0.0, 0.0


def tube_of(profile: Profile) -> tuple[float, float, float]:
    """The z of the centre, a radius that all of a profile is within, and the rho of the centre.

    That of a half circle about a point of the axis, or of a loop that is a circle; of any other
    profile all are 0. The profile's points are C / w, with w and the coordinates of C in
    Bernstein's basis; so are |C|² and w², with C seen from the centre. The largest quotient of two
    coefficients of these is no less than the square of the distance of any point.
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
    # and weights, and adds up no more than 2 X² times that of w². Subtracting the centre moves a
    # control point by 3 u size w at most, hence a coefficient by 6 u size X (w²), twice; and the
    # products, sums and quotients err by less than 4 (degree + 4) u of it, and w² by as much of
    # itself. Here is more than twice as much.
    count = 16 * (max(own.shape[1] for own in profile.pieces) + 4)
    spare = count * DOUBLE_EPS * 2.0 * largest * (largest + profile.size)
    return height, math.sqrt(most + spare), rho


def _circle(profile: Profile) -> tuple[float, float, float] | None:
    """The rho and z of a centre and the radius of a circle that may be a profile's.

    Of others it is None as a rule, and soon: they deform at frame rate.
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
        # The circle through three of them: where all differences' bisectors meet.
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
    """By how much the squares of distances from the centre may differ from a circle's, metres²."""
    return 2.0 * radius * (_ALIKE * radius + _ROUNDED * profile.size)


def _squared(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The squares of polynomials (n, degree + 1) in Bernstein's basis, (n, 2 degree + 1)."""
    weights = _binomials(rows.shape[1] - 1)
    scaled = rows * weights
    made = np.zeros((len(rows), 2 * rows.shape[1] - 1))
    for i in range(rows.shape[1]):
        made[:, i : i + rows.shape[1]] += scaled[:, i : i + 1] * scaled
    return made / _binomials(made.shape[1] - 1)


@lru_cache(maxsize=32)
def _binomials(degree: int) -> NDArray[np.float64]:
    return np.array([math.comb(degree, k) for k in range(degree + 1)], float)
