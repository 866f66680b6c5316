"""The parts in 3D: meshes with their sharp edges, placed each frame."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from itertools import islice
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import viser

from proximity_monitor.display.choice import PLAIN, Choice, Look
from proximity_monitor.display.geometry import IDENTITY, borders, feature_edges, rotate, smoothed
from proximity_monitor.display.labels import Label, short
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import Body, Frame, SceneInfo

DIM = 0.08
"""Opacity of parts that are not highlighted."""

POINT_RADIUS = 0.008
"""Radius of a point body's ball, in sizes of the scene."""

NAMES = 60
"""How many bodies have their names shown at most."""

EDGE = (45, 50, 60)

_PLACE = 3 * 8
"""Bytes of a pose's position, which come before those of its quaternion."""

# The corners of a box's triangles, for each coordinate 0 if it is the low one.
_SIDE = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]).reshape(2, 3, 2)
_BOX = np.concatenate([np.insert(_SIDE, axis, end, axis=2) for axis in range(3) for end in (0, 1)])


class Coat(NamedTuple):
    """Some triangles of a part in another colour."""

    corners: np.ndarray
    """(3n, 3) in the part's own frame and the page's units."""
    colour: tuple[int, int, int]


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

    @cached_property
    def edges(self) -> np.ndarray:
        """The edges (m, 2, 3) that are sharp or open."""
        if self._flat:
            return feature_edges(self.corners)
        return np.concatenate((self.corners[borders(self.triangles)], self._curves))


_LOOKS: WeakKeyDictionary[Part, tuple[float, _Look]] = WeakKeyDictionary()


def _look(part: Part, scale: float) -> _Look:
    """Return a part's look, which all browsers share: it takes a while to find."""
    known = _LOOKS.get(part)
    if known is None or known[0] != scale:
        known = _LOOKS[part] = scale, _Look(part, scale)
    return known[1]


