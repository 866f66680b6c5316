"""How current the page is: live, stale, computing or disconnected; and the banner."""

from __future__ import annotations

import enum
import math
import re
from html import escape
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.inbox import News
from proximity_monitor.display.signs import CLEAR_SIGN, STALE_SIGN, Sign, clearance, length, sign
from proximity_monitor.display.state import BOUNDED, STALE, STOP, WARN, Frame, SceneInfo

LATE_TICKS = 5.0
LATE_S = 1.5
"""Without a tick for so many periods, and at least so many seconds, something is wrong."""

GONE_S = 3.5
"""Seconds without diagnostics, which come each second, after which the monitor is gone."""

LOOKING_BACK = "looking back: of all here only this state and the banner are of now"


class ConnectionState(enum.Enum):
    """How current the picture is."""

    DISCONNECTED = "disconnected"
    COMPUTING = "computing"
    STALE = "stale"
    LIVE = "live"


_PILLS = {
    ConnectionState.DISCONNECTED: ("✖", "#b3261e"),
    ConnectionState.COMPUTING: ("…", "#0072b2"),
    ConnectionState.STALE: ("?", "#7a7a85"),
    ConnectionState.LIVE: ("●", "#009e73"),
}


class Connection(NamedTuple):
    """The state of the connection, and a line that says why."""

    state: ConnectionState
    text: str
    current: bool = True
    """Whether the last tick that was read is current."""


def connection(news: News, now_s: float) -> Connection:
    """Return the state of the connection at a moment of the monotonic clock."""
    since_frame, since_health = now_s - news.frame_at_s, now_s - news.health_at_s
    rate = (news.scene.settings["rate_hz"] if news.scene is not None else None) or 1.0
    late = since_frame > max(LATE_S, LATE_TICKS / rate)
    silent = late and since_health > GONE_S
    if silent and not news.present:
        last = min(since_frame, since_health)
        what = f"the monitor is gone for {last:.0f} s"
        if math.isinf(since_health):
            what = "waiting for the monitor"
        return Connection(ConnectionState.DISCONNECTED, what, current=False)
    if news.unreadable:
        what = "; ".join(f"{kind}: {why}" for kind, why in sorted(news.unreadable.items()))
        return Connection(ConnectionState.STALE, f"cannot be read: {what}", current=False)
    if silent:
        if news.frame is None:
            return Connection(
                ConnectionState.COMPUTING, "the monitor is there and prepares its search"
            )
        what = f"no word from the monitor for {since_frame:.0f} s"
        return Connection(ConnectionState.STALE, what, current=False)
    if news.frame is None or news.parts is None or news.scene is None:
        what = "its first tick" if news.frame is None else "the meshes of the parts"
        return Connection(ConnectionState.COMPUTING, f"waiting for {what}")
    if late:
        activity = news.health.schedule.get("message", "") if news.health is not None else ""
        what = f"no tick for {since_frame:.1f} s: {activity}"
        return Connection(ConnectionState.STALE, what, current=False)
    if bodies := silent_bodies(news.frame):
        named = ", ".join(f"{name} {told}" for name, told in list(bodies.items())[:4])
        more = f" and {len(bodies) - 4} more" if len(bodies) > 4 else ""
        return Connection(ConnectionState.STALE, f"no recent pose: {named}{more}")
    bounded = int((news.frame.pairs.status == BOUNDED).sum())
    if bounded:
        what = "1 pair is" if bounded == 1 else f"{bounded} pairs are"
        return Connection(ConnectionState.COMPUTING, f"{what} not exact yet: bounds are shown")
    return Connection(ConnectionState.LIVE, "every number is of the present poses")


def silent_bodies(frame: Frame) -> dict[str, str]:
    """Return the bodies without a recent pose, and for how long."""
    found: dict[str, float] = {}
    pairs = frame.pairs
    for i in (pairs.level == STALE).nonzero()[0]:
        said = re.findall(r"[\w./-]+", pairs.silent[i])
        silent = [name for name in pairs.names[i] if name in said]
        age = frame.stamp_s - pairs.stamp_s[i]
        for name in silent:
            # With two silent bodies, the stamp belongs to the one that is silent for longer.
            known = found.get(name, math.inf)
            found[name] = age if math.isinf(known) else min(known, age)
    return {
        name: "never given" if math.isnan(age) else f"for {age:.1f} s"
        for name, age in found.items()
    }


def pill(told: Connection, choice: Choice) -> str:
    """Return the present state as HTML, even while the page looks back."""
    glyph, colour = _PILLS[told.state]
    text = escape(told.text if choice.at_s is None else LOOKING_BACK)
    return (
        f'<div class="pm pm-line" id="pm-connection" data-state="{told.state.value}">'
        f'<span class=pm-pill style="background:{colour}">{glyph} {told.state.value}</span>'
        f'<span class="pm-cut pm-small" title="{text}">{text}</span></div>'
    )


def banner(frame: Frame, scene: SceneInfo, choice: Choice, told: Connection) -> str:
    """Return a banner with the worst pair that is not clear, or that all are clear.

    It always takes the same room, so that nothing moves under the pointer.

    Args:
        frame: the last tick.
        scene: its scene.
        choice: which pairs are hidden.
        told: whether the tick is current: pairs that were clear may not be so any more.
    """
    pairs = frame.pairs
    wrong = [
        int(i)
        for i in np.flatnonzero((pairs.level != 0) | pairs.touching)
        if pairs.names[i] not in choice.ignored
    ]
    if not wrong:
        if not told.current:
            return _boxed(STALE_SIGN, told.text, "")
        text = "the one pair" if scene.pairs == 1 else f"all {scene.pairs} pairs"
        if hidden := len(choice.ignored):
            text = f"all but {hidden} hidden of {scene.pairs} pairs"
        return _boxed(CLEAR_SIGN, text, "")
    order = {STOP: 0, WARN: 1, STALE: 2}
    wrong.sort(
        key=lambda i: (not pairs.touching[i], order.get(int(pairs.level[i]), 3), pairs.lower[i])
    )
    i, level = wrong[0], pairs.level[wrong[0]]
    limits = scene.thresholds_of(pairs.names[i])
    said = pairs.silent[i] if level == STALE else clearance(pairs, i, scene.unit)
    if level in (STOP, WARN):
        limit, name = (limits.stop, "stop") if level == STOP else (limits.warn, "warn")
        said += f", {name} at {length(limit, scene.unit)}"
    a, b = pairs.names[i]
    more = f"+ {len(wrong) - 1} more" if len(wrong) > 1 else ""
    return _boxed(sign(pairs, i), f"{a} - {b}: {said}", more)


def _boxed(mark: Sign, text: str, more: str) -> str:
    role = "status" if mark is CLEAR_SIGN else "alert"
    return (
        f'<div class=pm><div class=pm-banner role={role} id="pm-banner" data-word="{mark.word}"'
        f' style="border-color:{mark.colour}" title="{escape(text)}">'
        f'<b style="color:{mark.colour}">{mark.glyph} {mark.word}</b>'
        f"<span class=pm-cut>{escape(text)}</span><span class=pm-dim>{more}</span></div></div>"
    )
