"""Ticks of two pairs, as the page reads them."""

import numpy as np

from proximity_monitor.display.state import Frame, Pairs

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
