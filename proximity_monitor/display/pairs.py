"""The list of pairs as HTML."""

from __future__ import annotations

from html import escape

import numpy as np

from proximity_monitor.display.bridge import PRESSES, pair_word, word
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.conflicts import UNDECIDED, row_mark
from proximity_monitor.display.decisions import Decisions
from proximity_monitor.display.listing import Listing, listing
from proximity_monitor.display.order import KINDS, kinds
from proximity_monitor.display.signs import (
    clearance,
    feature,
    glyph,
    length,
    margin,
    mark,
    number,
    ramp,
    sign,
    uncertain,
    unproved,
)
from proximity_monitor.display.state import STALE, STOP, UNKNOWN, WARN, Pairs, SceneInfo
from proximity_monitor.display.unlisted import Unlisted, unlisted
from proximity_monitor.scene.naming import counted

FULL_ROWS = 100
"""How many rows have all details; later rows take one line each."""

BAR = 4.0
"""Full width of a row's bar, in multiples of the pair's warn."""


def gap(pairs: Pairs, row: int) -> np.ndarray:
    """Return the vector (3,) from the closest point of the first body to that of the second."""
    return pairs.points[row, 1] - pairs.points[row, 0]


def table(
    pairs: Pairs,
    scene: SceneInfo,
    choice: Choice,
    decisions: Decisions | None = None,
    left: Unlisted | None = None,
) -> str:
    """Return the list as HTML, with people's decisions about the pairs.

    Args:
        pairs: the pairs of the tick that is shown.
        scene: the scene of the tick.
        choice: which pairs are listed and how.
        decisions: people's decisions in the scene.
        left: the pairs that the tick does not list; None: the reasons are not known.
    """
    decisions, left = decisions or {}, left or unlisted(pairs, scene, None)
    found = listing(pairs, scene, choice, decisions)
    states = kinds(pairs)
    head = (
        f"<tr><th>state</th><th>pair; gap ΔX, ΔY, ΔZ [{scene.unit.symbol}]</th>"
        "<th class=pm-num>clearance</th><th></th></tr>"
    )
    body, count = [], 0
    for title, rows in found.groups:
        if title:
            many = counted(len(rows), "pair", "pairs")
            body.append(f"<tr class=pm-group><td colspan=4>{escape(title)}: {many}</td></tr>")
        for i in rows:
            count += 1
            decision = decisions.get(frozenset(pairs.names[i]), UNDECIDED)
            worse = f"worse {choice.when}"
            told = row_mark(decision, KINDS[states[i]], pairs.upper[i], scene.unit, worse)
            body.append((_row if count <= FULL_ROWS else _line)(pairs, i, scene, choice, told))
    return (
        f'<div class="pm pm-list" {PRESSES}><table class=pm-table id="pm-pairs">'
        f"{head}{''.join(body)}</table>"
        f"{_rest(pairs, found, left)}{_ignored(pairs, scene, choice)}</div>"
    )


def brief(pairs: Pairs, i: int, scene: SceneInfo) -> str:
    """Return a pair as one line of HTML: its sign, its name and its clearance."""
    shown = sign(pairs, i, scene)
    return (
        f'<div class=pm-line><b style="color:{shown.colour}">{glyph(shown)}</b>'
        f"<span class=pm-cut>{escape(' - '.join(pairs.names[i]))}</span>"
        f"<span class=pm-num>{clearance(pairs, i, scene.unit)}</span></div>"
    )


def _start(pairs: Pairs, i: int, scene: SceneInfo, choice: Choice) -> str:
    """Return the beginning of a row: its attributes and its state."""
    name, shown = "{} - {}".format(*pairs.names[i]), sign(pairs, i, scene)
    chosen = " pm-chosen" if pairs.names[i] == choice.pair else ""
    lower, upper = float(pairs.lower[i]), float(pairs.upper[i])
    return (
        f'<tr class="pm-row{chosen}" data-pair="{escape(name)}" data-lower="{lower!r}"'
        f' data-upper="{upper!r}" {pair_word("pick", pairs.names[i])}>'
        f'<td class=pm-sign style="color:{shown.colour}">{mark(shown)}</td>'
    )


def _line(pairs: Pairs, i: int, scene: SceneInfo, choice: Choice, decided: str) -> str:
    a, b = pairs.names[i]
    return (
        f"{_start(pairs, i, scene, choice)}<td>{escape(a)} - {escape(b)}{decided}</td>"
        f"<td class=pm-num{_title(pairs, i, scene)}>{clearance(pairs, i, scene.unit)}</td>"
        "<td></td></tr>"
    )


