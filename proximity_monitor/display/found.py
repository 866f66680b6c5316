"""The conflicts of a session: pairs that were not clear, and pairs that have a decision."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.conflicts import UNDECIDED
from proximity_monitor.display.decisions import Decision, Decisions
from proximity_monitor.display.events import Event, Events
from proximity_monitor.display.order import CLEAR_KIND, KINDS, STALE_KIND
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import SIGNS, Sign, sign
from proximity_monitor.display.snapshot import Snapshot
from proximity_monitor.display.state import SceneInfo

CLOCK_S = 1e9
"""Seconds; larger stamps are those of a wall clock, smaller ones those of a simulation."""


class Conflict(NamedTuple):
    """A pair that was not clear in the session, or that somebody decided about."""

    pair: PairName
    state: str
    """The worst state in the session, one of `order.KINDS`."""
    worst: Snapshot | None
    """The pair at its smallest clearance; None: no clearance was ever known."""
    decision: Decision
    events: Sequence[Event]
    """The pair's changes of state, the oldest first."""
    lowest: float
    """The smallest lower bound of all ticks in metres; NaN: not known."""

    @property
    def least(self) -> float:
        """The smallest upper bound in metres; NaN: not known."""
        return math.nan if self.worst is None else self.worst.upper

    def sign(self, scene: SceneInfo) -> Sign:
        """Return the sign of the worst state."""
        found = [event.after for event in self.events]
        if self.worst is not None:
            found.append(sign(self.worst.frame(self.pair).pairs, 0, scene))
        # If no kept moment has that state, no bounds prove that the pair reached the threshold.
        # Then take the mildest sign of the state.
        like = [each for each in SIGNS if each.kind == self.state]
        return next((each for each in like if each in found), like[-1])


class Found(NamedTuple):
    """A conflict, with the values that decide its place in a list."""

    pair: PairName
    kind: int
    """The worst state in the session, as a place in `order.KINDS`."""
    least: float
    """The smallest upper bound in metres; infinite: not known."""


def find(scene: SceneInfo, session: Session, events: Events, decisions: Decisions) -> list[Found]:
    """Return the conflicts, sorted by the worst state, then by the smallest clearance.

    Args:
        scene: decisions about parts that the scene does not have are left out.
        session: has the states and the smallest clearances.
        events: the changes of state that are still kept.
        decisions: people's decisions.
    """
    found = {pair: (kind, least) for pair, kind, least in session.conflicts()}

    def note(pair: PairName, kind: int) -> None:
        known = found.get(pair)
        if known is None:
            worst = session.worst(pair)
            known = CLEAR_KIND, math.inf if worst is None else worst[1].upper
        found[pair] = min(kind, known[0]), known[1]

    for event in events.all:
        kind = KINDS.index(event.after.kind)
        if kind < STALE_KIND:  # a stale pair is no conflict, because nothing is known about it
            note(event.pair, kind)
    for pair in _decided(scene, decisions):
        note(pair[::-1] if session.knows(pair[::-1]) else pair, CLEAR_KIND)
    return sorted((Found(pair, *each) for pair, each in found.items()), key=lambda one: one[1:])


def _decided(scene: SceneInfo, decisions: Decisions) -> list[PairName]:
    """Return the pairs of a scene that have a decision, the parts of each in the scene's order."""
    places = {name: place for place, name in enumerate(scene.names)}
    both = (sorted(key, key=places.get) for key in decisions if key <= places.keys())
    return [(pair[0], pair[1]) for pair in both if len(pair) == 2]


def conflicts(
    found: Iterable[Found], session: Session, events: Events, decisions: Decisions
) -> list[Conflict]:
    """Return the details of the conflicts in `found`, in the same order; arguments as in `find`."""
    of_pair: dict[PairName, list[Event]] = defaultdict(list)
    for event in events.all:
        of_pair[event.pair].append(event)
    made = []
    for pair, kind, _ in found:
        worst = session.worst(pair)
        decision = decisions.get(frozenset(pair), UNDECIDED)
        about = worst and worst[1], decision, of_pair.get(pair, ()), session.lowest(pair)
        made.append(Conflict(pair, KINDS[kind], *about))
    return made


def moment(stamp_s: float, start_s: float) -> str:
    """Return a moment of the session for people, with the wall clock's time if stamps are of it."""
    text = f"{stamp_s - start_s:.2f} s"
    if stamp_s < CLOCK_S:
        return text
    return (
        f"{text} ({datetime.fromtimestamp(stamp_s, UTC).isoformat(' ', 'milliseconds')[:-6]} UTC)"
    )
