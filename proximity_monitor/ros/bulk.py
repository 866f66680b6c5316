"""Reads poses from the bytes of their messages, without rclpy's Python objects.

rclpy takes some 20 µs for the pose of a `geometry_msgs/PoseStamped`, and 4 ms for 1,000 poses of a
`geometry_msgs/PoseArray`. It still reads messages that are not plain CDR, which another middleware
may choose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point, PoseArray, PoseStamped, Quaternion, Vector3
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

from proximity_monitor import cdr

_NUMBERS = 7  # position x, y, z; orientation x, y, z, w


class Poses(NamedTuple):
    """The content of a PoseArray."""

    stamp_ns: int
    frame: str
    positions: np.ndarray
    """(n, 3) metres."""
    quaternions: np.ndarray
    """(n, 4) x, y, z, w."""


class StampedPose(NamedTuple):
    """The content of a PoseStamped."""

    stamp_ns: int
    frame: str
    position: tuple[float, float, float]
    """Metres."""
    quaternion: tuple[float, float, float, float]
    """x, y, z, w."""


def read_pose(data: bytes) -> StampedPose:
    """Read a serialised PoseStamped.

    Raises:
        ValueError: the data is no PoseStamped.
    """
    if not cdr.is_plain(data):
        message = _deserialised(data, PoseStamped)
        return stamped_pose(message.header, message.pose.position, message.pose.orientation)
    try:
        reader = cdr.Reader(data)
        stamp_ns, frame = reader.stamp_ns(), reader.text()
        numbers = reader.doubles(_NUMBERS)
    except ValueError as error:
        raise ValueError(f"not a serialised PoseStamped: {error}") from error
    return StampedPose(stamp_ns, frame, numbers[:3], numbers[3:])


def stamped_pose(header: Header, p: Point | Vector3, q: Quaternion) -> StampedPose:
    """Return a pose whose parts rclpy has read."""
    stamp_ns = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
    return StampedPose(stamp_ns, header.frame_id, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def read_pose_array(data: bytes) -> Poses:
    """Read a serialised PoseArray.

    Raises:
        ValueError: the data is no PoseArray.
    """
    if not cdr.is_plain(data):
        return _read_slowly(data)
    try:
        reader = cdr.Reader(data)
        stamp_ns, frame, count = reader.stamp_ns(), reader.text(), reader.count()
        numbers = reader.array("f8", count * _NUMBERS)
    except ValueError as error:
        raise ValueError(f"not a serialised PoseArray: {error}") from error
    numbers = numbers.reshape(count, _NUMBERS).astype(np.float64, copy=False)
    return Poses(stamp_ns, frame, numbers[:, :3], numbers[:, 3:])


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
        raise ValueError(f"not a serialised {kind.__name__}: {error}") from error
