"""What is known about pairs that a tick does not list.

Most of them are certainly beyond their range. But a body that is attached to another one is not
watched against it. And if very many bodies are silent, the monitor lists only some of their pairs.
"""

from __future__ import annotations

from typing import NamedTuple

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.signs import CLEAR_SIGN, STALE_SIGN, UNWATCHED_SIGN, Sign
from proximity_monitor.display.state import Health, Pairs, SceneInfo
from proximity_monitor.scene.naming import counted

_TOLD = {
    CLEAR_SIGN: "beyond its range",
    STALE_SIGN: "not listed, perhaps without a recent pose",
    UNWATCHED_SIGN: "not watched while one is attached to the other",
}


class Unlisted(NamedTuple):
    """How many pairs are not listed, by the reason."""

    far: int = 0
    """Pairs that are certainly beyond their range."""
    unsure: int = 0
    """Pairs of silent bodies, of which nothing is certain."""
    unwatched: int = 0
    unexplained: int = 0
    """Pairs for which the reason is not known."""

    @property
    def lines(self) -> list[str]:
        """Return the counts that are not 0, in words."""
        attached = "not watched: {} bodies are attached to each other"
        told = (
            (self.far, "beyond its range", "beyond their range"),
            (self.unsure, *2 * ("without a recent pose and not listed",)),
            (self.unwatched, attached.format("its"), attached.format("their")),
            (self.unexplained, *2 * ("not listed",)),
        )
        return [counted(*each) for each in told if each[0]]


def unlisted(pairs: Pairs, scene: SceneInfo, health: Health | None) -> Unlisted:
    """Count the pairs that a tick does not list.

    Args:
        pairs: the pairs of the tick.
        scene: the scene of the tick.
        health: the monitor's report of that time, at most some seconds older; None: not known.
    """
    left = scene.pairs - len(pairs)
    told = {} if health is None else health.clearance
    unsure, unwatched = (told.get(f"pairs {kind}", "") for kind in ("not listed", "not watched"))
    if not (unsure.isdecimal() and unwatched.isdecimal()):
        return Unlisted(unexplained=left)
    unsure = min(int(unsure), left)
    # Only the scene tells what was attached since the report. A pair that was detached since then
    # is still counted, which does no harm.
    unwatched = min(max(int(unwatched), len(scene.unwatched)), left - unsure)
    return Unlisted(left - unsure - unwatched, unsure, unwatched)


def sign_of(pair: PairName, pairs: Pairs, scene: SceneInfo) -> Sign:
    """Return the sign of a pair that a tick does not list."""
    if pair in scene.unwatched:
        return UNWATCHED_SIGN
    if pairs.all_silent:
        heard = pairs.silent_names.isdisjoint(pair)
    else:
        heard = pairs.heard_names.issuperset(pair)
    return CLEAR_SIGN if heard else STALE_SIGN


def reason(pair: PairName, pairs: Pairs, scene: SceneInfo) -> str:
    """Return, for people, why a tick does not list a pair."""
    return _TOLD[sign_of(pair, pairs, scene)]
