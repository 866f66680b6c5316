"""The list of pairs, the nearest first."""

from __future__ import annotations

from html import escape

import numpy as np

from proximity_monitor.display.bridge import PRESSES, word
from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.signs import (
    clearance,
    feature,
    length,
    number,
    ramp,
    sign,
    uncertain,
)
from proximity_monitor.display.state import STALE, UNKNOWN, Pairs, SceneInfo

ROWS = 40
"""How many pairs are listed; the search finds the others."""

BAR = 4.0
"""The bar's full width, in multiples of a pair's warn."""


def listed(pairs: Pairs, choice: Choice) -> list[int]:
    """Return the rows that match the search, the nearest first; those without a pose come last."""
    order = np.lexsort((pairs.upper, pairs.lower))  # NaN sorts last
    return [
        int(i)
        for i in order
        if pairs.names[i] not in choice.ignored and choice.listens_to(*pairs.names[i])
    ]


def gap(pairs: Pairs, row: int) -> np.ndarray:
    """Return the vector (3,) from the closest point of the first body to that of the second."""
    return pairs.points[row, 1] - pairs.points[row, 0]


def table(pairs: Pairs, scene: SceneInfo, choice: Choice) -> str:
    """Return the list as HTML."""
    rows = listed(pairs, choice)
    shown = rows[:ROWS]
    head = (
        f"<tr><th>state</th><th>pair; gap ΔX, ΔY, ΔZ [{scene.unit.symbol}]</th>"
        "<th class=pm-num>clearance</th><th></th></tr>"
    )
    body = "".join(_row(pairs, i, scene, choice) for i in shown)
    return (
        f'<div class=pm {PRESSES}><table class=pm-table id="pm-pairs">{head}{body}</table>'
        f"{_rest(pairs, scene, rows)}{_ignored(choice)}</div>"
    )


def _row(pairs: Pairs, i: int, scene: SceneInfo, choice: Choice) -> str:
    a, b = pairs.names[i]
    mark = sign(pairs, i)
    chosen = " pm-chosen" if (a, b) == choice.pair else ""
    name = f"{a} - {b}"
    silent = f"<div class='pm-small'>{escape(pairs.silent[i])}</div>" if pairs.silent[i] else ""
    places = zip((a, b), pairs.features.get(i, ()) if chosen else (), strict=False)
    on = "".join(
        f"<div class='pm-small pm-on'>{escape(body)}: {escape(feature(told))}</div>"
        for body, told in places
    )
    deltas = ", ".join(number(float(x), scene.unit) for x in gap(pairs, i))
    lower, upper = float(pairs.lower[i]), float(pairs.upper[i])
    return (
        f'<tr class="pm-row{chosen}" data-pair="{escape(name)}" data-lower="{lower!r}"'
        f' data-upper="{upper!r}" {word(f"pick:{name}")}>'
        f'<td class=pm-sign style="color:{mark.colour}">{mark.glyph} {mark.word}</td>'
        f"<td>{escape(a)} - {escape(b)}<div class='pm-small pm-dim'>Δ {deltas}</div>"
        f"{on}{silent}</td>"
        f"<td class=pm-num>{_certainty(pairs, i)}{clearance(pairs, i, scene.unit)}"
        f"{_bar(pairs, i, scene)}</td>"
        f'<td><span class="pm-press pm-small" title="ignore this pair here"'
        f" {word(f'ignore:{name}')}>hide</span></td></tr>"
    )


def _certainty(pairs: Pairs, i: int) -> str:
    if not uncertain(pairs, i):
        return ""
    title = "the budget cut the search: the clearance is certified to lie between the two"
    return f'<span class="pm-small pm-dim" title="{title}">bounded </span>'


def _bar(pairs: Pairs, i: int, scene: SceneInfo) -> str:
    """A bar from 0 to four times warn: filled to the lower bound, paler to the upper one."""
    if pairs.status[i] == UNKNOWN:
        return ""
    limits = scene.thresholds_of(pairs.names[i])
    full = BAR * max(limits.warn, limits.stop, 1e-12)
    low, high = (100.0 * min(max(x / full, 0.0), 1.0) for x in (pairs.lower[i], pairs.upper[i]))
    red, green, blue = ramp(
        float(pairs.lower[i]),
        limits,
        touching=bool(pairs.touching[i]),
        stale=bool(pairs.level[i] == STALE),
    ).astype(int)
    colour = f"rgb({red} {green} {blue}"
    marks = "".join(
        f"<u style='left:{100.0 * x / full:.1f}%'></u>" for x in (limits.stop, limits.warn)
    )
    title = f"stop {length(limits.stop, scene.unit)}, warn {length(limits.warn, scene.unit)}"
    return (
        f'<div class=pm-bar title="{title}"><i style="left:0;width:{low:.1f}%;'
        f'background:{colour})"></i><i style="left:{low:.1f}%;width:{high - low:.1f}%;'
        f'background:{colour} / .4)"></i>{marks}</div>'
    )


def _rest(pairs: Pairs, scene: SceneInfo, rows: list[int]) -> str:
    more = [f"{len(rows) - ROWS} more, none nearer: search for them"] if len(rows) > ROWS else []
    beyond = scene.pairs - len(pairs)
    more += [f"{beyond} beyond their range"] if beyond > 0 else []
    return f"<div class='pm-small pm-dim'>{'; '.join(more)}</div>" if more else ""


def _ignored(choice: Choice) -> str:
    if not choice.ignored:
        return ""
    links = ", ".join(
        f"<span class=pm-press {word(f'ignore:{a} - {b}')}>{escape(a)} - {escape(b)}</span>"
        for a, b in sorted(choice.ignored)
    )
    return f"<div class=pm-small>hidden here, press to watch again: {links}</div>"


def as_pair(name: str) -> PairName:
    """Return the pair's names from a pressed word."""
    a, _, b = name.partition(" - ")
    return a, b
