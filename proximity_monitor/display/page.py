"""The page: its layout, and the loop that keeps it up to date."""

from __future__ import annotations

import time
from html import escape

import numpy as np
import viser

from proximity_monitor.display import serving
from proximity_monitor.display.bridge import Bridge
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.connection import Connection, banner, connection, pill
from proximity_monitor.display.holds import Holds
from proximity_monitor.display.inbox import Inbox, News
from proximity_monitor.display.limits import LimitsPanel
from proximity_monitor.display.lines import Lines
from proximity_monitor.display.move import Move
from proximity_monitor.display.node import ProximityDisplay
from proximity_monitor.display.pairs import as_pair, table
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.save import Save, Shown
from proximity_monitor.display.session import Session
from proximity_monitor.display.state import Frame
from proximity_monitor.display.style import STYLE
from proximity_monitor.display.timeline import Timeline

TABLE_S = 0.1
"""Seconds between two updates of the list: numbers that change faster cannot be read."""

WIDTH = 500
"""Width of the panel, in pixels."""


class Page:
    """Everything on the server, the same for all viewers."""

    def __init__(
        self, server: viser.ViserServer, inbox: Inbox, holds: Holds, node: ProximityDisplay
    ) -> None:
        """Lay the page out.

        Args:
            server: shows it.
            inbox: gives the monitor's messages.
            holds: the bodies that are held here.
            node: carries requests to the monitor.
        """
        self._server = server
        self._inbox = inbox
        self._holds = holds
        self._choice = Choice()
        self._session = Session()
        self._shown: Shown | None = None
        self._parts: Parts | None = None
        self._lines: Lines | None = None
        self._drawn: tuple = ()
        self._all_placed = True
        self._table_due_s = 0.0
        gui = server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        gui.add_html(STYLE)
        Bridge(gui, self._on_word)
        self._pill = gui.add_html("")
        self._banner = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Clearances", viser.Icon.RULER_MEASURE):
            self._add_list(gui)
        with tabs.add_tab("Move", viser.Icon.HAND_MOVE):
            self._move = Move(server, holds, self._choice)
        with tabs.add_tab("Limits", viser.Icon.ADJUSTMENTS):
            self._limits = LimitsPanel(gui, self._choice, node.set_parameters_of_monitor)
        over_time = gui.add_panel()
        plot = over_time.add_tab("Clearance", viser.Icon.CHART_LINE)
        over_time.float(x=14, y=-14, width=600, height=290)
        with tabs.add_tab("Session", viser.Icon.HISTORY):
            self._timeline = Timeline(gui, plot, self._session, self._choice, self._return_to_worst)
            self._save = Save(
                gui, self._session, self._choice, lambda: self._shown, self._move.hide
            )

    def step(self) -> None:
        """Bring the page up to date: one block of changes for all browsers."""
        news = self._inbox.read()
        now_s = time.monotonic()
        told = connection(news, now_s)
        with self._server.atomic():
            self._pill.content = pill(told, self._choice)
            if _complete(news):
                self._show(news, told, now_s)
            else:
                self._banner.content = ""  # it spoke of the previous scene

    def _show(self, news: News, told: Connection, now_s: float) -> None:
        scene, before = news.scene, self._shown
        if before is None or before.scene.key != scene.key:
            self._build(news)
        elif news.parts is not before.parts:
            self._parts.reshape(news.parts, scene.deforming)
        if news.frame is not self._session.newest:
            self._session.add(news.frame)
        at, choice = self._choice.at_s, self._choice
        frame = news.frame if at is None else self._session.at(at)
        self._shown = Shown(scene, frame, news.parts)
        held = self._holds.poses if at is None else {}
        self._parts.show(frame, held, choice, choice.pair or ())
        if not self._all_placed and frame.poses[:, 3:].any(axis=1).all():
            self._look_at_all(frame)
        self._move.show(frame, news)
        drawn = (frame, choice.pair, choice.body, choice.ignored, choice.lines, scene)
        if drawn != self._drawn:
            self._drawn = drawn
            self._lines.show(frame.pairs, scene, choice)
        if now_s >= self._table_due_s:
            self._table_due_s = now_s + TABLE_S
            self._banner.content = banner(news.frame, scene, choice, told)
            self._table.content = table(frame.pairs, scene, choice)
            self._limits.show(scene, news.frame, news.health, news.refusal, now_s)
        self._timeline.show(scene, now_s)

    def _build(self, news: News) -> None:
        """Begin with a scene."""
        self._server.scene.reset()
        serving.light(self._server)
        self._session.clear()
        self._holds.release()  # bodies held since the scene came belong to the previous one
        self._choice.ignored = frozenset()
        self._choice.pair = self._choice.body = self._choice.at_s = None
        self._parts = Parts(self._server, news.scene, news.parts, self._move.pick)
        self._parts.show(news.frame, {}, self._choice, ())
        self._lines = Lines(self._server, self._parts.scale, self._parts.size)
        self._move.begin(news.scene, self._parts)
        self._look_at_all(news.frame)
        self._server.gui.set_panel_label(news.scene.name)
        self._about.content = f"<div class='pm pm-dim'>{escape(news.scene.description)}</div>"

    def _look_at_all(self, frame: Frame) -> None:
        """Show all parts to new viewers, and to those who have not moved their camera."""
        low, high = self._parts.box()
        middle, across = (low + high) / 2.0, float(np.linalg.norm(high - low))
        camera = self._server.initial_camera
        before = camera.position
        middle[2] -= 0.12 * across  # the plot covers what is below it
        camera.look_at = middle
        camera.position = middle + across * np.array([0.55, -0.75, 0.45])
        for client in self._server.get_clients().values():
            if np.allclose(client.camera.position, before, atol=1e-3 * across):
                with client.atomic():
                    client.camera.look_at = middle
                    client.camera.position = camera.position
        # A monitor's first ticks may come before any poses.
        self._all_placed = bool(frame.poses[:, 3:].any(axis=1).all())

    def _add_list(self, gui: viser.GuiApi) -> None:
        self._about = gui.add_html("")
        search = gui.add_text("Search", "", hint="Words of the names of both parts")
        self._table = gui.add_html("")
        with gui.add_folder("Picture", expand_by_default=False):
            lines = gui.add_slider(
                "Lines", 0, 200, 1, self._choice.lines,
                hint="So many of the nearest pairs are drawn, beside all that are not clear",
            )  # fmt: skip
            names = gui.add_checkbox("Names", self._choice.names)

        @search.on_update
        async def _(_) -> None:
            self._choice.search = search.value

        @lines.on_update
        async def _(_) -> None:
            self._choice.lines = int(lines.value)

        @names.on_update
        async def _(_) -> None:
            self._choice.names = names.value

    def _on_word(self, word: str, client: viser.ClientHandle | None) -> None:
        what, _, name = word.partition(":")
        pair, choice = as_pair(name), self._choice
        if what == "ignore":
            choice.ignore(pair)
        elif what == "pick":
            choice.pair = None if choice.pair == pair else pair
            if choice.pair is not None and client is not None:
                self._zoom(client)

    def _zoom(self, client: viser.ClientHandle) -> None:
        """Look at the gap of the highlighted pair from the camera's direction, but nearer."""
        pairs = self._shown.frame.pairs
        row = pairs.places.get(self._choice.pair)
        if row is None or np.isnan(pairs.points[row]).any():
            return
        ends = pairs.points[row] * self._parts.scale
        middle = ends.mean(axis=0)
        away = np.array(client.camera.position) - middle
        away /= np.linalg.norm(away) or 1.0
        distance = max(4.0 * float(np.linalg.norm(ends[1] - ends[0])), 0.6 * self._parts.size)
        with client.atomic():
            client.camera.look_at = middle
            client.camera.position = middle + distance * away

    def _return_to_worst(self) -> None:
        """Hold the two bodies of the worst pair where they were."""
        found = self._session.worst(self._choice.pair, self._choice.ignored)
        if found is None:
            return
        pair, worst = found
        self._choice.at_s = None
        self._choice.pair = pair
        scene = self._shown.scene
        for name in pair:
            if name in scene.moving and scene.body(name).topic is not None:
                row = scene.moving.index(name)
                there, now = worst.poses[row], self._session.newest.pose(row)
                self._holds.place(name, there, there if now is None else now)


def _complete(news: News) -> bool:
    """Whether everything has come, of one scene: the first messages may be of the previous one."""
    scene, parts, frame = news.scene, news.parts, news.frame
    return (
        not (scene is None or parts is None or frame is None)
        and len(parts) == len(scene.bodies)
        and len(frame.poses) == len(scene.moving)
    )
