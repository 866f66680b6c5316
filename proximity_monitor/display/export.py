"""Tables to save, as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.conflicts import UNDECIDED
from proximity_monitor.display.decisions import Decisions
from proximity_monitor.display.events import Events
from proximity_monitor.display.order import margin_of
from proximity_monitor.display.pairs import gap
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import sign
from proximity_monitor.display.state import LEVELS, STATUSES, Frame, SceneInfo

DECIDED = ("decided", "comment")
"""The columns of a person's decision about a pair, in each of the tables."""


def pairs_csv(frame: Frame, scene: SceneInfo, session: Session, decisions: Decisions) -> str:
    """Return the listed pairs of a tick as CSV; lengths in the scene's unit, with all digits."""
    unit, pairs = scene.unit, frame.pairs
    s = unit.symbol
    head = [
        "a",
        "b",
        "state",
        "sign",
        "status",
        f"lower [{s}]",
        f"upper [{s}]",
        f"delta_x [{s}]",
        f"delta_y [{s}]",
        f"delta_z [{s}]",
        *(f"{axis}_{body} [{s}]" for body in "ab" for axis in "xyz"),
        f"warn [{s}]",
        f"stop [{s}]",
        f"margin [{s}]",
        "margin_to",
        "age [s]",
        f"session_min [{s}]",
        f"session_min_lower [{s}]",
        "stamp [s]",
        "on_a",
        "on_b",
        *DECIDED,
    ]
    rows = []
    for i, (a, b) in enumerate(pairs.names):
        thresholds, found = scene.thresholds_of((a, b)), session.worst((a, b))
        margin = margin_of(pairs, i, scene)
        least = float("nan") if found is None else found[1].upper
        lengths = [pairs.lower[i], pairs.upper[i], *gap(pairs, i), *pairs.points[i].ravel()]
        rows.append(
            [
                a,
                b,
                LEVELS[pairs.level[i]],
                sign(pairs, i, scene).word.lower(),
                STATUSES[pairs.status[i]],
                *(x / unit.to_metre for x in (*lengths, thresholds.warn, thresholds.stop)),
                margin.metres / unit.to_metre,
                margin.to,
                pairs.age_s[i],
                least / unit.to_metre,
                session.lowest((a, b)) / unit.to_metre,
                f"{frame.stamp_s:.9f}",
                *pairs.features.get(i, ("", "")),
                *_decided(decisions, (a, b)),
            ]
        )
    return csv_of(head, rows)


def series_csv(session: Session, scene: SceneInfo) -> str:
    """Return the session as CSV: one row for each tick and pair, lengths in the scene's unit."""
    unit = scene.unit
    head = ["stamp [s]", "a", "b", f"lower [{unit.symbol}]", f"upper [{unit.symbol}]", "state"]
    rows = (
        [
            f"{frame.stamp_s:.9f}",
            a,
            b,
            frame.pairs.lower[i] / unit.to_metre,
            frame.pairs.upper[i] / unit.to_metre,
            LEVELS[frame.pairs.level[i]],
        ]
        for frame in session.frames
        for i, (a, b) in enumerate(frame.pairs.names)
    )
    return csv_of(head, rows)


def events_csv(events: Events, session: Session, scene: SceneInfo, decisions: Decisions) -> str:
    """Return the session's changes of state as CSV, one row each, the oldest first."""
    start, unit = session.span_s[0], scene.unit
    rows = (
        [
            f"{event.stamp_s:.9f}",
            f"{event.stamp_s - start:.3f}",
            *event.pair,
            event.before.word.lower(),
            event.after.word.lower(),
            event.clearance,
            event.lower / unit.to_metre,
            event.upper / unit.to_metre,
            *_decided(decisions, event.pair),
        ]
        for event in events.all
    )
    bounds = [f"{which} [{unit.symbol}]" for which in ("lower", "upper")]
    head = ["stamp [s]", "session [s]", "a", "b", "before", "after", "clearance"]
    return csv_of([*head, *bounds, *DECIDED], rows)


def _decided(decisions: Decisions, pair: PairName) -> tuple[str, str]:
    decision = decisions.get(frozenset(pair), UNDECIDED)
    return decision.status, decision.comment


def csv_of(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as CSV (RFC 4180), whatever characters its texts have."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")  # texts with these are quoted
    writer.writerow(head)
    writer.writerows(rows)
    return out.getvalue()
