"""A browser's camera: where points are on its screen, and how to aim it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display.geometry import rotate

FILL = 0.4
"""Share of the picture that a gap fills after a zoom to it."""

HIGH = math.radians(75.0)
"""Vertical angle of a picture."""

NEAREST = 3e-5
"""Minimum distance of the camera to a gap, in units of the page.

Positions on the page are in single precision, and parts are about one unit large. At this distance
they jump by at most a pixel."""

LEAST = 2e-5
"""A smaller gap is magnified no more than one of this size, in units of the page: see `NEAREST`."""

NEAR = 0.02
"""Distance of the near plane, as a share of the distance to the point that the camera looks at."""

NEAR_MOST = 0.01
"""Greatest distance of the near plane, in units of the page."""


class View(NamedTuple):
    """The view of a camera, in the page's units."""

    position: np.ndarray
    """(3,) of the camera."""
    axes: np.ndarray
    """(3, 3) in rows: the directions to the right, down and forward."""
    focal: float
    """Focal length in pixels."""
    size: tuple[float, float]
    """Width and height of the picture, pixels."""

    @classmethod
    def of(cls, camera: viser.CameraHandle) -> View:
        """Return the view of a browser's camera."""
        height = max(float(camera.image_height), 1.0)
        return cls(
            np.array(camera.position),
            rotate(np.array(camera.wxyz), np.eye(3)),
            height / (2.0 * math.tan(camera.fov / 2.0)),
            (max(float(camera.image_width), 1.0), height),
        )

    @classmethod
    def looking(
        cls, position: np.ndarray, at: np.ndarray, size: tuple[float, float] = (1280.0, 800.0)
    ) -> View:
        """Return the view of a camera that looks at a point (3,); 75 degrees high, z is up."""
        forward = (at - position) / np.linalg.norm(at - position)
        right = np.cross(forward, (0.0, 0.0, 1.0))
        if np.linalg.norm(right) < 1e-6:
            right = np.array((1.0, 0.0, 0.0))  # the camera looks along z
        right /= np.linalg.norm(right)
        axes = np.array((right, np.cross(forward, right), forward))
        return cls(position, axes, size[1] / (2.0 * math.tan(HIGH / 2.0)), size)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the places of points (n, 3) on the screen (n, 2), and their depths (n,).

        For a point behind the camera the depth is not positive, and the place has no meaning.
        """
        right, down, depth = ((points - self.position) @ self.axes.T).T
        safe = np.where(depth > 0.0, depth, 1.0)
        place = self.focal * np.column_stack((right, down)) / safe[:, None]
        return place + np.array(self.size) / 2.0, depth

    def shift(self, points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Return points (n, 3) moved by pixels (n, 2) on the screen; each keeps its depth."""
        depth = (points - self.position) @ self.axes[2]
        return points + (depth / self.focal)[:, None] * (pixels @ self.axes[:2])


def facing(ends: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the unit direction (3,) across a gap that is nearest to the direction of the camera.

    Args:
        ends: (2, 3) the ends of the gap.
        position: (3,) of the camera.
    """
    along = ends[1] - ends[0]
    length = np.linalg.norm(along)
    along = along / length if length > 0.0 else np.zeros(3)
    # If the camera looks along the gap, any direction across it will do.
    for wish in (position - ends.mean(axis=0), *np.eye(3)):
        across = wish - (wish @ along) * along
        size = np.linalg.norm(across)
        if size > 1e-3 * np.linalg.norm(wish):
            break
    return across / size


def zoom(camera: viser.CameraHandle, ends: np.ndarray) -> None:
    """Move a camera so that a gap fills `FILL` of the picture, seen from the side."""
    middle = ends.mean(axis=0)
    across = facing(ends, np.array(camera.position))
    least = 2.0 * math.tan(camera.fov / 2.0) * min(1.0, camera.aspect)
    distance = max(float(np.linalg.norm(ends[1] - ends[0])) / (FILL * least), NEAREST)
    look(camera, middle + distance * across, middle)


def approach(camera: viser.CameraHandle, ends: np.ndarray, least: float) -> None:
    """Move a camera along its line to the middle of a gap until it is `least` away, or farther.

    Args:
        camera: the camera.
        ends: (2, 3) the ends of the gap.
        least: its distance from a small gap.
    """
    middle = ends.mean(axis=0)
    away = np.array(camera.position) - middle
    away /= np.linalg.norm(away) or 1.0
    distance = max(4.0 * float(np.linalg.norm(ends[1] - ends[0])), least)
    place(camera, middle + distance * away, middle)


def look(camera: viser.CameraHandle, position: np.ndarray, look_at: np.ndarray) -> None:
    """Put a camera at a position (3,) that may be very near to the point (3,) it looks at."""
    with camera.client.atomic():
        camera.min_orbit_distance = NEAREST / 10.0
        place(camera, position, look_at)
        adapt(camera)


def place(camera: viser.CameraHandle, position: np.ndarray, look_at: np.ndarray) -> None:
    """Put a camera at a position (3,), looking at a point (3,)."""
    with camera.client.atomic():
        camera.position = position  # this also moves the point looked at, so set that one last
        camera.look_at = look_at


def adapt(camera: viser.CameraHandle) -> None:
    """Adapt the near plane to the distance of the point that the camera looks at."""
    distance = float(np.linalg.norm(np.array(camera.position) - np.array(camera.look_at)))
    near = min(NEAR_MOST, 2.0 ** round(math.log2(max(NEAR * distance, 1e-7))))
    if camera.near != near:
        camera.near = near
