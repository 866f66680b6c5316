"""Writes the recording's files: CSV for people and spreadsheets, a bag for the tools of ROS."""

from __future__ import annotations

import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64

from proximity_monitor.ros import messages
from proximity_monitor.scene.recording import Recording, StampedAlert

if TYPE_CHECKING:
    from rosbags.rosbag2 import Writer


def dump(recording: Recording, folder: str, node: str, frame: str) -> list[Path]:
    """Write a recording into a new folder of its own and return the paths of its files.

    Args:
        recording: the recording to write.
        folder: where to make the new folder; empty: the current folder.
        node: full name of the node, whose topics the bag contains.
        frame: the fixed frame.

    Raises:
        OSError: a file or folder cannot be written.
        ImportError: rosbags is not installed; the CSV files are written all the same, as the
            message says.
    """
    name = f"{node.strip('/').replace('/', '_')}_{time.strftime('%Y%m%d_%H%M%S')}"
    try:
        parent = Path(folder or ".").expanduser().resolve()
    except RuntimeError as error:  # "~name", and there is no such user
        raise FileNotFoundError(f"recording_dir {folder}: {error}") from error
    made = _new_folder(parent, name)
    tables = recording.write_csv(made)
    try:
        bag = _write_bag(recording, made / "bag", node, frame)
    except ImportError as error:
        raise ImportError(
            f"wrote {' and '.join(map(str, tables))}, but no bag: {error}; install rosbags"
        ) from error
    return [*tables, bag]


def _new_folder(parent: Path, name: str) -> Path:
    """Make a folder that did not exist; a second dump in the same second gets a number."""
    parent.mkdir(parents=True, exist_ok=True)
    for number in range(1, 1000):
        made = parent / (name if number == 1 else f"{name}_{number}")
        try:
            made.mkdir()
        except FileExistsError:
            continue
        return made
    raise FileExistsError(f"{parent / name} and 998 like it exist already: delete some in {parent}")


def _write_bag(recording: Recording, path: Path, node: str, frame: str) -> Path:
    """Write the clearance and the alerts with their published types and topics."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        clearance = writer.add_connection(
            f"{node}/clearance", "std_msgs/msg/Float64", typestore=types
        )
        alerts = writer.add_connection(
            f"{node}/alerts", "diagnostic_msgs/msg/DiagnosticStatus", typestore=types
        )
        _write_all(writer, recording, clearance, alerts, frame)
    return path


def _write_all(writer: Writer, recording: Recording, clearance, alerts, frame: str) -> None:
    """Write ticks and alerts in the order of time; an alert follows its tick."""
    waiting = deque(recording.alerts)
    ticks = recording.ticks
    for stamp_ns, lower in zip(
        ticks["stamp_ns"].tolist(), ticks["clearance"].tolist(), strict=True
    ):
        while waiting and waiting[0].stamp_ns < stamp_ns:
            _write_alert(writer, alerts, waiting.popleft(), frame)
        writer.write(clearance, stamp_ns, serialize_message(Float64(data=lower)))
    for stamped in waiting:
        _write_alert(writer, alerts, stamped, frame)


def _write_alert(writer: Writer, connection, stamped: StampedAlert, frame: str) -> None:
    seconds, nanoseconds = divmod(stamped.stamp_ns, 1_000_000_000)
    stamp = Time(sec=seconds, nanosec=nanoseconds)
    status = messages.alert(stamped.alert, stamp=stamp, frame=frame)
    writer.write(connection, stamped.stamp_ns, serialize_message(status))
