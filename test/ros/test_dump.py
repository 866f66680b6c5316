"""The recording's files."""

import csv
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64
from std_srvs.srv import Trigger


def dump(peer):
    return peer.call(Trigger, "dump_recording", Trigger.Request())


def test_a_dump_has_every_tick_and_alert_as_tables_and_as_a_bag(peer, tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    assert peer.set_parameters(recording_dir=str(tmp_path)) == (True, "")
    peer.settle(ball=(0.0, 0.0, 0.15))
    (given,) = peer.wait(lambda: peer.alerts("table - ball"), "an alert")
    answer = dump(peer)
    assert answer.success, answer.message
    ticks, alerts, bag = map(Path, answer.message.split(", "))
    assert all(path.parent.parent == tmp_path for path in (ticks, alerts, bag))

    rows = list(csv.DictReader(alerts.open()))
    assert (rows[-1]["a"], rows[-1]["b"], rows[-1]["new"]) == ("table", "ball", "warn")
    assert f"clear -> warn: {rows[-1]['reason']}" == given.message
    told = {each.key: each.value for each in given.values}
    assert (rows[-1]["lower_m"], rows[-1]["upper_m"]) == (told["lower_m"], told["upper_m"])
    seen = list(csv.DictReader(ticks.open()))
    stamps = [int(row["stamp_ns"]) for row in seen]
    assert stamps == sorted(stamps)
    assert float(seen[-1]["clearance_m"]) == float(told["lower_m"])
    assert (seen[-1]["a"], seen[-1]["b"]) == ("table", "ball")

    with rosbag2.Reader(bag) as reader:
        messages = {}
        for connection, stamp, data in reader.messages():
            messages.setdefault(connection.topic, []).append((stamp, data))
    clearances = messages["/proximity_monitor/clearance"]
    assert [stamp for stamp, _ in clearances] == stamps
    assert deserialize_message(clearances[-1][1], Float64).data == float(seen[-1]["clearance_m"])
    kept = [
        deserialize_message(d, DiagnosticStatus) for _, d in messages["/proximity_monitor/alerts"]
    ]
    assert len(kept) == len(rows)
    assert kept[-1] == given

    assert dump(peer).success, "a second one within the same second"
    assert peer.set_parameters(recording_dir="")[0]


def test_a_dump_that_fails_is_an_answer_and_not_the_end(peer, tmp_path):
    (tmp_path / "file").write_text("in the way")
    assert peer.set_parameters(recording_dir=str(tmp_path / "file" / "folder"))[0]
    answer = dump(peer)
    assert not answer.success
    assert "file" in answer.message
    assert len(peer.settle()) == 3
    assert peer.set_parameters(recording_dir="")[0]
