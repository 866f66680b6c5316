"""Whether a profile sweeps a sphere, and how large that is at the most."""

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
"""Share of a sphere's radius within which its points are as far from its centre."""


def sphere_of(profile: Profile) -> tuple[float, float]:
    """The z of the centre and a radius that all of a profile is within, if it is a half circle.

    Else both are 0. The profile's points are C / w, with w and the coordinates of C in Bernstein's
    basis; so are |C|² and w², with C seen from the centre. The largest quotient of two coefficients
    of these is no less than the square of the distance of any point.
    """
    if profile.closed:
        return 0.0, 0.0
    ends = [own[k][k] for own, k in ((profile.pieces[0], 0), (profile.pieces[-1], -1))]
    low, high = (z / w for _, z, w in ends)
    centre, radius = 0.5 * (low + high), 0.5 * abs(high - low)
    # Of other profiles the last piece begins elsewhere, as a rule: they deform at frame rate.
    x, z, w = profile.pieces[-1][-1, 0].tolist()
    if not math.isclose(x * x + (z - centre * w) ** 2, (radius * w) ** 2, rel_tol=_ALIKE):
        return 0.0, 0.0
    least, most = math.inf, 0.0
    for pieces in profile.pieces:
        x, z, w = np.moveaxis(pieces, 2, 0)
        z = z - centre * w
        square = (x[:, 0] ** 2 + z[:, 0] ** 2) / w[:, 0] ** 2
        if not np.allclose(square, radius**2, rtol=_ALIKE, atol=0.0):
            return 0.0, 0.0
        quotients = (_squared(x) + _squared(z)) / _squared(w)
        least, most = min(least, quotients.min()), max(most, quotients.max())
    if not most - least <= 2.0 * _ALIKE * radius**2:
        return 0.0, 0.0
    # Coordinates of control points are no larger than the size, nor is that of the centre. So each
    # coefficient of |C|² adds up no more than 5 size² times that of w². It errs by less than
    # 4 (degree + 4) u of that, with the centre's subtraction, and w² by as small a share of itself:
    # by less than 24 (degree + 4) u size² in all. Here is more than twice as much.
    count = 16 * (max(own.shape[1] for own in profile.pieces) + 4)
    return centre, math.sqrt(most + count * DOUBLE_EPS * 4.0 * profile.size**2)


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
