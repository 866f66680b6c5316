"""The parts as mesh markers for ~/parts: one latched message with every body.

A marker can move only if its mesh is sent again, and a transform on /tf would need tf2_msgs, which
pip cannot install. A message of rclpy has a Python object for each corner: 50 ms for 12,000
triangles and seconds for a million. So rclpy serialises one triangle per body, and the corners are
spliced in from numpy arrays. A corner has 24 bytes, so the eight-byte alignment of all other fields
stays the same. After that only the poses are overwritten.

The message is built for the first viewer. It is published when a viewer appears and, while there is
a viewer, up to five times a second if a body moved. Every message is complete, so the latched one
is right for late viewers. The stamp is zero, which viewers take as "now", because the message is
older than the poses in it.

Two fields carry data that a marker has no field for. `uv_coordinates` has the normals of curved
bodies, as `cdr.as_octahedral`; viewers use this field only with a texture. The `text`, which
viewers ignore for triangles, is JSON: `solid`, whether the body has an inside, and `off_m`, the
largest distance of the triangles from the part that the body stands for, null if not known.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from geometry_msgs.msg import Point, Quaternion
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray, UVCoordinate

from proximity_monitor import engine
from proximity_monitor.ros.looks import Look, Looks
from proximity_monitor.scene import Body

RATE_HZ = 5.0
"""Smooth enough to see where a part is; the distances come at the monitor's own rate."""

BYTES_PER_S = 20e6
"""A message so large that RATE_HZ would exceed this is published less often."""

_ENCAPSULATION = 4  # bytes before the body of a serialised message; alignment counts from there
_PENDING = 0x70617274  # an action that no marker has: marks the place to overwrite
_POSE = struct.Struct("<7d")
_KEY = struct.Struct("<3i")  # id, type, action, which stand before the pose
_PLACEHOLDER = np.array(
    [[0.1234567, 2.3456789, 4.5678901], [6.7890123, 8.9012345, 0.2345678], [1.3, 2.7, 3.9]], "<f8"
)  # three points that are found by their bytes
_NORMALS = np.array([[0.125, 0.375], [0.625, -0.875], [-0.1875, 0.4375]], "<f4")  # likewise
_OTHER_LAYOUT = (
    "the middleware lays out serialised markers in a way that ~/parts cannot use; set the parameter"
    " markers to false"
)


class PartsMessage:
    """The serialised marker array of all bodies; poses are written into it."""

    def __init__(
        self,
        bodies: Sequence[Body],
        models: Mapping[str, engine.Model],
        frame: str,
        looks: Looks | None = None,
    ) -> None:
        """Build the message; a body is not shown until `place` gives it a pose.

        Args:
            bodies: in the order of the markers.
            models: by name of the body.
            frame: the frame of the poses.
            looks: looks that may be known already; None: none are.

        Raises:
            RuntimeError: the middleware lays messages out in a way that cannot be spliced.
        """
        self._index = {body.name: i for i, body in enumerate(bodies)}
        known = Looks() if looks is None else looks
        every = [known.of(models[body.name]) for body in bodies]
        markers = [
            _marker(i, body, look, frame)
            for i, (body, look) in enumerate(zip(bodies, every, strict=True))
        ]
        template = _Template(markers)
        # Two triangles of each body are enough to prove that splicing works, and quick to read.
        few = [look._replace(corners=look.corners[:6], normals=look.normals[:6]) for look in every]
        self._bytes, self._places = template.filled(few)
        self._prove(few)
        self._bytes, self._places = template.filled(every)
        self.place(dict.fromkeys(self._index))

    @property
    def period_s(self) -> float:
        """Seconds between two messages, so that neither limit is exceeded."""
        return max(1.0 / RATE_HZ, len(self._bytes) / BYTES_PER_S)

    def place(self, poses: Mapping[str, np.ndarray | None]) -> None:
        """Write bodies' (4, 4) poses; None hides a body."""
        for name, pose in poses.items():
            action = Marker.DELETE if pose is None else Marker.ADD
            struct.pack_into("<i", self._bytes, self._places[self._index[name]][0], action)
        known = {name: pose for name, pose in poses.items() if pose is not None}
        for name, numbers in zip(known, to_numbers(known.values()).tolist(), strict=True):
            _POSE.pack_into(self._bytes, self._places[self._index[name]][1], *numbers)

    def serialised(self) -> bytes:
        """Return the message as it is published."""
        return bytes(self._bytes)

    def _prove(self, looks: Sequence[Look]) -> None:
        """Refuse a middleware that lays messages out differently, before anything is published."""
        poses = np.tile(np.eye(4), (len(self._index), 1, 1))
        poses[:, :3, 3] = np.arange(len(poses))[:, None] + (0.25, 0.5, 0.75)
        self.place(dict(zip(self._index, poses, strict=True)))
        read = deserialize_message(self.serialised(), MarkerArray)
        for i, marker in enumerate(read.markers):
            p, q = marker.pose.position, marker.pose.orientation
            points = np.array([(point.x, point.y, point.z) for point in marker.points])
            normals = np.array([(uv.u, uv.v) for uv in marker.uv_coordinates]).reshape(-1, 2)
            if (
                marker.action != Marker.ADD
                or (p.x, p.y, p.z) != (i + 0.25, i + 0.5, i + 0.75)
                or ((q.x, q.y, q.z, q.w) != (0.0, 0.0, 0.0, 1.0))
                or not np.array_equal(points, looks[i].corners)
                or not np.array_equal(normals, looks[i].normals.astype(np.float32))
            ):
                raise RuntimeError(_OTHER_LAYOUT)


