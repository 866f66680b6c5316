"""Joint states from topics: links stand where the joints say, and bad messages are refused."""

import math
import time

import numpy as np
import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from sensor_msgs.msg import JointState

from proximity_monitor.ros.inputs import Inputs, Reason
from proximity_monitor.ros.joints import JointInputs, JointReason

GANTRY = """<robot name="gantry">
  <link name="rail"/>
  <link name="cart"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="arm">
    <collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.04 0.04"/></geometry></collision>
  </link>
  <link name="jaw"><collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link>
  <joint name="run" type="prismatic"><parent link="rail"/><child link="cart"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2"/></joint>
  <joint name="turn" type="revolute"><parent link="cart"/><child link="arm"/>
    <origin xyz="0.1 0 0"/><axis xyz="0 1 0"/><limit lower="-1.6" upper="1.6"/></joint>
  <joint name="grip" type="prismatic"><parent link="arm"/><child link="jaw"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/><limit lower="0" upper="0.1"/></joint>
</robot>
"""
SCENE = """version: 1
frame: cell
unit: mm
rate_hz: 50
budget_ms: 1000
thresholds: {warn: 100, stop: 20}
bodies:
  - {name: floor, primitive: {box: {size: [9000, 9000, 100]}}, pose: {position: [0, 0, -50]}}
robots:
  - name: gantry
    urdf: gantry.urdf
    pose: {position: [0, 0, 1000]}
    offsets: {grip: 50}
pairs: {watch: [{between: [gantry, floor]}]}
"""
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def gantry_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gantry")
    (folder / "gantry.urdf").write_text(GANTRY)
    path = folder / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def gantry(gantry_file):
    from proximity_monitor.scene import load_scene

    return load_scene(gantry_file)


def counting_node():
    """Return a node that counts the joint states that its callbacks have handled."""
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    class Counting(Node):
        dealt_with = 0

        def create_subscription(self, kind, topic, callback, *arguments, **more):
            def counted(message):
                callback(message)
                self.dealt_with += kind is JointState

            return super().create_subscription(kind, topic, counted, *arguments, **more)

    return Counting("bench", parameter_overrides=[Parameter("use_sim_time", value=True)])


class Bench:
    """Joint inputs with a publisher that feeds them; the test sets the node's clock."""

    def __init__(self, scene):
        from rclpy.executors import SingleThreadedExecutor

        self.node = counting_node()
        self.inputs = Inputs([body.name for body in scene.bodies if body.moving], scene.frame)
        self.joints = JointInputs(
            self.node, scene, self.inputs.store_many, forget=self.inputs.forget_pose
        )
        self._publisher = self.node.create_publisher(JointState, "joint_states", 10)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.set_time(100.0)
        self._wait(lambda: self._publisher.get_subscription_count() == 1)

    def close(self):
        self.joints.destroy()
        self._executor.shutdown()
        self.node.destroy_node()

    def _wait(self, condition):
        deadline = time.monotonic() + 20.0
        while not condition():
            assert time.monotonic() < deadline
            self._executor.spin_once(timeout_sec=0.02)

    def set_time(self, seconds):
        from rclpy.time import Time

        self.now_ns = int(seconds * SECOND)
        clock = self.node.get_clock()
        clock.set_ros_time_override(Time(nanoseconds=self.now_ns, clock_type=clock.clock_type))

    def tell(self, late_s=0.0, positions=None, names=None, **joints):
        """Publish positions, stamped `late_s` seconds ago, and wait until they were handled."""
        names = list(joints) if names is None else names
        positions = [float(value) for value in joints.values()] if positions is None else positions
        message = JointState(name=names, position=positions)
        stamp = self.now_ns - int(late_s * SECOND)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
        wanted = self.node.dealt_with + 1
        self._publisher.publish(message)
        self._wait(lambda: self.node.dealt_with == wanted)

    def place(self, body):
        """The position of a body's last good pose, rounded; None without one."""
        sample = self.inputs.samples(self.now_ns)[body]
        return None if sample is None else tuple(np.round(sample.pose[:3, 3], 9).tolist())

    def stale(self, body):
        return self.inputs.samples(self.now_ns)[body].stale

    def counted(self):
        return {reason: n for reason, n in self.joints.rejected.items() if n}


