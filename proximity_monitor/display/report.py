"""The report of a session's conflicts: one self-contained HTML file, and a table."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from html import escape

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.decisions import NEW
from proximity_monitor.display.events import Event
from proximity_monitor.display.export import csv_of
from proximity_monitor.display.found import Conflict, moment
from proximity_monitor.display.order import Margin, kind_of, margin_of
from proximity_monitor.display.signs import Sign, clearance, length, margin, number, sign
from proximity_monitor.display.snapshot import Snapshot
from proximity_monitor.display.state import Frame, Pairs, SceneInfo, Unit
from proximity_monitor.scene.naming import counted

PICTURES = 40
"""How many conflicts have a picture, the worst first."""

EVENTS = 50
"""How many changes of state the report lists for each conflict, the newest."""

PICTURED = 5
"""How many changes of state of each conflict have a picture, the newest."""

EVENT_PICTURES = 40
"""How many changes of state have a picture in the whole report, those of the worst conflicts."""

_HEAD = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<style>
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62em; margin: 2em auto;
       padding: 0 1em; font-variant-numeric: tabular-nums; }
section { border-top: 2px solid #8886; margin-top: 2em; break-inside: avoid-page; }
h2 { overflow-wrap: anywhere; }
img { max-width: 100%; border: 1px solid #8886; }
.seen { display: flex; gap: 1em; }
.seen img { flex: 1; min-width: 0; }
td img { width: 15em; }
table { border-collapse: collapse; margin: .6em 0; }
th, td { text-align: left; padding: 2px 14px 2px 0; vertical-align: top; }
.n { text-align: right; white-space: nowrap; }
.dim { opacity: .65; }
</style>"""


def report_html(
    found: Sequence[Conflict],
    pictures: Mapping[PairName, Sequence[bytes]],
    scene: SceneInfo,
    last: Frame,
    span_s: tuple[float, float],
    of_events: Mapping[int, bytes],
) -> str:
    """Return the report as an HTML document.

    Args:
        found: the conflicts, in the order of the report.
        pictures: PNG files of some conflicts at their smallest clearances: one of whole parts, then
            one of a section through the gap if the gap is small on the first.
        scene: the scene of the session.
        last: the newest tick.
        span_s: stamps of the session's beginning and end.
        of_events: PNG files of some changes of state, by the events' numbers.
    """
    start, end = span_s
    thresholds = scene.thresholds
    made = datetime.now(UTC).isoformat(" ", "seconds")[:-6]
    watched = counted(scene.pairs, "pair is", "pairs are")
    count = counted(len(found), "conflict", "conflicts")
    rest = len(found) - len(pictures)
    without = f" {counted(rest, 'has', 'have')} no picture." if rest else ""
    told = [
        _HEAD,
        f"<title>Conflicts of {escape(scene.name)}</title></head><body>",
        f"<h1>Conflicts of {escape(scene.name)}</h1><p>{escape(scene.description)}</p>",
        f"<p>Made {made} UTC, from a session of {end - start:.1f} s that ended at"
        f" {moment(end, start)}. {watched} watched, {count} found. Unless a pair has its own"
        f" thresholds, warn is {length(thresholds.warn, scene.unit)} and stop"
        f" {length(thresholds.stop, scene.unit)}. Every"
        f" clearance is certified to lie between its two bounds.{without}</p>",
    ]
    for conflict in found:
        seen = pictures.get(conflict.pair, ())
        told.append(_section(conflict, seen, of_events, scene, last, start))
    return "\n".join([*told, "</body></html>\n"])


def pictured(found: Sequence[Conflict]) -> list[Event]:
    """Return the changes of state that get a picture, those of the first conflicts first."""
    events = [event for conflict in found for event in conflict.events[-PICTURED:]]
    return [event for event in events if event.sight is not None][:EVENT_PICTURES]


