"""Moving a part: the gizmo, the typed pose, undo, reset and release."""

from __future__ import annotations

from html import escape

import numpy as np
import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.geometry import from_degrees, moved, to_degrees
from proximity_monitor.display.holds import Holds
from proximity_monitor.display.inbox import News
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.signs import DECIMALS
from proximity_monitor.display.state import Frame, SceneInfo

NOBODY = "(none)"


class Move:
    """The gizmo in the scene and the panel beside it."""

    def __init__(self, server: viser.ViserServer, holds: Holds, choice: Choice) -> None:
        """Add both; `begin` puts them to work."""
        self._server = server
        self._holds = holds
        self._choice = choice
        self._scene: SceneInfo | None = None
        self._parts: Parts | None = None
        self._frame: Frame | None = None
        self._gizmo: viser.TransformControlsHandle | None = None
        self._dragging: str | None = None  # a drag stays with its body, whatever is chosen
        self._hidden = False
        self._edited = False  # typed numbers wait for their button
        self._told: tuple[str | None, bytes] = (None, b"")
        gui = server.gui
        self._who = gui.add_dropdown("Part", (NOBODY,), hint="Or click a part in the picture")
        self._note = gui.add_html("")
        self._position = gui.add_vector3("Position", (0.0, 0.0, 0.0))
        self._turn = gui.add_vector3(
            "Turn [deg]", (0.0, 0.0, 0.0), step=1.0, hint="Roll, pitch and yaw about fixed axes"
        )
        self._apply = gui.add_button("Put it there", icon=viser.Icon.TARGET_ARROW)
        self._undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP, hint="Ctrl+Z")
        self._reset = gui.add_button("Back to where it was", icon=viser.Icon.REFRESH)
        self._release = gui.add_button("Let go: its own source moves it", icon=viser.Icon.HAND_OFF)
        command = gui.add_command("Undo the last move", hotkey="Z", modifier="cmd/ctrl")
        self._who.on_update(self._on_who)
        self._turn.precision = 3
        for field in (self._position, self._turn):
            field.on_update(self._on_typed)
        self._apply.on_click(self._on_apply)
        self._undo.on_click(self._on_undo)
        self._reset.on_click(self._on_reset)
        self._release.on_click(self._on_release)
        command.on_trigger(self._on_undo)

    def begin(self, scene: SceneInfo, parts: Parts) -> None:
        """Take a scene; the gizmo is made anew at its size."""
        self._scene, self._parts, self._frame = scene, parts, None
        self._dragging = None  # the old gizmo reports no end
        names = tuple(body.name for body in scene.bodies if body.topic is not None)
        self._who.options = (NOBODY, *names)
        digits = DECIMALS.get(scene.unit.symbol, 4)
        self._position.label = f"Position [{scene.unit.symbol}]"
        self._position.precision, self._position.step = digits, 10.0 ** (1 - digits)
        self._gizmo = self._server.scene.add_transform_controls(
            "/gizmo", scale=0.35 * parts.size, line_width=3.0, depth_test=False, visible=False
        )
        self._gizmo.on_update(self._on_drag)
        if self._choice.body is None and len(names) == 1:
            self.pick(names[0])

    def pick(self, name: str | None) -> None:
        """Choose the body at the gizmo."""
        self._choose(name)
        self._who.value = name or NOBODY

    def _choose(self, name: str | None) -> None:
        self._choice.body = name
        self._edited = False

    def show(self, frame: Frame, news: News) -> None:
        """Let gizmo and numbers follow the body."""
        self._frame = frame
        name = self._choice.body
        pose = None if name is None else self._pose(name)
        live = self._choice.at_s is None
        self._gizmo.visible = pose is not None and live and not self._hidden
        held = self._holds.poses
        for button in (self._reset, self._release):
            button.disabled = name not in held
        self._undo.disabled = not self._holds.can_undo
        self._note.content = _note(name, held.keys(), news.rivals)
        if pose is None or self._dragging is not None:
            return
        at = moved(pose, self._parts[name].centre / self._parts.scale)
        self._gizmo.position, self._gizmo.wxyz = at[:3] * self._parts.scale, at[3:]
        if not self._edited:
            self._tell(pose)

    def hide(self, hidden: bool) -> None:
        """Hide the gizmo until it is shown again, for a picture of the scene alone."""
        self._hidden = hidden
        if hidden and self._gizmo is not None:
            self._gizmo.visible = False

    def _pose(self, name: str) -> np.ndarray | None:
        held = self._holds.poses.get(name)
        if held is not None or self._frame is None:
            return held
        return self._frame.pose(self._scene.moving.index(name))

    def _tell(self, pose: np.ndarray) -> None:
        told = (self._choice.body, pose.tobytes())
        if told == self._told:
            return
        self._told = told
        unit = self._scene.unit
        digits = DECIMALS.get(unit.symbol, 4)
        self._position.value = tuple(np.round(pose[:3] / unit.to_metre, digits).tolist())
        self._turn.value = tuple(round(angle, 3) for angle in to_degrees(pose[3:]))

    async def _on_drag(self, event: viser.TransformControlsEvent) -> None:
        if event.phase == "start":
            name = self._choice.body
            pose = None if name is None else self._pose(name)
            self._dragging = None if pose is None else name
            if pose is not None:
                self._holds.take(name, pose)
        name = self._dragging
        if name is None:
            return
        scale, centre = self._parts.scale, self._parts[name].centre
        turned = np.array(event.target.wxyz) / np.linalg.norm(event.target.wxyz)
        at = np.concatenate((np.array(event.target.position) / scale, turned))
        pose = moved(at, -centre / scale)
        self._holds.move(name, pose)
        if name == self._choice.body:
            self._tell(pose)
        if event.phase == "end":
            self._dragging = None

    async def _on_who(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._choose(None if self._who.value == NOBODY else self._who.value)

    async def _on_typed(self, event: viser.GuiEvent) -> None:
        self._edited |= event.client is not None

    async def _on_apply(self, _) -> None:
        name = self._choice.body
        now = None if name is None else self._pose(name)
        if now is not None:
            place = np.array(self._position.value) * self._scene.unit.to_metre
            pose = np.concatenate((place, from_degrees(*self._turn.value)))
            self._holds.place(name, pose, now)
        self._edited = False

    async def _on_undo(self, _) -> None:
        if (name := self._holds.undo()) is not None:
            self.pick(name)

    async def _on_reset(self, _) -> None:
        self._holds.reset(self._choice.body)

    async def _on_release(self, _) -> None:
        if self._choice.body is not None:
            self._holds.release(self._choice.body)


def _note(name: str | None, held, rivals: tuple[str, ...]) -> str:
    if name is None:
        text = "Click a part, then drag its arrows, planes and arcs."
    elif name not in held:
        text = "Drag the gizmo to take the part; its pose is published 40 times a second."
    elif rivals:
        text = f"▲ held here, but {escape(', '.join(rivals))} publishes poses of held parts too"
    else:
        text = f"held here, with {len(held) - 1} more" if len(held) > 1 else "held here"
    return f'<div class="pm pm-small" id="pm-held">{text}</div>'
