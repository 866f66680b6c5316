"""A section: all in front of a plane is cut away, and the cut is outlined and hatched."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display.geometry import conjugate, rotate
from proximity_monitor.display.inks import EDGE
from proximity_monitor.display.part_view import PartView
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.view import View

EVERY_S = 0.2
"""Minimum seconds between two cuts of the parts."""

SPACING = 12.0
"""Approximate distance of the hatching's lines, in pixels."""

LINES = 60
"""Maximum number of lines of a part's hatching to either side of the plane's middle."""

_OUTLINE = (25, 28, 34)


class Plane(NamedTuple):
    """A plane in the page's units; everything on the side of its normal is cut away."""

    middle: np.ndarray
    """(3,) a point of the plane, about which the parts are hatched."""
    normal: np.ndarray
    """(3,) of unit length."""

    def seen_from(self, pose: np.ndarray, scale: float) -> Plane:
        """Return the plane in the frame of a body at a pose (7,), which is in metres."""
        back = conjugate(pose[3:])
        return Plane(rotate(back, self.middle - pose[:3] * scale), rotate(back, self.normal))


class Cut(NamedTuple):
    """The rest of a mesh behind a plane."""

    vertices: np.ndarray
    """(n, 3)"""
    triangles: np.ndarray
    """(m, 3) of vertices."""
    outline: np.ndarray
    """(k, 2, 3) where the plane meets it; seen against the normal, the inside is to the left."""


def cut(vertices: np.ndarray, triangles: np.ndarray, plane: Plane) -> Cut:
    """Return a mesh without its part in front of a plane.

    Args:
        vertices: (n, 3).
        triangles: (m, 3) of vertices.
        plane: in the same frame.
    """
    height = (vertices - plane.middle) @ plane.normal
    above = (height > 0.0)[triangles]
    count = above.sum(axis=1)
    kept = triangles[count == 0]
    mixed, over = triangles[(count == 1) | (count == 2)], above[(count == 1) | (count == 2)]
    if not len(mixed):
        return Cut(vertices, kept, np.zeros((0, 2, 3)))
    # Rotate the corners of each triangle so that the one alone on its side comes first.
    alone = np.argmax(over == (over.sum(axis=1) == 1)[:, None], axis=1)
    turned = np.take_along_axis(mixed, (alone[:, None] + np.arange(3)) % 3, axis=1)
    high = height[turned]
    share = high[:, :1] / (high[:, :1] - high[:, 1:])  # the signs differ, so it is not 0 / 0
    first, others = vertices[turned[:, 0], None], vertices[turned[:, 1:]]
    met = first + share[..., None] * (others - first)
    new = len(vertices) + np.arange(2 * len(mixed)).reshape(-1, 2)
    tips = high[:, 0] <= 0.0  # the first corner is kept; otherwise the other two are
    tip = np.column_stack((turned[tips, 0], new[tips]))
    p, q, b, c = (*new[~tips].T, *turned[~tips, 1:].T)
    rest = np.concatenate((np.column_stack((p, b, c)), np.column_stack((p, c, q))))
    return Cut(
        np.concatenate((vertices, met.reshape(-1, 3))),
        np.concatenate((kept, tip, rest)),
        np.where(tips[:, None, None], met[:, ::-1], met),
    )


def behind(segments: np.ndarray, plane: Plane) -> np.ndarray:
    """Return segments (n, 2, 3) without their parts in front of a plane, as (m, 2, 3)."""
    height = (segments - plane.middle) @ plane.normal
    above = height > 0.0
    segments, height, above = (x[~above.all(axis=1)] for x in (segments, height, above))
    span = height[:, 0] - height[:, 1]
    share = np.divide(height[:, 0], span, out=np.zeros(len(span)), where=span != 0.0)[:, None]
    crossing = segments[:, 0] + share * (segments[:, 1] - segments[:, 0])
    return np.where(above[..., None], crossing[:, None], segments)


