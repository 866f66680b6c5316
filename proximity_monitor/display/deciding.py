"""The panel in which people decide about the highlighted pair.

Others may decide about the same pair meanwhile. Fields that the person has not touched follow their
decision. A typed value stays, but it is saved only after the person has seen that decision.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from html import escape

import viser

from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.conflicts import (
    UNDECIDED,
    DecisionStore,
    decision_line,
    decision_now,
)
from proximity_monitor.display.decisions import NEW, STATUSES, Decision
from proximity_monitor.display.order import kind_of
from proximity_monitor.display.pairs import brief
from proximity_monitor.display.signs import clearance
from proximity_monitor.display.state import Pairs, SceneInfo
from proximity_monitor.display.unlisted import reason


class Deciding:
    """The fields for the status and comment of a pair, and a line that names the file."""

    def __init__(
        self,
        gui: viser.GuiApi,
        decisions: DecisionStore,
        choice: Choice,
        camera: Callable[[], tuple[float, ...]],
    ) -> None:
        """Add the panel at the current place of the GUI; `camera` returns `Decision.camera`."""
        self._decisions = decisions
        self._choice = choice
        self._pair: PairName | None = None  # the pair whose decision is in the fields
        self._known = (NEW, "")  # the decision that the person has seen: status and comment
        self._clash = ""
        self._pairs: Pairs | None = None
        self._folder = gui.add_folder("Status of the pair", expand_by_default=False)
        with self._folder:
            self._note = gui.add_html("")
            self._status = gui.add_dropdown(
                "Status",
                STATUSES,
                hint="A note for everybody, kept in a file; alerts do not change",
            )
            self._comment = gui.add_text("Comment", "", hint="Saved with the status")
            self._keep = gui.add_button("Save the status", icon=viser.Icon.CHECK)
            self._where = gui.add_html("")

        @self._keep.on_click
        def _(_) -> None:
            if self._pair is not None and self._agrees():
                row = self._pairs.places.get(self._pair)
                decision = decision_now(self._pairs, row, *self._typed, camera())
                decisions.decide(self._pair, decision)
                self._known = self._typed

    def show(self, pairs: Pairs, scene: SceneInfo) -> None:
        """Follow the highlighted pair; typed values stay while the pair is the same.

        Without a pair the panel is hidden, unless the file has a problem.

        Args:
            pairs: the pairs of the moment that is shown; a decision is about that moment.
            scene: the scene of these pairs.
        """
        pair, self._pairs = self._choice.pair, pairs
        decision = self._decision(pair)
        if pair != self._pair or self._typed == self._known:
            self._pair, self._known = pair, (decision.status, decision.comment)
            self._status.value, self._comment.value = self._known
            self._clash = ""
        row = pairs.places.get(pair)
        problem = escape(self._decisions.problem)
        self._folder.visible = pair is not None or bool(problem)
        self._note.content = (
            f'<div class="pm pm-small" id="pm-decided">{self._told(decision, scene, row)}'
            f'<div class="pm-unproved">{escape(self._clash)}</div>'
            f'<div class="pm-unproved">{problem}</div></div>'
        )
        path, where = self._decisions.path, ""
        if pair is not None and path is not None:
            written = self._decisions.is_written(pair)
            told = f"{'Decisions are kept in' if written else 'Not yet written to'} {path}"
            where = f'<div class="pm pm-small pm-dim" id="pm-kept">{escape(told)}</div>'
        self._where.content = where

    @property
    def _typed(self) -> tuple[str, str]:
        return self._status.value, self._comment.value

    def _decision(self, pair: PairName | None) -> Decision:
        known = UNDECIDED if pair is None else self._decisions.all.get(frozenset(pair))
        return known or UNDECIDED

    def _agrees(self) -> bool:
        """Return whether the fields began with the decision in force; if not, show that one."""
        decision = self._decision(self._pair)
        before, self._known = self._known, (decision.status, decision.comment)
        agrees = before == self._known
        self._clash = (
            ""
            if agrees
            else f"Not saved: meanwhile somebody else chose {': '.join(filter(None, self._known))}."
            " Press again to save yours instead."
        )
        return agrees

    def _told(self, decision: Decision, scene: SceneInfo, row: int | None) -> str:
        """Return the pair and the decision about it as HTML.

        The pair's row in the list may be scrolled out of the panel, so this tells its clearance.
        """
        if self._pair is None:
            return "Press a pair in the list to set its status."
        pairs = self._pairs
        pair = escape(" - ".join(self._pair)) if row is None else brief(pairs, row, scene)
        return f"<div>{pair}</div>{escape(self._line(decision, scene, row))}"

    def _line(self, decision: Decision, scene: SceneInfo, row: int | None) -> str:
        state, upper = "", math.nan
        if row is not None:
            state, upper = kind_of(self._pairs, row), self._pairs.upper[row]
        when = self._choice.when
        told = [decision_line(decision, state, upper, scene.unit, f"worse {when}")]
        if decision.decided:
            told.append(f"decided {decision.decided}")
        if row is None:
            told.append(f"{when} {reason(self._pair, self._pairs, scene)}")
        elif self._choice.at_s is not None:
            then = clearance(self._pairs, row, scene.unit)
            told.append(f"the status refers to this moment: {then}")
        return "; ".join(filter(None, told))
