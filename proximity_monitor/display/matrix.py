"""The clash matrix: parts against parts, with the state of each pair."""

from __future__ import annotations

from html import escape
from itertools import combinations

from proximity_monitor.display.bridge import PRESSES, pair_word
from proximity_monitor.display.choice import PairName
from proximity_monitor.display.labels import short
from proximity_monitor.display.order import urgent_first
from proximity_monitor.display.signs import glyph, sign
from proximity_monitor.display.state import Pairs, SceneInfo

PARTS = 24
"""Approximate maximum number of parts in the matrix: those of the most urgent pairs."""

NAME = 16
"""Maximum characters of a name in the matrix."""


def matrix(pairs: Pairs, scene: SceneInfo, highlighted: PairName | None = None) -> str:
    """Return the matrix as HTML; pairs that are not listed have no mark."""
    named: dict[str, None] = {}
    for i in urgent_first(pairs, scene):
        if len(named) >= PARTS:
            break
        named.update(dict.fromkeys(pairs.names[i]))
    names = [body.name for body in scene.bodies if body.name in named]  # in the scene's order
    cells: dict[tuple[int, int], str] = {}
    for (r, a), (c, b) in combinations(enumerate(names), 2):
        row = pairs.places.get((a, b), pairs.places.get((b, a)))
        if row is not None:
            cells[c, r] = _cell(pairs, row, scene, highlighted)
    head = "".join(f"<th title={_quoted(name)}>{k + 1}</th>" for k, name in enumerate(names[:-1]))
    rows = "".join(
        f"<tr><td class=pm-cut title={_quoted(name)}>{r + 1} {escape(short(name, NAME))}</td>"
        + "".join(cells.get((r, c), "<td class=pm-dim>·</td>") for c in range(r))
        + "</tr>"
        for r, name in enumerate(names)
    )
    rest = "most urgent pairs only" if len(names) >= PARTS else ""
    rest = f"<div class='pm-small pm-dim'>{rest}</div>"
    begin = '<table class=pm-table id="pm-matrix" style="width:auto">'
    return (
        f'<div class="pm pm-wide" {PRESSES}>{begin}'
        f"<tr><th></th>{head}</tr>{rows}</table>{rest}</div>"
    )


def _cell(pairs: Pairs, i: int, scene: SceneInfo, highlighted: PairName | None) -> str:
    a, b = pairs.names[i]
    shown = sign(pairs, i, scene)
    title = f"{a} - {b}: {shown.word}"  # no number, because it would change with each tick
    chosen = " pm-chosen" if (a, b) == highlighted else ""
    return (
        f'<td class="pm-sign{chosen}" style="color:{shown.colour};cursor:pointer"'
        f" title={_quoted(title)} {pair_word('pick', (a, b))}>{glyph(shown)}</td>"
    )


def _quoted(text: str) -> str:
    return f'"{escape(text, quote=True)}"'
