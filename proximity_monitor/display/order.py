"""The order of pairs: the worse state first, then the smaller margin to the pair's own limit."""

from __future__ import annotations

import numpy as np

from proximity_monitor.display.state import STALE, STOP, UNKNOWN, WARN, Pairs, SceneInfo

KINDS = ("contact", "stop", "warn", "stale", "clear")
"""The states of pairs, the worst first."""

CONTACT_KIND, STOP_KIND, WARN_KIND, STALE_KIND, CLEAR_KIND = range(len(KINDS))


def kinds(pairs: Pairs) -> np.ndarray:
    """Return each pair's state (k,), as a place in KINDS."""
    return _kinds(pairs.level, pairs.status, pairs.touching)


def kind_of(pairs: Pairs, row: int) -> str:
    """Return the state of one pair, one of KINDS."""
    one = slice(row, row + 1)
    return KINDS[_kinds(pairs.level[one], pairs.status[one], pairs.touching[one])[0]]


def _kinds(level: np.ndarray, status: np.ndarray, touching: np.ndarray) -> np.ndarray:
    found = np.full(len(level), CLEAR_KIND, np.int8)
    found[level == WARN] = WARN_KIND
    found[level == STOP] = STOP_KIND
    found[touching] = CONTACT_KIND
    found[(level == STALE) | (status == UNKNOWN)] = STALE_KIND
    return found


def margins(pairs: Pairs, scene: SceneInfo, of: np.ndarray) -> np.ndarray:
    """Return by how many metres (k,) each pair's lower bound is above the limit that matters.

    The limit is `warn` for a clear or stale pair and `stop` for a pair at warn or stop. For bodies
    that touch it is 0.

    Args:
        pairs: the pairs of a tick.
        scene: has the limits.
        of: (k,) the pairs' states, as places in KINDS.
    """
    warn, stop = scene.limits_of(pairs.names)
    limit = np.where(of >= STALE_KIND, warn, stop)
    return pairs.lower - np.where(of == CONTACT_KIND, 0.0, limit)


def urgent_first(pairs: Pairs, scene: SceneInfo) -> np.ndarray:
    """Return the rows (k,) of all pairs, the most urgent first; those without a pose come last."""
    of = kinds(pairs)
    return np.lexsort((pairs.upper, margins(pairs, scene, of), of))  # NaN sorts last