@pytest.fixture
def bench(rclpy_context, gantry):
    made = Bench(gantry)
    yield made
    made.close()


def test_links_stand_where_the_joints_say(bench):
    bench.tell(run=0.5, turn=math.pi / 2)
    assert bench.place("gantry_cart") == (0.5, 0.0, 1.0)
    assert bench.place("gantry_arm") == (0.6, 0.0, 1.0)
    # Turned about y, the arm hangs down. The jaw's joint is at the scene file's offset.
    assert bench.place("gantry_jaw") == (0.65, 0.0, 0.5)
    assert bench.counted() == {}


def test_there_is_no_pose_before_every_joint_has_a_position(bench):
    assert bench.joints.missing() == ["run", "turn"]
    bench.tell(run=0.5)
    assert bench.joints.missing() == ["turn"]
    assert bench.place("gantry_cart") == (0.5, 0.0, 1.0)
    assert bench.place("gantry_arm") is None
    bench.tell(turn=0.0)
    assert bench.joints.missing() == []
    assert bench.place("gantry_arm") == (0.6, 0.0, 1.0)


def test_a_joint_that_is_left_out_keeps_its_position_and_grows_old(bench):
    bench.tell(run=0.5, turn=0.0)
    for step in range(1, 5):
        bench.set_time(100.0 + 0.2 * step)
        bench.tell(turn=0.1 * step)
    # The cart's joint has been silent for 0.8 s, and the arm depends on it.
    assert bench.stale("gantry_cart")
    assert bench.stale("gantry_arm")
    bench.tell(run=0.7)
    assert not bench.stale("gantry_cart")
    assert not bench.stale("gantry_arm")
    assert bench.place("gantry_arm") == (0.8, 0.0, 1.0)


def test_motion_between_two_positions_of_a_slower_joint_counts_as_a_whole(bench):
    """The arm's pose is as old as the position of `run`, while `turn` goes on."""
    bench.tell(run=0.0, turn=0.0)
    bench.set_time(100.1)
    bench.tell(turn=0.5)
    bench.set_time(100.2)
    bench.tell(run=0.0, turn=1.0)
    course = bench.inputs.course("gantry_arm")
    assert course.seconds == pytest.approx(0.2)
    np.testing.assert_allclose(course.before[:3, :3], np.eye(3), atol=1e-12)


def test_a_position_of_the_scene_file_does_not_grow_old(bench):
    bench.tell(run=0.0, turn=0.0)
    bench.set_time(100.4)
    bench.tell(run=0.1, turn=0.0)
    assert not bench.stale("gantry_jaw")
    assert bench.inputs.stamp_ns("gantry_jaw") == bench.now_ns


REFUSED = {
    JointReason.LENGTH: {"names": ["run", "turn"], "positions": [1.0]},
    JointReason.TWICE: {"names": ["run", "run"], "positions": [1.0, 1.0]},
    JointReason.NOT_FINITE: {"run": 1.0, "turn": math.nan},
    JointReason.TOO_FAR: {"run": 1e12},
    JointReason.FUTURE: {"run": 1.0, "late_s": -5.0},
    JointReason.ORDER: {"run": 1.0, "late_s": 0.3},
}


@pytest.mark.parametrize(("reason", "bad"), REFUSED.items(), ids=REFUSED)
def test_a_bad_message_is_refused_as_a_whole_and_counted(bench, reason, bad):
    bench.tell(run=0.5, turn=0.0)
    bench.tell(**bad)
    assert bench.counted() == {reason: 1}
    assert bench.place("gantry_cart") == (0.5, 0.0, 1.0)
    bench.set_time(100.1)
    bench.tell(run=0.6)
    assert bench.place("gantry_cart") == (0.6, 0.0, 1.0)
    assert bench.counted() == {reason: 1}


