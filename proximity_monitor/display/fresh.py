"""News grows old in the browser itself.

Each tick that is shown restarts an animation of the style sheet, which ends when the next tick is
overdue. Its end makes grey what was green and changes the words, so nothing here has to be alive
for that: neither the monitor nor the display, and no script runs.
"""

from __future__ import annotations

import viser

from proximity_monitor.display.state import Frame, SceneInfo

LATE_TICKS = 5.0
LATE_S = 1.0
"""Without a tick for so many periods, and at least so many seconds, what is shown is old."""

GREEN, GREY = "#009e73", "#7a7a85"
CLEAR = f"var(--pm-clear, {GREEN})"
"""The colour of what is clear or live, while that is known."""

_END = (
    f"{{ to {{ --pm-clear: {GREY}; --pm-now: none; --pm-then: inline;"
    " --pm-canvas: grayscale(1) opacity(.6) } }"
)
STYLE = f"""
@keyframes pm-old-0 {_END}
@keyframes pm-old-1 {_END}
.pm-now {{ display: var(--pm-now, inline) }}
.pm-then {{ display: var(--pm-then, none) }}
.pm-good, .tabler-icon-cloud-check, canvas {{ filter: var(--pm-canvas, none) }}
"""


def patience_s(scene: SceneInfo | None) -> float:
    """Return after how many seconds the next tick is overdue."""
    rate = (scene.settings["rate_hz"] if scene is not None else None) or 1.0
    return max(LATE_S, LATE_TICKS / rate)


def aging(now: str, then: str) -> str:
    """Return HTML that reads otherwise once the news is old."""
    return f"<span class=pm-now>{now}</span><span class=pm-then>{then}</span>"


class Beat:
    """The animation, which every tick restarts by another name."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Add it to a page."""
        self._html = gui.add_html("")
        self._frame: Frame | None = None
        self._turn = 0

    def show(self, frame: Frame, left_s: float) -> None:
        """Restart it if this is another tick, which is good for so many seconds."""
        if frame is self._frame or left_s <= 0.0:
            return
        self._frame, self._turn = frame, 1 - self._turn
        rule = f"body {{ animation: pm-old-{self._turn} 1ms linear {left_s:.3f}s forwards }}"
        self._html.content = f'<style id="pm-beat">{rule}</style>'
