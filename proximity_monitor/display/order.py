"""The order of pairs: the worse state first, then the smaller margin to the pair's threshold."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.state import STALE, STOP, UNKNOWN, WARN, Pairs, SceneInfo

KINDS = ("contact", "stop", "warn", "stale", "clear")
"""The states of pairs, the worst first."""

CONTACT_KIND, STOP_KIND, WARN_KIND, STALE_KIND, CLEAR_KIND = range(len(KINDS))


class Margin(NamedTuple):
    """How far a pair is at least from its next threshold, certainly."""

    to: str
    """The threshold, ``warn`` or ``stop``; or ``contact``. Empty: the pair is stale."""
    metres: float
    """The lower bound less that threshold. NaN: the pair is stale, so nothing is certain."""


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
    """Return each pair's margin (k,) in metres: its lower bound less the threshold that matters.

    The threshold is `warn` for a clear or stale pair and `stop` for a pair at warn or stop. For
    bodies that touch it is 0.

    Args:
        pairs: the pairs of a tick.
        scene: has the thresholds.
        of: (k,) the pairs' states, as places in KINDS.
    """
    warn, stop = scene.warn_and_stop(pairs.names)
    threshold = np.where(of >= STALE_KIND, warn, stop)
    return pairs.lower - np.where(of == CONTACT_KIND, 0.0, threshold)


def margin_of(pairs: Pairs, row: int, scene: SceneInfo) -> Margin:
    """Return the margin of one pair; see `margins`."""
    kind = KINDS.index(kind_of(pairs, row))
    if kind == STALE_KIND:
        return Margin("", math.nan)
    thresholds = scene.thresholds_of(pairs.names[row])
    to, at = "stop", thresholds.stop
    if kind == CLEAR_KIND:
        to, at = "warn", thresholds.warn
    elif kind == CONTACT_KIND:
        to, at = "contact", 0.0
    return Margin(to, float(pairs.lower[row]) - at)


def urgent_first(pairs: Pairs, scene: SceneInfo) -> np.ndarray:
    """Return the rows (k,) of all pairs, the most urgent first; those without a pose come last."""
    of = kinds(pairs)
    return np.lexsort((pairs.upper, margins(pairs, scene, of), of))  # NaN sorts last
