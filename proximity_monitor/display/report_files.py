"""The panel that saves the report of conflicts."""

from __future__ import annotations

from collections.abc import Callable

import viser

from proximity_monitor.display.found import Conflict, conflicts
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.portraits import Portraits
from proximity_monitor.display.report import PICTURES, conflicts_csv, report_html
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
        """Add them at this place of the GUI.

        Args:
            gui: takes them.
            shared: the recorded session, its changes of state, and what was decided.
            portraits: takes the pictures.
            shown: returns the content of the page, None before the first frame.
            parts: returns the page's parts.
        """
        self._shared = shared
        self._portraits = portraits
        self._parts = parts
        with gui.add_folder("Report of conflicts"):
            report = gui.add_button("Conflicts, illustrated (HTML)", icon=viser.Icon.REPORT)
            table = gui.add_button("Conflicts as CSV", icon=viser.Icon.TABLE)
            gui.add_html(
                "<div class='pm pm-small pm-dim'>Of all pairs that were not clear in this session"
                " or have a status. While pictures are taken, this page shows other moments.</div>"
            )
        # Plain functions: viser runs them in threads of their own, and they wait for pictures.
        report.on_click(sender(shown, "conflicts.html", self._report))
        table.on_click(sender(shown, "conflicts.csv", self._table))

    def _found(self, shown: Shown) -> list[Conflict]:
        shared = self._shared
        return conflicts(shown.newest, shared.session, shared.events, shared.conflicts.all)

    def _report(self, shown: Shown, _: viser.ClientHandle) -> bytes:
        found, parts = self._found(shown), self._parts()
        pictures = {
            each.pair: png(self._portraits.take(each.worst.frame(each.pair), each.pair, parts))
            for each in found[:PICTURES]
            if each.worst is not None
        }
        span_s = self._shared.session.span_s
        return report_html(found, pictures, shown.scene, shown.newest, span_s).encode()

    def _table(self, shown: Shown, _: viser.ClientHandle) -> bytes:
        span_s = self._shared.session.span_s
        return conflicts_csv(self._found(shown), shown.scene, shown.newest, span_s).encode()
