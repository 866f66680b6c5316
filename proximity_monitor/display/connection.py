"""How current the page is: live, stale, computing or disconnected; and the banner."""

from __future__ import annotations

import enum
import math
from collections.abc import Collection, Mapping
from functools import lru_cache
from html import escape
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.fresh import GREEN, GREY, aging, fading, patience_s
from proximity_monitor.display.inbox import GONE_S, News
from proximity_monitor.display.order import urgent_first
from proximity_monitor.display.signs import (
    CLEAR_SIGN,
    HIDDEN_SIGN,
    STALE_SIGN,
    UNWATCHED_SIGN,
    Sign,
    clearance,
    length,
    mark,
    sign,
    unproved,
)
from proximity_monitor.display.state import BOUNDED, STALE, STOP, WARN, Frame, Pairs, SceneInfo
from proximity_monitor.display.unlisted import Unlisted, unlisted
from proximity_monitor.scene.naming import counted


class ConnectionState(enum.Enum):
    """How current the picture is."""

    DISCONNECTED = "disconnected"
    COMPUTING = "computing"
    STALE = "stale"
    LIVE = "live"


_PILLS = {
    ConnectionState.DISCONNECTED: ("✖", "#b3261e"),
    ConnectionState.COMPUTING: ("…", fading("#0072b2")),
    ConnectionState.STALE: ("?", GREY),
    ConnectionState.LIVE: ("●", fading(GREEN)),
}

_PAST = fading("#6a3d9a")


class Connection(NamedTuple):
    """The state of the connection, and a line that gives the reason."""

    state: ConnectionState
    text: str
    current: bool = True
    """Whether the newest tick is current."""


def connection(news: News, now_s: float) -> Connection:
    """Return the state of the connection at a moment of the monotonic clock."""
    since_frame, since_health = now_s - news.frame_at_s, now_s - news.health_at_s
    late = since_frame > patience_s(news.scene)
    silent = late and since_health > GONE_S
    if silent and not news.present:
        last = min(since_frame, since_health)
        what = f"monitor gone for {last:.0f} s"
        if math.isinf(since_health):
            what = "waiting for a monitor: start one, or compare namespaces and ROS_DOMAIN_ID"
        return Connection(ConnectionState.DISCONNECTED, what, current=False)
    if news.unreadable:
        what = "; ".join(f"{kind}: {why}" for kind, why in sorted(news.unreadable.items()))
        return Connection(ConnectionState.STALE, f"cannot be read: {what}", current=False)
    if silent:
        if news.frame is None:
            return Connection(
                ConnectionState.COMPUTING,
                "the monitor is preparing its search",
                current=False,
            )
        what = f"no word from the monitor for {since_frame:.0f} s"
        return Connection(ConnectionState.STALE, what, current=False)
    if news.frame is None or news.parts is None or news.scene is None:
        what = "the first tick" if news.frame is None else "the meshes of the parts"
        return Connection(ConnectionState.COMPUTING, f"waiting for {what}", current=False)
    if late:
        activity = news.health.schedule.get("message", "") if news.health is not None else ""
        what = f"no tick for {since_frame:.1f} s: {activity}"
        return Connection(ConnectionState.STALE, what, current=False)
    if bodies := silent_bodies(news.frame):
        named = ", ".join(f"{name} ({told})" for name, told in list(bodies.items())[:4])
        more = f" and {len(bodies) - 4} more" if len(bodies) > 4 else ""
        return Connection(ConnectionState.STALE, f"no recent pose: {named}{more}")
    bounded = int((news.frame.pairs.status == BOUNDED).sum())
    if bounded:
        what = counted(bounded, "pair is", "pairs are")
        return Connection(ConnectionState.COMPUTING, f"{what} not exact yet: bounds are shown")
    return Connection(ConnectionState.LIVE, "the numbers match the present poses")


@lru_cache(maxsize=1)
def silent_bodies(frame: Frame) -> Mapping[str, str]:
    """Return the bodies without a recent pose, and for how long. Cached, so it runs once a tick."""
    found: dict[str, float] = {}
    pairs = frame.pairs
    rows = np.flatnonzero(pairs.level == STALE)
    ages = frame.stamp_s - pairs.stamp_s[rows]
    for i, age in zip(rows.tolist(), ages.tolist(), strict=True):
        for name in pairs.silent_bodies.get(i, pairs.names[i]):
            # If both are silent, the stamp belongs to the one that is silent for longer.
            known = found.get(name)
            # A stamp is NaN if one of the two had none ever. That tells nothing of the other.
            found[name] = age if known is None else float(np.fmin(known, age))
    return {name: "never" if math.isnan(age) else f"{age:.1f} s" for name, age in found.items()}


def pill(
    told: Connection,
    choice: Choice,
    newest_s: float = 0.0,
    deforming: Collection[str] = (),
    shown_s: float | None = None,
) -> str:
    """Return the state as HTML. While the page looks back, it says *past* and never *live*.

    Args:
        told: the state of the connection.
        choice: holds the moment that is shown.
        newest_s: the stamp of the newest tick.
        deforming: bodies of which only the present shape is known.
        shown_s: the stamp of the tick that is shown; None: it is the chosen moment.
    """
    glyph, colour = _PILLS[told.state]
    state, text = told.state.value, escape(told.text)
    name, reason, title = f"{glyph} {state}", text, text
    if choice.at_s is not None:
        now = "" if told.state is ConnectionState.LIVE else f"; now {state}: {text}"
        shapes = f" and the shape of {escape(', '.join(sorted(deforming)))}" if deforming else ""
        which = f"only the banner{shapes} {'are' if deforming else 'is'} current"
        shown_s = choice.at_s if shown_s is None else shown_s
        other = _other_tick(shown_s - choice.at_s)
        text = f"looking back {newest_s - shown_s:.1f} s{other}: {which}{now}"
        state, name, reason, title, colour = "past", "◀ past", text, text, _PAST
    if told.current:  # otherwise the display knows the reason, and the text above has it
        then = "" if choice.at_s is None else f"{text}; "
        name, reason = aging(name, "? no news"), aging(text, f"{then}no tick came in time")
        title = ""  # a title cannot change when the news grows old
    return (
        f'<div class="pm pm-line" id="pm-connection" data-state="{state}">'
        f'<span class=pm-pill style="background:{colour}">{name}</span>'
        f'<span class="pm-cut pm-small" title="{title}">{reason}</span></div>'
    )


