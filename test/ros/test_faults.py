"""Faulty sources and peers: the node goes on, reports them, and never calls a pair clear."""

import signal
import sys
import time

import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

APART = {"ball": (0.0, 0.0, 0.5), "die": (0.8, 0.1, 0.9)}

SOURCE = """
import os, sys, time
import rclpy
from geometry_msgs.msg import PoseStamped
rclpy.init(args=[])
node = rclpy.create_node("source")
publisher = node.create_publisher(PoseStamped, sys.argv[1], 10)
message = PoseStamped()
message.header.frame_id = "cell"
place = message.pose.position
place.x, place.y, place.z = map(float, sys.argv[2:5])
message.pose.orientation.w = 1.0
period, due = 1.0 / float(sys.argv[5]), time.perf_counter()
while True:
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)
    due += period
    time.sleep(max(0.0, due - time.perf_counter()))
"""


@pytest.fixture
def source(run):
    """Start a process that publishes a body's pose at a rate."""

    def start(name, position, rate_hz):
        topic = f"bodies/{name}/pose"
        return run(sys.executable, "-c", SOURCE, topic, *position, rate_hz)

    return start


def schedule(peer):
    return peer.health()["schedule"] if peer.health() else {}


def at(peer, height, state):
    """Return whether the ball's pair has this state, with the ball at this height (m)."""
    pair = peer.pairs().get("table - ball")
    return (
        pair
        and pair["state"] == state
        and float(pair["upper_m"]) == pytest.approx(height - 0.1, abs=1e-3)
    )


def test_a_source_that_is_killed_is_stale_and_a_new_one_is_heard_at_once(impatient, source):
    peer = impatient
    peer.hold(die=APART["die"])
    first = source("ball", (0.0, 0.0, 0.7), 50)
    peer.wait(lambda: at(peer, 0.7, "clear"), "the source")
    first.stop(signal.SIGKILL)
    peer.wait(lambda: at(peer, 0.7, "stale"), "the ball to be stale where it was last seen")
    peer.wait(lambda: peer.next("clearance").data == 0.0, "no clearance")
    source("ball", (0.0, 0.0, 0.6), 50)
    peer.wait(lambda: at(peer, 0.6, "clear"), "the new source")


def test_a_flood_of_10000_poses_a_second_starves_nothing(peer, source):
    peer.hold(die=APART["die"])
    source("ball", (0.0, 0.0, 0.6), 10_000)
    peer.wait(lambda: at(peer, 0.6, "clear"), "the flood")
    peer.next("diagnostics")
    began = len(peer.received.setdefault("closest_points", []))
    told = time.monotonic()
    for _ in range(3):  # services are answered in between
        assert peer.set_parameters(rel_err=0.0)[0]
        peer.next("diagnostics")
    took_s = time.monotonic() - told
    ticks = len(peer.received["closest_points"]) - began
    assert 5.0 * took_s < ticks < 75.0 * took_s, "at most 50 Hz, neither starved nor driven"
    peer.wait(lambda: {p["state"] for p in peer.pairs().values()} == {"clear"}, "both bodies")
    assert peer.set_parameters(rel_err=-1.0)[0]


@pytest.mark.parametrize(
    "qos",
    [
        QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
        QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    ],
    ids=["best effort", "transient local"],
)
def test_a_source_that_comes_back_with_another_qos_is_heard(peer, qos):
    peer.hold(die=APART["die"])
    publisher = peer.node.create_publisher(PoseStamped, "bodies/ball/pose", qos)

    def heard():
        publisher.publish(peer.pose((0.0, 0.0, 0.65)))
        pair = peer.pairs().get("table - ball")
        return pair and float(pair["upper_m"]) == pytest.approx(0.55, abs=1e-3)

    peer.wait(heard, "its poses")
    peer.node.destroy_publisher(publisher)


def test_a_peer_whose_qos_cannot_fit_is_counted_by_topic(peer):
    def outputs():
        return peer.health().get("outputs", {})

    peer.wait(outputs, "diagnostics")
    name = "incompatible QoS: ~/closest_points"
    before = int(outputs().get(name, 0))
    wanted = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    late = peer.node.create_subscription(
        DiagnosticArray, "proximity_monitor/closest_points", lambda message: None, wanted
    )
    peer.wait(lambda: int(outputs().get(name, 0)) == before + 1, "the count")
    told = [
        status
        for message in peer.received["diagnostics"]
        for status in message.status
        if status.name.endswith("outputs") and status.level == DiagnosticStatus.WARN
    ]
    assert "1 peer with an incompatible quality of service" in told[-1].message
    assert "~/closest_points: a subscriber has an incompatible DURABILITY" in peer.monitor.text
    peer.node.destroy_subscription(late)
    assert {pair["state"] for pair in peer.settle().values()} == {"clear"}


def test_a_transition_that_is_not_possible_does_not_kill_the_node(peer):
    assert not peer.change(Transition.TRANSITION_CONFIGURE)
    assert {pair["state"] for pair in peer.settle().values()} == {"clear"}


def test_a_second_node_of_the_same_name_is_told_of(peer):
    def outputs():
        return peer.health(peer.next("diagnostics"))["outputs"]

    assert outputs()["nodes of the same name"] == "0"
    other = rclpy.create_node("proximity_monitor")
    found = peer.wait(
        lambda: (o := outputs())["nodes of the same name"] == "1" and o, "the diagnostics of both"
    )
    assert "2 nodes are called proximity_monitor" in found["text"]
    assert found["level"] == DiagnosticStatus.WARN
    outputs()
    assert peer.monitor.text.count("another node is called /proximity_monitor") == 1
    other.destroy_node()
    peer.wait(lambda: "no other node is called" in peer.monitor.text, "the other to be gone")


def test_two_monitors_in_one_domain_do_not_disturb_each_other(peer, launch, scene_file, new_peer):
    process = launch("node", "-r", "__ns:=/second", scene=scene_file, pose_timeout_s=1.0)
    other = new_peer(process, "second")
    other.settle(ball=(0.0, 0.0, 0.115))
    peer.settle()
    assert other.pairs()["table - ball"]["state"] == "stop"
    assert peer.pairs()["table - ball"]["state"] == "clear"
    first = {status.name for status in peer.next("diagnostics").status}
    second = {status.name for status in other.next("diagnostics").status}
    assert not first & second


@pytest.mark.long
def test_a_second_monitor_of_the_same_name_and_topics_leaves_the_first_working(
    peer, launch, scene_file
):
    twin = launch("node", scene=scene_file, pose_timeout_s=1.0)
    peer.wait(
        lambda: peer.node.count_publishers("proximity_monitor/closest_points") == 2, "the twin"
    )
    pairs = peer.settle(ball=(0.0, 0.0, 0.15))
    assert pairs["table - ball"]["state"] == "warn"
    assert twin.stop(signal.SIGTERM)[0] == 0
    peer.wait(
        lambda: peer.node.count_publishers("proximity_monitor/closest_points") == 1, "its end"
    )
    assert peer.settle()["table - ball"]["state"] == "clear"
