"""The input that attaches a part to another, so that they move together, or detaches it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape

import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.inbox import News
from proximity_monitor.scene.naming import safe

NOTHING = "(nothing)"
WAITS = "waits for a recent pose of both parts; their clearance is still watched"


class Attaching:
    """The input for the part at the gizmo. It sets parameters of the monitor, for all browsers."""

    def __init__(
        self,
        gui: viser.GuiApi,
        choice: Choice,
        ask: Callable[[Mapping[str, str]], None],
    ) -> None:
        """Add the input at the current place of the GUI; `ask` sends parameters to the monitor."""
        self._choice = choice
        self._asked = ""
        self._told: tuple = ()
        self._parent = gui.add_dropdown(
            "Attached to", (NOTHING,), hint="They move together from now on, for all browsers"
        )
        self._note = gui.add_html("")

        @self._parent.on_update
        def _(event: viser.GuiEvent) -> None:
            child, parent = self._choice.body, self._parent.value
            if event.client is None or child is None:
                return
            self._asked = _parameter(child)
            ask({self._asked: "" if parent == NOTHING else parent})

    def show(self, news: News) -> None:
        """Show the parent that the monitor reports, and why the part is not held by it.

        It waits for poses, or the monitor refused a request of this page.
        """
        child, scene = self._choice.body, news.scene
        names = (body.name for body in scene.bodies if body.name != child)
        options = (NOTHING,) if child is None else (NOTHING, *names)
        if self._parent.options != options:
            self._parent.options = options
        parent = NOTHING if child is None else scene.attachments.get(child, NOTHING)
        if self._told != (child, parent, news.refusal):
            self._told = (child, parent, news.refusal)
            self._parent.value = parent
        self._parent.disabled = child is None
        own = child is not None and self._asked == _parameter(child)
        waits = parent not in (NOTHING, scene.held.get(child))
        told = WAITS if waits else ""
        if own and self._asked in news.refused:
            told = f"refused: {news.refusal}"
        self._note.content = f'<div class="pm pm-small pm-unproved">{escape(told)}</div>'


def _parameter(child: str) -> str:
    return f"attachments.{safe(child)}"
