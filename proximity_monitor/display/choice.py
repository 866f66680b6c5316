"""The choices of the person at a page; callbacks write them, the page's loop reads them."""

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
    """None: the opacity that the scene says."""
    edges: bool = True
    """Whether its sharp edges are drawn."""
    bands: bool = False
    """Whether it is coloured by clearance."""


PLAIN = Look()


@dataclass
class Choice:
    """One page's choices. Each field is set as a whole, so no lock is needed."""

    pair: PairName | None = None
    """The highlighted pair; the other parts are dimmed."""
    body: str | None = None
    """The body at the gizmo."""
    search: str = ""
    state: str = ""
    """Only pairs of this state are listed, one of `order.KINDS`; empty: of every state."""
    part: str = ""
    """Only pairs of this body are listed; empty: of every body."""
    status: str = ""
    """Only pairs of this status are listed, one of `decisions.STATUSES`; empty: of every status."""
    group: str = ""
    """How the list is grouped, one of `listing.GROUPS`; empty: not at all."""
    ignored: frozenset[PairName] = field(default_factory=frozenset)
    """Ignored pairs: not drawn, not in the banner, and not in the session's minimum; the monitor
    keeps watching them."""
    lines: int = 12
    """How many of the nearest pairs are drawn, besides all that are not clear."""
    names: bool = True
    """Whether parts show their names."""
    looks: Mapping[str, Look] = field(default_factory=dict)
    """By name, the looks of parts that differ from what the scene says."""
    at_s: float | None = None
    """The moment of the session to show; None: now."""
    seen: tuple[PairName, Snapshot] | None = None
    """A pair that the page looks back at, as it was; the session may not have kept that tick."""

    @property
    def when(self) -> str:
        """The word for the moment that is shown."""
        return "now" if self.at_s is None else "then"

    @property
    def filtered(self) -> bool:
        """Whether the filters may leave pairs out of the list."""
        return bool(self.search or self.state or self.part or self.status)

    def look_back(self, pair: PairName, stamp_s: float, then: Snapshot | None) -> None:
        """Show a pair at a moment; `then` is its snapshot at that moment, None if not known."""
        self.seen = None if then is None else (pair, then)
        self.at_s, self.pair = stamp_s, pair

    def ignore(self, pair: PairName) -> None:
        """Ignore a pair, or stop ignoring it."""
        self.ignored ^= {pair}
        if self.pair in self.ignored:
            self.pair = None

    def ignores(self, names: Sequence[PairName]) -> np.ndarray:
        """Return which (k,) of these pairs are ignored."""
        if not self.ignored:
            return np.zeros(len(names), bool)
        return np.fromiter((name in self.ignored for name in names), bool, len(names))
