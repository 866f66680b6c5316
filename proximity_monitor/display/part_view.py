"""The scene nodes of one body: its mesh with sharp edges, placed in each frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display.choice import Look
from proximity_monitor.display.detail import levels
from proximity_monitor.display.geometry import IDENTITY
from proximity_monitor.display.inks import EDGE, linear
from proximity_monitor.display.received import Part
from proximity_monitor.display.shape import shape_of
from proximity_monitor.display.state import Body

DIM = 0.08
"""Maximum opacity of parts that are dimmed because others are highlighted."""

_PLACE = 3 * 8
"""Bytes of a pose's position, which comes before its quaternion."""

# The corners of a box's triangles: for each coordinate 0 for the low and 1 for the high side.
_SIDE = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]).reshape(2, 3, 2)
_BOX = np.concatenate([np.insert(_SIDE, axis, end, axis=2) for axis in range(3) for end in (0, 1)])


class Coat(NamedTuple):
    """Triangles of a part that are drawn in another colour."""

    corners: np.ndarray
    """(3n, 3) in the part's own frame and the page's units."""
    colour: tuple[int, int, int]
    opaque: bool = False
    """Whether it stays opaque on a transparent part, so that the part's other sides do not hide it:
    a browser draws nothing that is behind a transparent mesh, unless it has drawn it before."""


