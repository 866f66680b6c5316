"""A robot on a vehicle: its description comes from a topic, its root moves, its joints move.

One monitor serves all tests. Its overrides name a pair in reverse order, or are misspelt.
"""

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

import rclpy
from geometry_msgs.msg import PoseStamped, TransformStamped
from rcl_interfaces.srv import GetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.sources import _check_topics
from proximity_monitor.scene import load_scene

LOADER = """<robot name="loader">
  <link name="chassis">
    <collision><geometry><box size="0.8 0.6 0.2"/></geometry></collision></link>
  <link name="lamp">
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="fork">
    <collision><geometry><box size="1 0.1 0.1"/></geometry></collision></link>
  <joint name="screws" type="fixed"><parent link="chassis"/><child link="lamp"/>
    <origin xyz="0 0 0.5"/></joint>
  <joint name="lift" type="prismatic"><parent link="chassis"/><child link="fork"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/><limit lower="0" upper="2"/></joint>
</robot>
"""
SCENE = """version: 1
frame: hall
unit: m
rate_hz: 50
budget_ms: 1000
bodies:
  - {name: wall, primitive: {box: {size: [0.2, 9, 9]}}, pose: {position: [5.1, 0, 0]}}
robots:
  - {name: loader, urdf: {topic: robot_description}, root: {frame: base_link}}
pairs:
  watch:
    - {between: [wall, loader]}
    - {between: [wall, loader_fork], thresholds: {warn: 0.3, stop: 0.1}}
"""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture(scope="module")
def hall(tmp_path_factory):
    path = tmp_path_factory.mktemp("hall") / "hall.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def monitor(launch_for_all, hall):
    parameters = {
        "scene": hall,
        "pose_timeout_s": 1.0,
        "thresholdz.warn": 0.2,
        "pairs.loader_fork.wall.warn": 0.25,
        "pairs.wall.loader_lamp.warn": 0.5,
    }
    return launch_for_all("node", "-r", "__ns:=/hall", **parameters)


def told(monitor, text):
    """Wait until the monitor has printed a text."""
    deadline = time.monotonic() + 180.0
    while text not in monitor.text:
        assert time.monotonic() < deadline, monitor.text
        assert monitor.popen.poll() is None, monitor.text
        time.sleep(0.05)


@pytest.fixture(scope="module")
def description(rclpy_context, monitor):
    """Publish the description; check first that the monitor waits, and says for what."""
    import rclpy

    wanted = "waiting for the robot description on /hall/robot_description"
    told(monitor, f"{wanted} (std_msgs/msg/String): it has no publisher yet")
    node = rclpy.create_node("describer", namespace="/hall")
    volatile = node.create_publisher(String, "robot_description", 1)
    told(monitor, "its publisher's durability is volatile, but must be")
    node.destroy_publisher(volatile)
    publisher = node.create_publisher(String, "robot_description", LATCHED)
    publisher.publish(String(data=LOADER))
    told(monitor, "watching at 50 Hz")
    yield publisher
    node.destroy_node()


@pytest.fixture
def loader(new_peer, monitor, description):
    """A peer that keeps publishing the root's pose and the fork's height."""
    peer = new_peer(monitor, namespace="/hall")
    poses = peer.node.create_publisher(PoseStamped, "bodies/loader/pose", 1)
    joints = peer.node.create_publisher(JointState, "joint_states", 1)
    peer.root, peer.lift = None, None

    def tell():
        if peer.root is not None:
            poses.publish(peer.pose(*peer.root, frame="hall"))
        if peer.lift is not None:
            message = JointState(name=["lift"], position=[peer.lift])
            message.header.stamp = peer.node.get_clock().now().to_msg()
            joints.publish(message)

    peer.node.create_timer(0.02, tell)
    return peer


def clearances(peer):
    return {name: float(pair["upper_m"]) for name, pair in peer.pairs().items()}


def settled(peer, **expected):
    """Wait until the links have these clearances (m) to the wall; return all pairs."""

    def reached():
        found = clearances(peer)
        return found and all(
            abs(found[f"wall - loader_{link}"] - metres) < 1e-9 for link, metres in expected.items()
        )

    peer.wait(reached, f"clearances of {expected}", 120.0)
    return peer.pairs()


def states(peer):
    return {name.rpartition("_")[2]: pair["state"] for name, pair in peer.pairs().items()}


AHEAD = (0.0, 0.0, 0.0, 1.0)
RIGHT = (0.0, 0.0, -math.sqrt(0.5), math.sqrt(0.5))


