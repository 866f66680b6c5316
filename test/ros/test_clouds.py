"""Bodies that are point clouds from topics."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from rclpy.duration import Duration
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from proximity_monitor.ros.played import as_cloud

SCENE = """
version: 1
frame: cell
unit: mm
rate_hz: 50
budget_ms: 200
bodies:
  - {name: wall, primitive: {box: {size: [10, 500, 500]}}, pose: {position: [-5, 0, 0]}}
  - {name: camera, primitive: {point: {}}, moving: true}
  - {name: scan, cloud: {topic: scan/points, radius: 10}}
  - {name: seen, cloud: {topic: camera/points, frame: camera}}
thresholds: {warn: 50, stop: 5}
pairs:
  watch:
    - {between: [wall, scan]}
    - {between: [wall, seen]}
"""
HOLE = (math.nan, math.nan, math.nan)


class Sensors:
    """A peer that publishes the camera's pose and the clouds in `clouds`, again and again."""

    def __init__(self, peer):
        self.peer = peer
        self.publishers = {
            name: peer.node.create_publisher(PointCloud2, topic, 1)
            for name, topic in (("scan", "scan/points"), ("seen", "camera/points"))
        }
        self.camera = peer.node.create_publisher(
            type(peer.pose((0, 0, 0))), "bodies/camera/pose", 1
        )
        self.at = (0.0, 0.0, 0.0)
        self.clouds = {}
        peer.node.create_timer(0.04, self._publish)

    def _publish(self):
        self.camera.publish(self.peer.pose(self.at))
        for name, points in self.clouds.items():
            self.send(name, points, "cell" if name == "scan" else "camera")

    def send(self, name, points, frame, late_s=0.0):
        stamp = self.peer.node.get_clock().now() - Duration(nanoseconds=int(late_s * 1e9))
        header = Header(frame_id=frame, stamp=stamp.to_msg())
        self.publishers[name].publish(as_cloud(np.reshape(points, (-1, 3)), header))

    def pair(self, name):
        return self.peer.pairs().get(f"wall - {name}")

    def wait_for_gap(self, name, expected):
        def told():
            pair = self.pair(name)
            known = pair and pair["state"] != "stale" and pair["age_s"] == "0.0000"
            return known and float(pair["upper_m"]) == pytest.approx(expected, abs=1e-6)

        self.peer.wait(told, f"a gap of {expected} m", 180.0)

    def wait_for_state(self, name, state):
        self.peer.wait(lambda: (p := self.pair(name)) and p["state"] == state, f"{name} {state}")

    def inputs(self, key):
        return int(self.peer.health().get("inputs", {}).get(key, 0))


@pytest.fixture(scope="module")
def sensors(launch_for_all, peer_for_all, tmp_path_factory):
    path = tmp_path_factory.mktemp("sensed") / "sensed.yaml"
    path.write_text(SCENE)
    process = launch_for_all("node", "-r", "__ns:=/sensed", scene=path, pose_timeout_s=1.0)
    yield Sensors(peer_for_all(process, "sensed"))
    process.stop()


@pytest.fixture(autouse=True)
def alive(sensors):
    """Restore both clouds before each test except the first."""
    if sensors.clouds:
        sensors.clouds = {"scan": [(0.3, 0.0, 0.0)], "seen": [(0.5, 0.0, 0.0)]}
        sensors.at = (0.0, 0.0, 0.0)
        sensors.wait_for_gap("scan", 0.29)
        sensors.wait_for_gap("seen", 0.5)


def test_a_cloud_is_stale_until_it_comes_and_then_each_message_is_the_whole_of_it(sensors):
    sensors.peer.wait(lambda: sensors.pair("scan"), "the pair", 180.0)
    assert sensors.pair("scan")["state"] == "stale"
    assert "no cloud yet of scan" in sensors.pair("scan")["text"]
    sensors.clouds = {"scan": [(0.3, 0.0, 0.0), HOLE, (0.2, 0.1, 0.1)]}
    sensors.wait_for_gap("scan", 0.19)
    many = np.random.default_rng(0).uniform((0.1, -0.2, -0.2), (0.9, 0.2, 0.2), (5000, 3))
    many[17] = 0.06, 0.0, 0.0
    sensors.clouds = {"scan": many}
    sensors.wait_for_gap("scan", 0.05)
    assert sensors.pair("scan")["state"] == "warn"
    sensors.peer.wait(lambda: sensors.inputs("points dropped: scan") > 0, "the count of holes")


def test_a_cloud_goes_along_with_the_body_in_whose_frame_it_is(sensors):
    sensors.at = (0.2, 0.0, 0.0)
    sensors.wait_for_gap("seen", 0.7)
    sensors.wait_for_gap("scan", 0.29)


@pytest.mark.parametrize("bad", ["silent", "other frame", "not finite", "stale stamp"])
def test_a_cloud_that_stops_or_is_no_good_is_stale(sensors, bad):
    before = sensors.inputs(f"rejected: {bad}")
    del sensors.clouds["scan"]

    def stale():
        if bad == "other frame":
            sensors.send("scan", [(0.3, 0.0, 0.0)], "camera")
        elif bad == "not finite":
            sensors.send("scan", [HOLE, HOLE], "cell")
        elif bad == "stale stamp":
            sensors.send("scan", [(0.3, 0.0, 0.0)], "cell", late_s=60.0)
        pair = sensors.pair("scan")
        return pair and pair["state"] == "stale" and "no recent cloud of scan" in pair["text"]

    sensors.peer.wait(stale, "the cloud to be stale")
    sensors.wait_for_state("seen", "clear")
    if bad != "silent":
        sensors.peer.wait(lambda: sensors.inputs(f"rejected: {bad}") > before, "its count")


def test_a_cloud_without_points_is_clear_only_as_long_as_it_comes(sensors):
    sensors.clouds["scan"] = [(0.04, 0.0, 0.0)]
    sensors.wait_for_state("scan", "warn")
    sensors.peer.forget()
    sensors.clouds["scan"] = np.empty((0, 3))
    sensors.peer.wait(lambda: sensors.peer.pairs() and not sensors.pair("scan"), "it to be gone")
    alert = sensors.peer.wait(lambda: sensors.peer.alerts("wall - scan"), "an alert")[-1]
    assert alert.message.endswith(" -> clear: no points in scan")
    sensors.peer.wait(lambda: sensors.peer.next("clearance").data > 0.4, "a clearance of the rest")
    del sensors.clouds["scan"]
    sensors.wait_for_state("scan", "stale")
    assert "no recent cloud of scan" in sensors.pair("scan")["text"]
    sensors.peer.wait(lambda: sensors.peer.next("clearance").data == 0.0, "no clearance")


def test_a_flood_of_clouds_costs_one_model_a_tick_and_the_latest_wins(sensors):
    before = sensors.inputs("clouds built: scan")
    del sensors.clouds["scan"]
    for k in range(500):
        sensors.send("scan", [(0.3 - 2e-4 * k, 0.0, 0.0)], "cell")
    sensors.clouds["scan"] = [(0.15, 0.0, 0.0)]
    sensors.wait_for_gap("scan", 0.14)
    sensors.peer.next("diagnostics")
    built = sensors.inputs("clouds built: scan") - before
    assert 0 < built < 250, "500 came while there were some ticks"
