"""Finds the part under a click.

The page does this itself. If the meshes listened to presses, a mesh in front of the gizmo's handles
would take the presses on them, so a part that covers its own handles could not be moved by them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display.geometry import conjugate, rotate
from proximity_monitor.display.part_view import PartView
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.section import Plane

FAINT = 0.3
"""A part of less opacity than this is seen through, so a click goes through it as well."""

OnPick = Callable[[str], None]


def listen(
    api: viser.SceneApi,
    parts: Callable[[], Parts | None],
    section: Callable[[], Plane | None],
    on_pick: OnPick,
) -> None:
    """Call `on_pick` with the name of each movable part that is clicked."""

    # Not a coroutine, so that viser does not run it in the server's thread: large meshes take long.
    @api.on_click()
    def _(event: viser.SceneClickEvent) -> None:
        views, direction = parts(), np.array(event.ray_direction)
        if views is None:
            return
        ray = kept(np.array(event.ray_origin), direction, section())
        if (name := part_under(ray, views)) is not None:
            on_pick(name)


class Ray(NamedTuple):
    """A ray, or a piece of it, in the page's units."""

    origin: np.ndarray
    """(3,)"""
    direction: np.ndarray
    """(3,) of any length."""
    end: float = math.inf
    """Where the ray ends, in lengths of its direction; negative: it is empty."""


def kept(origin: np.ndarray, direction: np.ndarray, plane: Plane | None) -> Ray:
    """Return the part of a ray in the half-space that a section leaves."""
    if plane is None:
        return Ray(origin, direction)
    height, rise = (origin - plane.middle) @ plane.normal, direction @ plane.normal
    crossing = -height / rise if rise != 0.0 else math.inf
    if height <= 0.0:
        return Ray(origin, direction, crossing if rise > 0.0 else math.inf)
    if rise >= 0.0:
        return Ray(origin, direction, -math.inf)
    return Ray(origin + crossing * direction, direction)


def part_under(ray: Ray, parts: Parts) -> str | None:
    """Return the first movable part on a ray; None if an opaque fixed part comes before it.

    Args:
        ray: the pointer's ray.
        parts: the parts as they are shown.
    """
    hits = [
        (_distance(ray.origin, ray.direction, view, parts.scale), view) for view in parts.shown()
    ]
    for distance, view in sorted(hits, key=lambda hit: hit[0]):
        if np.isinf(distance) or distance > ray.end:
            break
        if view.movable:
            return view.name
        if view.opacity >= 1.0:
            break
    return None


def _distance(origin: np.ndarray, direction: np.ndarray, view: PartView, scale: float) -> float:
    if view.opacity < FAINT:
        return np.inf
    back = conjugate(view.pose[3:])
    start = rotate(back, origin - view.pose[:3] * scale)
    return first_hit(start, rotate(back, direction), view.low, view.high, view.corners())


def first_hit(
    origin: np.ndarray, direction: np.ndarray, low: np.ndarray, high: np.ndarray, corners
) -> float:
    """Return where a ray first meets a triangle, in lengths of `direction`; infinite: nowhere.

    Source: Moeller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997.

    Args:
        origin: (3,).
        direction: (3,).
        low: (3,) low corner of the triangles' box.
        high: (3,) high corner.
        corners: (n, 3, 3) of the triangles.
    """
    middle, radius = (low + high) / 2.0, np.linalg.norm(high - low) / 2.0
    if np.linalg.norm(np.cross(middle - origin, direction)) > radius * np.linalg.norm(direction):
        return np.inf
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(direction, v)
    volume = np.einsum("ij,ij->i", u, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        from_a = origin - a
        s = np.einsum("ij,ij->i", from_a, across) / volume
        around = np.cross(from_a, u)
        t = around @ direction / volume
        at = np.einsum("ij,ij->i", v, around) / volume
        inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0) & (at > 0.0)
    return float(at[inside].min(initial=np.inf))