def _row(pairs: Pairs, i: int, scene: SceneInfo, choice: Choice, decided: str) -> str:
    a, b = pairs.names[i]
    silent = f"<div class='pm-small'>{escape(pairs.silent[i])}</div>" if pairs.silent[i] else ""
    told = pairs.features.get(i, ()) if (a, b) == choice.pair else ()
    on = "".join(
        f"<div class=pm-small>{escape(body)}: "
        f"<span class=pm-on>{escape(feature(where))}</span></div>"
        for body, where in zip((a, b), told, strict=False)
    )
    least = margin(pairs, i, scene) if (a, b) == choice.pair else ""
    least = f"<div class='pm-small pm-margin'>{least}</div>" if least else ""
    deltas = ", ".join(number(float(x), scene.unit) for x in gap(pairs, i))
    return (
        f"{_start(pairs, i, scene, choice)}"
        f"<td>{escape(a)} - {escape(b)}<div class='pm-small pm-dim'>Δ {deltas}</div>"
        f"{least}{decided}{on}{silent}</td>"
        f"<td class=pm-num{_title(pairs, i, scene)}>{_certainty(pairs, i, scene)}"
        f"{clearance(pairs, i, scene.unit)}{_bar(pairs, i, scene)}</td>"
        f'<td><span class="pm-press pm-small" title="hide this pair here"'
        f" {pair_word('ignore', (a, b))}>hide</span></td></tr>"
    )


def _certainty(pairs: Pairs, i: int, scene: SceneInfo) -> str:
    if pairs.level[i] in (STOP, WARN) and unproved(pairs, i, scene):
        which = "stop" if pairs.level[i] == STOP else "warn"
        title = "the threshold lies between the bounds: the clearance may be above it"
        return f'<div class="pm-small pm-unproved" title="{title}">not proved above {which}</div>'
    if not uncertain(pairs, i):
        return ""
    title = "the budget ended the search: the clearance certainly lies between these"
    return f'<span class="pm-small pm-dim" title="{title}">bounded </span>'


def _title(pairs: Pairs, i: int, scene: SceneInfo) -> str:
    """Return the attribute that tells the pair's thresholds, and its margin, under the pointer."""
    thresholds, unit = scene.thresholds_of(pairs.names[i]), scene.unit
    told = f"stop {length(thresholds.stop, unit)}, warn {length(thresholds.warn, unit)}"
    return f' title="{"; ".join(filter(None, (told, margin(pairs, i, scene))))}"'


def _bar(pairs: Pairs, i: int, scene: SceneInfo) -> str:
    """Return a bar from 0 to `BAR` times warn: solid to the lower bound, paler to the upper one."""
    if pairs.status[i] == UNKNOWN:
        return ""
    thresholds = scene.thresholds_of(pairs.names[i])
    full = BAR * max(thresholds.warn, thresholds.stop, 1e-12)
    low, high = (100.0 * min(max(x / full, 0.0), 1.0) for x in (pairs.lower[i], pairs.upper[i]))
    red, green, blue = ramp(
        float(pairs.lower[i]),
        thresholds,
        touching=bool(pairs.touching[i]),
        stale=bool(pairs.level[i] == STALE),
    ).astype(int)
    colour = f"rgb({red} {green} {blue}"
    marks = "".join(
        f"<u style='left:{100.0 * x / full:.1f}%'></u>" for x in (thresholds.stop, thresholds.warn)
    )
    return (
        f'<div class=pm-bar><i style="left:0;width:{low:.1f}%;'
        f'background:{colour})"></i><i style="left:{low:.1f}%;width:{high - low:.1f}%;'
        f'background:{colour} / .4)"></i>{marks}</div>'
    )


def _rest(pairs: Pairs, found: Listing, left: Unlisted) -> str:
    more, wrong = [], found.left_out
    if len(pairs) and not any(rows for _, rows in found.groups):
        more.append("search, filter and hiding leave no pair to list")
    if found.more_clear:
        one, many = "more clear pair: search for it", "more clear pairs: search for them"
        more.append(counted(found.more_clear, one, many))
    if found.clear_left_out:
        many = counted(found.clear_left_out, "clear pair is", "clear pairs are")
        more.append(f"{many} left out by the filter")
    more += left.lines
    told = f"<div class='pm-small pm-dim'>{'; '.join(more)}</div>" if more else ""
    if wrong:
        told += (
            f'<div id="pm-left-out" class="pm-press pm-unproved" {word("unfilter:")}>'
            f"{counted(wrong, 'pair is', 'pairs are')} not clear and left out by the filter:"
            " press to list all</div>"
        )
    return told


def _ignored(pairs: Pairs, scene: SceneInfo, choice: Choice) -> str:
    if not choice.ignored:
        return ""
    links = []
    for a, b in sorted(choice.ignored):
        row, state = pairs.places.get((a, b)), ""
        if row is not None and (pairs.level[row] != 0 or pairs.touching[row]):
            shown = sign(pairs, row, scene)
            state = f' <b style="color:{shown.colour}">{mark(shown)}</b>'
        press = pair_word("ignore", (a, b))
        links.append(f"<span class=pm-press {press}>{escape(a)} - {escape(b)}</span>{state}")
    return f"<div class=pm-small>hidden here, press to show again: {', '.join(links)}</div>"
