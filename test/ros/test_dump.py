"""The files of a recording that is dumped."""

import csv
import os
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64
from std_srvs.srv import Trigger


def dump(peer):
    return peer.call(Trigger, "dump_recording", Trigger.Request())


def test_a_dump_has_every_tick_and_alert_as_tables_and_as_a_bag(peer, tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    assert peer.set_parameters(recording_dir=str(tmp_path)) == (True, "")
    peer.settle(ball=(0.0, 0.0, 0.15))
    given = peer.wait(lambda: peer.alerts("table - ball"), "an alert")[-1]
    answer = dump(peer)
    assert answer.success, answer.message
    ticks, alerts, bag = map(Path, answer.message.split(", "))
    assert all(path.parent.parent == tmp_path for path in (ticks, alerts, bag))

    rows = list(csv.DictReader(alerts.open()))
    assert (rows[-1]["a"], rows[-1]["b"], rows[-1]["new"]) == ("table", "ball", "warn")
    assert f"{rows[-1]['old']} -> warn: {rows[-1]['reason']}" == given.message
    told = {each.key: each.value for each in given.values}
    assert (rows[-1]["lower_m"], rows[-1]["upper_m"]) == (told["lower_m"], told["upper_m"])
    seen = list(csv.DictReader(ticks.open()))
    stamps = [int(row["stamp_ns"]) for row in seen]
    assert stamps == sorted(stamps)
    (tick,) = [row for row in seen if row["stamp_ns"] == rows[-1]["stamp_ns"]]
    assert float(tick["clearance_m"]) == float(told["lower_m"])
    assert (tick["a"], tick["b"]) == ("table", "ball")

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


@pytest.mark.parametrize("folder", ["file/folder", "~nobody-has-this-name/folder"])
def test_a_dump_that_fails_is_an_answer_and_not_the_end(peer, tmp_path, folder):
    (tmp_path / "file").write_text("in the way")
    where = folder if folder.startswith("~") else str(tmp_path / folder)
    assert peer.set_parameters(recording_dir=where)[0]
    answer = dump(peer)
    assert not answer.success
    assert folder in answer.message
    assert len(peer.settle()) == 3
    assert peer.set_parameters(recording_dir="")[0]


@pytest.fixture
def slow(launch, scene_file, tmp_path, new_peer):
    """A peer of a monitor whose dump writes the tables and then waits for the file "go"."""
    (tmp_path / "rosbags").mkdir()
    (tmp_path / "rosbags" / "__init__.py").touch()
    (tmp_path / "rosbags" / "rosbag2.py").write_text(
        "import pathlib, time\n"
        f"while not pathlib.Path({str(tmp_path / 'go')!r}).exists():\n"
        "    time.sleep(0.01)\n"
        "raise ImportError('it goes')\n"
    )
    path = f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    process = launch(
        "node",
        *("-r", "__ns:=/slow"),
        scene=scene_file,
        recording_dir=tmp_path / "written",
        environment={"PYTHONPATH": path},
    )
    peer = new_peer(process, "slow")
    peer.settle()
    yield peer
    (tmp_path / "go").touch()


def begin(peer, folder):
    """Ask for a dump and wait until its tables exist; return the future of the answer."""
    answer = peer.client(Trigger, "dump_recording").call_async(Trigger.Request())
    peer.wait(lambda: list(folder.glob("written/*/alerts.csv")), "the tables")
    return answer


def test_the_watch_goes_on_while_a_dump_is_written(slow, tmp_path):
    answer = begin(slow, tmp_path)
    slow.forget()
    slow.wait(lambda: len(slow.received.get("closest_points", ())) > 20, "results")
    slow.wait(lambda: {pair["state"] for pair in slow.pairs().values()} == {"clear"}, "poses")
    assert not answer.done()
    (tmp_path / "go").touch()
    slow.wait(answer.done, "the answer")
    assert not answer.result().success
    assert "no bag: it goes" in answer.result().message


def test_a_monitor_that_is_cleaned_up_while_it_writes_lives_on(slow, tmp_path):
    answer = begin(slow, tmp_path)
    assert slow.change(Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP)
    (tmp_path / "go").touch()
    slow.wait(lambda: "no bag: it goes" in slow.monitor.text, "its end")
    assert slow.change(Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)
    slow.settle()
    assert not answer.done(), "the service is another one"
