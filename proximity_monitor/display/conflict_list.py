"""The list of the session's conflicts on one page; a press looks back at the smallest clearance."""

from __future__ import annotations

from html import escape

import viser

from proximity_monitor.display.bridge import PRESSES, pair_word
from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.conflicts import row_mark
from proximity_monitor.display.found import Conflict, conflicts, find
from proximity_monitor.display.listing import admits, left_out
from proximity_monitor.display.order import KINDS
from proximity_monitor.display.paging import page_of, pager
from proximity_monitor.display.shared import Shared
from proximity_monitor.display.signs import between
from proximity_monitor.display.state import OVERLAPPING, SceneInfo

TURN = "conflicts-from"
"""The word that a press sends to turn to another page of the list."""

EVERY_S = 0.5
"""Seconds between two updates of the list."""

NOTHING = "<div class='pm-small pm-dim'>no conflict is known so far</div>"


class ConflictList:
    """Lists each pair that was not clear in the session or has a status, the worst first."""

    def __init__(self, gui: viser.GuiApi, shared: Shared, choice: Choice) -> None:
        """Add the list at the current place of the GUI."""
        self._about = shared.session, shared.events
        self._decisions = shared.decisions
        self._choice = choice
        self._first = 0
        self._due_s = 0.0
        with gui.add_folder("Conflicts"):
            self._list = gui.add_html("")

    def show(self, scene: SceneInfo, now_s: float) -> None:
        """Bring the list up to date."""
        if now_s >= self._due_s:
            self._due_s = now_s + EVERY_S
            self._list.content = self._html(scene)

    def go(self, pair: PairName) -> None:
        """Look back at a pair at its smallest clearance, or else at its last change of state.

        A pair that never came into its range is highlighted, so that its status can be changed.
        """
        session, events = self._about
        worst = session.worst(pair)
        last = next((event for event in reversed(events.all) if event.pair == pair), None)
        if worst is not None:
            self._choice.look_back(pair, worst[1].stamp_s, worst[1])
        elif last is not None:
            self._choice.look_back(pair, last.stamp_s, last.then)
        else:
            self._choice.pair = pair
        self._due_s = 0.0

    def turn(self, first: str) -> None:
        """Show the page of the list that begins with a row."""
        self._first, self._due_s = int(first) if first.isdecimal() else 0, 0.0

    def _html(self, scene: SceneInfo) -> str:
        decisions, (session, events) = self._decisions.all, self._about
        every = find(scene, session, events, decisions)
        listed = [
            each for each in every if admits(self._choice, each.pair, KINDS[each.kind], decisions)
        ]
        page = page_of(self._first, len(listed))
        self._first, start = page.start, session.span_s[0]
        shown = conflicts(listed[page], session, events, decisions)
        rows = "".join(_row(each, start, scene, self._choice) for each in shown)
        return (
            f'<div class=pm {PRESSES}><table class=pm-table id="pm-conflicts"><tr><th>worst</th>'
            f"<th>pair</th><th class=pm-num>smallest</th><th class=pm-num>at</th></tr>{rows}"
            f"</table>{pager(TURN, page.start, len(listed))}{'' if every else NOTHING}"
            f"{left_out(len(every) - len(listed))}</div>"
        )


def _row(conflict: Conflict, start: float, scene: SceneInfo, choice: Choice) -> str:
    shown, (a, b), worst = conflict.sign(scene), conflict.pair, conflict.worst
    least = at = ""
    if worst is not None:
        overlapping = worst.status == OVERLAPPING
        least = between(conflict.lowest, worst.upper, overlapping, scene.unit)
        at = f"{worst.stamp_s - start:.1f} s"
    chosen = " pm-chosen" if conflict.pair == choice.pair else ""
    decided = row_mark(
        conflict.decision, conflict.state, conflict.least, scene.unit, "was worse in this session"
    )
    return (
        f'<tr class="pm-row{chosen}" {pair_word("conflict", conflict.pair)}>'
        f'<td class=pm-sign style="color:{shown.colour}">{shown.glyph} {shown.word}</td>'
        f"<td>{escape(a)} - {escape(b)}{decided}</td>"
        f"<td class=pm-num>{least}</td><td class=pm-num>{at}</td></tr>"
    )
