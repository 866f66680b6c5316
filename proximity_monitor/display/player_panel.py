"""The panel of the player: play, pause, speed and seek. It moves the bodies for all browsers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from html import escape

import viser

from proximity_monitor.display.inbox import News
from proximity_monitor.display.state import Playing, SceneInfo

ASK_S = 0.2
"""Minimum seconds between two requests to the player while a slider is dragged."""

HAND_S = 1.0
"""Seconds after a request during which the slider stays, unless the player reports its motion."""

LEAST_S = 60.0
"""The slider of a motion without a period reaches to here, or to the next power of ten seconds."""

SPEED_MOST = 1000.0
"""Highest speed that the player takes."""

NONE = "No player publishes a motion. To start one: ros2 run proximity_monitor player."
ENDED = (
    "The player has ended, as one with loop:=false does after its motion. Start it again to play;"
    " the session so far stays."
)


class PlayerPanel:
    """Sets the player's own parameters."""

    def __init__(self, gui: viser.GuiApi, ask: Callable[[Mapping[str, float]], None]) -> None:
        """Add the panel at the current place of the GUI; `ask` sends parameters to the player."""
        self._ask = ask
        self._scene: SceneInfo | None = None
        self._playing: Playing | None = None
        self._wanted: dict[str, float] = {}
        self._asked_s = -math.inf
        with gui.add_folder("Motion"):
            self._note = gui.add_html("")
            # One button for both would do the opposite if it were pressed a moment late.
            self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
            self._pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
            self._speed = gui.add_number(
                "Speed",
                1.0,
                min=0.0,
                max=SPEED_MOST,
                step=0.01,  # it also rounds what is typed
                hint="Seconds of motion per second",
            )
            self._seek = gui.add_slider(
                "Moment [s]", 0.0, 1.0, 0.001, 0.0, hint="Where to continue in the motion"
            )

        @self._play.on_click
        def _(_) -> None:
            self._wanted["speed"] = self._speed.value or 1.0

        @self._pause.on_click
        def _(_) -> None:
            self._wanted["speed"] = 0.0

        @self._speed.on_update
        def _(event: viser.GuiEvent) -> None:
            # While the player is paused, the field holds the speed for the next Play.
            if event.client is not None and self._playing is not None and self._playing.speed:
                self._wanted["speed"] = self._speed.value

        @self._seek.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                self._wanted["seek_s"] = self._seek.value

    def show(self, news: News, now_s: float) -> None:
        """Send new values to the player, and show the player's state."""
        before, self._playing = self._playing, news.playing
        if self._scene is not None and self._scene.key != news.scene.key:
            self._wanted.clear()  # it was meant for the motion of that scene
        self._scene = news.scene
        for each in (self._play, self._pause, self._speed, self._seek):
            each.disabled = news.playing is None
        if news.playing is None:
            self._wanted.clear()
            self._note.content = _note(ENDED if news.player_ended else NONE)
            return
        if self._wanted:
            if now_s >= self._asked_s + ASK_S:
                self._asked_s = now_s
                wanted, self._wanted = self._wanted, {}
                self._ask(wanted)
        elif now_s >= self._asked_s + HAND_S or news.playing is not before:
            self._follow(news.playing, news.frame.stamp_s)
        refused = f" Refused: {news.player_refusal}" if news.player_refusal else ""
        self._note.content = _note(_line(news.playing, news.frame.stamp_s) + refused)

    def _follow(self, playing: Playing, stamp_s: float) -> None:
        if playing.speed:
            self._speed.value = playing.speed
        moment = playing.at(stamp_s)
        end = playing.period_s or max(LEAST_S, 10.0 ** math.ceil(math.log10(max(moment, 1.0))))
        if self._seek.max != end:
            self._seek.max, self._seek.step = end, end / 1000.0
        self._seek.value = min(round(moment, 3), end)


def _line(playing: Playing, stamp_s: float) -> str:
    of = f" of {playing.period_s:.2f} s" if playing.period_s else " s"
    how = f"speed {playing.speed:g}" if playing.speed else "paused"
    return f"At {playing.at(stamp_s):.2f}{of}, {how}."


def _note(text: str) -> str:
    return f'<div class="pm pm-small" id="pm-motion">{escape(text)}</div>'
