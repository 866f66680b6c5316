"""Reads poses from ROS 2 bags (mcap or sqlite3) with the package rosbags, without ROS 2."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from proximity_monitor.scene.poses import UNIT_LENGTH

_STAMPED = "geometry_msgs/msg/PoseStamped"
_ARRAY = "geometry_msgs/msg/PoseArray"
_NANO = 1_000_000_000
_FILES = ".mcap", ".db3"
_FOLDER = "give the bag's folder, whose metadata.yaml says what is compressed"
_ZSTD = b"\x28\xb5\x2f\xfd"
_INSTALL = "reading bags needs the package rosbags: pip install '.[bag]'"


@dataclass(frozen=True, eq=False)
class Track:
    """The recorded messages of one topic."""

    bodies: tuple[str, ...]
    times: list[float]
    """Seconds from the start of the bag to the receipt of each message, never decreasing."""
    poses: np.ndarray
    """(messages, bodies, 7): x, y, z in metres, quaternion x, y, z, w of length 1."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """The recorded messages of the chosen topics."""

    tracks: tuple[Track, ...]
    duration_s: float
    """Duration of the whole bag."""


def read_tracks(path: Path, topics: Mapping[str, str | tuple[str, ...]], frame: str) -> Recorded:
    """Read the poses of some topics.

    Args:
        path: the bag's folder, or its .mcap or .db3 file.
        topics: by topic, one body for messages of type PoseStamped, or several for PoseArray.
        frame: the frame_id that each message must have.

    Raises:
        ValueError: the bag cannot be read or does not match `topics` or `frame`, or rosbags is
            missing. The message names the file, the topic and the remedy.
    """
    kinds, messages, start_ns, end_ns = _read(path, topics)
    tracks = []
    for topic, moved in topics.items():
        bodies = (moved,) if isinstance(moved, str) else moved
        expected = _STAMPED if isinstance(moved, str) else _ARRAY
        try:
            _check_kinds(kinds[topic], expected)
            tracks.append(_track(bodies, expected, messages[topic], start_ns, frame))
        except ValueError as error:
            raise ValueError(f"{path}: {topic}: {error}") from None
    return Recorded(tuple(tracks), (end_ns - start_ns) / _NANO)


def _read(
    path: Path, topics: Mapping[str, Any]
) -> tuple[dict[str, set[str]], dict[str, list[tuple[int, bytes]]], int, int]:
    """Return types and serialised messages with times, by topic; begin and end; all times in ns."""
    try:
        from rosbags.rosbag2 import Reader
    except ImportError as error:
        raise ValueError(f"{path}: {_INSTALL} ({error})") from None
    if path.is_file() and path.suffix not in _FILES:
        raise ValueError(
            f"{path}: is not a ROS 2 bag: it is not a {' or '.join(_FILES)} file; {_FOLDER}"
        )
    kinds: dict[str, set[str]] = {}
    messages: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in topics}
    try:
        with Reader(path) as bag:
            for connection in bag.connections:
                kinds.setdefault(connection.topic, set()).add(connection.msgtype)
            used = [each for each in bag.connections if each.topic in topics]
            for connection, stamp_ns, raw in bag.messages(used) if used else ():
                messages[connection.topic].append((stamp_ns, raw))
            start_ns, end_ns = bag.start_time, bag.end_time - 1  # end_time is one past the last
    except Exception as error:
        # For a damaged file, rosbags raises its own ReaderError. It also lets through OSError,
        # struct.error, KeyError, TypeError, AssertionError, and whatever the decompressors and
        # apsw (which reads .db3 files) raise. A list of them all might not fit its next version.
        raise ValueError(f"{path}: cannot be read as a ROS 2 bag: {error!r}") from error
    for topic in topics:
        told = sum(each.msgcount for each in used if each.topic == topic)
        if len(messages[topic]) != told:
            raise ValueError(
                f"{path}: {topic}: {len(messages[topic])} of {told} messages can be read, so the "
                "bag is damaged; record it again, or repair it with the tools of its format"
            )
        if topic not in kinds:
            raise ValueError(
                f"{path}: {topic}: no such topic in the bag; it has {', '.join(sorted(kinds))}"
            )
    return kinds, messages, start_ns, end_ns


def _check_kinds(kinds: set[str], expected: str) -> None:
    if kinds != {expected}:
        raise ValueError(
            f"has messages of type {' and '.join(sorted(kinds))}; a single name needs {_STAMPED}, "
            f"a list of names needs {_ARRAY}"
        )


def _track(
    bodies: tuple[str, ...],
    kind: str,
    messages: Sequence[tuple[int, bytes]],
    start_ns: int,
    frame: str,
) -> Track:
    if not messages:
        raise ValueError("the bag has no messages on this topic")
    from rosbags.serde import SerdeError

    types = _types()
    times: list[float] = []
    numbers = array("d")
    last_ns = 0
    for number, (stamp_ns, raw) in enumerate(messages, 1):
        try:
            message: Any = types.deserialize_cdr(raw, kind)
        except SerdeError as error:
            if raw.startswith(_ZSTD):
                raise ValueError(f"message {number} is compressed; {_FOLDER}") from error
            raise ValueError(f"message {number} cannot be read as {kind}: {error!r}") from error
        found = [message.pose] if kind == _STAMPED else message.poses
        header = message.header
        if header.frame_id != frame:
            raise ValueError(
                f"message {number} is in frame {header.frame_id!r}, but the scene in {frame!r}"
            )
        if stamp_ns < last_ns:
            raise ValueError(f"message {number} is older than the one before it; sort the bag")
        if len(found) != len(bodies):
            raise ValueError(
                f"message {number} has {len(found)} poses, but the scene names {len(bodies)} bodies"
            )
        last_ns = stamp_ns
        times.append((stamp_ns - start_ns) / _NANO)
        for pose in found:
            numbers.extend(_numbers(pose))
    poses = np.array(numbers).reshape(len(messages), len(bodies), 7)
    return Track(bodies, times, _sound(poses))


@cache
def _types() -> Any:
    """Return the message definitions of Jazzy, cached because they take 0.1 s to make."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def _numbers(pose: Any) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _sound(poses: np.ndarray) -> np.ndarray:
    """Normalise the quaternions of poses (n, m, 7); raise ValueError if a row is no pose."""
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
    wrong = ~(np.isfinite(poses).all(axis=-1) & (np.abs(lengths[..., 0] - 1.0) <= UNIT_LENGTH))
    if wrong.any():
        message, body = np.argwhere(wrong)[0].tolist()
        raise ValueError(
            f"message {message + 1} has a pose that is not finite, or whose quaternion is not of "
            "length 1: "
            f"{poses[message, body].tolist()}"
        )
    poses[..., 3:] /= lengths
    return poses