def test_an_empty_message_changes_nothing(bench):
    bench.tell(run=0.5, turn=0.0)
    bench.tell()
    assert bench.place("gantry_cart") == (0.5, 0.0, 1.0)
    assert bench.counted() == {}


def test_a_stale_message_is_refused_by_its_stamp(bench):
    bench.tell(run=0.5, turn=0.0, late_s=2.0)
    assert bench.place("gantry_cart") is None
    assert bench.inputs.rejected[Reason.STALE] == 3


def test_unknown_joints_are_counted_and_the_others_taken(bench):
    bench.tell(run=0.5, turn=0.0, elbow=1.0, wrist=2.0)
    assert bench.counted() == {JointReason.UNKNOWN: 1}
    assert bench.place("gantry_cart") == (0.5, 0.0, 1.0)


def test_a_joint_beyond_its_limit_is_taken_and_counted(bench):
    bench.tell(run=2.5, turn=0.0)
    assert bench.counted() == {JointReason.LIMIT: 1}
    assert bench.place("gantry_cart") == (2.5, 0.0, 1.0)


def test_after_the_clock_went_back_everything_is_heard_anew(bench):
    bench.tell(run=0.5, turn=0.0)
    bench.set_time(50.0)
    bench.inputs.forget()  # as the monitor does at its next tick
    bench.tell(run=0.7)
    assert bench.counted() == {}
    assert bench.place("gantry_cart") == (0.7, 0.0, 1.0)
    assert bench.joints.missing() == ["turn"]


@pytest.mark.parametrize("topic", ["joint_states", "/joint_states"])
def test_two_robots_may_share_a_topic(rclpy_context, gantry_file, tmp_path, topic):
    """Neither robot counts the other's joints as unknown."""
    from proximity_monitor.scene import load_scene

    (tmp_path / "gantry.urdf").write_text(GANTRY)
    lift = GANTRY.replace("gantry", "lift").replace('name="run"', 'name="lift_run"')
    lift = lift.replace('name="turn"', 'name="lift_turn"').replace(
        'name="grip"', 'name="lift_grip"'
    )
    (tmp_path / "lift.urdf").write_text(lift)
    path = tmp_path / "scene.yaml"
    lift = f"robots:\n  - {{name: lift, urdf: lift.urdf, topic: {topic}}}\n"
    path.write_text(SCENE.replace("robots:\n", lift))
    bench = Bench(load_scene(path))
    try:
        bench.tell(run=0.5, lift_run=-0.5)
        assert bench.counted() == {}
        assert bench.place("gantry_cart") == (0.5, 0.0, 1.0)
        assert bench.place("lift_cart") == (-0.5, 0.0, 0.0)
    finally:
        bench.close()


# Across processes.


@pytest.fixture(scope="module")
def monitor(launch_for_all, gantry_file):
    return launch_for_all("node", "-r", "__ns:=/gantry", scene=gantry_file, pose_timeout_s=1.0)


@pytest.fixture
def robot(new_peer, monitor):
    """A peer of the monitor, with a driver that keeps publishing the positions in `joints`."""
    peer = new_peer(monitor, namespace="/gantry")
    publisher = peer.node.create_publisher(JointState, "joint_states", 10)
    peer.joints = {}

    def tell():
        if peer.joints:
            message = JointState(name=list(peer.joints), position=list(peer.joints.values()))
            message.header.stamp = peer.node.get_clock().now().to_msg()
            publisher.publish(message)

    peer.node.create_timer(0.02, tell)
    return peer