def _section(
    conflict: Conflict,
    pictures: Sequence[bytes],
    of_events: Mapping[int, bytes],
    scene: SceneInfo,
    last: Frame,
    start: float,
) -> str:
    pair, unit = conflict.pair, scene.unit
    name, thresholds = escape(" - ".join(pair)), scene.thresholds_of(pair)
    alts = (f"{name} at its smallest clearance", f"a section through the gap of {name} then")
    images = "".join(_image(each, alt) for each, alt in zip(pictures, alts, strict=False))
    row = last.pairs.places.get(pair)
    now, upper = "", math.nan
    if row is not None:
        now, upper = kind_of(last.pairs, row), float(last.pairs.upper[row])
    rows = [("status", escape(_decision(conflict, now, upper, unit)))]
    if conflict.worst is not None:
        rows += _smallest(conflict.worst, conflict.lowest, pair, scene, start)
    if row is not None:
        end = f"{_shown(sign(last.pairs, row, scene))}, {clearance(last.pairs, row, unit)}"
        rows.append(("at the end", f"{end}{_margin(last.pairs, row, scene)}"))
    own = f"warn {length(thresholds.warn, unit)}, stop {length(thresholds.stop, unit)}"
    rows.append(("thresholds", own))
    table = "".join(f"<tr><th>{key}</th><td>{value}</td></tr>" for key, value in rows)
    return (
        f"<section><h2>{name}</h2><div class=seen>{images}</div><table>{table}</table>"
        f"{_events(conflict, of_events, scene, start)}</section>"
    )


def _image(picture: bytes, alt: str) -> str:
    """Return a PNG file as HTML; `alt` is escaped text that replaces it."""
    return f'<img alt="{alt}" src="data:image/png;base64,{base64.b64encode(picture).decode()}">'


def _smallest(
    worst: Snapshot, lowest: float, pair: PairName, scene: SceneInfo, start: float
) -> list[tuple[str, str]]:
    unit, told = scene.unit, worst.frame(pair).pairs
    least = length(lowest, unit)
    ever = "" if least == length(worst.lower, unit) else f"; at least {least} at every tick"
    points = (f"({', '.join(number(float(x), unit) for x in point)})" for point in worst.points)
    return [
        (
            "smallest clearance",
            f"{_shown(sign(told, 0, scene))}, lower bound {length(worst.lower, unit)}, upper bound"
            f" {length(worst.upper, unit)}{ever}{_margin(told, 0, scene)}",
        ),
        ("at", moment(worst.stamp_s, start)),
        ("closest points", f"{' and '.join(points)} {unit.symbol}, in {escape(scene.frame)}"),
    ]


def _margin(pairs: Pairs, row: int, scene: SceneInfo) -> str:
    found = margin(pairs, row, scene)
    return f"; {found}" if found else ""


def _decision(conflict: Conflict, now: str, upper: float, unit: Unit) -> str:
    """Return what was decided, the bounds it was about, and whether the pair is or was worse.

    Args:
        conflict: has the decision, and the worst state in the session.
        now: the pair's state at the end, one of `order.KINDS`; empty: not known.
        upper: the pair's upper bound at the end, metres; NaN: not known.
        unit: the unit for bounds.
    """
    decision = conflict.decision
    about = worse = ""
    if decision.status != NEW:
        about = _bounds(decision.lower, decision.upper, unit)
        about += f" as {decision.state}" if decision.state else ""
    if decision.outgrown(now, upper):
        worse = ", and worse now"
    elif decision.outgrown(conflict.state, conflict.least):
        worse = ", and was worse in this session"
    when = f" (decided {decision.decided})" if decision.decided else ""
    comment = f": {decision.comment}" if decision.comment else ""
    return f"{decision.status}{about}{worse}{when}{comment}"


def _bounds(lower: float | None, upper: float | None, unit: Unit) -> str:
    """Return the bounds that a decision was about; empty if they are not known."""
    if upper is None:
        return ""
    low, high = "" if lower is None else number(lower, unit), number(upper, unit)
    return f" at {f'{low} … ' if low not in ('', high) else ''}{high} {unit.symbol}"


