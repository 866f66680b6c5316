"""The parts in 3D: meshes with their sharp edges and names, placed each frame."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.geometry import IDENTITY, borders, feature_edges, smoothed
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import Body, Frame, SceneInfo

DIM = 0.08
"""Opacity of parts that are not highlighted."""

POINT_RADIUS = 0.008
"""Radius of a point body's ball, in sizes of the scene."""

_EDGE = (45, 50, 60)


class _Look:
    """The triangles of a part, in the page's units."""

    def __init__(self, part: Part, scale: float) -> None:
        """Let triangles share corners where the part is smooth."""
        soup = part.corners * scale
        self.low, self.high = soup.min(axis=0), soup.max(axis=0)
        self.corners, self.triangles = soup, np.arange(len(soup)).reshape(-1, 3)
        self._flat = part.normals is None
        if not self._flat:
            lines = ~part.normals.any(axis=1).reshape(-1, 3).any(axis=1)
            self._curves = soup.reshape(-1, 3, 3)[lines, :2]
            self.corners, self.triangles = smoothed(soup, part.normals)

    def edges(self) -> np.ndarray:
        """Return the edges (m, 2, 3) that are sharp or open."""
        if self._flat:
            return feature_edges(self.corners)
        return np.concatenate((self.corners[borders(self.triangles)], self._curves))


class PartView:
    """One body in the scene graph."""

    def __init__(
        self, api: viser.SceneApi, i: int, body: Body, part: Part, scale: float, radius: float
    ) -> None:
        """Add it; `scale` is in units of the page a metre, `radius` is that of a point's ball."""
        self.name = body.name
        self.pose = IDENTITY if part.pose is None else part.pose
        self._opacity = float(part.colour[3])
        look = _Look(part, scale)
        self.low, self.high, self._triangles = look.low, look.high, look.triangles
        colour = tuple(round(255 * c) for c in part.colour[:3])
        self.frame = api.add_frame(f"/parts/{i}", show_axes=False)
        if body.point:
            self.mesh = api.add_icosphere(
                f"/parts/{i}/mesh", radius, color=colour, subdivisions=3, cast_shadow=False
            )
            self._edges = None
        else:
            self.mesh = api.add_mesh_simple(
                f"/parts/{i}/mesh",
                look.corners,
                look.triangles,
                color=colour,
                flat_shading=part.normals is None,
                side="double",
                opacity=None if self._opacity >= 1.0 else self._opacity,
                cast_shadow=False,
                receive_shadow=False,
            )
            edges = look.edges()
            self._edges = api.add_line_segments(
                f"/parts/{i}/edges", edges, _EDGE, thickness=1.0, thickness_units="screen",
                visible=len(edges) > 0,
            )  # fmt: skip
        top = [*((self.low + self.high) / 2.0)[:2], self.high[2]]
        self._label = api.add_label(
            f"/parts/{i}/name", self.name, position=top, anchor="bottom-center",
            font_screen_scale=0.85, visible=False,
        )  # fmt: skip

    @property
    def centre(self) -> np.ndarray:
        """The middle of its box, in its own frame and the page's units."""
        return (self.low + self.high) / 2.0

    def reshape(self, part: Part, scale: float) -> None:
        """Take another shape; edges are not found again each time."""
        look = _Look(part, scale)
        if not np.array_equal(look.triangles, self._triangles):
            self._triangles = look.triangles
            self.mesh.faces = look.triangles.astype(np.uint32)
        self.mesh.vertices = look.corners.astype(np.float32)
        self.low, self.high = look.low, look.high
        if self._edges is not None:
            self._edges.remove()
            self._edges = None

    def show(self, pose: np.ndarray | None, scale: float, *, dim: bool, names: bool) -> None:
        """Place it, or hide it while it has no pose."""
        self.frame.visible = pose is not None
        if pose is None:
            return
        self.pose = pose
        self.frame.position = pose[:3] * scale
        self.frame.wxyz = pose[3:]
        opacity = min(DIM, self._opacity) if dim else self._opacity
        opacity = None if opacity >= 1.0 else opacity
        if self.mesh.opacity != opacity:
            self.mesh.opacity = opacity
        if self._edges is not None:
            self._edges.visible = not dim
        self._label.visible = names and not dim


class Parts:
    """All bodies of a scene."""

    def __init__(
        self,
        server: viser.ViserServer,
        scene: SceneInfo,
        parts: Sequence[Part],
        on_pick: Callable[[str], None],
    ) -> None:
        """Add them; `on_pick` gets the name of a moving body that is clicked."""
        boxes = [part.corners for part in parts if len(part.corners)]
        size = max((float(np.ptp(c, axis=0).max()) for c in boxes), default=1.0) or 1.0
        # Graphics show only a range of distances, so the largest part of every scene is about one
        # unit large on the page, whatever its size in metres.
        self.scale = 10.0 ** -np.round(np.log10(size))
        self.size = size * self.scale
        self._views: dict[str, PartView] = {}
        self._rows = {name: i for i, name in enumerate(scene.moving)}
        for i, (body, part) in enumerate(zip(scene.bodies, parts, strict=True)):
            view = PartView(server.scene, i, body, part, self.scale, POINT_RADIUS * self.size)
            self._views[body.name] = view
            if body.topic is not None:
                self._make_pickable(view, on_pick)

    def __getitem__(self, name: str) -> PartView:
        """Return the view of a body."""
        return self._views[name]

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the low and high corners of the whole scene, in the page's units."""
        corners = np.concatenate(
            [
                view.pose[:3] * self.scale + np.stack((view.low, view.high))
                for view in self._views.values()
            ]
        )
        return corners.min(axis=0), corners.max(axis=0)

    def show(
        self, frame: Frame, held: Mapping[str, np.ndarray], choice: Choice, lit: Collection[str]
    ) -> None:
        """Place the bodies.

        Args:
            frame: the tick to show.
            held: poses of bodies that are held here, which are newer.
            choice: whether names are shown.
            lit: the highlighted bodies; empty: none, and nothing is dim.
        """
        for name, view in self._views.items():
            row = self._rows.get(name)
            pose = view.pose if row is None else held.get(name)
            if pose is None:
                pose = frame.pose(row)
            view.show(pose, self.scale, dim=bool(lit) and name not in lit, names=choice.names)

    def reshape(self, parts: Sequence[Part], names: Collection[str]) -> None:
        """Show the new shapes of the bodies that are named, of meshes in the scene's order."""
        for view, part in zip(self._views.values(), parts, strict=True):
            if view.name in names:
                view.reshape(part, self.scale)

    @staticmethod
    def _make_pickable(view: PartView, on_pick: Callable[[str], None]) -> None:
        @view.mesh.on_click
        async def _(_) -> None:
            on_pick(view.name)
