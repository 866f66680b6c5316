"""Parts that look small are drawn with fewer triangles: no card, or a slow one, draws all of them.

The browser makes the coarser meshes (by meshoptimizer, which stops where its measure of the error
is 2 % of the part), and chooses among them in each frame, by how far the part is from its camera.
"""

from __future__ import annotations

import math

import numpy as np

PIXELS = 16.0
"""Triangles that look smaller than so many pixels are more than the eye needs."""

SHARES = (1 / 4, 1 / 16, 1 / 64)
"""Of a part's triangles, from near to far."""

FEWEST = 256
"""So many triangles a part keeps at least."""

FOCAL = 704.0
"""Focal length in pixels of a picture with 1,080 lines, 75 degrees high."""


def has_levels(count: int) -> bool:
    """Return whether a part of so many triangles is drawn with fewer where it looks small."""
    return SHARES[0] * count >= FEWEST


def levels(corners: np.ndarray, count: int, focal: float) -> tuple[tuple[float, float], ...]:
    """Return from which distance on which share of a part's triangles is enough; empty: all.

    A ball of radius r covers pi (f r / d)^2 pixels at the distance d, with the focal length f, and
    half of its n triangles face the camera. On average they are smaller than p pixels each where
    d > f r sqrt(2 pi / (n p)).

    Args:
        corners: (k, 3) of the triangles.
        count: of triangles.
        focal: length in pixels of the browser's camera.
    """
    radius = 0.5 * float(np.linalg.norm(np.ptp(corners, axis=0))) if len(corners) else 0.0
    return tuple(
        # Its nearest point counts, which is nearer than its middle.
        (radius * (1.0 + focal * math.sqrt(2.0 * math.pi / (share * count * PIXELS))), share)
        for share in SHARES
        if share * count >= FEWEST
    )