class PartView:
    """One body in the scene graph. It stands alone with its own nodes, or it is an instance."""

    def __init__(
        self,
        api: viser.SceneApi,
        i: int,
        body: Body,
        part: Part,
        scale: float,
        radius: float,
        focal: float,
    ) -> None:
        """Take a body. It gets no nodes until it is shown alone.

        Args:
            api: takes the nodes.
            i: the body's place in the scene.
            body: the body.
            part: its shape and colour.
            scale: units of the page per metre.
            radius: radius of the ball that shows a point body.
            focal: focal length of the camera in pixels; 0 if the body deforms: it has no levels.
        """
        self._api = api
        self.name = body.name
        self.path = f"/parts/{i}"
        """The name of its frame node."""
        self.movable = body.topic is not None
        self.pose = IDENTITY if part.pose is None else part.pose
        self.point = body.point
        self.solid, self.deviation = part.solid, part.deviation
        self.colour = tuple(round(255 * c) for c in part.colour[:3])
        self.shape = 0
        """A number that changes with each change of shape or of coats."""
        self.coats: Sequence[Coat] = ()
        """Coloured triangles that replace its mesh; empty: the mesh is shown."""
        self.edges_wanted = True
        self.named = False
        """Whether its name is shown."""
        self.placed = False
        """Whether it has a pose."""
        self.mesh: viser.MeshHandle | viser.BatchedMeshHandle | None = None
        """Its own mesh; None until it is shown alone."""
        self.opacity = self.usual_opacity = float(part.colour[3])
        """Its present opacity, and its opacity if no look sets another."""
        self.dimmed = False
        self._frame: viser.FrameHandle | None = None
        self._edges: viser.LineSegmentsHandle | None = None
        self._cut_away = self._reshaped = False
        self._coated: list[tuple[Coat, viser.MeshHandle]] = []
        self._told: tuple = ()  # the arguments of the last `show`
        self._placed_at = b""  # the pose of its own nodes
        self._radius = radius
        self.whole = whole = shape_of(part, scale, detailed=focal > 0.0)
        """The shape of the part, uncut."""
        self.levels = levels(whole.corners, len(whole.triangles), focal) if focal > 0.0 else ()
        """Distances, each with the share of its triangles drawn from there on."""
        self.low, self.high = whole.low, whole.high
        self.edges = whole.edges if not body.point else np.zeros((0, 2, 3))
        """(m, 2, 3) its sharp and open edges, in its own frame and the page's units."""
        if body.point:
            self.low, self.high = self.low - radius, self.high + radius

    def stand(self) -> None:
        """Make the body stand alone: add its own nodes, if it has none."""
        if self._frame is not None:
            return
        api, name, whole = self._api, f"{self.path}/mesh", self.whole
        self._frame = api.add_frame(self.path, show_axes=False)
        if self.point:
            self.mesh = api.add_icosphere(
                name, self._radius, color=self.colour, subdivisions=3, cast_shadow=False
            )
            return
        if self.levels:
            self.mesh = self._detailed(name)
        else:
            self.mesh = self._meshed(api, name, whole.corners, whole.triangles, self.usual_opacity)
        if not self._reshaped:
            self._edges = api.add_line_segments(
                f"{self.path}/edges", self.edges, EDGE, thickness=1.0, thickness_units="screen",
                visible=len(self.edges) > 0,
            )  # fmt: skip

    @property
    def plain(self) -> bool:
        """Whether it looks as it did at first, so that it may be drawn as an instance."""
        return not (self._cut_away or self.coats or self._reshaped)

    @property
    def centre(self) -> np.ndarray:
        """The middle of its box, in its own frame and the page's units."""
        return (self.low + self.high) / 2.0

    @property
    def top(self) -> np.ndarray:
        """The middle (3,) of its box's upper side, in its own frame and the page's units."""
        return np.array([*self.centre[:2], self.high[2]])

    @property
    def triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Its vertices (n, 3), in its own frame and the page's units, and triangles (m, 3)."""
        return self.whole.corners, self.whole.triangles

    def corners(self) -> np.ndarray:
        """Return its triangles' corners (n, 3, 3), in its own frame and the page's units.

        A point has the corners of a box about its ball.
        """
        if self.point:
            return np.stack((self.low, self.high))[_BOX, np.arange(3)]
        return self.whole.corners[self.whole.triangles]

    def reshape(self, part: Part, scale: float) -> None:
        """Take another shape. Its edges are removed, because finding them again takes too long."""
        self.stand()
        self._reshaped = True
        before, self.solid, self.deviation = self.whole, part.solid, part.deviation
        self.whole = whole = shape_of(part, scale, before, detailed=False)
        if self.levels or whole.flat != before.flat:  # the mesh does not fit the new shape
            shown, self.levels = self.mesh.visible, ()
            self.mesh.remove()
            name = f"{self.path}/mesh"
            self.mesh = self._meshed(self._api, name, whole.corners, whole.triangles, self.opacity)
            self.mesh.visible = shown
        elif not np.array_equal(whole.triangles, before.triangles):
            self.mesh.faces = whole.triangles.astype(np.uint32)
        self.shape += 1
        self.mesh.vertices = whole.corners.astype(np.float32)
        self.low, self.high = whole.low, whole.high
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
        """Show coloured triangles in place of the mesh; with no coats, show the mesh again."""
        for _, node in self._coated:
            node.remove()
        self.coats = coats
        self.shape += 1
        self._coated = [
            (coat, self.coloured(api, f"{self.path}/coat_{i}", coat))
            for i, coat in enumerate(coats)
            if len(coat.corners)
        ]
        self._show_what_is_left()

    def coloured(self, api: viser.SceneApi, name: str, coat: Coat) -> viser.MeshHandle:
        """Add a coat's triangles."""
        triangles = np.arange(len(coat.corners)).reshape(-1, 3)
        opacity = self._opacity_of(coat)
        return self._meshed(api, name, coat.corners, triangles, opacity, coat.colour)

    def _opacity_of(self, coat: Coat) -> float:
        return 1.0 if coat.opaque and not self.dimmed else self.opacity

    def cut_away(self, cut: bool) -> None:
        """Hide or show all of it; a section hides it and shows other nodes instead."""
        self._cut_away = cut
        self._show_what_is_left()

    def _show_what_is_left(self) -> None:
        hidden = self._cut_away or bool(self.coats)
        if hidden:
            self.stand()
        if self.mesh is not None:
            self.mesh.visible = not hidden
        for _, node in self._coated:
            node.visible = not self._cut_away

    def _detailed(self, name: str) -> viser.BatchedMeshHandle:
        """Add its mesh as a single instance, because only instances have levels of detail."""
        return self._api.add_batched_meshes_simple(
            name,
            self.whole.corners,
            self.whole.triangles,
            batched_positions=np.zeros((1, 3)),
            batched_wxyzs=IDENTITY[None, 3:],
            batched_colors=linear(np.array([self.colour])),
            flat_shading=self.whole.flat,
            side="double",
            opacity=None if self.usual_opacity >= 1.0 else self.usual_opacity,
            lod=self.levels,
            cast_shadow=False,
            receive_shadow=False,
        )

    def _meshed(self, api, name, vertices, triangles, opacity, colour=None) -> viser.MeshHandle:
        return api.add_mesh_simple(
            name,
            vertices,
            triangles,
            color=self.colour if colour is None else colour,
            flat_shading=self.whole.flat or colour is not None,
            side="double",
            opacity=None if opacity >= 1.0 else opacity,
            cast_shadow=False,
            receive_shadow=False,
        )

    def show(
        self,
        pose: np.ndarray | None,
        scale: float,
        *,
        look: Look,
        dim: bool,
        names: bool,
        alone: bool = True,
    ) -> None:
        """Place it, or hide it while it has no pose; without a change it returns at once.

        Args:
            pose: (7,) in metres, or None.
            scale: units of the page per metre.
            look: the look that people chose.
            dim: whether it is dimmed because others are highlighted.
            names: whether parts show their names.
            alone: whether its own nodes show it; otherwise it is an instance of a group's mesh.
        """
        placed = b"" if pose is None else pose.tobytes()
        told = (placed, look, dim, names, self._cut_away, self.shape, alone)
        if told == self._told:
            return
        self._told = told
        self.placed = pose is not None
        if pose is not None:
            self.pose = pose
            self.opacity, self.dimmed = seen(self.usual_opacity, look, dim), dim
            self.edges_wanted = look.edges and not dim
            self.named = names and not dim
        if alone:
            self.stand()
        if self._frame is None:
            return
        self._frame.visible = alone and self.placed
        if alone and self.placed:
            self._show_alone(placed, scale)

    def _show_alone(self, placed: bytes, scale: float) -> None:
        before, self._placed_at = self._placed_at, placed
        if placed[:_PLACE] != before[:_PLACE]:
            self._frame.position = self.pose[:3] * scale
        if placed[_PLACE:] != before[_PLACE:]:
            self._frame.wxyz = self.pose[3:]
        coated = [(mesh, self._opacity_of(coat)) for coat, mesh in self._coated]
        for mesh, opacity in ((self.mesh, self.opacity), *coated):
            told = None if opacity >= 1.0 else opacity
            if mesh.opacity != told:
                mesh.opacity = told
        if self._edges is not None:
            self._edges.visible = self.edges_wanted and self.mesh.visible


def seen(usual: float, look: Look, dim: bool) -> float:
    """Return the opacity of a part; `usual` is the scene's."""
    opacity = usual if look.opacity is None else look.opacity
    return min(DIM, opacity) if dim else opacity
