"""Patches whose weights differ by eight orders of magnitude: large cells that bend in one plane.

Such a cell may hardly bend along the direction of its bound, while the direction is poor because
the cell bends across it.
"""

import numpy as np
import pytest
from engine_bodies import IDENTITY, translation
from engine_surfaces import clamped, patch, unclamped

from proximity_monitor import engine

AWAY = translation(3.0, 1.0, 0.5)


@pytest.mark.parametrize("seed", [48, 49, 142, 168, 656])
def test_searches_come_to_an_end(seed):
    """Not so if cells are divided only where they bend along the direction of their bound."""
    p, q, r, s = (int(degree) for degree in np.random.default_rng(seed).integers(1, 6, 4))
    knots = clamped if seed % 2 else unclamped
    a = patch(seed, (p + 3, q + 3), (p, q), knots, 8.0)
    b = patch(seed + 1000, (r + 3, s + 3), (r, s), decades=0.0 if seed % 2 else 8.0)
    found = engine.distance(a, IDENTITY, b, AWAY)
    assert found.status is engine.Status.EXACT
    near = engine.within(a, IDENTITY, b, AWAY, 0.99 * found.lower)
    assert near.decided
    assert not near.within
