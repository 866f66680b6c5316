"""The page of one browser: its layout, and the steps that keep it up to date."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape

import numpy as np
import viser

from proximity_monitor.display import conflict_list, event_list, picking, serving
from proximity_monitor.display.bridge import Bridge, as_pair
from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.conflict_list import ConflictList
from proximity_monitor.display.connection import Connection, banner, pill
from proximity_monitor.display.deciding import Deciding
from proximity_monitor.display.decisions import Decision
from proximity_monitor.display.event_list import EventList
from proximity_monitor.display.event_picture import EventPicture
from proximity_monitor.display.fresh import Beat, patience_s
from proximity_monitor.display.holds import Hand
from proximity_monitor.display.inbox import News
from proximity_monitor.display.inspection import Inspect
from proximity_monitor.display.keys import Keys
from proximity_monitor.display.labels import Label, Labels
from proximity_monitor.display.lines import Lines
from proximity_monitor.display.listing import Filters, in_order
from proximity_monitor.display.matrix import matrix
from proximity_monitor.display.move import Move
from proximity_monitor.display.pairs import table
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.player_panel import PlayerPanel
from proximity_monitor.display.portraits import Portraits, Sitting
from proximity_monitor.display.report_files import ReportFiles
from proximity_monitor.display.save import Save
from proximity_monitor.display.settings import SettingsPanel
from proximity_monitor.display.shared import Shared, Shown
from proximity_monitor.display.state import Frame, SceneInfo
from proximity_monitor.display.style import STYLE
from proximity_monitor.display.timeline import Timeline
from proximity_monitor.display.turns import Turns
from proximity_monitor.display.unlisted import unlisted
from proximity_monitor.display.view import View, approach, look, place

TABLE_S = 0.08
"""Seconds between two updates of the numbers; faster changes cannot be read. It is a little less
than a tenth, so that each of ten ticks a second is shown, also one that comes early."""

LONGEST_S = 0.5
"""Maximum seconds between two updates of a long list: less than the time after which it is old."""

CHARACTER_S = 1e-6
"""Seconds between two updates of a list per character of its HTML, which the browser must read."""

REMEDY = "It tries again. If that does not help, reload it; details are in the display's log."

FAULT_S = 10.0
"""Seconds for which an error is shown after the last failed step."""

WIDTH = 500
"""Width of the panel, in pixels."""


class Page:
    """The page of one browser; its view, choice, hidden pairs and moment are its own."""

    def __init__(self, client: viser.ClientHandle, shared: Shared) -> None:
        """Lay the page out in a browser; `shared` is what all browsers share."""
        self._client = client
        self._server = shared.server
        self._session = shared.session
        self._decisions = shared.decisions
        self.hand = Hand(shared.holds, f"browser {client.client_id + 1}")
        self._choice = Choice()
        self._shown: Shown | None = None
        self._parts: Parts | None = None
        self._lines: Lines | None = None
        self._labels: Labels | None = None
        self._numbers: Sequence[Label] | None = None  # of the list's tick; None: to be renewed
        self._session_number = self._session.number
        self._drawn: tuple = ()
        self._listed: tuple = ()
        self._sat: Sitting | None = None
        self._all_placed = True
        self._due_s = self._table_due_s = self._fault_until_s = 0.0
        gui = client.gui
        self._turns = Turns(gui)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        gui.add_html(STYLE)
        Bridge(gui, self._on_word)
        self._beat = Beat(gui)
        self._fault = gui.add_html("")
        self._pill = gui.add_html("")
        self._banner = gui.add_html("")
        self._over = gui.add_html("")  # lies over the picture
        tabs = gui.add_tab_group()
        with tabs.add_tab("Clearances", viser.Icon.RULER_MEASURE):
            self._add_list(gui)
        with tabs.add_tab("Move", viser.Icon.HAND_MOVE):
            self._move = Move(client, self.hand, self._choice, shared.ask)
        with tabs.add_tab("Settings", viser.Icon.ADJUSTMENTS):
            self._settings = SettingsPanel(gui, self._choice, shared.tried, shared.ask)
        picking.listen(client.scene, lambda: self._parts, self._inspect.plane, self._on_pick)
        over_time = gui.add_panel()
        plot = over_time.add_tab("Clearance", viser.Icon.CHART_LINE)
        over_time.dock_below(gui.main_panel)
        with tabs.add_tab("Session", viser.Icon.HISTORY):
            self._player = PlayerPanel(gui, shared.ask_player)
            self._timeline = Timeline(gui, plot, self._session, self._choice, self._return_to_worst)
            self._portraits = Portraits(client, self._move.hide)
            picture = EventPicture(
                shared.events, self._choice, self._portraits, lambda: self._parts
            )
            self._conflict_list = ConflictList(gui, shared, self._choice)
            self._event_list = EventList(gui, shared, self._choice, picture)
            self._save = Save(gui, shared, self._choice, lambda: self._shown, self._move.hide)
            self._files = ReportFiles(
                gui, shared, self._portraits, lambda: self._shown, lambda: self._parts
            )
        Keys(gui, self._choice, self._listed_pairs, self._pick, self._inspect.do)
        self._turns.hear_all()

    def take_up(self) -> None:
        """Run the callbacks of this browser that have come; call this before each step."""
        self._turns.take_up()

    def step(self, news: News, told: Connection, now_s: float) -> None:
        """Bring the page up to date: first the part in the hand and its numbers, then the rest."""
        with self._client.atomic():
            deforming = () if news.scene is None else news.scene.deforming
            if news.complete:
                self._begin_step(news)
            else:
                self._banner.content = ""  # it is about the previous scene
                self._move.rest()
            shown_s = None if self._shown is None else self._shown.frame.stamp_s
            self._pill.content = pill(
                told, self._choice, self._session.span_s[1], deforming, shown_s
            )
        if news.complete:
            if self._choice.body is not None:
                serving.hand_over(self._client)
            sitting = self._portraits.sitting
            with self._client.atomic():
                self._show(news, told, now_s, sitting)
        self._client.flush()  # otherwise it waits for further messages
        if news.complete:
            self._portraits.note(sitting)

    def admit(self, fault: str, now_s: float) -> None:
        """Show an error of the page, and keep it for `FAULT_S` after the last; empty: no error."""
        if fault:
            self._fault_until_s = now_s + FAULT_S
            text = escape(f"This page failed, and may show old numbers: {fault[:200]}. {REMEDY}")
            self._fault.content = f'<div class="pm pm-fault" id="pm-fault" role=alert>{text}</div>'
        elif now_s >= self._fault_until_s and self._fault.content:
            self._fault.content = ""

    def _begin_step(self, news: News) -> None:
        """Take the news, and show the part at the gizmo."""
        scene, before = news.scene, self._shown
        if before is None or before.scene.key != scene.key:
            self._build(news)
        elif news.parts is not before.parts or scene.deforming != before.scene.deforming:
            self._parts.reshape(news.parts, scene.deforming)
        if self._session_number != self._session.number:
            self._session_number = self._session.number
            self._choice.at_s = self._choice.seen = None  # the moment was in another session
        at = self._choice.at_s
        frame = news.frame if at is None else self._at(at)
        self._shown = Shown(scene, frame, news.parts, news.frame)
        self._move.show(frame, news)

    def _show(self, news: News, told: Connection, now_s: float, sitting: Sitting | None) -> None:
        scene, frame, choice = news.scene, self._shown.frame, self._choice
        left = unlisted(news.frame.pairs, scene, news.health)
        left_then = left
        if choice.at_s is not None:  # the reasons at that moment were not kept
            left_then = unlisted(frame.pairs, scene, None)
        listed = (frame, scene, self._decisions.all, replace(choice), left_then)
        # Only a changed list delays the next update, so that a new tick is shown at once.
        anew = now_s >= self._table_due_s and listed != self._listed
        if anew:
            self._numbers = None
        self._draw(frame, scene, sitting)
        if not self._all_placed and frame.poses[:, 3:].any(axis=1).all():
            self._look_at_all(frame)
        self._inspect.show(scene, frame, news.parts, now_s, sitting)
        if now_s >= self._due_s or anew:
            self._due_s = now_s + TABLE_S
            self._banner.content = banner(news.frame, scene, choice, told, left)
            self._settings.show(scene, news.health, news.refusal, now_s)
            self._deciding.show(frame.pairs, scene)
            if told.current:
                self._beat.show(news.frame, patience_s(scene) - (now_s - news.frame_at_s))
        if anew:
            self._listed = listed
            self._table.content = told = table(
                frame.pairs, scene, choice, self._decisions.all, left_then
            )
            self._matrix.content = matrix(frame.pairs, scene, choice.pair)
            self._table_due_s = now_s + min(max(TABLE_S, CHARACTER_S * len(told)), LONGEST_S)
        self._timeline.show(scene, now_s)
        self._player.show(news, now_s)
        self._conflict_list.show(scene, now_s)
        self._event_list.show(news, now_s)

    def _at(self, stamp_s: float) -> Frame:
        """Return the tick at a stamp; if it was not kept, its known pair, or else the next tick."""
        frame, seen = self._session.at(stamp_s), self._choice.seen
        if seen is not None and frame.stamp_s != stamp_s:
            pair, then = seen
            if (pair, then.stamp_s) == (self._choice.pair, stamp_s) and then.placed:
                return then.frame(pair)
        return frame

    def _draw(self, frame: Frame, scene: SceneInfo, sitting: Sitting | None) -> None:
        """Bring the picture up to date: parts, lines and labels.

        The labels' numbers change only when the list's do, so that both are of the same tick.
        """
        choice = self._choice
        held = self.hand.poses if choice.at_s is None else {}
        view, cut = View.of(self._client.camera), None
        if sitting is not None:
            frame, pair, view, cut = sitting
            held, choice = {}, replace(choice, pair=pair, ignored=frozenset())
        self._parts.show(frame, held, choice, choice.pair or ())
        drawn = (frame, choice.pair, choice.body, choice.ignored, choice.lines, scene)
        if drawn != self._drawn:
            self._drawn = drawn
            self._lines.show(frame.pairs, scene, choice)
        if self._sat is not sitting:  # a picture must not show a label of another moment
            self._sat = sitting
            self._labels.clear()
        at_once = sitting is not None or self._numbers is None
        if sitting is None and self._numbers is None:
            self._numbers = self._lines.labels
        numbers = self._numbers if sitting is None else self._lines.labels
        labels = [*numbers, *self._parts.labels()] if cut is None else []
        self._labels.show(labels, view, self._lines.tips, at_once=at_once)

    def _build(self, news: News) -> None:
        """Build the page's content for a scene."""
        self._client.scene.reset()
        self._choice.ignored = frozenset()
        self._choice.pair = self._choice.body = self._choice.at_s = None
        self._filters.begin(news.scene)
        focal = View.of(self._client.camera).focal
        self._parts = Parts(self._client, news.scene, news.parts, focal)
        self._portraits.begin(self._parts)
        self._parts.show(news.frame, {}, self._choice, ())
        self._lines = Lines(self._client, self._parts.scale, self._parts.size)
        self._labels, self._numbers = Labels(self._client.scene, "/distances"), None
        self._inspect.begin(news.scene, self._parts)
        self._move.begin(news.scene, self._parts)
        self.hand.begin(news.scene.key)
        self._look_at_all(news.frame)
        self._client.gui.set_panel_label(news.scene.name)
        self._about.content = f"<div class='pm pm-dim'>{escape(news.scene.description)}</div>"

    def _look_again(self) -> None:
        camera = self._server.initial_camera
        place(self._client.camera, camera.position, camera.look_at)

    def _look_at_all(self, frame: Frame) -> None:
        """Show all parts, unless the user has moved the camera already."""
        low, high = self._parts.box()
        middle, across = (low + high) / 2.0, float(np.linalg.norm(high - low))
        camera = self._server.initial_camera
        before = camera.position
        camera.look_at = middle
        camera.position = middle + across * np.array([0.55, -0.75, 0.45])
        mine = self._client.camera
        if np.allclose(mine.position, before, atol=1e-3 * across):
            place(mine, camera.position, middle)
        # A monitor's first ticks may come before any pose.
        self._all_placed = bool(frame.poses[:, 3:].any(axis=1).all())

    def _add_list(self, gui: viser.GuiApi) -> None:
        self._inspect = Inspect(self._client, self._choice, self._look_again, self._over)
        self._filters = Filters(gui, self._choice)
        self._deciding = Deciding(gui, self._decisions, self._choice, self._camera)
        self._table = gui.add_html("")
        with gui.add_folder("Clash matrix", expand_by_default=False):
            self._matrix = gui.add_html("")
        with gui.add_folder("Picture", expand_by_default=False):
            lines = gui.add_slider(
                "Lines", 0, 200, 1, self._choice.lines,
                hint="Number of nearest pairs to draw, besides all that are not clear",
            )  # fmt: skip
            names = gui.add_checkbox(
                "Names", self._choice.names, hint="Shows the names of parts in the picture"
            )
            self._inspect.add_looks(gui)
        self._about = gui.add_html("")

        @lines.on_update
        def _(_) -> None:
            self._choice.lines = int(lines.value)

        @names.on_update
        def _(_) -> None:
            self._choice.names = names.value

    def _on_pick(self, name: str) -> None:
        """Choose the part that was clicked. Any thread may call this."""
        self._turns.submit(self._move.pick, name)

    def _on_word(self, word: str) -> None:
        what, _, name = word.partition(":")
        if what == "unfilter":
            self._filters.clear()
        elif what == "event":
            self._event_list.go(name)
            self._see_then(None)
        elif what == event_list.TURN:
            self._event_list.turn(name)
        elif what == conflict_list.TURN:
            self._conflict_list.turn(name)
        elif self._shown is not None:
            self._on_pair(what, name)

    def _on_pair(self, what: str, name: str) -> None:
        """Handle a press at a pair; ignore a pair that is not on the page or has gone."""
        choice, bodies = self._choice, self._shown.scene.names
        pair = as_pair(name)
        if what == "conflict":
            if pair is not None and set(pair) <= set(bodies):
                self._conflict_list.go(pair)
                self._see_then(self._decisions.all.get(frozenset(pair)))
            return
        if pair not in self._shown.frame.pairs.places and pair not in choice.ignored:
            return
        if what == "ignore":
            choice.ignore(pair)
        elif what == "pick":
            self._pick(None if choice.pair == pair else pair)

    def _pick(self, pair: PairName | None) -> None:
        """Highlight a listed pair and look at its gap; None: highlight no pair."""
        self._choice.pair = pair
        if self._shown is not None:
            pairs = self._shown.frame.pairs
            if (row := pairs.places.get(pair)) is not None:
                self._approach(pairs.points[row])

    def _listed_pairs(self) -> list[PairName]:
        """Return the pairs of the list, in its order."""
        if (shown := self._shown) is None:
            return []
        return in_order(shown.frame.pairs, shown.scene, self._choice, self._decisions.all)

    def _approach(self, points: np.ndarray) -> None:
        """Look at closest points (2, 3) from the camera's present direction, but nearer."""
        if not np.isnan(points).any():
            scale, least = self._parts.scale, 0.6 * self._parts.size
            approach(self._client.camera, points * scale, least)

    def _camera(self) -> tuple[float, ...]:
        """Return this browser's camera as `Decision.camera`."""
        camera, scale = self._client.camera, self._parts.scale
        metres = np.concatenate((camera.position, camera.look_at)) / scale
        return tuple(metres.round(9).tolist())

    def _see_then(self, decision: Decision | None) -> None:
        """Take the camera of the person who decided about a conflict, or else look at its gap."""
        seen = self._choice.seen
        if decision is not None and decision.camera is not None:
            position, at = np.reshape(decision.camera, (2, 3)) * self._parts.scale
            look(self._client.camera, position, at)
        elif seen is not None and seen[0] == self._choice.pair:
            self._approach(seen[1].points)

    def _return_to_worst(self) -> None:
        """Hold both bodies of the worst pair where they were then; say which of them cannot be."""
        found = self._session.worst(self._choice.pair, self._choice.ignored)
        if found is None or not found[1].placed:
            return
        pair, worst = found
        self._choice.at_s = None
        self._choice.pair = pair
        scene = self._shown.scene
        for name in [name for name in pair if name in scene.moving]:
            row = scene.moving.index(name)
            there, now = worst.poses[row], self._session.newest.pose(row)
            if scene.body(name).topic is None:
                why = "its poses come from elsewhere"
            elif self.hand.place(name, there, there if now is None else now):
                continue
            elif (other := self.hand.other(name)) is not None:
                why = f"{other.name} holds it: take it over first"
            elif (parent := scene.held.get(name)) is not None:
                why = f"it is attached to {parent}: detach it first"
            else:
                why = "another scene has begun"
            self._client.add_notification("Not returned", f"{name}: {why}", color="red")
