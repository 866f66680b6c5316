"""The player in its own process, heard over DDS: it plays what its scene names, nothing else."""

from __future__ import annotations

import json
import math
import re
import time

import numpy as np
import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from geometry_msgs.msg import PoseArray, PoseStamped
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import String

from proximity_monitor import engine, motion
from proximity_monitor.ros.clouds import read_points
from proximity_monitor.ros.player import ProximityPlayer
from proximity_monitor.ros.qos import LATCHED
from proximity_monitor.scene import load_scene

NodeNameNonExistentError = rclpy_implementation.NodeNameNonExistentError
BODIES = """
version: 1
frame: shop
unit: mm
rate_hz: 40
bodies:
  - {name: bed, primitive: {box: {size: [9, 9, 9]}}, pose: {position: [0, 0, 0]}}
  - {name: ram, primitive: {box: {size: [9, 9, 9]}}, moving: true}
  - {name: wheel, primitive: {box: {size: [9, 9, 9]}}, moving: true}
  - {name: door, primitive: {box: {size: [9, 9, 9]}}, topic: doors/front}
"""
CRANK = """
  slider_crank:
    crank: wheel
    crank_origin: [0, 0, 0]
    crank_axis: [0, 0, 1]
    slide_direction: [1, 0, 0]
    crank_radius: 20
    rod_length: 80
    rpm: 60
    pistons: {ram: {phase_deg: 0, offset: [0, 0, 0]}}
"""
DOOR = """
  script:
    bodies:
      door: {hinge: {origin: [0, 50, 0], axis: [0, 0, 1], angles_deg: [[0, 0], [2, 720]]}}
"""
DRAWER = """
  script:
    bodies: {door: {slide: {axis: [1, 0, 0], offsets: [[0, 0], [0.3, 235]]}}}
"""
URDF = """
<robot name="swing">
  <link name="post"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <link name="arm"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <joint name="pivot" type="revolute">
    <parent link="post"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
</robot>
"""
ROBOT = """
robots: [{name: swing, urdf: swing.urdf, topic: swing/states}]
"""
PIVOT = """
  script:
    joints: {pivot: {angles_deg: [[0, 0], [1, 90], [2, 0]]}}
"""
BLADDER = """
  deform:
    bodies: {bladder: {field: breathe, amplitude: 0.5, frequency_hz: 2}}
"""
SOFT = "  - {name: bladder, SHAPE, deforming: true, moving: true}\n"


@pytest.fixture
def scene(tmp_path):
    """Return a function that writes a scene and returns its file and its motion."""
    (tmp_path / "swing.urdf").write_text(URDF)

    def write(*effects, more=""):
        path = tmp_path / "scene.yaml"
        path.write_text(BODIES + more + "motion:" + "".join(effects))
        return path, motion.from_scene(load_scene(path))

    return write