class PartView:
    """One body in the scene graph."""

    def __init__(
        self, api: viser.SceneApi, i: int, body: Body, part: Part, scale: float, radius: float
    ) -> None:
        """Add it; `scale` is in units of the page a metre, `radius` is that of a point's ball."""
        self.name = body.name
        self.movable = body.topic is not None
        self.pose = IDENTITY if part.pose is None else part.pose
        self.point = body.point
        self.colour = tuple(round(255 * c) for c in part.colour[:3])
        self.shape = 0
        """Differs after each change of shape or of coats."""
        self.coats: Sequence[Coat] = ()
        """What is shown in place of its mesh; empty: the mesh."""
        self.edges = np.zeros((0, 2, 3))
        """(m, 2, 3) its sharp and open edges, in its own frame and the page's units."""
        self.edges_wanted = True
        self.named = False
        """Whether its name is shown."""
        self._opacity = float(part.colour[3])
        self._cut_away = False
        self._coated: list[viser.MeshHandle] = []
        self._told: tuple = (b"",)  # what was shown last, its pose as bytes first
        look = _look(part, scale)
        self.low, self.high = look.low, look.high
        self._corners, self._triangles = look.corners, look.triangles
        if body.point:
            self.low, self.high = self.low - radius, self.high + radius
        self._flat = part.normals is None
        self.frame = api.add_frame(f"/parts/{i}", show_axes=False)
        if body.point:
            self.mesh = api.add_icosphere(
                f"/parts/{i}/mesh", radius, color=self.colour, subdivisions=3, cast_shadow=False
            )
            self._edges = None
        else:
            self.mesh = self._meshed(api, f"/parts/{i}/mesh", look.corners, look.triangles)
            self.edges = look.edges
            self._edges = api.add_line_segments(
                f"/parts/{i}/edges", self.edges, EDGE, thickness=1.0, thickness_units="screen",
                visible=len(self.edges) > 0,
            )  # fmt: skip

    @property
    def centre(self) -> np.ndarray:
        """The middle of its box, in its own frame and the page's units."""
        return (self.low + self.high) / 2.0

    def top(self, scale: float) -> np.ndarray:
        """Return the middle of its upper side (3,) in the scene, in the page's units."""
        top = np.array([*self.centre[:2], self.high[2]])
        return self.pose[:3] * scale + rotate(self.pose[3:], top)

    @property
    def opacity(self) -> float:
        """How opaque it is drawn now."""
        return 1.0 if self.mesh.opacity is None else self.mesh.opacity

    @property
    def triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Its vertices (n, 3), in its own frame and the page's units, and triangles (m, 3)."""
        return self._corners, self._triangles

    def corners(self) -> np.ndarray:
        """Return its triangles' corners (n, 3, 3), in its own frame and the page's units.

        The ball of a point is a box here.
        """
        if self.point:
            return np.stack((self.low, self.high))[_BOX, np.arange(3)]
        return self._corners[self._triangles]

    def reshape(self, part: Part, scale: float) -> None:
        """Take another shape; edges are not found again each time."""
        look = _look(part, scale)
        if not np.array_equal(look.triangles, self._triangles):
            self._triangles = look.triangles
            self.mesh.faces = look.triangles.astype(np.uint32)
        self.shape += 1
        self._corners = look.corners
        self.mesh.vertices = look.corners.astype(np.float32)
        self.low, self.high = look.low, look.high
        if self._edges is not None:
            self._edges.remove()
            self._edges = None
            self.edges = self.edges[:0]

    def like(
        self, api: viser.SceneApi, name: str, vertices: np.ndarray, triangles: np.ndarray
    ) -> viser.MeshHandle:
        """Add another mesh that looks like this part's."""
        return self._meshed(api, name, vertices, triangles, self.opacity)

    def coat(self, api: viser.SceneApi, coats: Sequence[Coat]) -> None:
        """Show triangles of several colours in place of the mesh; without any, the mesh again."""
        for node in self._coated:
            node.remove()
        self.coats = coats
        self.shape += 1
        name = self.frame.name
        self._coated = [
            self.coloured(api, f"{name}/coat_{i}", *coat)
            for i, coat in enumerate(coats)
            if len(coat.corners)
        ]
        self._show_what_is_left()

    def coloured(
        self, api: viser.SceneApi, name: str, corners: np.ndarray, colour: tuple[int, int, int]
    ) -> viser.MeshHandle:
        """Add triangles, given by their corners (3n, 3), in another colour."""
        triangles = np.arange(len(corners)).reshape(-1, 3)
        return self._meshed(api, name, corners, triangles, self.opacity, colour)

    def cut_away(self, cut: bool) -> None:
        """Hide all of it, because something else is shown instead."""
        self._cut_away = cut
        self._show_what_is_left()

    def _show_what_is_left(self) -> None:
        self.mesh.visible = not (self._cut_away or self.coats)
        for node in self._coated:
            node.visible = not self._cut_away

    def _meshed(
        self, api, name, vertices, triangles, opacity=None, colour=None
    ) -> viser.MeshHandle:
        opacity = self._opacity if opacity is None else opacity
        return api.add_mesh_simple(
            name,
            vertices,
            triangles,
            color=self.colour if colour is None else colour,
            flat_shading=self._flat or colour is not None,
            side="double",
            opacity=None if opacity >= 1.0 else opacity,
            cast_shadow=False,
            receive_shadow=False,
        )

    def show(
        self, pose: np.ndarray | None, scale: float, *, look: Look, dim: bool, names: bool
    ) -> None:
        """Place it, or hide it while it has no pose; what is as before costs next to nothing."""
        placed = b"" if pose is None else pose.tobytes()
        hidden = not self.mesh.visible
        told = (placed, look, dim, names, hidden)
        if told == self._told:
            return
        before, self._told = self._told[0], told
        self.frame.visible = pose is not None
        if pose is None:
            return
        if placed[:_PLACE] != before[:_PLACE]:
            self.frame.position = pose[:3] * scale
        if placed[_PLACE:] != before[_PLACE:]:
            self.frame.wxyz = pose[3:]
        self.pose = pose
        opacity = self._opacity if look.opacity is None else look.opacity
        opacity = min(DIM, opacity) if dim else opacity
        opacity = None if opacity >= 1.0 else opacity
        for mesh in (self.mesh, *self._coated):
            if mesh.opacity != opacity:
                mesh.opacity = opacity
        self.edges_wanted = look.edges and not dim
        if self._edges is not None:
            self._edges.visible = self.edges_wanted and not hidden
        self.named = names and not dim


class Parts:
    """All bodies of a scene."""

    def __init__(self, server: viser.ViserServer, scene: SceneInfo, parts: Sequence[Part]) -> None:
        """Add them."""
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

    def __getitem__(self, name: str) -> PartView:
        """Return the view of a body."""
        return self._views[name]

    def shown(self) -> list[PartView]:
        """Return the views of the bodies that have a pose."""
        return [view for view in self._views.values() if view.frame.visible]

    def labels(self) -> list[Label]:
        """Return the names that are shown, those of the first bodies where they are many."""
        named = (view for view in self.shown() if view.named)
        return [
            Label(short(view.name), view.top(self.scale), 0.85) for view in islice(named, NAMES)
        ]

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
            dim, look = bool(lit) and name not in lit, choice.looks.get(name, PLAIN)
            view.show(pose, self.scale, look=look, dim=dim, names=choice.names)

    def reshape(self, parts: Sequence[Part], names: Collection[str]) -> None:
        """Show the new shapes of the bodies that are named, of meshes in the scene's order."""
        for view, part in zip(self._views.values(), parts, strict=True):
            if view.name in names:
                view.reshape(part, self.scale)
