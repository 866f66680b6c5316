"""Markers for viewers, each tick: distance lines, closest points and labels.

Each marker costs some 40 µs on either side. So all lines are one marker and all points another,
coloured by the level of each pair, and only pairs that are not clear and the nearest few get
labels. Ids are stable. A label that is no longer wanted is deleted alone, because deleting
everything at once would flicker. The markers live for a second, or for three ticks if that is
longer, so a monitor that dies leaves no picture behind that looks current.

Everything is in the fixed frame and stamped with its tick.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from proximity_monitor.ros.messages import clearance_text, pair_name
from proximity_monitor.scene import Unit
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.state import PairState, PairStatus

NEAREST = 3
"""How many of the nearest pairs are labelled even if all are clear."""

LABELS = 50
"""How many of the nearest pairs that are not clear are labelled. More labels would not help, and
each costs as much as all lines together."""

COLOURS = {
    Level.CLEAR: ColorRGBA(r=0.16, g=0.63, b=0.40, a=1.0),
    Level.WARN: ColorRGBA(r=0.95, g=0.65, b=0.10, a=1.0),
    Level.STOP: ColorRGBA(r=0.86, g=0.16, b=0.16, a=1.0),
    Level.STALE: ColorRGBA(r=0.55, g=0.45, b=0.70, a=1.0),
}


class ClearanceMarkers:
    """Makes the message of ~/markers, and remembers which labels are shown."""

    def __init__(self, frame: str, unit: Unit, size: float) -> None:
        """Begin with nothing shown; `size`, the scene's extent in metres, scales the marks."""
        self._frame = frame
        self._unit = unit
        self._size = size
        self._life = Duration(sec=1)
        self._labelled: set[int] = set()

    def live(self, life_s: float) -> None:
        """Let markers made from now on vanish after `life_s` seconds without a newer one."""
        self._life = Duration(sec=int(life_s), nanosec=int(life_s % 1.0 * 1e9))

    def message(
        self, pairs: Sequence[PairState], levels: Mapping[int, Level], stamp: Time
    ) -> MarkerArray:
        """Return the markers of a tick; pairs without a pose have none.

        Args:
            pairs: the pairs that the tick lists.
            levels: by the pair's index in the scene, which is also the id of its label.
            stamp: the tick's stamp.
        """
        shown = [pair for pair in pairs if pair.status is not PairStatus.UNKNOWN]
        nearest = sorted(shown, key=lambda pair: pair.lower)
        urgent = [pair for pair in nearest if levels[pair.index] is not Level.CLEAR]
        labelled = {pair.index: pair for pair in (*nearest[:NEAREST], *urgent[:LABELS])}
        markers = [
            self._many(Marker.LINE_LIST, "distance", stamp, 0.002, levels, shown),
            self._many(Marker.SPHERE_LIST, "points", stamp, 0.008, levels, shown),
        ]
        markers += [self._label(pair, levels[i], stamp) for i, pair in sorted(labelled.items())]
        gone = self._labelled - labelled.keys()
        markers += [self._gone("label", i, stamp) for i in sorted(gone)]
        self._labelled = set(labelled)
        return MarkerArray(markers=markers)

    def farewell(self, stamp: Time) -> MarkerArray:
        """Return the message that removes all markers."""
        gone = [self._gone("distance", 0, stamp), self._gone("points", 0, stamp)]
        gone += [self._gone("label", i, stamp) for i in sorted(self._labelled)]
        self._labelled = set()
        return MarkerArray(markers=gone)

    def _many(
        self,
        kind: int,
        namespace: str,
        stamp: Time,
        scale: float,
        levels: Mapping[int, Level],
        shown: Sequence[PairState],
    ) -> Marker:
        if not shown:
            return self._gone(namespace, 0, stamp)  # viewers complain about lists without points
        marker = self._marker(kind, namespace, 0, stamp)
        marker.scale.x = marker.scale.y = marker.scale.z = scale * self._size
        marker.points = [to_point(p) for pair in shown for p in (pair.point_a, pair.point_b)]
        marker.colors = [COLOURS[levels[pair.index]] for pair in shown for _ in range(2)]
        marker.color = COLOURS[Level.CLEAR]  # some viewers hide a list whose own alpha is 0
        return marker

    def _label(self, pair: PairState, level: Level, stamp: Time) -> Marker:
        marker = self._marker(Marker.TEXT_VIEW_FACING, "label", pair.index, stamp)
        marker.scale.z = 0.02 * self._size
        marker.pose.position = to_point((pair.point_a + pair.point_b) / 2.0)
        marker.color = COLOURS[level]
        marker.text = f"{pair_name(pair.a, pair.b)}\n{clearance_text(pair, self._unit)}"
        return marker

    def _marker(self, kind: int, namespace: str, i: int, stamp: Time) -> Marker:
        marker = Marker(type=kind, action=Marker.ADD, ns=namespace, id=i, lifetime=self._life)
        marker.header.frame_id = self._frame
        marker.header.stamp = stamp
        return marker

    def _gone(self, namespace: str, i: int, stamp: Time) -> Marker:
        marker = Marker(action=Marker.DELETE, ns=namespace, id=i)
        marker.header.frame_id = self._frame
        marker.header.stamp = stamp
        return marker


def to_point(xyz: np.ndarray) -> Point:
    """Return a (3,) array as a message."""
    x, y, z = xyz.tolist()
    return Point(x=x, y=y, z=z)
