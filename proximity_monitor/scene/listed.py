"""The listed pairs of a tick as arrays, whoever made the tick."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.state import STATUSES, PairState, PairStates

_UNKNOWN = np.full((2, 3), np.nan)


def as_arrays(pairs: Sequence[PairState]) -> PairStates:
    """Return the pairs as arrays: as they are, if a monitor made them, else packed one by one."""
    if isinstance(pairs, PairStates):
        return pairs
    names = tuple(dict.fromkeys(name for pair in pairs for name in (pair.a, pair.b)))
    place = {name: i for i, name in enumerate(names)}
    kinds = {}
    for pair in pairs:
        kinds |= zip((pair.a, pair.b), pair.kinds, strict=False)
    return PairStates(
        names=names,
        positions=np.array([pair.index for pair in pairs], dtype=np.int64),
        bodies=np.array([(place[p.a], place[p.b]) for p in pairs], np.int64).reshape(-1, 2),
        lower=np.array([pair.lower for pair in pairs]),
        upper=np.array([pair.upper for pair in pairs]),
        points=np.array([(pair.point_a, pair.point_b) for pair in pairs]).reshape(-1, 2, 3),
        status=np.array([STATUSES.index(pair.status) for pair in pairs], dtype=np.int8),
        age_s=np.array([pair.age_s for pair in pairs]),
        silent=np.array([(p.a in p.silent, p.b in p.silent) for p in pairs], bool).reshape(-1, 2),
        session_min=np.array([pair.session_min for pair in pairs]),
        session_min_lower=np.array([pair.session_min_lower for pair in pairs]),
        kinds=tuple(kinds.get(name, engine.Model) for name in names),
        elements=np.array([pair.elements for pair in pairs], np.int32).reshape(-1, 2),
        parameters=np.array(
            [_UNKNOWN if p.parameters is None else p.parameters for p in pairs], np.float64
        ).reshape(-1, 2, 3),
    )