class _Template:
    """The serialised array with one triangle per body, and the offsets of its fields."""

    def __init__(self, markers: Sequence[Marker]) -> None:
        self._data = bytes(serialize_message(MarkerArray(markers=markers)))
        self._places, self._lists = [], []
        """`_places`: for each marker, the offsets of its action and pose. `_lists`: for each
        marker's points and then its normals, the offsets of the count and the first element."""
        at = 0
        for i in range(len(markers)):
            key = self._found(_KEY.pack(i, Marker.TRIANGLE_LIST, _PENDING), at)
            action, end = key + 8, key + _KEY.size - _ENCAPSULATION
            self._places.append((action, _ENCAPSULATION + (end + 7) // 8 * 8))
            at = key
            for pattern in (_PLACEHOLDER, _NORMALS):
                at = self._found(pattern.tobytes(), at)
                # The count is right before the first element, or four bytes of padding earlier.
                count = next((each for each in (at - 4, at - 8) if self._number(each) == 3), None)
                if count is None:
                    raise RuntimeError(_OTHER_LAYOUT)
                self._lists.append((count, at))

    def filled(self, looks: Sequence[Look]) -> tuple[bytearray, list[tuple[int, int]]]:
        """Return the message with the bodies' looks, and the offsets of its actions and poses."""
        parts, places, end, longer = [], [], 0, 0
        lists = iter(self._lists)
        for look, (action, pose) in zip(looks, self._places, strict=True):
            places.append((action + longer, pose + longer))
            for array, pattern in ((look.corners, _PLACEHOLDER), (look.normals, _NORMALS)):
                count, first = next(lists)
                data = np.ascontiguousarray(array, pattern.dtype).tobytes()
                parts.append(self._data[end:count])
                parts.append(struct.pack("<I", len(array)))
                parts.append(self._data[count + 4 : first])
                parts.append(data)
                end = first + pattern.nbytes
                longer += len(data) - pattern.nbytes
        return bytearray(b"".join([*parts, self._data[end:]])), places

    def _found(self, pattern: bytes, start: int) -> int:
        at = self._data.find(pattern, start)
        if at < 0:
            raise RuntimeError(_OTHER_LAYOUT)
        return at

    def _number(self, at: int) -> int:
        return struct.unpack_from("<I", self._data, at)[0]


def _marker(i: int, body: Body, look: Look, frame: str) -> Marker:
    marker = Marker(type=Marker.TRIANGLE_LIST, action=_PENDING, ns="parts", id=i)
    marker.header.frame_id = frame
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    r, g, b, a = (float(value) for value in body.colour)
    marker.color = ColorRGBA(r=r, g=g, b=b, a=a)
    marker.pose.orientation = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in _PLACEHOLDER.tolist()]
    marker.uv_coordinates = [UVCoordinate(u=u, v=v) for u, v in _NORMALS.tolist()]
    off_m = look.off if math.isfinite(look.off) else None
    marker.text = json.dumps({"solid": look.solid, "off_m": off_m})
    return marker


def to_numbers(poses: Iterable[np.ndarray]) -> np.ndarray:
    """Return positions and quaternions x, y, z, w (k, 7) of k poses (4, 4), as in messages."""
    stacked = np.array(list(poses)).reshape(-1, 4, 4)
    return np.hstack((stacked[:, :3, 3], to_quaternions(stacked[:, :3, :3])))


def to_quaternions(rotations: np.ndarray) -> np.ndarray:
    """Return the unit quaternions xyzw (k, 4), w >= 0, of rotations (k, 3, 3).

    It starts from the largest of the four components, so that it never divides by a small number.
    """
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = np.moveaxis(rotations, 0, -1)
    xx, yy, zz, ww = (1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22,
                      1 + m00 + m11 + m22)  # fmt: skip
    xy, xz, yz = m01 + m10, m02 + m20, m12 + m21
    xw, yw, zw = m21 - m12, m02 - m20, m10 - m01
    # Four times the quaternion's outer product with itself: each row is a multiple of it.
    rows = np.array(((xx, xy, xz, xw), (xy, yy, yz, yw), (xz, yz, zz, zw), (xw, yw, zw, ww)))
    largest = np.argmax((xx, yy, zz, ww), axis=0)
    found = rows[largest, :, np.arange(len(largest))]
    norm = np.sqrt((found * found).sum(axis=1))
    return found / np.where(found[:, 3] < 0.0, -norm, norm)[:, None]


def to_quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    """Return the unit quaternion x, y, z, w, with w >= 0, of one rotation (3, 3)."""
    x, y, z, w = to_quaternions(rotation[None])[0].tolist()
    return x, y, z, w
