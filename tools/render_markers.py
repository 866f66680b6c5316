"""Draw what RViz and Foxglove receive: the messages of ~/parts and ~/markers of a running demo.

    python -m pip install '.[ros]' matplotlib
    python tools/render_markers.py
    python tools/render_markers.py --scene rings --azimuth -70 --out rings.png

The script starts the demo on a DDS domain of its own and listens to both topics as a viewer does.
It draws once enough labels are shown, and ends the demo. Everything has the place, size and colour
of its marker. Unlike in a viewer, edges are inked, lines and points behind an opaque part are
fainter instead of hidden, and labels that would cover each other are moved up or down, with a thin
line to their places.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from itertools import combinations
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patheffects import withStroke
from raster import Camera, Picture
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from render_scene import FINER, plt
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from proximity_monitor.ros.markers import COLOURS
from proximity_monitor.ros.qos import LATCHED
from proximity_monitor.ros.spin import ros, spin
from proximity_monitor.scene.poses import pose_matrix

OUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "markers.png"
PARTS, MARKERS = "/proximity_monitor/parts", "/proximity_monitor/markers"
KINDS = {
    getattr(Marker, kind): kind
    for kind in ("TRIANGLE_LIST", "LINE_LIST", "SPHERE_LIST", "TEXT_VIEW_FACING")
}
PATIENCE_S = 240.0
EVERY = QoSProfile(depth=100)  # so that no deletion is missed, which would leave a label
SETTLE_S = 0.5  # after the first parts, because the first ticks lack poses
WAIT_S = 30.0  # for enough labels, later for any (a turn of the engine takes 25 s)
SIZE = (1200, 860)
MARGINS = (50, 50, 40, 76)  # left, right, top, bottom, in pixels: room for labels and a caption
BACKGROUND = 48 / 255  # as in rviz/assembly.rviz
PIECES = 64  # of a line; each is tested for a part in front of it
FAINT = 0.4
DPI = 100
CAPITAL = 0.729  # of matplotlib's font size: a text marker's scale.z is the height of a capital


class Viewer(Node):
    """Keeps the markers of both topics as a viewer does, until there is something to draw."""

    def __init__(self, labels: int) -> None:
        """Subscribe; parts set `ready` once `labels` labels are shown, or after a time limit."""
        super().__init__("render_markers")
        self.ready = False
        self._labels = labels
        self._since = np.inf
        # By topic, then by namespace and id: each marker with the time at which its lifetime ends.
        self._kept: dict[str, dict[tuple[str, int], tuple[Marker, float]]] = defaultdict(dict)
        self.create_subscription(MarkerArray, MARKERS, self._take_marks, EVERY)
        self.create_subscription(MarkerArray, PARTS, self._take_parts, LATCHED, raw=True)

    def shown(self, topic: str) -> list[Marker]:
        """Return a topic's markers that have not outlived their lifetimes."""
        now = time.monotonic()
        return [marker for marker, end in self._kept[topic].values() if now < end]

    def _take_marks(self, message: MarkerArray) -> None:
        if not self.ready:
            self._keep(MARKERS, message)

    def _take_parts(self, data: bytes) -> None:
        """Unpack the parts only when they are to be drawn, because unpacking in Python is slow.

        Each message is complete. A tick publishes it last, so the tick's distances are already
        here.
        """
        self._since = min(self._since, time.monotonic())
        labels = sum(mark.type == Marker.TEXT_VIEW_FACING for mark in self.shown(MARKERS))
        wait_s = SETTLE_S if labels >= self._labels else WAIT_S
        if not self.ready and labels and time.monotonic() - self._since > wait_s:
            message = deserialize_message(data, MarkerArray)
            self._keep(PARTS, message)
            self.ready = len(self._kept[PARTS]) == len(message.markers)  # every body has a pose

    def _keep(self, topic: str, message: MarkerArray) -> None:
        kept, now = self._kept[topic], time.monotonic()
        for marker in message.markers:
            if marker.action == Marker.ADD:
                life = marker.lifetime.sec + 1e-9 * marker.lifetime.nanosec
                kept[marker.ns, marker.id] = marker, now + (life or np.inf)
            elif marker.action == Marker.DELETE:
                kept.pop((marker.ns, marker.id), None)
            elif marker.action == Marker.DELETEALL:
                kept.clear()