def settled(robot, lowest):
    """Wait until the arm's lower bound is `lowest` (m) and no pair is stale; return all pairs."""

    def near():
        pairs = robot.pairs()
        lower = float(pairs["floor - gantry_arm"]["lower_m"]) if pairs else math.nan
        known = all(pair["state"] != "stale" for pair in pairs.values())
        return pairs if known and abs(lower - lowest) < 1e-9 else None

    return robot.wait(near, f"the arm at {lowest} m", START_DEADLINE_S)


def test_the_monitor_follows_the_joints(robot):
    robot.joints = {"run": 0.0, "turn": 0.0}
    pairs = settled(robot, 0.98)
    assert {pair["state"] for pair in pairs.values()} == {"clear"}
    robot.joints = {"run": 0.3, "turn": math.pi / 2}
    pairs = settled(robot, 0.5)
    assert float(pairs["floor - gantry_cart"]["upper_m"]) == pytest.approx(0.9)
    # The jaw, 20 mm wide, is at the arm's end, and its own joint at the scene file's 50 mm.
    assert float(pairs["floor - gantry_jaw"]["upper_m"]) == pytest.approx(0.49)


def test_joints_that_fall_silent_are_stale_and_never_clear(robot):
    robot.joints = {"run": 0.0, "turn": 0.0}
    settled(robot, 0.98)
    robot.joints = {}
    robot.wait(
        lambda: {pair["state"] for pair in robot.pairs().values()} == {"stale"}, "stale pairs"
    )
    robot.joints = {"run": 0.0, "turn": 0.0}
    robot.wait(
        lambda: {pair["state"] for pair in robot.pairs().values()} == {"clear"}, "clear pairs"
    )


def test_the_diagnostics_count_what_is_wrong_with_joints(robot):
    robot.joints = {"run": 0.0, "turn": 1.7, "elbow": 0.0}

    def counts():
        health = robot.health()
        inputs = health.get("inputs", {})
        return {
            reason: int(inputs.get(f"rejected: {reason}", 0))
            for reason in (JointReason.LIMIT, JointReason.UNKNOWN, JointReason.NOT_FINITE)
        }

    robot.wait(
        lambda: min(counts()[JointReason.LIMIT], counts()[JointReason.UNKNOWN]) > 0, "both counts"
    )
    robot.joints = {"run": math.nan, "turn": 0.0}
    robot.wait(lambda: counts()[JointReason.NOT_FINITE] > 0, "a count")


def test_a_joint_s_first_position_counts_though_measured_before_another_s(
    rclpy_context, all_in_file
):
    bench = Bench(all_in_file)
    bench.tell(grip=0.05)
    bench.tell(late_s=0.1, run=0.0, turn=math.pi / 2)
    assert bench.place("gantry_jaw") == (0.15, 0.0, 0.5)
    assert bench.inputs.stamp_ns("gantry_jaw") == bench.now_ns - SECOND // 10
    bench.close()


@pytest.fixture
def all_in_file(gantry_file):
    from proximity_monitor.scene import load_scene

    known = "offsets: {grip: 50, run: 0}\n    angles_deg: {turn: 0}"
    path = gantry_file.with_name("known.yaml")
    path.write_text(SCENE.replace("offsets: {grip: 50}", known))
    return load_scene(path)


def test_many_unknown_joints_are_told_of_by_some(bench, capfd):
    names = [f"other{i}" for i in range(20_021)]
    for some, last in ((names[:21], "and 1 more joint does"), (names, "and 19980 more joints do")):
        bench.tell(names=some, positions=[0.0] * len(some))
        said = capfd.readouterr().err
        assert said.count("not belong to a robot in the scene") == 21
        assert last in said
    for step in range(5):
        bench.tell(names=[f"{name}.{step}" for name in names], positions=[0.0] * len(names))
    assert len(bench.joints._told) < 30_000


def test_joints_forget_when_they_are_told_that_the_clock_went_back(bench):
    bench.tell(run=0.5, turn=0.0)
    assert bench.joints.missing() == []
    bench.joints.forget()
    assert bench.joints.missing() == ["run", "turn"]