class Listener:
    """Subscribes to topics of one player and waits for their messages."""

    def __init__(self, namespace):
        import rclpy

        self.namespace = namespace
        self.node = rclpy.create_node("listener", namespace=namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.heard = {}

    def subscribe(self, kind, topic):
        heard = self.heard[topic] = []
        self.node.create_subscription(kind, topic, heard.append, QoSProfile(depth=10))

    def latched(self, kind, topic):
        heard = self.heard[topic] = []
        self.node.create_subscription(kind, topic, heard.append, LATCHED)

    def set(self, process, **values):
        """Set parameters of the player; return whether it accepted all of them."""
        client = self.node.create_client(SetParameters, "proximity_player/set_parameters")
        parameters = [Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        self.wait(client.service_is_ready, process)
        answer = client.call_async(SetParameters.Request(parameters=parameters))
        self.wait(answer.done, process)
        return all(each.successful for each in answer.result().results)

    def wait(self, condition, process):
        deadline = time.monotonic() + START_DEADLINE_S
        while not (found := condition()):
            running = process.popen.poll() is None
            assert running and time.monotonic() < deadline, process.text
            self.executor.spin_once(timeout_sec=0.02)
        return found

    def first(self, process, count=1):
        """Wait for the first `count` messages of each topic, and return them."""
        self.wait(lambda: all(len(each) >= count for each in self.heard.values()), process)
        return {topic: each[:count] for topic, each in self.heard.items()}

    def topics(self, process, *least):
        """Return the topics that the player publishes for the scene, once `least` is among them."""

        def published():
            try:
                found = self.node.get_publisher_names_and_types_by_node(
                    "proximity_player", self.namespace
                )
            except NodeNameNonExistentError:  # the player is not known yet
                return None
            names = {name for name, _ in found} - {"/rosout", "/parameter_events"}
            names.discard(f"{self.namespace}/proximity_player/motion")
            return names if names >= {f"{self.namespace}/{topic}" for topic in least} else None

        return self.wait(published, process)

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def listener(rclpy_context, request):
    made = Listener(f"/test_{abs(hash(request.node.name))}")
    yield made
    made.close()


@pytest.fixture
def play(launch, listener):
    """Start a player in the listener's namespace; it ends with the test."""
    started = []

    def start(path, **parameters):
        process = launch("player", "-r", f"__ns:={listener.namespace}", scene=path, **parameters)
        started.append(process)
        return process

    yield start
    for process in started:
        process.stop()


def seconds(header):
    return header.stamp.sec + header.stamp.nanosec * 1e-9


def assert_same(message, pose):
    """Check that a Pose message has the position and the x axis of a matrix."""
    p, q = message.position, message.orientation
    assert [p.x, p.y, p.z] == pytest.approx(pose[:3, 3].tolist(), abs=1e-9)
    x, y, z, w = q.x, q.y, q.z, q.w
    column = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
    assert column == pytest.approx(pose[:3, 0].tolist(), abs=1e-9)


def test_all_effects_of_the_scene_are_played_and_told_by_name_and_count(scene, play, listener):
    path, moves = scene(CRANK, DOOR)
    process = play(path, seek_s=0.3, speed=0.0)
    for topic in ("bodies/ram/pose", "bodies/wheel/pose", "doors/front"):
        listener.subscribe(PoseStamped, topic)
    heard = listener.first(process)
    expected = moves.poses(0.3)
    for topic, name in zip(heard, ("ram", "wheel", "door"), strict=True):
        (message,) = heard[topic]
        assert message.header.frame_id == "shop"
        assert_same(message.pose, expected[name])
    (line,) = [line for line in process.text.splitlines() if "published at" in line]
    assert line.endswith(
        "slider_crank: 2 bodies, 60 rpm; script: 1 body, 2 s in a loop, "
        "published at 40 Hz, speed 0, from 0.3 s"
    )


@pytest.mark.parametrize(
    ("effect", "told", "bodies"),
    [
        (
            CRANK,
            "slider_crank: 2 bodies, 60 rpm, published",
            ("bodies/ram/pose", "bodies/wheel/pose"),
        ),
        (DOOR, "script: 1 body, 2 s in a loop, published", ("doors/front",)),
    ],
)
def test_nothing_is_published_that_the_scene_does_not_name(
    scene, play, listener, effect, told, bodies
):
    path, _ = scene(effect)
    process = play(path)
    for topic in bodies:
        listener.subscribe(PoseStamped, topic)
    listener.first(process)
    topics = listener.topics(process, *bodies)
    assert topics == {f"{listener.namespace}/{topic}" for topic in bodies}
    (line,) = [line for line in process.text.splitlines() if "published at" in line]
    assert line.partition("]: ")[2].startswith(told)


def test_in_bulk_one_message_has_all_moving_bodies_in_the_scenes_order(scene, play, listener):
    path, moves = scene(DOOR, CRANK)
    process = play(path, bulk="true", rate_hz=100.0)
    listener.subscribe(PoseArray, "poses")
    first, *_, last = listener.first(process, 20)["poses"]
    assert first.header.frame_id == "shop"
    assert listener.topics(process, "poses") == {f"{listener.namespace}/poses"}
    # The whole motion looks the same after one second; the wheel's angle gives the time.
    times = []
    for message in (first, last):
        ram, wheel, door = message.poses
        times.append(math.atan2(wheel.orientation.z, wheel.orientation.w) / math.pi)
        expected = moves.poses(times[-1])
        for pose, name in ((ram, "ram"), (wheel, "wheel"), (door, "door")):
            assert_same(pose, expected[name])
    passed = seconds(last.header) - seconds(first.header)
    assert (times[1] - times[0]) % 1.0 == pytest.approx(passed % 1.0, abs=1e-6)


def angle(message):
    """Return the rotation about z, in turns."""
    turn = message.pose.orientation
    return math.atan2(turn.z, turn.w) / math.pi % 1.0


def test_the_motion_is_paused_resumed_and_sought_while_it_runs(scene, play, listener):
    path, _ = scene(CRANK)  # a turn a second
    process = play(path, speed=0.02)
    told, heard = "proximity_player/motion", listener.heard
    listener.subscribe(PoseStamped, "bodies/wheel/pose")
    listener.latched(String, told)
    listener.first(process)

    def moment(message, motion):
        """Return the moment of the motion (s) at a pose's stamp, by the published motion."""
        passed = seconds(message.header) - motion["stamp_s"]
        return motion["moment_s"] + passed * motion["speed"]

    def follows(count, **expected):
        """Return the last published motion if it is as expected and `count` poses follow it."""
        motion, poses = json.loads(heard[told][-1].data), heard["bodies/wheel/pose"]
        since = [m for m in poses if seconds(m.header) > motion["stamp_s"]]
        if len(since) < count or any(motion[k] != pytest.approx(v) for k, v in expected.items()):
            return None
        for each in since:
            assert angle(each) == pytest.approx(moment(each, motion) % 1.0, abs=1e-6)
        return motion

    listener.wait(lambda: follows(3, speed=0.02, period_s=1.0), process)
    listener.set(process, speed=0.0)
    paused = listener.wait(lambda: follows(5, speed=0.0), process)
    assert 0.0 < paused["moment_s"] < 0.9
    listener.set(process, speed=0.01)
    resumed = listener.wait(lambda: follows(3, speed=0.01), process)
    assert resumed["moment_s"] == paused["moment_s"]
    listener.set(process, seek_s=0.25)
    sought = listener.wait(lambda: follows(3, moment_s=0.25), process)
    assert sought["speed"] == 0.01
    assert not listener.set(process, speed=-1.0)
    assert not listener.set(process, seek_s=math.nan)


def play_here(listener, path, moves, **parameters):
    """Run a player in this process to its end, and return it."""
    overrides = [
        Parameter(name, value=v) for name, v in ({"scene": str(path)} | parameters).items()
    ]
    player = ProximityPlayer(moves, parameter_overrides=overrides, namespace=listener.namespace)
    listener.executor.add_node(player)
    deadline = time.monotonic() + START_DEADLINE_S
    while not player.finished and time.monotonic() < deadline:
        listener.executor.spin_once(timeout_sec=0.02)
    for _ in range(5):
        listener.executor.spin_once(timeout_sec=0.02)
    player.destroy_node()
    return player


def test_a_motion_that_is_played_once_ends_at_its_last_pose(scene, listener):
    path, moves = scene(DRAWER)
    listener.subscribe(PoseStamped, "doors/front")
    player = play_here(listener, path, moves, loop=False, rate_hz=33.0)
    assert player.fault == ""
    assert listener.heard["doors/front"][-1].pose.position.x == pytest.approx(0.235, abs=1e-15)


def test_a_motion_that_cannot_go_on_is_told_and_ends_the_player(scene, listener):
    path, moves = scene(DRAWER)

    def fail(t):
        raise ValueError("door: beyond 1e45 m")

    moves.poses = fail
    player = play_here(listener, path, moves)
    assert player.fault == f"{path}: motion: door: beyond 1e45 m"


def test_joints_are_published_on_the_topic_of_their_robot(scene, play, listener):
    path, _ = scene(PIVOT, more=ROBOT)
    process = play(path, seek_s=0.5, speed=0.0)
    listener.subscribe(JointState, "swing/states")
    (message,) = listener.first(process)["swing/states"]
    assert list(message.name) == ["pivot"]
    assert list(message.position) == [pytest.approx(math.pi / 4.0)]
    assert seconds(message.header) > 0.0
    assert listener.topics(process, "swing/states") == {f"{listener.namespace}/swing/states"}
    assert "script: 1 joint, 2 s in a loop, published" in process.text


def test_a_joint_of_several_robots_is_published_for_the_one_that_is_named(scene, play, listener):
    other = ROBOT.replace("]", ", {name: other, urdf: swing.urdf, topic: other/states}]")
    path, _ = scene(PIVOT.replace("pivot:", "swing/pivot:"), more=other)
    process = play(path, seek_s=0.5, speed=0.0)
    listener.subscribe(JointState, "swing/states")
    (message,) = listener.first(process)["swing/states"]
    assert list(message.name) == ["pivot"]


@pytest.mark.parametrize(
    ("effects", "parameters", "told"),
    [
        ((CRANK,), {"bulk": "true"}, "bulk: needs a pose of every moving body, .* drive door; set"),
        ((DOOR,), {"seek_s": -1.0}, "seek_s"),
        ((DOOR,), {"rate_hz": 0.01}, "rate_hz: must be at least 0.1, or -1 for the scene's; not"),
    ],
)
def test_a_player_that_cannot_play_says_why(scene, play, effects, parameters, told):
    path, _ = scene(*effects)
    process = play(path, **parameters)
    assert process.ended() == 1
    assert "Traceback" not in process.text
    assert re.search(told, process.text)


@pytest.mark.parametrize(
    "shape, topic",
    [("primitive: {sphere: {radius: 9}}", "vertices"), ("model: sail.json", "control")],
    ids=["mesh", "surface"],
)
def test_points_of_a_deforming_body_are_a_cloud_in_its_own_frame(
    scene, play, listener, tmp_path, shape, topic
):
    x, y = np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0], indexing="ij")
    sail = engine.Patch(np.stack((x, y, x * y), axis=-1))
    engine.save_geomdl(sail, tmp_path / "sail.json")
    path, moves = scene(BLADDER, DOOR, more=SOFT.replace("SHAPE", shape))
    topic = f"bodies/bladder/{topic}"
    process = play(path, seek_s=0.1, speed=0.0)
    listener.subscribe(PointCloud2, topic)
    listener.subscribe(PoseStamped, "doors/front")
    heard = listener.first(process)
    (cloud,) = heard[topic]
    assert cloud.header.frame_id == "bladder"
    fields = [(field.name, field.datatype) for field in cloud.fields]
    assert fields == [(name, PointField.FLOAT64) for name in "xyz"]
    points = moves.control_points(0.1)["bladder"]
    assert (cloud.width, cloud.height, cloud.row_step) == (len(points), 1, len(cloud.data))
    assert np.array_equal(read_points(cloud), points)
    assert listener.topics(process, *heard) == {f"{listener.namespace}/{topic}" for topic in heard}
    assert "deform: 1 body, breathe at 2 Hz; script: 1 body, 2 s in a loop, " in process.text
