"""Poses read as they were serialised.

rclpy makes Python objects of a message before a callback sees it: 20 microseconds for the pose of a
`geometry_msgs/PoseStamped`, some 4 ms for the 1,000 of a `geometry_msgs/PoseArray`. Serialised, a
pose is seven float64 in a row, which are taken as they are. Serialisations other than plain CDR
(XCDR1), which another middleware may choose, are read by rclpy.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point, PoseArray, PoseStamped, Quaternion, Vector3
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

_ENCAPSULATION = 4  # bytes before the body: kind and options; alignment counts from their end
_PLAIN_CDR = {b"\x00\x00": ">", b"\x00\x01": "<"}
_HEADER = {order: struct.Struct(f"{order}iII") for order in "<>"}  # and the frame's length
_POSE = {order: struct.Struct(f"{order}7d") for order in "<>"}
_NUMBERS = 7  # position x, y, z; orientation x, y, z, w


class Poses(NamedTuple):
    """What a message says."""

    stamp_ns: int
    frame: str
    positions: np.ndarray
    """(n, 3) metres."""
    quaternions: np.ndarray
    """(n, 4) x, y, z, w."""


class StampedPose(NamedTuple):
    """What a message about one body says."""

    stamp_ns: int
    frame: str
    position: tuple[float, float, float]
    """Metres."""
    quaternion: tuple[float, float, float, float]
    """x, y, z, w."""


def read_pose(data: bytes) -> StampedPose:
    """Read a serialised PoseStamped.

    Raises:
        ValueError: it is none.
    """
    order = _PLAIN_CDR.get(data[:2])
    if order is None:
        message = _deserialised(data, PoseStamped)
        return stamped_pose(message.header, message.pose.position, message.pose.orientation)
    try:
        stamp_ns, frame, at = _read_header(data, order)
        numbers = _POSE[order].unpack_from(data, _aligned(at, 8))
    except (struct.error, ValueError) as error:
        raise ValueError(f"no serialised PoseStamped: {error}") from error
    return StampedPose(stamp_ns, frame, numbers[:3], numbers[3:])


def stamped_pose(header: Header, p: Point | Vector3, q: Quaternion) -> StampedPose:
    """Return a pose of which rclpy has read the parts."""
    stamp_ns = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
    return StampedPose(stamp_ns, header.frame_id, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def read_pose_array(data: bytes) -> Poses:
    """Read a serialised PoseArray.

    Raises:
        ValueError: it is none.
    """
    order = _PLAIN_CDR.get(data[:2])
    if order is None:
        return _read_slowly(data)
    try:
        stamp_ns, frame, at = _read_header(data, order)
        at = _aligned(at, 4)
        (count,) = struct.unpack_from(f"{order}I", data, at)
        start = _aligned(at + 4, 8) if count else 0  # without a pose nothing follows the count
        numbers = np.frombuffer(data, f"{order}f8", count * _NUMBERS, start)
    except (struct.error, ValueError) as error:
        raise ValueError(f"no serialised PoseArray: {error}") from error
    numbers = numbers.reshape(count, _NUMBERS).astype(np.float64, copy=False)
    return Poses(stamp_ns, frame, numbers[:, :3], numbers[:, 3:])


def _read_header(data: bytes, order: str) -> tuple[int, str, int]:
    """Stamp and frame of a message that begins with a header, and where that ends."""
    seconds, nanoseconds, length = _HEADER[order].unpack_from(data, _ENCAPSULATION)
    at = _ENCAPSULATION + _HEADER[order].size
    frame = data[at : at + length].rstrip(b"\0").decode()
    return seconds * 1_000_000_000 + nanoseconds, frame, at + length


def _aligned(at: int, size: int) -> int:
    """The next place, from `at` on, at which a number of `size` bytes may stand."""
    return at + (_ENCAPSULATION - at) % size


def _read_slowly(data: bytes) -> Poses:
    message = _deserialised(data, PoseArray)
    stamp = message.header.stamp
    numbers = np.array(
        [
            (p.position.x, p.position.y, p.position.z,
             p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w)
            for p in message.poses
        ]
    ).reshape(-1, _NUMBERS)  # fmt: skip
    stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
    return Poses(stamp_ns, message.header.frame_id, numbers[:, :3], numbers[:, 3:])


def _deserialised(data: bytes, kind: type):
    try:
        return deserialize_message(data, kind)
    except RuntimeError as error:  # rclpy's RMWError is one
        raise ValueError(f"no serialised {kind.__name__}: {error}") from error
