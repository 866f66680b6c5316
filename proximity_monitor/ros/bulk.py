"""All poses of one moment in one message: `geometry_msgs/PoseArray`, read as it was serialised.

rclpy makes three Python objects of each pose before a callback sees it, some 4 ms for 1,000 of
them. The poses of a serialised array are seven float64 each in a row, so numpy takes them as they
are. Serialisations other than plain CDR (XCDR1), which another middleware may choose, are read by
rclpy.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PoseArray
from rclpy.serialization import deserialize_message

_ENCAPSULATION = 4  # bytes before the body: kind and options; alignment counts from their end
_PLAIN_CDR = {b"\x00\x00": ">", b"\x00\x01": "<"}
_NUMBERS = 7  # position x, y, z; orientation x, y, z, w


class Poses(NamedTuple):
    """What a message says."""

    stamp_ns: int
    frame: str
    positions: np.ndarray
    """(n, 3) metres."""
    quaternions: np.ndarray
    """(n, 4) x, y, z, w."""


def read_pose_array(data: bytes) -> Poses:
    """Read a serialised PoseArray.

    Raises:
        ValueError: it is none.
    """
    order = _PLAIN_CDR.get(data[:2])
    if order is None:
        return _read_slowly(data)
    try:
        seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", data, _ENCAPSULATION)
        at = _ENCAPSULATION + 12
        frame = data[at : at + length].rstrip(b"\0").decode()
        at = _aligned(at + length, 4)
        (count,) = struct.unpack_from(f"{order}I", data, at)
        start = _aligned(at + 4, 8) if count else 0  # without a pose nothing follows the count
        numbers = np.frombuffer(data, f"{order}f8", count * _NUMBERS, start)
    except (struct.error, ValueError) as error:
        raise ValueError(f"no serialised PoseArray: {error}") from error
    numbers = numbers.reshape(count, _NUMBERS).astype(np.float64, copy=False)
    stamp_ns = seconds * 1_000_000_000 + nanoseconds
    return Poses(stamp_ns, frame, numbers[:, :3], numbers[:, 3:])


def _aligned(at: int, size: int) -> int:
    """The next place, from `at` on, at which a number of `size` bytes may stand."""
    return at + (_ENCAPSULATION - at) % size


def _read_slowly(data: bytes) -> Poses:
    try:
        message = deserialize_message(data, PoseArray)
    except Exception as error:  # rclpy raises RCLError or RuntimeError, as the middleware likes
        raise ValueError(f"no serialised PoseArray: {error}") from error
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
