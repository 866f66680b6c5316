"""The choices of the people at the page; callbacks write them, the page's loop reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from proximity_monitor.display.snapshot import Snapshot

PairName = tuple[str, str]


class Look(NamedTuple):
    """How a part is drawn."""

    opacity: float | None = None
    """None: as the scene says."""
    edges: bool = True
    """Whether its sharp edges are drawn."""
    bands: bool = False
    """Whether it is coloured by clearance."""


PLAIN = Look()


@dataclass
class Choice:
    """Each field is set as a whole, so no lock is needed."""

    pair: PairName | None = None
    """The highlighted pair; the rest is dim."""
    body: str | None = None
    """At the gizmo."""
    search: str = ""
    state: str = ""
    """Only pairs of this state are listed, one of `order.KINDS`; empty: of all."""
    part: str = ""
    """Only pairs of this body are listed; empty: of all."""
    status: str = ""
    """Only pairs of this status are listed, one of `decisions.STATUSES`; empty: of all."""
    group: str = ""
    """By what the list is grouped, one of `listing.GROUPS`; empty: not at all."""
    ignored: frozenset[PairName] = field(default_factory=frozenset)
    """Ignored pairs: not drawn, not in the banner, and not in the session's minimum; the monitor
    keeps watching them."""
    lines: int = 12
    """How many of the nearest pairs are drawn, besides all that are not clear."""
    names: bool = True
    """Whether parts show their names."""
    looks: Mapping[str, Look] = field(default_factory=dict)
    """By part, of those that do not look as the scene says."""
    at_s: float | None = None
    """The moment of the session to show; None: now."""
    seen: tuple[PairName, Snapshot] | None = None
    """A pair that somebody went back to, as it was: the session may not have kept that tick."""

    @property
    def when(self) -> str:
        """What people call the moment that is shown."""
        return "now" if self.at_s is None else "then"

    @property
    def filtered(self) -> bool:
        """Whether some pairs are not listed."""
        return bool(self.search or self.state or self.part or self.status)

    def look_back(self, pair: PairName, stamp_s: float, then: Snapshot | None) -> None:
        """Show a pair at a moment; `then` is the pair there, if that is known."""
        self.seen = None if then is None else (pair, then)
        self.at_s, self.pair = stamp_s, pair

    def ignore(self, pair: PairName) -> None:
        """Ignore a pair, or watch it again."""
        self.ignored ^= {pair}
        if self.pair in self.ignored:
            self.pair = None

    def ignores(self, names: Sequence[PairName]) -> np.ndarray:
        """Return which (k,) of these pairs are ignored."""
        if not self.ignored:
            return np.zeros(len(names), bool)
        return np.fromiter((name in self.ignored for name in names), bool, len(names))
