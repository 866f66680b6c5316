"""Moving a part: the gizmo, the typed pose, undo, reset and release."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping
from html import escape

import numpy as np
import viser

from proximity_monitor.display.attaching import Attaching
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.drag import Drag, Room
from proximity_monitor.display.fine import Fine, stepped
from proximity_monitor.display.geometry import from_degrees, moved, to_degrees
from proximity_monitor.display.guard import AT_CONTACT, AT_STOP, FREE
from proximity_monitor.display.holds import Hand
from proximity_monitor.display.inbox import News
from proximity_monitor.display.pairs import brief
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.script import GIZMO
from proximity_monitor.display.signs import DECIMALS
from proximity_monitor.display.state import Frame, Pairs, SceneInfo

NOBODY = "(none)"
LET_GO = "Let go: its own source moves it"

_UNTOLD = (None, b"")

NEAREST = 4
"""How many of the part's nearest clearances the panel lists."""

HANDLES = 130.0
"""Length of the handles in pixels, the same at every zoom."""

REST_S = 1.0
"""If others move the part, the fields take its pose after this many seconds at rest. Nobody could
type into fields that change meanwhile."""


class Move:
    """The gizmo in the scene and the panel beside it."""

    def __init__(
        self,
        client: viser.ClientHandle,
        hand: Hand,
        choice: Choice,
        ask: Callable[[Mapping[str, str]], None],
    ) -> None:
        """Add both; they work once `begin` is called. `ask` sends parameters to the monitor."""
        self._client = client
        self._hand = hand
        self._choice = choice
        self._scene: SceneInfo | None = None
        self._parts: Parts | None = None
        self._newest: Frame | None = None
        self._gizmo: viser.TransformControlsHandle | None = None
        self._hidden = False
        self._edited = False  # whether typed numbers wait for the button
        self._told = _UNTOLD  # body and pose that the fields show
        self._seen: tuple[str | None, bytes] = (None, b"")
        self._moved_s = -math.inf
        gui = client.gui
        self._who = gui.add_dropdown("Part", (NOBODY,), hint="Or click a part in the picture")
        self._note = gui.add_html("")
        self._near = gui.add_html("")
        self._now = gui.add_html("")
        with gui.add_form(None) as form:  # so that Enter in a field puts the part there
            self._position = gui.add_vector3(
                "Position", (0.0, 0.0, 0.0), hint="Of the part's origin, in the scene's frame"
            )
            self._turn = gui.add_vector3(
                "Turn [deg]", (0.0, 0.0, 0.0), step=1.0, hint="Roll, pitch and yaw about fixed axes"
            )
        # A button shows no hint, so its label names the key.
        self._apply = gui.add_button("Put it there (Enter)", icon=viser.Icon.TARGET_ARROW)
        self._undo = gui.add_button("Undo (Ctrl+Z)", icon=viser.Icon.ARROW_BACK_UP)
        self._reset = gui.add_button("Back to where it was", icon=viser.Icon.REFRESH)
        self._release = gui.add_button(LET_GO, icon=viser.Icon.HAND_OFF)
        self._stop = gui.add_dropdown(
            "Drags stop", (FREE, AT_STOP, AT_CONTACT), hint="By each tick's certified bounds"
        )
        self._attaching = Attaching(gui, choice, ask)
        self._fine = Fine(gui, self._on_step)
        self._drag = Drag(hand, self._fine)
        command = gui.add_command("Undo the last move", hotkey="Z", modifier="cmd/ctrl")
        self._who.on_update(self._on_who)
        self._turn.precision = 3
        for field in (self._position, self._turn):
            field.on_update(self._on_typed)
        self._apply.on_click(self._on_apply)
        form.on_submit(self._on_apply)
        self._undo.on_click(self._on_undo)
        self._reset.on_click(self._on_reset)
        self._release.on_click(self._on_release)
        command.on_trigger(self._on_undo)

    def begin(self, scene: SceneInfo, parts: Parts) -> None:
        """Switch to a scene; the gizmo is made again."""
        self._scene, self._parts = scene, parts
        self._newest, self._told = None, _UNTOLD  # the fields may show another unit
        self._drag.end()  # the removed gizmo reports no end of a drag
        names = tuple(body.name for body in scene.bodies if body.topic is not None)
        self._who.options = (NOBODY, *names)
        self._fine.begin(scene.unit)
        digits = DECIMALS.get(scene.unit.symbol, 4)
        self._position.label = f"Position [{scene.unit.symbol}]"
        self._position.precision, self._position.step = digits, 10.0 ** (1 - digits)
        self._gizmo = self._client.scene.add_transform_controls(
            GIZMO, scale=HANDLES, fixed=True, line_width=3.0, depth_test=False, visible=False
        )
        self._gizmo.on_update(self._on_drag)
        self.pick(names[0] if len(names) == 1 else None)

    def pick(self, name: str | None) -> None:
        """Choose the body at the gizmo."""
        self._choose(name)
        self._who.value = name or NOBODY

    def _choose(self, name: str | None) -> None:
        self._choice.body = name
        self._edited = False

    def show(self, frame: Frame, news: News) -> None:
        """Make the gizmo and the numbers follow the body."""
        self._scene, self._newest = news.scene, news.frame
        self._advance()
        name, live = self._choice.body, self._live
        self._near.content = _clearances(name, frame.pairs, self._scene)
        pose = None
        if name is not None:
            pose = self._pose(name) if live else frame.pose(self._scene.moving.index(name))
        other, own = self._hand.other(name), self._hand.own
        parent = None if name is None else news.scene.held.get(name)
        free = self._may(name)
        self._attaching.show(news)
        self._apply.disabled = not free
        self._reset.disabled = name not in own or not free
        self._release.disabled = name not in own and other is None
        self._release.label = LET_GO if other is None else f"Take it over from {other.name}"
        self._undo.disabled = not (self._hand.can_undo and live)
        self._note.content = _note(name, own, other, parent, news.rivals, live)
        if pose is not None and self._drag.body is None:
            at = moved(pose, self._parts[name].centre / self._parts.scale)
            self._gizmo.position, self._gizmo.wxyz = at[:3] * self._parts.scale, at[3:]
            if (self._rests(name, pose) or name in own or not live) and not self._edited:
                self._tell(pose)
        # Last, so that no browser shows the handles where they were before.
        self._gizmo.visible = pose is not None and free and not self._hidden
        self._now.content = self._where(name, pose)

    def hide(self, hidden: bool) -> None:
        """Hide the gizmo for a picture of the scene alone, or let it be shown again."""
        self._hidden = hidden
        if hidden and self._gizmo is not None:
            self._gizmo.visible = False

    def rest(self) -> None:
        """Disable all moves while another scene comes, until its parts are shown."""
        self._drag.end()
        for each in (self._apply, self._undo, self._reset, self._release):
            each.disabled = True
        if self._gizmo is not None:
            self._gizmo.visible = False

    @property
    def _live(self) -> bool:
        """Whether parts may be moved: not while the page looks back."""
        return self._choice.at_s is None

    def _may(self, name: str | None) -> bool:
        """Return whether this page may move a part."""
        return name is not None and self._live and self._hand.may(name)

    def _pose(self, name: str) -> np.ndarray | None:
        """Return the pose of a part now, whatever moment is shown; None: not known."""
        held = self._hand.poses.get(name)
        if held is not None or self._newest is None:
            return held
        return self._newest.pose(self._scene.moving.index(name))

    def _rests(self, name: str, pose: np.ndarray) -> bool:
        """Return whether a part has been still for `REST_S`, or has just been chosen."""
        seen, now_s = (name, pose.tobytes()), time.monotonic()
        if seen != self._seen:
            self._moved_s = now_s if name == self._seen[0] else -math.inf
            self._seen = seen
        return now_s - self._moved_s >= REST_S

    def _tell(self, pose: np.ndarray) -> None:
        """Show a pose in the fields."""
        told = (self._choice.body, pose.tobytes())
        if told != self._told:
            self._told = told
            self._position.value, self._turn.value = self._numbers(pose)

    def _where(self, name: str | None, pose: np.ndarray | None) -> str:
        """Return the pose of a part as HTML; an empty line if the fields show that pose already."""
        told = ""
        if pose is not None and (name, pose.tobytes()) != self._told:
            place, turn = (", ".join(map(repr, each)) for each in self._numbers(pose))
            at = f"at {place} {escape(self._scene.unit.symbol)}, turned by {turn} deg"
            told = f"{self._choice.when} {at}"
        return f'<div class="pm pm-small pm-dim pm-room" style="--lines:1" id="pm-now">{told}</div>'

    def _numbers(self, pose: np.ndarray) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return position and angles of a pose for the fields: in the scene's unit, in degrees."""
        unit = self._scene.unit
        digits = DECIMALS.get(unit.symbol, 4)
        place = tuple(np.round(pose[:3] / unit.to_metre, digits).tolist())
        return place, tuple(round(float(angle), 3) for angle in to_degrees(pose[3:]))

    async def _on_drag(self, event: viser.TransformControlsEvent) -> None:
        scale, turned = self._parts.scale, np.array(event.target.wxyz)
        at = np.array(event.target.position) / scale
        handles = np.concatenate((at, turned / np.linalg.norm(turned)))
        if event.phase == "start":
            self._drag.end()
            name = self._choice.body
            if self._may(name) and (pose := self._pose(name)) is not None:
                self._drag.begin(name, pose, handles, self._parts[name].centre / scale)
        if (name := self._drag.body) is None:
            return
        self._drag.follow(handles, self._parts[name].centre / scale)
        self._advance()
        if event.phase == "end":
            self._drag.end()

    def _advance(self) -> None:
        """Move the dragged part towards the target of the drag, as far as it may."""
        if not self._live:
            self._drag.end()
        newest = self._newest
        room = None if newest is None else Room(newest, self._scene, self._parts)
        moved_to = self._drag.advance(room, self._stop.value)
        if moved_to is not None and moved_to[0] == self._choice.body:
            self._tell(moved_to[1])

    def _place(self, placed: Callable[[np.ndarray], np.ndarray]) -> None:
        """Hold the chosen part at the pose that `placed` makes of its present one, if allowed."""
        name = self._choice.body
        if self._may(name) and (now := self._pose(name)) is not None:
            self._hand.place(name, placed(now), now)
        self._edited = False

    def _on_step(self, shift: np.ndarray, turn: np.ndarray) -> None:
        def stepped_from(now: np.ndarray) -> np.ndarray:
            centre = self._parts[self._choice.body].centre / self._parts.scale
            return moved(stepped(moved(now, centre), shift, turn), -centre)

        self._place(stepped_from)

    def _on_who(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._choose(None if self._who.value == NOBODY else self._who.value)

    def _on_typed(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._edited, self._told = True, _UNTOLD

    def _on_apply(self, _) -> None:
        def typed(_: np.ndarray) -> np.ndarray:
            place = np.array(self._position.value) * self._scene.unit.to_metre
            pose = np.concatenate((place, from_degrees(*self._turn.value)))
            self._told = (self._choice.body, pose.tobytes())  # keeps the angles as they are typed
            return pose

        self._place(typed)

    def _on_undo(self, _) -> None:
        if self._live and (name := self._hand.undo()) is not None:
            self.pick(name)

    def _on_reset(self, _) -> None:
        if self._may(self._choice.body):
            self._hand.reset(self._choice.body)

    def _on_release(self, _) -> None:
        name = self._choice.body
        if name is not None and self._hand.other(name) is not None:
            self._hand.take_over(name)
        elif name is not None:
            self._hand.release(name)


def _clearances(name: str | None, pairs: Pairs, scene: SceneInfo) -> str:
    """Return the nearest pairs of a part as HTML."""
    if name is None:
        return ""
    own = np.array(pairs.rows_of.get(name, ()), int)
    rows = own[np.argsort(pairs.lower[own])][:NEAREST]
    told = "".join(brief(pairs, i, scene) for i in rows)
    room = f'class="pm pm-small pm-room" style="--lines:{NEAREST}"'
    return f'<div {room} id="pm-near">{told}</div>'


def _note(
    name: str | None,
    own: Collection[str],
    other: Hand | None,
    parent: str | None,
    rivals: tuple[str, ...],
    live: bool,
) -> str:
    if name is None:
        text = "Click a part, then drag its arrows, planes and arcs."
    elif not live:
        text = "looking back: go back to live to move parts"
    elif other is not None:
        text = f"▲ held by {escape(other.name)}, another view of this page"
    elif parent is not None:
        text = f"attached to {escape(parent)}: it moves with it"
    elif name not in own:
        text = "Drag the gizmo to take the part; its pose is published 40 times a second."
    elif rivals:
        text = f"▲ held here, but {escape(', '.join(rivals))} publishes poses of held parts too"
    else:
        text = f"held here, with {len(own) - 1} more" if len(own) > 1 else "held here"
    return f'<div class="pm pm-small" id="pm-held">{text}</div>'
