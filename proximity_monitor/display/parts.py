"""The parts in 3D, placed in each frame; many bodies of one shape are instances of one mesh."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import islice

import numpy as np
import viser

from proximity_monitor.display.choice import PLAIN, Choice, Look
from proximity_monitor.display.detail import FOCAL
from proximity_monitor.display.geometry import rotate
from proximity_monitor.display.instances import Instances
from proximity_monitor.display.labels import Label, short
from proximity_monitor.display.part_view import PartView, seen
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import Frame, SceneInfo

POINT_RADIUS = 0.008
"""Radius of the ball that shows a point body, as a share of the scene's size."""

NAMES = 60
"""Maximum number of bodies whose names are shown."""

MANY = 20
"""Minimum number of bodies of one shape that are drawn as instances of one mesh. Fewer are better
drawn one by one: if one instance moves, the poses of all are sent, and the edges of instances are
wires of one pixel, which adjacent faces cover in places."""


class _Group:
    """Bodies of one shape, each drawn as an instance while nothing distinguishes it."""

    def __init__(self, api: viser.SceneApi, k: int, views: Sequence[PartView], rows: list[int]):
        self.views, self.rows = views, np.array(rows)
        self.drawn = np.zeros(len(rows), bool)
        self.look = PLAIN
        colours = np.array([view.colour for view in views])
        self._usual = views[0].usual_opacity
        first = views[0]
        self._nodes = Instances(api, f"/instances/{k}", first.whole, colours, first.levels)

    def choose(self, looks: Mapping[str, Look]) -> None:
        """Take the look that most of them have."""
        self.look = PLAIN
        if looks:
            counted = Counter(looks.get(view.name, PLAIN) for view in self.views)
            self.look = counted.most_common(1)[0][0]

    def show(self, poses: np.ndarray, scale: float, dim: bool) -> None:
        """Place the instances that are drawn; `poses` (n, 7) are those of all bodies."""
        opacity, edges = seen(self._usual, self.look, dim), self.look.edges and not dim
        self._nodes.show(poses[self.rows], self.drawn, scale, opacity=opacity, edges=edges)


class Parts:
    """All bodies of a scene."""

    def __init__(
        self,
        server: viser.ViserServer | viser.ClientHandle,
        scene: SceneInfo,
        parts: Sequence[Part],
        focal: float = FOCAL,
    ) -> None:
        """Add the bodies.

        Args:
            server: takes the nodes, for all browsers or for one.
            scene: has the bodies.
            parts: shapes and colours of the bodies, in the scene's order.
            focal: focal length of the camera in pixels.
        """
        boxes = [part.corners for part in parts if len(part.corners)]
        size = max((float(np.ptp(c, axis=0).max()) for c in boxes), default=1.0) or 1.0
        # Graphics show only a limited range of distances. So the page's unit makes the largest part
        # of every scene about one unit large, whatever its size in metres.
        self.scale = 10.0 ** -np.round(np.log10(size))
        self.size = size * self.scale
        self._views: dict[str, PartView] = {}
        self._rows = {body.name: i for i, body in enumerate(scene.bodies) if body.moving}
        for i, (body, part) in enumerate(zip(scene.bodies, parts, strict=True)):
            view = PartView(
                server.scene, i, body, part, self.scale, POINT_RADIUS * self.size,
                0.0 if body.name in scene.deforming else focal,
            )  # fmt: skip
            self._views[body.name] = view
        self._poses = np.array([view.pose for view in self._views.values()]).reshape(-1, 7)
        self._moving = np.array([body.moving for body in scene.bodies], bool)
        self._member: dict[str, tuple[_Group, int]] = {}
        self._groups = self._together(server.scene, scene, parts)
        for view in self._views.values():
            if view.name not in self._member:
                view.stand()

    def _together(
        self, api: viser.SceneApi, scene: SceneInfo, parts: Sequence[Part]
    ) -> list[_Group]:
        """Find the shapes that at least `MANY` bodies have, and make a group for each."""
        alike: dict[tuple, list[int]] = {}
        for i, (body, part) in enumerate(zip(scene.bodies, parts, strict=True)):
            if not (body.point or body.name in scene.deforming):
                key = (body.mesh, len(part.corners), float(part.colour[3]))
                alike.setdefault(key, []).append(i)
        views, groups = list(self._views.values()), []
        for rows in alike.values():
            # Different checksums prove that meshes differ; equal ones do not prove that they agree.
            rows = [i for i in rows if parts[i].looks_like(parts[rows[0]])]
            if len(rows) >= MANY:
                group = _Group(api, len(groups), [views[i] for i in rows], rows)
                self._member |= {view.name: (group, k) for k, view in enumerate(group.views)}
                groups.append(group)
        return groups

    def __getitem__(self, name: str) -> PartView:
        """Return the view of a body."""
        return self._views[name]

    def shown(self) -> list[PartView]:
        """Return the views of the bodies that have a pose."""
        return [view for view in self._views.values() if view.placed]

    def labels(self) -> list[Label]:
        """Return the names that are shown, at most `NAMES` of them."""
        named = list(islice((view for view in self.shown() if view.named), NAMES))
        poses = np.array([view.pose for view in named]).reshape(-1, 7)
        tops = rotate(poses[:, 3:], np.array([view.top for view in named]).reshape(-1, 3))
        tops += poses[:, :3] * self.scale
        return [Label(short(view.name), top, 0.85) for view, top in zip(named, tops, strict=True)]

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
            held: poses of bodies that are held here; they are newer than the tick.
            choice: has the looks, and whether names are shown.
            lit: the highlighted bodies; empty: none, and nothing is dimmed.
        """
        poses = self._poses.copy()
        poses[self._moving] = frame.poses
        for name, pose in held.items():
            if (row := self._rows.get(name)) is not None:
                poses[row] = pose
        known = poses[:, 3:].any(axis=1).tolist()
        for group in self._groups:
            group.choose(choice.looks)
        for view, pose, is_known in zip(self._views.values(), poses, known, strict=True):
            name = view.name
            dim, look = bool(lit) and name not in lit, choice.looks.get(name, PLAIN)
            alone, member = True, self._member.get(name)
            if member is not None:
                group, k = member
                alone = not view.plain or look != group.look or dim != bool(lit)
                group.drawn[k] = is_known and not alone
            at = pose if is_known else None
            view.show(at, self.scale, look=look, dim=dim, names=choice.names, alone=alone)
        for group in self._groups:
            group.show(poses, self.scale, bool(lit))

    def reshape(self, parts: Sequence[Part], names: Collection[str]) -> None:
        """Show the new shapes of the named bodies; `parts` has all, in the scene's order."""
        for view, part in zip(self._views.values(), parts, strict=True):
            if view.name in names:
                view.reshape(part, self.scale)
