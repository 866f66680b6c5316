"""The choice of the pairs that the list shows, their order and their groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display.bridge import word
from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.conflicts import UNDECIDED
from proximity_monitor.display.decisions import STATUSES, Decisions
from proximity_monitor.display.order import CLEAR_KIND, KINDS, kinds, urgent_first
from proximity_monitor.display.state import Pairs, SceneInfo

ROWS = 40
"""How many clear pairs are listed; pairs that are not clear are all listed."""

GROUPS = ("state", "part")
ALL, NO_GROUPS = "(all)", "(none)"


class Listing(NamedTuple):
    """The rows of the list, and how many it leaves out."""

    groups: Sequence[tuple[str, Sequence[int]]]
    """Titles and rows, the most urgent first; without grouping, one group with an empty title."""
    more_clear: int
    """How many clear pairs match the filters but come after the listed ones."""
    left_out: int
    """How many pairs that are not clear and not ignored the filters leave out."""
    clear_left_out: int
    """How many clear pairs that are not ignored the filters leave out."""


def listing(
    pairs: Pairs, scene: SceneInfo, choice: Choice, decisions: Decisions | None = None
) -> Listing:
    """Return what to list of a tick's pairs; filters use the decisions that people made."""
    of, order = kinds(pairs), urgent_first(pairs, scene)
    clear = of == CLEAR_KIND
    watched = ~choice.ignores(pairs.names)
    matching = _matching(pairs, of, choice, decisions or {})
    rows = order[(watched & matching)[order]]
    late = np.cumsum(clear[rows]) > ROWS
    late &= clear[rows]
    rest = watched & ~matching
    return Listing(
        _grouped(pairs, of, rows[~late].tolist(), choice.group),
        int(late.sum()),
        int((rest & ~clear).sum()),
        int((rest & clear).sum()),
    )


def in_order(
    pairs: Pairs, scene: SceneInfo, choice: Choice, decisions: Decisions
) -> list[PairName]:
    """Return the names of the listed pairs, in the order of the list; arguments as in `listing`."""
    groups = listing(pairs, scene, choice, decisions).groups
    return [pairs.names[i] for _, rows in groups for i in rows]


def _matching(pairs: Pairs, of: np.ndarray, choice: Choice, decisions: Decisions) -> np.ndarray:
    if not choice.filtered:
        return np.ones(len(pairs), bool)
    each = (
        admits(choice, name, KINDS[kind], decisions)
        for name, kind in zip(pairs.names, of, strict=True)
    )
    return np.fromiter(each, bool, len(pairs))


def admits(choice: Choice, pair: PairName, state: str, decisions: Decisions) -> bool:
    """Return whether the filters admit a pair in a state, one of `order.KINDS`."""
    if not choice.filtered:
        return True
    if (choice.state and choice.state != state) or (choice.part and choice.part not in pair):
        return False
    if choice.status and choice.status != decisions.get(frozenset(pair), UNDECIDED).status:
        return False
    text = " ".join(pair).lower()
    return all(each in text for each in choice.search.lower().split())


def left_out(count: int) -> str:
    """Return HTML with the number of rows that filters leave out; a press on it lists all again."""
    told = f"{count} left out by the filter: press to list all"
    return f"<div class='pm-press pm-unproved' {word('unfilter:')}>{told}</div>" if count else ""


def _grouped(
    pairs: Pairs, of: np.ndarray, rows: Sequence[int], by: str
) -> list[tuple[str, list[int]]]:
    """Group rows. Under "part", a pair joins the group of its part that was listed earlier."""
    if not by:
        return [("", list(rows))]
    found: dict[str, list[int]] = {}
    for i in rows:
        if by == "state":
            title = KINDS[of[i]]
        else:
            title = next((name for name in pairs.names[i] if name in found), pairs.names[i][0])
        found.setdefault(title, []).append(i)
    return list(found.items())


class Filters:
    """The inputs that choose what is listed."""

    def __init__(self, gui: viser.GuiApi, choice: Choice) -> None:
        """Add the inputs at the current place of the GUI."""
        search = gui.add_text("Search", "", hint="Words in the names of both parts")
        with gui.add_folder("Filter and group", expand_by_default=False):
            state = gui.add_dropdown("State", (ALL, *KINDS), hint="Lists only pairs in this state")
            self._part = part = gui.add_dropdown(
                "Of part", (ALL,), hint="Lists only pairs of this part"
            )
            status = gui.add_dropdown(
                "Of status", (ALL, *STATUSES), hint="Lists only pairs with this decision"
            )
            group = gui.add_dropdown(
                "Group by", (NO_GROUPS, *GROUPS), hint="Puts a heading above each group"
            )
        self._inputs = ((search, ""), (state, ALL), (part, ALL), (status, ALL))
        self._choice = choice

        @search.on_update
        def _(_) -> None:
            choice.search = search.value

        @state.on_update
        def _(_) -> None:
            choice.state = "" if state.value == ALL else state.value

        @part.on_update
        def _(_) -> None:
            choice.part = "" if part.value == ALL else part.value

        @status.on_update
        def _(_) -> None:
            choice.status = "" if status.value == ALL else status.value

        @group.on_update
        def _(_) -> None:
            choice.group = "" if group.value == NO_GROUPS else group.value

    def begin(self, scene: SceneInfo) -> None:
        """Switch to a scene."""
        self._choice.part = ""
        self._part.options = (ALL, *(body.name for body in scene.bodies))
        self._part.value = ALL

    def clear(self) -> None:
        """Clear the filters, so that all pairs are listed again."""
        for each, value in self._inputs:
            each.value = value
        self._choice.search = self._choice.state = self._choice.part = self._choice.status = ""