def main() -> int:
    """Draw what the command line asks for; return 1 if there is nothing to draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    scene = "a bundled scene's name, or a scene file with a motion (engine)"
    parser.add_argument("--scene", default="engine", help=scene)
    out = "picture to write (docs/images/markers.png)"
    parser.add_argument("--out", type=Path, default=OUT, metavar="PNG", help=out)
    parser.add_argument(
        "--azimuth",
        type=float,
        default=-106.0,
        help="azimuth of the viewpoint, degrees from +x (%(default)g)",
    )
    parser.add_argument(
        "--elevation",
        type=float,
        default=22.0,
        help="elevation of the viewpoint, degrees (%(default)g)",
    )
    labels = (
        f"wait for N labels, but at most {WAIT_S:g} s: the three nearest pairs and all pairs that"
        " are not clear have one (%(default)d)"
    )
    parser.add_argument("--labels", type=int, default=4, metavar="N", help=labels)
    asked = parser.parse_args()
    parts, marks = listen(asked.scene, asked.labels)
    if not marks:
        print(f"no picture: {PARTS} or {MARKERS} had nothing to draw", file=sys.stderr)
        return 1
    draw(parts, marks, asked)
    print(f"{asked.out}: {len(parts)} markers of {PARTS}, {len(marks)} of {MARKERS}")
    return 0


def listen(scene: str, labels: int) -> tuple[list[Marker], list[Marker]]:
    """Return what a viewer of a demo shows of both topics; nothing if it does not come in time."""
    os.environ |= {
        "ROS_DOMAIN_ID": str(random.SystemRandom().randint(1, 100)),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    command = [sys.executable, "-m", "proximity_monitor", "demo", "--scene", scene, "--no-page"]
    demo = subprocess.Popen([*command, "--speed", "0.2"])
    end = time.monotonic() + PATIENCE_S
    try:
        with ros([]) as stop:
            viewer = Viewer(labels)

            def over() -> bool:
                return viewer.ready or demo.poll() is not None or time.monotonic() > end

            spin([viewer], stop, over)
            return (viewer.shown(PARTS), viewer.shown(MARKERS)) if viewer.ready else ([], [])
    finally:
        demo.send_signal(signal.SIGINT)
        demo.wait()


def draw(parts: list[Marker], marks: list[Marker], asked: argparse.Namespace) -> None:
    """Write a picture of the markers."""
    width, height = SIZE
    everything = np.vstack([_points(marker) for marker in parts])
    frame = tuple(FINER * v for v in (*SIZE, *MARGINS))
    camera = Camera.fit(everything, asked.azimuth, asked.elevation, frame)
    drawn, near = _solids(parts, camera)
    figure = plt.figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    axes = figure.add_axes((0, 0, 1, 1))
    fine = drawn.reshape(height, FINER, width, FINER, 3)
    axes.imshow(fine.mean(axis=(1, 3)), interpolation="nearest")
    axes.set_axis_off()
    axes.autoscale(False)
    for marker in marks:
        if marker.type == Marker.LINE_LIST:
            _lines(axes, marker, near, camera)
        elif marker.type == Marker.SPHERE_LIST:
            _spheres(axes, marker, near, camera)
    _labels(axes, [mark for mark in marks if mark.type == Marker.TEXT_VIEW_FACING], camera)
    _caption(axes, parts, marks)
    figure.savefig(asked.out, dpi=DPI)
    plt.close(figure)


def _solids(parts: list[Marker], camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts' picture, and how near to the eye their opaque surfaces are."""
    opaque, translucent = Picture(camera), []
    for marker in parts:
        triangles = _points(marker).reshape(-1, 3, 3)
        if marker.color.a >= 1.0:
            _add(opaque, triangles, marker)
        else:
            translucent.append((triangles, marker))
    drawn = opaque.shaded(BACKGROUND)
    # The farthest first, by their middles, as viewers sort them.
    translucent.sort(key=lambda each: (each[0] @ camera.axes[2]).mean())
    for triangles, marker in translucent:
        edges = triangles[:, 1:] - triangles[:, :1]
        towards = np.cross(edges[:, 0], edges[:, 1]) @ camera.axes[2] > 0.0
        # A viewer shows both sides of a triangle: first those that face away, reversed here.
        for side in (triangles[~towards][:, ::-1], triangles[towards]):
            layer = Picture(camera)
            _add(layer, side, marker)
            over = marker.color.a * (layer.near > opaque.near)[..., None]
            drawn = (1.0 - over) * drawn + over * layer.shaded(BACKGROUND)
    return drawn, opaque.near


def _add(picture: Picture, triangles: np.ndarray, marker: Marker) -> None:
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    picture.add(triangles.reshape(-1, 3), faces, _rgba(marker.color)[:3])