def test_all_links_follow_the_root_and_the_joints(loader):
    loader.root, loader.lift = ((1.0, 0.0, 0.0), AHEAD), 0.0
    settled(loader, chassis=3.6, lamp=3.95, fork=3.0)
    loader.root = ((2.0, 1.0, 0.0), AHEAD)
    settled(loader, chassis=2.6, lamp=2.95, fork=2.0)
    loader.root = ((2.0, 1.0, 0.0), RIGHT)  # it turns the fork away from the wall
    settled(loader, chassis=2.7, lamp=2.95, fork=2.95)
    # The wall ends at a height of 4.5 m. The fork is above it, so its clearance is diagonal.
    loader.root, loader.lift = ((2.0, 0.0, 4.0), AHEAD), 1.0
    settled(loader, chassis=2.6, lamp=2.95, fork=math.hypot(2.0, 0.45))


def test_a_silent_root_makes_all_links_stale_and_silent_joints_theirs(loader):
    loader.root, loader.lift = ((1.0, 0.0, 0.0), AHEAD), 0.0
    pairs = settled(loader, chassis=3.6, fork=3.0)
    assert {pair["state"] for pair in pairs.values()} == {"clear"}
    loader.lift = None
    loader.wait(
        lambda: states(loader) == {"chassis": "clear", "lamp": "clear", "fork": "stale"},
        "a stale fork",
    )
    loader.root, loader.lift = None, 0.0
    loader.wait(lambda: set(states(loader).values()) == {"stale"}, "stale pairs")
    loader.root = ((1.0, 0.0, 0.0), AHEAD)
    loader.wait(lambda: set(states(loader).values()) == {"clear"}, "clear pairs")


def test_an_override_may_name_a_pair_in_either_order(loader):
    names = ["pairs.wall.loader_fork.warn", "pairs.wall.loader_fork.stop"]
    request = GetParameters.Request(names=names)
    answer = loader.call(GetParameters, "get_parameters", request)
    assert [value.double_value for value in answer.values] == [0.25, 0.1]
    assert "pairs.loader_fork.wall" not in loader.monitor.text


def test_an_override_that_names_nothing_is_told(loader):
    text = loader.monitor.text
    nothing = "is set, but no parameter has that name"
    assert f"parameter thresholdz.warn {nothing}; did you mean thresholds.warn?" in text
    assert (
        f"parameter pairs.wall.loader_lamp.warn {nothing}: the scene file has no such pair with"
        " its own thresholds" in text
    )
    assert text.count(nothing) == 2


def test_a_description_that_changes_is_told(loader, description):
    description.publish(String(data=LOADER))  # the same text, as from another publisher
    description.publish(String(data=LOADER.replace("0.8 0.6", "0.9 0.6")))
    told(loader.monitor, "the robot description on /hall/robot_description changed, but the scene")
    assert loader.monitor.text.count("changed, but the scene") == 1


def test_a_transform_moves_the_root(rclpy_context, hall):
    import rclpy

    from proximity_monitor.ros.qos import Incompatible
    from proximity_monitor.ros.sources import Sources

    class Settings:
        frame, body_topics, tf = "hall", False, False

    scene = load_scene(hall, lambda topic: LOADER)
    inputs = Inputs([body.name for body in scene.bodies if body.moving], "hall", ["loader"])
    node = rclpy.create_node("transforms")
    called = []
    sources = Sources(
        node, scene, {}, Settings, inputs, Incompatible(node),
        deform=None, on_poses=lambda: called.append(1),
    )  # fmt: skip
    now = node.get_clock().now()
    transform = TransformStamped(child_frame_id="base_link")
    transform.header.frame_id, transform.header.stamp = "hall", now.to_msg()
    transform.transform.translation.y = 2.0
    transform.transform.rotation.w = 1.0
    sources.take_transforms([transform])
    samples = inputs.samples(now.nanoseconds)
    assert samples["loader_fork"] is None  # its joint has no position yet
    np.testing.assert_array_equal(samples["loader_lamp"].pose[:3, 3], [0.0, 2.0, 0.5])
    assert called == [1]
    sources.destroy()
    node.destroy_node()


def test_two_bodies_on_one_topic_are_refused_behind_a_root_on_it(rclpy_context, tmp_path):
    (tmp_path / "loader.urdf").write_text(LOADER)
    sphere = "primitive: {sphere: {radius: 1}}"
    text = SCENE.replace("{topic: robot_description}", "loader.urdf").replace(
        "frame: base_link", "topic: cart"
    )
    path = tmp_path / "scene.yaml"
    path.write_text(text.replace("robots:", f"  - {{name: a, {sphere}, topic: /cart}}\nrobots:"))
    node = rclpy.create_node("topics")
    settings = SimpleNamespace(body_topics=True)
    _check_topics(node, load_scene(path), {}, settings)
    path.write_text(
        path.read_text().replace("robots:", f"  - {{name: b, {sphere}, topic: cart}}\nrobots:")
    )
    with pytest.raises(ValueError, match=r"topic /cart .*the pose of a .*the pose of b"):
        _check_topics(node, load_scene(path), {}, settings)
    node.destroy_node()