def _shown(shown: Sign) -> str:
    return f"<b>{shown.glyph} {escape(shown.word)}</b>"


def _events(
    conflict: Conflict, of_events: Mapping[int, bytes], scene: SceneInfo, start: float
) -> str:
    if not conflict.events:
        return ""
    unit, rows = scene.unit, ""
    for event in conflict.events[-EVENTS:]:
        picture = of_events.get(event.number)
        image = "" if picture is None else _image(picture, "the pair then")
        rows += (
            f"<tr><td class=n>{moment(event.stamp_s, start)}</td>"
            f"<td>{event.before.glyph} {event.before.word} → {_shown(event.after)}</td>"
            f"<td class=n>{number(event.lower, unit)}</td>"
            f"<td class=n>{number(event.upper, unit)}</td><td>{image}</td></tr>"
        )
    more = len(conflict.events) - EVENTS
    rest = ""
    if more > 0:
        left = counted(more, "older change is", "older changes are")
        rest = f"<p class=dim>{left} left out.</p>"
    return (
        f"<table><tr><th>moment</th><th>change</th><th class=n>lower [{unit.symbol}]</th>"
        f"<th class=n>upper [{unit.symbol}]</th><th>then</th></tr>{rows}</table>{rest}"
    )


def conflicts_csv(
    found: Sequence[Conflict], scene: SceneInfo, last: Frame, span_s: tuple[float, float]
) -> str:
    """Return the conflicts as CSV; lengths in the scene's unit, with all digits.

    Its states are those of the page and of `events_csv`, such as ``stop?`` if nothing proves that
    the pair reached stop. Those of decisions are as in their file.
    """
    unit, pairs = scene.unit, last.pairs
    s = unit.symbol
    head = ["a", "b", "decided", "comment", "decided_at", "decided_state"]
    head += [f"decided_{which} [{s}]" for which in ("lower", "upper")]
    head += ["worst_state"]
    head += [f"{which} [{s}]" for which in ("min_lower", "min_upper", "session_min_lower")]
    head += [f"min_margin [{s}]", "min_margin_to"]
    head += ["min_stamp [s]", "min_session [s]"]
    head += [f"{axis}_{body} [{s}]" for body in "ab" for axis in "xyz"]
    head += ["state", *(f"{which} [{s}]" for which in ("lower", "upper", "warn", "stop"))]
    head += [f"margin [{s}]", "margin_to", "events"]
    rows = []
    for each in found:
        worst, row, decision = each.worst, pairs.places.get(each.pair), each.decision
        nothing = [np.nan] * 8
        lengths = nothing if worst is None else [worst.lower, worst.upper, *worst.points.ravel()]
        low, high, *points = (x / unit.to_metre for x in lengths)
        thresholds = scene.thresholds_of(each.pair)
        then = Margin("", math.nan)
        if worst is not None:
            then = margin_of(worst.frame(each.pair).pairs, 0, scene)
        last_margin = Margin("", math.nan) if row is None else margin_of(pairs, row, scene)
        now = [np.nan, np.nan] if row is None else [pairs.lower[row], pairs.upper[row]]
        rows.append(
            [
                *each.pair,
                decision.status,
                decision.comment,
                decision.decided,
                decision.state,
                *("" if x is None else x / unit.to_metre for x in (decision.lower, decision.upper)),
                each.sign(scene).word.lower(),
                low,
                high,
                each.lowest / unit.to_metre,
                then.metres / unit.to_metre,
                then.to,
                "" if worst is None else f"{worst.stamp_s:.9f}",
                "" if worst is None else f"{worst.stamp_s - span_s[0]:.3f}",
                *points,
                "" if row is None else sign(pairs, row, scene).word.lower(),
                *(x / unit.to_metre for x in (*now, thresholds.warn, thresholds.stop)),
                last_margin.metres / unit.to_metre,
                last_margin.to,
                len(each.events),
            ]
        )
    return csv_of(head, rows)
