"""What a page shows grows old in the browser itself, without any script.

A page is old until its first tick. Each new tick restarts a CSS animation that ends when the next
tick is overdue. At its end all colours of states turn grey, words and glyphs change, and stripes
lie over the window. So this works even if the monitor and the display have died. The animation
changes nothing before its end, because a browser would compute the page's style for each frame of
an animation that does.
"""

from __future__ import annotations

import viser

from proximity_monitor.display.state import Frame, SceneInfo

LATE_TICKS = 5.0
LATE_S = 1.0
"""Without a tick for this many periods, and at least this many seconds, the page is old."""

GREEN, GREY = "#009e73", "#7a7a85"


def fading(colour: str) -> str:
    """Return a colour for the style sheet that turns grey when the news is old."""
    return f"var(--pm-old, {colour})"


_OLD = (
    f"--pm-old: {GREY}; --pm-now: none; --pm-then: inline; --pm-veil: block; --pm-faint: .55;"
    " --pm-drained: grayscale(1) opacity(.6)"
)
# In a page without a `Beat`, such as a replay, everything stays fresh.
STYLE = f"""
@keyframes pm-old-0 {{ to {{ {_OLD} }} }}
@keyframes pm-old-1 {{ to {{ {_OLD} }} }}
.pm-now {{ display: var(--pm-now, inline) }}
.pm-then {{ display: var(--pm-then, none) }}
.pm-num, .pm-margin {{ opacity: var(--pm-faint, 1) }}
.pm-bar, .tabler-icon-cloud-check, canvas {{ filter: var(--pm-drained, none) }}
body::before, body::after {{ display: var(--pm-veil, none); position: fixed; pointer-events: none }}
body::before {{ content: ""; inset: 0; z-index: 9998;
  background: repeating-linear-gradient(45deg, {GREY}22 0 8px, transparent 8px 24px) }}
body::after {{ content: "? no news: everything shown is old"; top: 8px; left: 8px; z-index: 9999;
  padding: 4px 12px; border-radius: 6px; background: {GREY}; color: #fff;
  font: 600 15px system-ui, sans-serif }}
"""


def patience_s(scene: SceneInfo | None) -> float:
    """Return after how many seconds the next tick is overdue."""
    rate = (scene.settings["rate_hz"] if scene is not None else None) or 1.0
    return max(LATE_S, LATE_TICKS / rate)


def aging(now: str, then: str) -> str:
    """Return HTML that reads `now` while the news is fresh and `then` once it is old."""
    return f"<span class=pm-now>{now}</span><span class=pm-then>{then}</span>"


class Beat:
    """The animation. Every tick restarts it by giving it another name."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Add the animation to a page; the page is old before its first tick."""
        self._html = gui.add_html(_rule(_OLD))
        self._frame: Frame | None = None
        self._turn = 0

    def show(self, frame: Frame, left_s: float) -> None:
        """Restart the animation if the tick is a new one; in `left_s` seconds it will be old."""
        if frame is self._frame or left_s <= 0.0:
            return
        self._frame, self._turn = frame, 1 - self._turn
        self._html.content = _rule(
            f"animation: pm-old-{self._turn} 1ms linear {left_s:.3f}s forwards"
        )


def _rule(style: str) -> str:
    return f'<style id="pm-beat">body {{ {style} }}</style>'