def hatching(outline: np.ndarray, plane: Plane, spacing: float, slant: float) -> np.ndarray:
    """Return lines (m, 2, 3) within an outline (k, 2, 3), near the plane's middle.

    A place is inside if the outline winds round it, so shells may overlap. A line that does not
    leave as often as it enters is left out, because the mesh is open there.
    """
    u = np.cross(plane.normal, np.eye(3)[np.argmin(np.abs(plane.normal))])
    u /= np.linalg.norm(u)
    v = np.cross(plane.normal, u)
    x_axis = math.cos(slant) * u + math.sin(slant) * v
    y_axis = math.cos(slant) * v - math.sin(slant) * u
    flat = (outline - plane.middle) @ np.column_stack((x_axis, y_axis)) / spacing
    low, high = flat[..., 1].min(axis=1), flat[..., 1].max(axis=1)
    # A line through a corner counts only the segment that goes up from there.
    begin = np.maximum(np.ceil(low), -LINES).astype(int)
    end = np.minimum(np.ceil(high), LINES + 1).astype(int)
    count = np.maximum(end - begin, 0)
    of = np.repeat(np.arange(len(flat)), count)
    line = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + begin[of]
    (x0, y0), (x1, y1) = flat[of, 0].T, flat[of, 1].T
    x = x0 + (x1 - x0) * (line - y0) / (y1 - y0)
    order = np.lexsort((x, line))
    line, x, up = line[order], x[order], np.where(y0 < y1, 1, -1)[order]
    left = np.bincount(line + LINES, up, minlength=2 * LINES + 1) != 0
    x = np.clip(x, -2 * LINES, 2 * LINES)
    line, x, up = (each[~left[line + LINES]] for each in (line, x, up))
    winds = np.cumsum(up)[:-1] != 0  # each line ends with a sum of 0
    inside = winds & (x[:-1] < x[1:])
    line, x = line[:-1][inside], np.column_stack((x[:-1], x[1:]))[inside]
    return plane.middle + spacing * (x[..., None] * x_axis + line[:, None, None] * y_axis)


class Section:
    """The section of one page; while there is a plane, it has nodes below the parts' frames."""

    def __init__(self, api: viser.SceneApi, parts: Parts) -> None:
        """Begin without a plane."""
        self._api = api
        self._parts = parts
        self._due_s = -math.inf
        self._nodes: dict[str, list[viser.SceneNodeHandle]] = {}
        self._made: dict[str, tuple] = {}
        self.plane: Plane | None = None

    def aim(self, plane: Plane | None) -> None:
        """Set the plane; None ends the section."""
        self.plane = plane
        self._due_s = -math.inf
        if plane is None:
            self._clear_all()

    def show(self, view: View, now_s: float) -> None:
        """Cut the parts where they are now, at most every `EVERY_S`."""
        if self.plane is None or now_s < self._due_s:
            return
        self._due_s = now_s + EVERY_S
        distance = float(np.linalg.norm(view.position - self.plane.middle))
        spacing = 2.0 ** round(math.log2(max(SPACING * distance / view.focal, 1e-9)))
        for i, part in enumerate(self._parts.shown()):
            self._cut(i, part, spacing)

    def _cut(self, i: int, view: PartView, spacing: float) -> None:
        plane = self.plane.seen_from(view.pose, self._parts.scale)
        wanted = (*plane.middle, *plane.normal, spacing, view.opacity, view.edges_wanted)
        wanted = (np.round(wanted, 9).tobytes(), view.shape, view.dimmed)
        if self._made.get(view.name) == wanted:
            return
        self._clear(view)
        self._made[view.name] = wanted
        if view.point:
            return
        corners = np.stack((view.low, view.high))[
            np.indices((2, 2, 2)).reshape(3, -1).T, np.arange(3)
        ]
        if ((corners - plane.middle) @ plane.normal <= 0.0).all():
            return
        view.cut_away(True)
        vertices, triangles, outline = cut(*view.triangles, plane)
        nodes = self._nodes[view.name] = []
        name = view.path
        if view.coats:
            nodes += self._coats(view, plane)
        elif len(triangles):
            nodes.append(view.like(self._api, f"{name}/cut", vertices, triangles))
        edges = behind(view.edges, plane)
        if view.edges_wanted and len(edges) and not view.coats:
            nodes.append(_lines(self._api, f"{name}/cut_edges", edges, EDGE, 1.0))
        if len(outline):
            nodes.append(_lines(self._api, f"{name}/outline", outline, _OUTLINE, 2.5))
            lines = hatching(outline, plane, spacing, math.radians(45.0 if i % 2 else 135.0))
            if view.solid and len(lines):
                dark = tuple(int(0.6 * c) for c in view.colour)
                nodes.append(_lines(self._api, f"{name}/hatching", lines, dark, 1.2))

    def _coats(self, view: PartView, plane: Plane) -> Iterator[viser.SceneNodeHandle]:
        """Cut each of a part's coats, and yield the nodes that show the rest."""
        for i, coat in enumerate(view.coats):
            whole = np.arange(len(coat.corners)).reshape(-1, 3)
            vertices, triangles, _ = cut(coat.corners, whole, plane)
            if len(triangles):
                left = coat._replace(corners=vertices[triangles].reshape(-1, 3))
                yield view.coloured(self._api, f"{view.path}/cut_{i}", left)

    def _clear_all(self) -> None:
        for name in list(self._made):  # also parts that are no longer shown
            self._clear(self._parts[name])

    def _clear(self, view: PartView) -> None:
        self._made.pop(view.name, None)
        for node in self._nodes.pop(view.name, []):
            node.remove()
        view.cut_away(False)


def _lines(api, name: str, lines: np.ndarray, colour, width: float) -> viser.SceneNodeHandle:
    return api.add_line_segments(
        name, lines.astype(np.float32), colour, thickness=width, thickness_units="screen"
    )
