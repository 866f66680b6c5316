"""The panel that saves the report of conflicts."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import viser

from proximity_monitor.display.found import Conflict, conflicts, find
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.portraits import Portraits
from proximity_monitor.display.report import PICTURES, conflicts_csv, pictured, report_html
from proximity_monitor.display.save import png, sender
from proximity_monitor.display.shared import Shared, Shown


class ReportFiles:
    """Two buttons; each sends a file to the browser that pressed it."""

    def __init__(
        self,
        gui: viser.GuiApi,
        shared: Shared,
        portraits: Portraits,
        shown: Callable[[], Shown | None],
        parts: Callable[[], Parts | None],
    ) -> None:
        """Add the buttons at the current place of the GUI.

        Args:
            gui: takes the buttons.
            shared: the recorded session, its changes of state, and people's decisions.
            portraits: takes the pictures.
            shown: returns the content of the page; None before the first frame.
            parts: returns the page's parts.
        """
        self._shared = shared
        self._portraits = portraits
        self._parts = parts
        with gui.add_folder("Report of conflicts"):
            self._button = gui.add_button("Conflicts, illustrated (HTML)", icon=viser.Icon.REPORT)
            self._progress = gui.add_html("")
            table = gui.add_button("Conflicts as CSV", icon=viser.Icon.TABLE)
            gui.add_html(
                "<div class='pm pm-small pm-dim'>Of all pairs that were not clear in this session"
                " or have a status. While pictures are taken, this page shows other moments.</div>"
            )
        self._button.on_click(sender(shown, "conflicts.html", self._report))
        table.on_click(sender(shown, "conflicts.csv", self._table))

    def _found(self, shown: Shown) -> list[Conflict]:
        shared = self._shared
        about = shared.session, shared.events, shared.decisions.all
        return conflicts(find(shown.scene, *about), *about)

    def _report(self, shown: Shown, _: viser.ClientHandle) -> bytes:
        self._button.disabled = True  # a second report would wait for the pictures of the first
        try:
            return self._illustrated(shown)
        finally:
            self._button.disabled, self._progress.content = False, ""

    def _illustrated(self, shown: Shown) -> bytes:
        parts = self._parts()  # taken first: if the scene changes after this, pictures are refused
        found, events = self._found(shown), self._shared.events

        of_events = dict(events.pictures)
        placed = [x for x in found[:PICTURES] if x.worst is not None and x.worst.placed]
        missing = [event for event in pictured(found) if event.number not in of_events]
        moments = itertools.count(1)

        def tell() -> None:
            told = f"taking pictures: moment {next(moments)} of {len(placed) + len(missing)}"
            self._progress.content = f"<div class='pm pm-small' id='pm-taking'>{told}</div>"

        pictures = {}
        for each in placed:
            tell()
            seen = each.worst.frame(each.pair)
            taken = self._portraits.take_with_gap(seen, each.pair, parts)
            pictures[each.pair] = [*map(png, taken)]
        for event in missing:
            tell()
            seen = event.sight.frame(event.pair)
            of_events[event.number] = png(self._portraits.take(seen, event.pair, parts))
            events.keep(event, of_events[event.number])
        span_s = self._shared.session.span_s
        document = report_html(found, pictures, shown.scene, shown.newest, span_s, of_events)
        return document.encode()

    def _table(self, shown: Shown, _: viser.ClientHandle) -> bytes:
        span_s = self._shared.session.span_s
        return conflicts_csv(self._found(shown), shown.scene, shown.newest, span_s).encode()
