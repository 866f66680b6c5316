"""One body in the scene graph: its mesh with sharp edges, placed each frame."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import viser

from proximity_monitor.display.choice import Look
from proximity_monitor.display.detail import has_levels, levels
from proximity_monitor.display.geometry import (
    IDENTITY,
    SHARP,
    SMOOTH,
    borders,
    face_normals,
    feature_edges,
    shared,
    smoothed,
)
from proximity_monitor.display.inks import EDGE, linear
from proximity_monitor.display.instances import Shape
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import Body

DIM = 0.08
"""Opacity of parts that are not highlighted."""

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

    def __init__(self, part: Part, scale: float, before: _Look | None, *, detailed: bool) -> None:
        """Let triangles share corners: where the part is smooth, or where each has its own shade.

        Args:
            part: of the scene.
            scale: units of the page a metre.
            before: its look before it took this shape.
            detailed: whether it may have levels of detail. Coarser levels look like it only if they
                have its normals, so it has no shades by triangles.
        """
        soup = part.corners * scale
        self.low, self.high = soup.min(axis=0), soup.max(axis=0)
        self._soup, self._normals = soup, part.normals
        self.flat = part.normals is None and not (detailed and has_levels(len(soup) // 3))
        if not self.flat:
            normals, sharp = part.normals, SMOOTH
            if normals is None:
                normals, sharp = np.repeat(face_normals(soup), 3, axis=0), SHARP
            self.corners, self.triangles = smoothed(soup, normals, sharp)
            return
        if before is None or not before.shares(soup):
            self._first, self.triangles = shared(soup)
        else:
            self._first, self.triangles = before._first, before.triangles
        self.corners = soup[self._first]

    def shares(self, soup: np.ndarray) -> bool:
        """Return whether the triangles with these corners (3n, 3) share the same ones as here."""
        if not self.flat or len(soup) != 3 * len(self.triangles):
            return False
        return np.array_equal(soup[self._first][self.triangles.reshape(-1)], soup)

    @cached_property
    def edges(self) -> np.ndarray:
        """The edges (m, 2, 3) that are sharp or open."""
        if self._normals is None:
            return feature_edges(self._soup)
        curves = ~self._normals.any(axis=1).reshape(-1, 3).any(axis=1)
        lines = self._soup.reshape(-1, 3, 3)[curves, :2]
        return np.concatenate((self.corners[borders(self.triangles)], lines))


_LOOKS: WeakKeyDictionary[Part, tuple[float, _Look]] = WeakKeyDictionary()


def _look(part: Part, scale: float, before: _Look | None = None, *, detailed: bool) -> _Look:
    """Return a part's look, which all browsers share: it takes a while to find."""
    known = _LOOKS.get(part)
    if known is None or known[0] != scale:
        known = _LOOKS[part] = scale, _Look(part, scale, before, detailed=detailed)
    return known[1]


