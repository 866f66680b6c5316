"""The choices of the people at the page; callbacks write them, the page's loop reads them."""

from __future__ import annotations

from dataclasses import dataclass, field

PairName = tuple[str, str]


@dataclass
class Choice:
    """Each field is set as a whole, so no lock is needed."""

    pair: PairName | None = None
    """The highlighted pair; the rest is dim."""
    body: str | None = None
    """At the gizmo."""
    search: str = ""
    ignored: frozenset[PairName] = field(default_factory=frozenset)
    """Ignored pairs: not drawn, not in the banner, and not in the session's minimum; the monitor
    keeps watching them."""
    lines: int = 12
    """How many of the nearest pairs are drawn, besides all that are not clear."""
    names: bool = True
    """Whether parts show their names."""
    at_s: float | None = None
    """The moment of the session to show; None: now."""

    def ignore(self, pair: PairName) -> None:
        """Ignore a pair, or watch it again."""
        self.ignored ^= {pair}
        if self.pair in self.ignored:
            self.pair = None

    def listens_to(self, a: str, b: str) -> bool:
        """Return whether a pair's names contain every word of the search."""
        text = f"{a} {b}".lower()
        return all(word in text for word in self.search.lower().split())
