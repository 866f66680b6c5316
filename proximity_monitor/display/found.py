"""The conflicts of a session: the pairs that were not clear, and those decided about."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.conflicts import UNDECIDED
from proximity_monitor.display.decisions import Decision, Decisions
from proximity_monitor.display.events import Event, Events
from proximity_monitor.display.order import CLEAR_KIND, KINDS, STALE_KIND, kinds
from proximity_monitor.display.session import Session
from proximity_monitor.display.snapshot import Snapshot
from proximity_monitor.display.state import Frame

CLOCK_S = 1e9
"""Stamps beyond it are of a clock on the wall, others those of a simulation."""


class Conflict(NamedTuple):
    """A pair that was not clear in the session, or that somebody decided about."""

    pair: PairName
    state: str
    """The worst of the session, one of `order.KINDS`."""
    worst: Snapshot | None
    """Its smallest clearance; None: it never had one."""
    decision: Decision
    events: Sequence[Event]
    """The oldest first."""


def conflicts(
    last: Frame, session: Session, events: Events, decisions: Decisions
) -> list[Conflict]:
    """Return the conflicts, the worst state first and then the smallest clearance.

    Args:
        last: the newest tick.
        session: the smallest clearances.
        events: the changes of state that are still known.
        decisions: what people decided.
    """
    of_pair: dict[PairName, list[Event]] = defaultdict(list)
    found: dict[PairName, int] = {}

    def note(pair: PairName, kind: int) -> None:
        if kind < STALE_KIND:  # what is stale is no conflict: nothing is known
            found[pair] = min(kind, found.get(pair, CLEAR_KIND))

    for event in events.all:
        of_pair[event.pair].append(event)
        note(event.pair, KINDS.index(event.after.kind))
    least, now = session.worst_of_each(), kinds(last.pairs)
    for pair, worst in least.items():
        note(pair, int(kinds(worst.frame(pair).pairs)[0]))
    for i in np.flatnonzero(now < STALE_KIND):
        note(last.pairs.names[i], int(now[i]))
    for pair in (*last.pairs.names, *least):
        if frozenset(pair) in decisions:
            found.setdefault(pair, CLEAR_KIND)
    made = [
        Conflict(
            pair,
            KINDS[kind],
            least.get(pair),
            decisions.get(frozenset(pair), UNDECIDED),
            of_pair[pair],
        )
        for pair, kind in found.items()
    ]
    return sorted(made, key=_urgency)


def _urgency(conflict: Conflict) -> tuple[int, float]:
    least = float("inf") if conflict.worst is None else conflict.worst.upper
    return KINDS.index(conflict.state), least


def moment(stamp_s: float, start_s: float) -> str:
    """Return a moment of the session for people, by the wall's clock too where stamps are of it."""
    text = f"{stamp_s - start_s:.2f} s"
    if stamp_s < CLOCK_S:
        return text
    return (
        f"{text} ({datetime.fromtimestamp(stamp_s, UTC).isoformat(' ', 'milliseconds')[:-6]} UTC)"
    )
