"""Bags written for a test, by the writer of rosbags."""

from __future__ import annotations

from pathlib import Path

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_JAZZY)
STAMPED, ARRAY = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseArray"
NANO = 1_000_000_000
BEGIN_S = 1_700_000_000
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def message(kind, *args):
    return TYPES.types[kind](*args)


def header(stamp_s, frame):
    stamp_ns = round((BEGIN_S + stamp_s) * NANO)
    stamp = message("builtin_interfaces/msg/Time", *divmod(stamp_ns, NANO))
    return message("std_msgs/msg/Header", stamp, frame)


def pose(position, quaternion=UPRIGHT):
    return message(
        "geometry_msgs/msg/Pose",
        message("geometry_msgs/msg/Point", *map(float, position)),
        message("geometry_msgs/msg/Quaternion", *map(float, quaternion)),
    )


def stamped(t, position, quaternion=UPRIGHT, frame="cell"):
    """Return t and a PoseStamped that is recorded and stamped t seconds after the bag's start."""
    return t, message(STAMPED, header(t, frame), pose(position, quaternion))


def array(t, *positions, frame="cell"):
    """Return t and a PoseArray, as `stamped` does."""
    return t, message(ARRAY, header(t, frame), [pose(each) for each in positions])


def write(
    path: Path, storage: StoragePlugin, compression: CompressionMode | None = None, **topics
) -> Path:
    """Write a bag. Each topic is a list of times with messages, or with bytes that are no message.

    The keyword `tool` gives the topic /tool. An empty topic has the type PoseStamped.
    """
    entries = []
    bag = Writer(path, version=9, storage_plugin=storage)
    if compression is not None:
        bag.set_compression(compression, CompressionFormat.ZSTD)
    with bag:
        for name, messages in topics.items():
            kinds = {each.__msgtype__ for _, each in messages if not isinstance(each, bytes)}
            (kind,) = kinds or {STAMPED}
            connection = bag.add_connection(f"/{name}", kind, typestore=TYPES)
            for t, each in messages:
                raw = each if isinstance(each, bytes) else TYPES.serialize_cdr(each, kind)
                entries.append((round((BEGIN_S + t) * NANO), connection, raw))
        for stamp_ns, connection, raw in sorted(entries, key=lambda entry: entry[0]):
            bag.write(connection, stamp_ns, raw)
    return path
