"""Pictures of one pair at one moment, drawn by the browser that asks for them.

A picture shows whole parts. If the gap is small on it, a second picture shows the gap itself, in a
section. The second one is seen from the same place with a longer focal length, because pictures do
not show anything nearer to the camera than a hundredth of the page's unit.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import viser
import viser.transforms

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.section import Plane
from proximity_monitor.display.state import Frame
from proximity_monitor.display.view import FILL, LEAST, View, facing

SIZE = (960, 600)
"""Maximum width and height of a picture, in pixels."""

TRIAL, TRIALS = (8, 8), 2
"""Size in pixels and number of trial pictures, which are thrown away. A browser adds and removes
meshes one frame after it is told to, and labels two frames after. Once it has answered the trials,
it has done so."""

PATIENCE_S = 30.0
"""Seconds to wait for a browser's picture before giving up."""

SIDES = 4.0
"""Distance of the camera to a gap, in widths of the gap; see also `CONTEXT`."""

CONTEXT = 0.6
"""Minimum distance of the camera, in sizes of the scene, to show where on the parts the gap is."""

SMALL = 60.0
"""If a gap has fewer pixels than this on its picture, there is a second picture of the gap."""

DETAIL = 0.04
"""The picture of a contact shows as much as that of a gap of this many sizes of the scene."""


class Sitting(NamedTuple):
    """What the page shows for a picture, instead of the user's own view and moment."""

    frame: Frame
    pair: PairName
    view: View
    cut: Plane | None = None
    """The plane of the section; None: whole parts, with labels."""


class Portraits:
    """Takes pictures. Meanwhile the 3D view of that browser shows the picture's moment."""

    def __init__(self, client: viser.ClientHandle, hide_gizmo: Callable[[bool], None]) -> None:
        """Begin without a picture to take."""
        self._client = client
        self._hide_gizmo = hide_gizmo
        self._one_at_a_time = threading.Lock()
        self._lock = threading.Lock()  # guards the fields below
        self._parts: Parts | None = None
        self._is_shown = threading.Event()
        self.sitting: Sitting | None = None
        """What the page has to show for a picture; None: what its user looks at."""

    def begin(self, parts: Parts) -> None:
        """Switch to the parts of another scene; end a picture of the previous scene."""
        with self._lock:
            self._parts, self.sitting = parts, None
            self._is_shown.set()  # `_take` must not wait for it any more

    def note(self, sitting: Sitting | None) -> None:
        """Note what a step of the page has shown. Call this only after a step that succeeded."""
        with self._lock:
            if sitting is not None and sitting is self.sitting:
                self._is_shown.set()

    def take(self, frame: Frame, pair: PairName, parts: Parts) -> np.ndarray:
        """Return a picture (height, width, 3) on white. Do not call this in the page's own thread.

        Args:
            frame: the moment; it has the pair.
            pair: the pair to highlight.
            parts: the page's parts at the time when the moment was chosen.

        Raises:
            RuntimeError, TimeoutError: the page has another scene now, or no picture came.
        """
        return self._take(self._whole(frame, pair, parts), parts)

    def take_with_gap(self, frame: Frame, pair: PairName, parts: Parts) -> list[np.ndarray]:
        """Return that picture and, if the gap is small on it, one of the gap; see `take`."""
        whole = self._whole(frame, pair, parts)
        ends = frame.pairs.points[frame.pairs.places[pair]] * parts.scale
        close = _close(whole, ends, DETAIL * parts.size)
        return [self._take(each, parts) for each in (whole, close) if each is not None]

    def _whole(self, frame: Frame, pair: PairName, parts: Parts) -> Sitting:
        camera = self._client.camera
        size = min(SIZE[0], camera.image_width), min(SIZE[1], camera.image_height)
        ends = frame.pairs.points[frame.pairs.places[pair]] * parts.scale
        view = _aimed(ends, np.array(camera.position), parts.size, size)
        return Sitting(frame, pair, view)

    def _take(self, sitting: Sitting, parts: Parts) -> np.ndarray:
        with self._one_at_a_time:
            with self._lock:
                self._check(parts)
                self._is_shown.clear()
                self.sitting = sitting
            self._hide_gizmo(True)
            try:
                if not self._is_shown.wait(PATIENCE_S):
                    raise TimeoutError("the page did not show the moment")
                for _ in range(TRIALS):
                    self._check(parts)
                    self._render(sitting.view, TRIAL)
                image = self._render(sitting.view, sitting.view.size)
                self._check(parts)
            finally:
                with self._lock:
                    self.sitting = None
                self._hide_gizmo(False)
        opaque = image[..., 3:] / 255.0
        return np.round(image[..., :3] * opaque + 255.0 * (1.0 - opaque)).astype(np.uint8)

    def _check(self, parts: Parts) -> None:
        if parts is not self._parts:
            raise RuntimeError("the scene has changed: try again")

    def _render(self, view: View, size: tuple[int, int]) -> np.ndarray:
        width, height = size
        return self._client.get_render(
            height,
            width,
            position=view.position,
            wxyz=viser.transforms.SO3.from_matrix(view.axes.T).wxyz,
            fov=2.0 * math.atan(height / (2.0 * view.focal)),
            transport_format="png",
            timeout=PATIENCE_S,
        )


def _aimed(
    ends: np.ndarray, position: np.ndarray, size: float, picture: tuple[float, float]
) -> View:
    """Return a view across a gap, from the camera's side.

    Args:
        ends: (2, 3) the ends of the gap. All lengths are in the page's units.
        position: (3,) of the camera.
        size: of the scene.
        picture: width and height in pixels.
    """
    middle = ends.mean(axis=0)
    away = max(SIDES * float(np.linalg.norm(ends[1] - ends[0])), CONTEXT * size)
    return View.looking(middle + away * facing(ends, position), middle, picture)


def _close(whole: Sitting, ends: np.ndarray, detail: float) -> Sitting | None:
    """Return a sitting in which a gap fills as much of the picture as after *Zoom to the gap*.

    Args:
        whole: a sitting across the gap.
        ends: (2, 3) the ends of the gap, in the page's units.
        detail: the length to show if the gap is 0, in the page's units.

    Returns:
        None if the gap is not small in `whole`.
    """
    view, across = whole.view, float(np.linalg.norm(ends[1] - ends[0]))
    away = ends.mean(axis=0) - view.position
    distance = float(np.linalg.norm(away))
    if view.focal * across / distance >= SMALL:
        return None
    shown = max(across, LEAST) if across > 0.0 else detail
    focal = FILL * min(view.size) * distance / shown
    plane = Plane(ends.mean(axis=0), -away / distance)
    return whole._replace(view=view._replace(focal=focal), cut=plane)
