"""Seeing a gap: zoom the camera to it, lay a section through it, make parts transparent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape

import numpy as np
import viser

from proximity_monitor.display.banding import Banding
from proximity_monitor.display.choice import PLAIN, Choice, PairName
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.portraits import Sitting
from proximity_monitor.display.received import Part
from proximity_monitor.display.section import Plane, Section
from proximity_monitor.display.state import Frame, SceneInfo
from proximity_monitor.display.view import View, adapt, facing, zoom

ZOOM, SECTION, WHOLE = "Zoom to the gap", "Section through it", "Whole scene"

EVERY = "(all parts)"


class Inspect:
    """The buttons for seeing a gap, and the section of one page."""

    def __init__(
        self,
        client: viser.ClientHandle,
        choice: Choice,
        look_at_all: Callable,
        over: viser.GuiHtmlHandle,
    ) -> None:
        """Add the buttons at the current place of the GUI.

        Args:
            client: the browser.
            choice: holds the highlighted pair and the looks of the parts.
            look_at_all: shows the whole scene.
            over: shows a line over the picture while a section is on; in the panel such a line
                would push the list down.
        """
        self._client = client
        self._choice = choice
        self._look_at_all = look_at_all
        self._over = over
        self._plane: Plane | None = None
        self._section: Section | None = None
        self._parts: Parts | None = None
        self._frame: Frame | None = None
        self._problem: tuple[PairName | None, str] = (None, "")  # why a button failed for a pair
        buttons = client.gui.add_button_group(
            "Gap", (ZOOM, SECTION, WHOLE), hint="Of the highlighted pair, else of the nearest"
        )
        self._note = client.gui.add_html("")

        @buttons.on_click
        def _(_) -> None:
            self.do(buttons.value)

        @client.camera.on_update
        async def _(camera: viser.CameraHandle) -> None:
            adapt(camera)

    def add_looks(self, gui: viser.GuiApi) -> None:
        """Add the inputs for how each part is drawn, at the current place of the GUI."""
        self._whose = gui.add_dropdown(
            "Look of", (EVERY,), hint="The fields below change how this part is drawn"
        )
        self._opacity = gui.add_slider(
            "Opacity", 0.0, 1.0, 0.05, 1.0, hint="0: invisible, 1: opaque"
        )
        self._edges = gui.add_checkbox("Edges", True, hint="Draws sharp and open edges")
        self._bands = gui.add_checkbox(
            "Bands", False, hint="Colours by clearance: below stop, below warn, above"
        )
        self._legend = gui.add_html("")

        @self._whose.on_update
        def _(_) -> None:
            self._tell_looks()

        self._fields = {"opacity": self._opacity, "edges": self._edges, "bands": self._bands}
        for field in self._fields.values():
            field.on_update(self._on_look)

    def begin(self, scene: SceneInfo, parts: Parts) -> None:
        """Switch to a scene."""
        self._parts, self._plane = parts, None
        self._section = Section(self._client.scene, parts)
        self._banding = Banding(self._client.scene, parts, scene)
        self._choice.looks = {}
        self._whose.options = (EVERY, *(body.name for body in scene.bodies))
        self._whose.value = EVERY
        self._tell_looks()

    def show(
        self,
        scene: SceneInfo,
        frame: Frame,
        parts: Sequence[Part],
        now_s: float,
        sitting: Sitting | None = None,
    ) -> None:
        """Cut the parts where they are now and colour them by clearance.

        For a picture (`sitting`), use its own section and view, and no bands.
        """
        self._frame = frame
        looks = {} if sitting is not None else self._choice.looks
        wanted = [name for name, look in looks.items() if look.bands]
        self._banding.show(scene, frame, parts, wanted, now_s, self._choice.at_s is not None)
        self._legend.content = self._banding.legend()
        on = f"A section is on. To end it, press <i>{WHOLE}</i>."
        on = f'<div class="pm-over" id="pm-section">{on}</div>'
        self._over.content = on if self._plane is not None else ""
        pair, problem = self._problem
        note = f'<div class="pm pm-small" id="pm-no-gap">{escape(problem)}</div>'
        self._note.content = note if problem and pair == self._choice.pair else ""
        plane = self._plane if sitting is None else sitting.cut
        if plane is not self._section.plane:
            self._section.aim(plane)
        view = View.of(self._client.camera) if sitting is None else sitting.view
        self._section.show(view, now_s)

    def plane(self) -> Plane | None:
        """Return the plane of the section, if there is one."""
        return self._plane

    def gap(self) -> np.ndarray | None:
        """Return the closest points (2, 3) of the highlighted pair, in the page's units.

        If no pair is highlighted, return those of the nearest pair. None: they are not known.
        """
        if self._frame is None:
            return None
        pairs = self._frame.pairs
        known = ~np.isnan(pairs.points).any(axis=(1, 2)) & ~self._choice.ignores(pairs.names)
        row = pairs.places.get(self._choice.pair)
        if self._choice.pair is None:
            rows = np.flatnonzero(known)
            row = rows[np.argmin(pairs.lower[rows])] if len(rows) else None
        if row is None or not known[row]:
            return None
        return pairs.points[row] * self._parts.scale

    def do(self, what: str) -> None:
        """Do what a button does: `ZOOM`, `SECTION` or `WHOLE`."""
        if self._parts is None:
            return
        camera, ends, pair = self._client.camera, self.gap(), self._choice.pair
        whose = "any pair" if pair is None else " - ".join(pair)
        lacks = ends is None and what != WHOLE
        self._problem = pair, f"the closest points of {whose} are not known now" if lacks else ""
        if what == WHOLE:
            self._plane = None
            self._look_at_all()
        elif ends is not None and what == ZOOM:
            zoom(camera, ends)
        elif ends is not None:
            self._plane = Plane(ends.mean(axis=0), facing(ends, np.array(camera.position)))

    def _tell_looks(self) -> None:
        """Show how the chosen part looks, or what all parts have in common."""
        looks = {name: self._choice.looks.get(name, PLAIN) for name in self._named()}
        opacities = {
            self._parts[name].usual_opacity if look.opacity is None else look.opacity
            for name, look in looks.items()
        }
        if len(opacities) == 1:
            self._opacity.value = opacities.pop()
        self._edges.value = all(look.edges for look in looks.values())
        self._bands.value = all(look.bands for look in looks.values())

    def _on_look(self, event: viser.GuiEvent) -> None:
        if event.client is None:
            return
        field = next(name for name, each in self._fields.items() if each is event.target)
        looks = dict(self._choice.looks)
        for name in self._named():
            looks[name] = looks.get(name, PLAIN)._replace(**{field: event.target.value})
        self._choice.looks = looks

    def _named(self) -> Sequence[str]:
        """Return the names of the parts whose look the fields show and change."""
        whose = self._whose.value
        return self._whose.options[1:] if whose == EVERY else (whose,)
