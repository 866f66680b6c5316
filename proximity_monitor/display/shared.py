"""What the pages of all browsers share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import viser

from proximity_monitor.display.conflicts import DecisionStore
from proximity_monitor.display.events import Events
from proximity_monitor.display.holds import Holds
from proximity_monitor.display.received import Part
from proximity_monitor.display.session import Session
from proximity_monitor.display.state import Frame, SceneInfo
from proximity_monitor.display.tried import Tried


class Shown(NamedTuple):
    """What a page shows; all of it belongs to one scene."""

    scene: SceneInfo
    frame: Frame
    """The tick that the page shows, now or in the past."""
    parts: Sequence[Part]
    newest: Frame
    """The last tick."""


@dataclass(frozen=True)
class Shared:
    """What all pages share: there is one monitor, one session and one set of held bodies."""

    server: viser.ViserServer
    holds: Holds
    session: Session
    events: Events
    decisions: DecisionStore
    tried: Tried
    ask: Callable[[Mapping[str, float | str]], None]
    """Sends parameters to the monitor."""
    ask_player: Callable[[Mapping[str, float]], None]
    """Sends parameters to the player."""
    reset_minima: Callable[[], None]
    """Asks the monitor to forget its smallest clearances."""
