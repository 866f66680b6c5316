"""Levels of detail: a part that looks small is drawn with fewer triangles.

Without a graphics card, or with a slow one, drawing all of them would take too long. The browser
makes the coarser meshes (with meshoptimizer, which stops where its measure of the error is 2 % of
the part). In each frame it chooses among them by the part's distance from its camera.
"""

from __future__ import annotations

import math

import numpy as np

PIXELS = 16.0
"""Triangles smaller than this on the screen, in pixels, are finer than the eye needs."""

SHARES = (1 / 4, 1 / 16, 1 / 64)
"""Shares of a part's triangles that the levels draw, from near to far."""

FEWEST = 256
"""Fewest triangles of a level."""

FOCAL = 704.0
"""Focal length in pixels of a picture with 1,080 lines and a vertical angle of 75 degrees."""


def has_levels(count: int) -> bool:
    """Return whether a part of `count` triangles has levels of detail."""
    return SHARES[0] * count >= FEWEST


def levels(corners: np.ndarray, count: int, focal: float) -> tuple[tuple[float, float], ...]:
    """Return the distances from which on each share of a part's triangles is enough.

    Each entry is a distance and a share; no entry means that all triangles are always drawn. A ball
    of radius r covers pi (f r / d)^2 pixels at the distance d, with the focal length f, and half of
    its n triangles face the camera. On average each is smaller than p pixels if
    d > f r sqrt(2 pi / (n p)).

    Args:
        corners: (k, 3) corners of the triangles.
        count: number of triangles.
        focal: focal length of the browser's camera in pixels.
    """
    radius = 0.5 * float(np.linalg.norm(np.ptp(corners, axis=0))) if len(corners) else 0.0
    return tuple(
        # The part's nearest point counts, so its radius is added to the distance of its middle.
        (radius * (1.0 + focal * math.sqrt(2.0 * math.pi / (share * count * PIXELS))), share)
        for share in SHARES
        if share * count >= FEWEST
    )
