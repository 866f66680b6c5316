"""States of pairs and ticks made by hand."""

import math

import numpy as np

from proximity_monitor.scene import Thresholds, WatchedPair
from proximity_monitor.scene.state import PairState, PairStatus, Tick

NOWHERE = np.full(3, math.nan)


def pair(lower, *, upper=None, status=PairStatus.EXACT, silent=(), index=0, a="piston", b="block",
         points=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))):  # fmt: skip
    return PairState(
        a=a,
        b=b,
        lower=lower,
        upper=lower if upper is None else upper,
        point_a=np.array(points[0]),
        point_b=np.array(points[1]),
        status=status,
        age_s=0.0,
        silent=silent,
        session_min=math.inf,
        session_min_lower=math.inf,
        index=index,
    )


def tick(*pairs, far=0, elapsed_s=0.001):
    return Tick(pairs, elapsed_s, budget_s=0.01, searched=(), left=0, far=far)


def watched(count=1, reach=math.inf):
    limits = Thresholds(0.0, 0.0, 0.0)
    names = [("piston", "block")] + [(f"a{i}", f"b{i}") for i in range(1, count)]
    return tuple(WatchedPair(a, b, 0.0, 0.0, limits, False, range=reach) for a, b in names)
