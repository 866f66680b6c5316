"""Ticks of two pairs, as the page reads them."""

import numpy as np

from proximity_monitor.display.state import Body, Frame, Pairs, SceneInfo, Thresholds, Unit

NAMES = (("a", "b"), ("a", "c"))


def pairs(lower, upper, status=0, level=0, names=NAMES):
    n = len(names)
    return Pairs(
        names,
        np.array(lower, float),
        np.array(upper, float),
        np.zeros((n, 2, 3)),
        np.full(n, status, np.int8),
        np.full(n, level, np.int8),
        np.zeros(n),
        np.zeros(n),
        ("",) * n,
    )


def frame(stamp_s, lower, upper=None, **given):
    upper = lower if upper is None else upper
    return Frame(stamp_s, np.full((2, 7), stamp_s), pairs(lower, upper, **given))


def scene_and_frame(*, unlisted=0, range_m=0.1):
    """Return a scene of three pairs, and a tick in which body a has a margin of 0.01 m to stop."""
    names = (("a", "b"), ("c", "a"), ("b", "c"))
    thresholds = {("c", "a"): Thresholds(0.05, 0.03, 0.0)}
    bodies = tuple(Body(name, True, None, False, "", range=range_m) for name in "abc")
    told = Pairs(
        names, np.array([0.3, 0.04, 0.001]), np.ones(3), np.zeros((3, 2, 3)), np.zeros(3, np.int8),
        np.zeros(3, np.int8), np.zeros(3), np.zeros(3), ("",) * 3,
    )  # fmt: skip
    scene = SceneInfo(
        "s", "", "w", Unit("m", 1.0), bodies, frozenset(), 3 + unlisted,
        Thresholds(0.1, 0.02, 0.0), thresholds, True, {},
    )  # fmt: skip
    return scene, Frame(0.0, np.zeros((0, 7)), told)