def _other_tick(late_s: float) -> str:
    """Return how far the shown tick is from the chosen moment; empty if they are the same."""
    if not late_s:
        return ""
    return f", at the tick {abs(late_s):.3g} s {'after' if late_s > 0.0 else 'before'} that moment"


def banner(
    frame: Frame,
    scene: SceneInfo,
    choice: Choice,
    told: Connection,
    left: Unlisted | None = None,
) -> str:
    """Return a banner with the worst pair that is not clear, or with the word that all are clear.

    The banner always takes the same room, so that nothing moves under the pointer. It is green only
    if it speaks of at least one pair and all of those are clear, including hidden ones.

    Args:
        frame: the last tick.
        scene: the scene of the tick.
        choice: says which pairs are hidden.
        told: says whether the tick is current; if not, pairs that were clear may not be so now.
        left: the pairs that the tick does not list; None: the reasons are not known.
    """
    left = left or unlisted(frame.pairs, scene, None)
    pairs, order = frame.pairs, urgent_first(frame.pairs, scene)
    wrong = order[((pairs.level != 0) | pairs.touching)[order]]
    hidden = np.array([pairs.names[i] in choice.ignored for i in wrong], bool)
    shown, hidden = wrong[~hidden], wrong[hidden]
    when = "" if choice.at_s is None else "now: "
    if len(shown):
        more = f"+ {len(shown) - 1} more" if len(shown) > 1 else ""
        name, figures = _told(pairs, shown[0], scene)
        return _boxed(sign(pairs, shown[0], scene), when + name, figures, more=more)
    if len(hidden):
        count = f"{counted(len(hidden), 'hidden pair is', 'hidden pairs are')} not clear"
        first = sign(pairs, hidden[0], scene)
        name, figures = _told(pairs, hidden[0], scene)
        return _boxed(HIDDEN_SIGN, f"{when}{count}:", figures, lead=f"{first.word} {name}")
    if not told.current:
        return _boxed(STALE_SIGN, told.text)
    if left.unsure:
        return _boxed(STALE_SIGN, f"{when}{'; '.join(left.lines)}")
    which = " listed" if left.unexplained else " watched" if left.unwatched else ""
    count = scene.pairs - left.unexplained - left.unwatched
    if not count:
        return _boxed(UNWATCHED_SIGN, f"{when}no pair is{which or ' watched'}")
    text = f"the one{which} pair" if count == 1 else f"all {count}{which} pairs"
    if choice.ignored:
        text += f", {len(choice.ignored)} of them hidden"
    if not len(pairs):
        return _boxed(CLEAR_SIGN, when + text)
    a, b = pairs.names[i := int(np.argmin(np.nan_to_num(pairs.lower, nan=np.inf)))]
    nearest = "nearest" if len(pairs) == scene.pairs else "nearest of those listed"
    figures = _Figures(clearance(pairs, i, scene.unit))
    return _boxed(CLEAR_SIGN, f"{when}{text};", figures, lead=f"{nearest} {a} - {b}:")


class _Figures(NamedTuple):
    """What the banner tells of a pair's clearance."""

    number: str
    how: str = ""
    threshold: str = ""


def _told(pairs: Pairs, i: int, scene: SceneInfo) -> tuple[str, _Figures]:
    """Return a pair's name and its figures."""
    level, thresholds = pairs.level[i], scene.thresholds_of(pairs.names[i])
    a, b = pairs.names[i]
    if level == STALE:
        return f"{a} - {b}:", _Figures("", pairs.silent[i])
    said, how, threshold = clearance(pairs, i, scene.unit), "", ""
    if level in (STOP, WARN):
        at, name = (thresholds.stop, "stop") if level == STOP else (thresholds.warn, "warn")
        how = "not proved above" if unproved(pairs, i, scene) else ""
        said, threshold = f"{said},", f"{name} at {length(at, scene.unit)}"
    return f"{a} - {b}:", _Figures(said, how, threshold)


def _boxed(
    shown: Sign, text: str, figures: _Figures | None = None, *, lead: str = "", more: str = ""
) -> str:
    """Return the banner, which has two lines. If they are too short, words are cut, not numbers."""
    role = "status" if shown is CLEAR_SIGN else "alert"
    told, kind = "", "pm-both"
    if figures is not None:
        kind = "pm-cut"
        words = (("pm-cut", lead), ("pm-on", figures.number), ("pm-cut", figures.how),
                 ("pm-on", figures.threshold))  # fmt: skip
        told = "".join(f"<span class={c}>{escape(each)}</span>" for c, each in words if each)
        told = f"<span class=pm-figures>{told}</span>"
    title = " ".join(filter(None, (text, lead, *(figures or ()))))
    return (
        f'<div class=pm><div class=pm-banner role={role} id="pm-banner" data-word="{shown.word}"'
        f' style="border-color:{shown.colour}" title="{escape(title)}">'
        f'<b style="color:{shown.colour}">{mark(shown)}</b>'
        f"<span class={kind}>{escape(text)}</span>{told}"
        f"<span class=pm-dim>{more}</span></div></div>"
    )
