"""Seeing a gap: the camera goes to it, a section is laid through it, parts become transparent."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import viser

from proximity_monitor.display.banding import Banding
from proximity_monitor.display.choice import PLAIN, Choice, Look
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.received import Part
from proximity_monitor.display.section import Plane, Section
from proximity_monitor.display.state import Frame, SceneInfo
from proximity_monitor.display.view import View, adapt, facing, zoom

ZOOM, SECTION, WHOLE = "Zoom to the gap", "Section through it", "Whole scene"

EVERY = "(all parts)"


class Inspect:
    """Its buttons, and the section of one page."""

    def __init__(self, client: viser.ClientHandle, choice: Choice, look_at_all: Callable) -> None:
        """Add the buttons at this place of the GUI; `look_at_all` shows the whole scene."""
        self._client = client
        self._choice = choice
        self._look_at_all = look_at_all
        self._section: Section | None = None
        self._parts: Parts | None = None
        self._frame: Frame | None = None
        buttons = client.gui.add_button_group(
            "Gap", (ZOOM, SECTION, WHOLE), hint="Of the chosen pair; without one, the nearest"
        )

        @buttons.on_click
        def _(_) -> None:
            self._do(buttons.value)

        @client.camera.on_update
        async def _(camera: viser.CameraHandle) -> None:
            adapt(camera)

    def add_looks(self, gui: viser.GuiApi) -> None:
        """Add how each part is drawn at this place of the GUI."""
        self._whose = gui.add_dropdown("Look of", (EVERY,))
        self._opacity = gui.add_slider("Opacity", 0.0, 1.0, 0.05, 1.0)
        self._edges = gui.add_checkbox("Edges", True)
        self._bands = gui.add_checkbox(
            "Bands", False, hint="Colours by clearance: below stop, below warn, above"
        )
        self._legend = gui.add_html("")

        @self._whose.on_update
        def _(_) -> None:
            look = self._choice.looks.get(self._whose.value, PLAIN)
            if look.opacity is not None:
                self._opacity.value = look.opacity
            self._edges.value, self._bands.value = look.edges, look.bands

        for field in (self._opacity, self._edges, self._bands):
            field.on_update(self._on_look)

    def begin(self, scene: SceneInfo, parts: Parts) -> None:
        """Take a scene."""
        self._parts = parts
        self._section = Section(self._client.scene, parts)
        self._banding = Banding(self._client.scene, parts, scene)
        self._choice.looks = {}
        self._whose.options = (EVERY, *(body.name for body in scene.bodies))

    def show(
        self, frame: Frame, parts: Sequence[Part], now_s: float, *, plain: bool = False
    ) -> None:
        """Cut the parts where they are now, or colour them by clearance, unless they are plain."""
        self._frame = frame
        looks = {} if plain else self._choice.looks
        wanted = [name for name, look in looks.items() if look.bands]
        self._banding.show(frame, parts, wanted, now_s)
        self._legend.content = self._banding.legend()
        self._section.lift(plain)
        if self._section.plane is not None:
            self._section.show(View.of(self._client.camera), now_s)

    def plane(self) -> Plane | None:
        """Return the plane of the section, if there is one."""
        return None if self._section is None else self._section.plane

    def gap(self) -> np.ndarray | None:
        """Return the closest points (2, 3) of the chosen or nearest pair, in the page's units."""
        if self._frame is None:
            return None
        pairs = self._frame.pairs
        known = ~np.isnan(pairs.points).any(axis=(1, 2)) & ~self._choice.ignores(pairs.names)
        row = pairs.places.get(self._choice.pair)
        if row is None:
            rows = np.flatnonzero(known)
            row = rows[np.argmin(pairs.lower[rows])] if len(rows) else None
        if row is None or not known[row]:
            return None
        return pairs.points[row] * self._parts.scale

    def _do(self, what: str) -> None:
        camera, ends = self._client.camera, self.gap()
        if what == WHOLE:
            self._section.aim(None)
            self._look_at_all()
        elif ends is not None and what == ZOOM:
            zoom(camera, ends)
        elif ends is not None:
            self._section.aim(Plane(ends.mean(axis=0), facing(ends, np.array(camera.position))))

    def _on_look(self, event: viser.GuiEvent) -> None:
        if event.client is None:
            return
        names = self._whose.options[1:] if self._whose.value == EVERY else (self._whose.value,)
        opacity = self._opacity.value if event.target is self._opacity else None
        looks = dict(self._choice.looks)
        for name in names:
            before = looks.get(name, PLAIN)
            see_through = before.opacity if opacity is None else opacity
            looks[name] = Look(see_through, self._edges.value, self._bands.value)
        self._choice.looks = looks
