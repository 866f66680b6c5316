"""What the people at the page have chosen; callbacks write it, the page's loop reads it."""

from __future__ import annotations

from dataclasses import dataclass, field

PairName = tuple[str, str]


@dataclass
class Choice:
    """Single fields are set as a whole, so no lock is needed."""

    pair: PairName | None = None
    """Highlighted: the rest is dim."""
    body: str | None = None
    """At the gizmo."""
    search: str = ""
    ignored: frozenset[PairName] = field(default_factory=frozenset)
    """Not drawn, not in the banner and not in the session's worst; the monitor watches them on."""
    lines: int = 12
    """So many of the nearest pairs are drawn, beside all that are not clear."""
    names: bool = True
    """Whether parts bear their names."""
    at_s: float | None = None
    """The moment of the session that is shown; None: now."""

    def ignore(self, pair: PairName) -> None:
        """Ignore a pair, or watch it again."""
        self.ignored ^= {pair}
        if self.pair in self.ignored:
            self.pair = None

    def listens_to(self, a: str, b: str) -> bool:
        """Return whether a pair's names hold every word of the search."""
        text = f"{a} {b}".lower()
        return all(word in text for word in self.search.lower().split())