class PartView:
    """One body in the scene graph."""

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
        """Take a body, which has no nodes before it is shown alone.

        Args:
            api: takes the nodes.
            i: its place in the scene.
            body: of the scene.
            part: its looks.
            scale: units of the page a metre.
            radius: of a point's ball.
            focal: length in pixels of the camera; 0 if the body deforms, which is drawn as it is.
        """
        self._api = api
        self.name = body.name
        self.path = f"/parts/{i}"
        """The name of its node."""
        self.movable = body.topic is not None
        self.pose = IDENTITY if part.pose is None else part.pose
        self.point = body.point
        self.colour = tuple(round(255 * c) for c in part.colour[:3])
        self.shape = 0
        """Differs after each change of shape or of coats."""
        self.coats: Sequence[Coat] = ()
        """What is shown in place of its mesh; empty: the mesh."""
        self.edges_wanted = True
        self.named = False
        """Whether its name is shown."""
        self.placed = False
        """Whether it has a pose."""
        self.mesh: viser.MeshHandle | viser.BatchedMeshHandle | None = None
        """None: it was never shown alone."""
        self.opacity = self.usual_opacity = float(part.colour[3])
        """How opaque it is drawn now, and without a wish."""
        self._frame: viser.FrameHandle | None = None
        self._edges: viser.LineSegmentsHandle | None = None
        self._cut_away = self._reshaped = False
        self._coated: list[viser.MeshHandle] = []
        self._told: tuple = ()  # what was shown last
        self._placed_at = b""  # where its own nodes are
        self._radius = radius
        self._look = look = _look(part, scale, detailed=focal > 0.0)
        self._levels = levels(look.corners, len(look.triangles), focal) if focal > 0.0 else ()
        self.low, self.high = look.low, look.high
        self.edges = look.edges if not body.point else np.zeros((0, 2, 3))
        """(m, 2, 3) its sharp and open edges, in its own frame and the page's units."""
        if body.point:
            self.low, self.high = self.low - radius, self.high + radius

    def stand(self) -> None:
        """Add its own nodes, if it has none."""
        if self._frame is not None:
            return
        api, name = self._api, self.path
        self._frame = api.add_frame(name, show_axes=False)
        if self.point:
            self.mesh = api.add_icosphere(
                f"{name}/mesh", self._radius, color=self.colour, subdivisions=3, cast_shadow=False
            )
            return
        self.mesh = (
            self._detailed(f"{name}/mesh")
            if self._levels
            else self._meshed(
                api, f"{name}/mesh", self._look.corners, self._look.triangles, self.usual_opacity
            )
        )
        if not self._reshaped:
            self._edges = api.add_line_segments(
                f"{name}/edges", self.edges, EDGE, thickness=1.0, thickness_units="screen",
                visible=len(self.edges) > 0,
            )  # fmt: skip

    @property
    def plain(self) -> bool:
        """Whether it looks as its shape does at first."""
        return not (self._cut_away or self.coats or self._reshaped)

    @property
    def whole(self) -> Shape:
        """Its shape."""
        look = self._look
        return Shape(look.corners, look.triangles, self.edges, look.flat, self._levels)

    @property
    def centre(self) -> np.ndarray:
        """The middle of its box, in its own frame and the page's units."""
        return (self.low + self.high) / 2.0

    @property
    def top(self) -> np.ndarray:
        """The middle of its box's upper side (3,), as `centre`."""
        return np.array([*self.centre[:2], self.high[2]])

    @property
    def triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Its vertices (n, 3), in its own frame and the page's units, and triangles (m, 3)."""
        return self._look.corners, self._look.triangles

    def corners(self) -> np.ndarray:
        """Return its triangles' corners (n, 3, 3), in its own frame and the page's units.

        The ball of a point is a box here.
        """
        if self.point:
            return np.stack((self.low, self.high))[_BOX, np.arange(3)]
        return self._look.corners[self._look.triangles]

    def reshape(self, part: Part, scale: float) -> None:
        """Take another shape; edges are not found again each time."""
        self.stand()
        self._reshaped = True
        before, look = self._look, _look(part, scale, self._look, detailed=False)
        self._look = look
        if not np.array_equal(look.triangles, before.triangles):
            self.mesh.faces = look.triangles.astype(np.uint32)
        self.shape += 1
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
        self._coated = [
            self.coloured(api, f"{self.path}/coat_{i}", *coat)
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
        hidden = self._cut_away or bool(self.coats)
        if hidden:
            self.stand()
        if self.mesh is not None:
            self.mesh.visible = not hidden
        for node in self._coated:
            node.visible = not self._cut_away

    def _detailed(self, name: str) -> viser.BatchedMeshHandle:
        """Add its mesh as the one instance of itself: only instances have levels of detail."""
        return self._api.add_batched_meshes_simple(
            name,
            self._look.corners,
            self._look.triangles,
            batched_positions=np.zeros((1, 3)),
            batched_wxyzs=IDENTITY[None, 3:],
            batched_colors=linear(np.array([self.colour])),
            flat_shading=self._look.flat,
            side="double",
            opacity=None if self.usual_opacity >= 1.0 else self.usual_opacity,
            lod=self._levels,
            cast_shadow=False,
            receive_shadow=False,
        )

    def _meshed(self, api, name, vertices, triangles, opacity, colour=None) -> viser.MeshHandle:
        return api.add_mesh_simple(
            name,
            vertices,
            triangles,
            color=self.colour if colour is None else colour,
            flat_shading=self._look.flat or colour is not None,
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
        """Place it, or hide it while it has no pose; what is as before costs next to nothing.

        Args:
            pose: (7,) in metres, or None.
            scale: units of the page a metre.
            look: that people chose.
            dim: whether others are highlighted.
            names: whether parts have their names shown.
            alone: whether it is drawn by its own nodes; else it is an instance among others.
        """
        placed = b"" if pose is None else pose.tobytes()
        told = (placed, look, dim, names, self._cut_away, self.shape, alone)
        if told == self._told:
            return
        self._told = told
        self.placed = pose is not None
        if pose is not None:
            self.pose = pose
            self.opacity = seen(self.usual_opacity, look, dim)
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
        opacity = None if self.opacity >= 1.0 else self.opacity
        for mesh in (self.mesh, *self._coated):
            if mesh.opacity != opacity:
                mesh.opacity = opacity
        if self._edges is not None:
            self._edges.visible = self.edges_wanted and self.mesh.visible


def seen(usual: float, look: Look, dim: bool) -> float:
    """Return how opaque a part is drawn, of which the scene has a usual opacity."""
    opacity = usual if look.opacity is None else look.opacity
    return min(DIM, opacity) if dim else opacity