def _lines(axes: Axes, marker: Marker, near: np.ndarray, camera: Camera) -> None:
    """Draw lines in pieces, because a part may hide some pieces, and the colour may change."""
    ends = camera.project(_points(marker)).reshape(-1, 2, 3)
    colours = _colours(marker).reshape(-1, 2, 4)
    along = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    for (a, b), (first, last) in zip(ends, colours, strict=True):
        points = (1.0 - along) * a + along * b
        colour = (1.0 - along[1:]) * first + along[1:] * last
        colour[_behind(points[1:], near, 2.0 * camera.pixel), 3] *= FAINT
        pieces = np.stack((points[:-1, :2], points[1:, :2]), axis=1) / FINER
        width = _wide(marker.scale.x, camera)
        axes.add_collection(LineCollection(pieces, colors=colour, linewidths=width, zorder=2))


def _spheres(axes: Axes, marker: Marker, near: np.ndarray, camera: Camera) -> None:
    seen, colours = camera.project(_points(marker)), _colours(marker)
    colours[_behind(seen, near, 0.5 * marker.scale.x), 3] *= FAINT
    area = _wide(marker.scale.x, camera) ** 2  # of the square around a disc
    axes.scatter(*seen[:, :2].T / FINER, s=area, c=colours, linewidths=0, zorder=3)


def _labels(axes: Axes, texts: list[Marker], camera: Camera) -> None:
    """Write texts at their places, moved up or down if they would cover each other."""
    halo = [withStroke(linewidth=5.0, foreground=str(BACKGROUND))]
    style = {"ha": "center", "va": "center", "path_effects": halo, "zorder": 5}
    drawn = []
    for marker in texts:
        x, y, _ = camera.project(_pose(marker)[None, :3, 3])[0] / FINER
        size, colour = _wide(marker.scale.z, camera) / CAPITAL, _rgba(marker.color)
        drawn.append(axes.text(x, y, marker.text, fontsize=size, color=colour, **style))
    boxes = [text.get_window_extent() for text in drawn]  # their y points up, that of pictures down
    down = np.zeros(len(drawn))
    for _ in range(200):
        for (i, a), (j, b) in combinations(enumerate(boxes), 2):
            if a.x0 < b.x1 and b.x0 < a.x1:
                apart = (a.y0 + a.y1) / 2 - down[i] - (b.y0 + b.y1) / 2 + down[j]
                push = max(0.0, (a.height + b.height) / 2 - abs(apart)) / 2
                down[[i, j]] += np.copysign(push, apart) * np.array([-1.0, 1.0])
    for text, moved in zip(drawn, down, strict=True):
        x, y = text.get_position()
        axes.plot((x, x), (y, y + moved), color=text.get_color(), linewidth=1.0, zorder=4)
        text.set_y(y + moved)


def _caption(axes: Axes, parts: list[Marker], marks: list[Marker]) -> None:
    """Write at the bottom what each topic contributes, and what the colours mean."""
    (right, bottom), style = SIZE, {"fontsize": 11, "va": "center"}
    for y, topic, markers in ((bottom - 44, PARTS, parts), (bottom - 22, MARKERS, marks)):
        counts = Counter((marker.ns, KINDS[marker.type]) for marker in markers)
        said = ",  ".join(f"{space}: {count} {kind}" for (space, kind), count in counts.items())
        axes.text(24, y, topic, color="white", weight="bold", **style)
        axes.text(280, y, said, color="0.8", **style)
    x, style = right - 24, style | {"weight": "bold", "ha": "right"}
    for level, colour in reversed(COLOURS.items()):
        word = axes.text(x, bottom - 22, level.name.lower(), color=_rgba(colour), **style)
        x -= word.get_window_extent().width + 14


def _pose(marker: Marker) -> np.ndarray:
    at, turn = marker.pose.position, marker.pose.orientation
    return pose_matrix((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))


def _points(marker: Marker) -> np.ndarray:
    """Return a marker's points (n, 3) at its pose."""
    pose = _pose(marker)
    points = np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)
    return points @ pose[:3, :3].T + pose[:3, 3]


def _rgba(colour: ColorRGBA) -> tuple[float, float, float, float]:
    return colour.r, colour.g, colour.b, colour.a


def _colours(marker: Marker) -> np.ndarray:
    """Return the colour (n, 4) of each point: its own, or the marker's."""
    return np.array([_rgba(c) for c in marker.colors or [marker.color] * len(marker.points)])


def _wide(metres: float, camera: Camera) -> float:
    """Return a length in the world in matplotlib's unit, a 72nd of an inch."""
    return metres / camera.pixel / FINER * 72 / DPI


def _behind(seen: np.ndarray, near: np.ndarray, slack: float) -> np.ndarray:
    """Return whether an opaque part is nearer to the eye than each projected point (n, 3)."""
    column, row = seen[:, :2].astype(int).T
    height, width = near.shape
    at = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    return near[at] - slack > seen[:, 2]


if __name__ == "__main__":
    sys.exit(main())
