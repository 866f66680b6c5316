"""The pose inputs, fed by hand: many poses at once, in any layout, late, out of order."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

import rclpy
from geometry_msgs.msg import Pose, PoseArray, PoseStamped, TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField

from proximity_monitor.ros import still_clock
from proximity_monitor.ros.bulk import StampedPose, read_pose, read_pose_array
from proximity_monitor.ros.clouds import read_points
from proximity_monitor.ros.inputs import Inputs, Reason
from proximity_monitor.ros.sources import Sources
from proximity_monitor.scene import load_scene, pose_matrix

SECOND = 1_000_000_000
NAMES = ("one", "two", "three")
UNIT = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))


@pytest.fixture
def inputs():
    made = Inputs(NAMES, "cell")
    made.timeout_s = 0.5
    return made


def kept(inputs, now_ns=10 * SECOND):
    """Return the kept position of each body, by name."""
    return {
        name: None if sample is None else sample.pose[:3, 3].tolist()
        for name, sample in inputs.samples(now_ns).items()
    }


def store(inputs, positions, quaternions=UNIT, *, stamp=10 * SECOND, frame="cell"):
    return inputs.store_array(
        np.array(positions, dtype=float), np.array(quaternions), stamp, frame, 10 * SECOND
    )


PLACES = [[1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0]]


@given(
    frame=st.text("abc_", max_size=12),
    numbers=st.lists(st.tuples(*[st.floats(allow_nan=False, width=64)] * 7), max_size=5),
)
def test_a_serialised_array_is_read_as_rclpy_reads_it(frame, numbers):
    message = PoseArray()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = 7, 8
    for x, y, z, a, b, c, d in numbers:
        pose = Pose()
        pose.position.x, pose.position.y, pose.position.z = x, y, z
        turn = pose.orientation
        turn.x, turn.y, turn.z, turn.w = a, b, c, d
        message.poses.append(pose)
    poses = read_pose_array(serialize_message(message))
    assert (poses.stamp_ns, poses.frame) == (7 * SECOND + 8, frame)
    assert np.hstack([poses.positions, poses.quaternions]).tolist() == [list(n) for n in numbers]


@given(
    frame=st.text("abc_", max_size=12),
    numbers=st.tuples(*[st.floats(allow_nan=False, width=64)] * 7),
)
def test_a_serialised_pose_is_read_as_rclpy_reads_it(frame, numbers):
    message = PoseStamped()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = 7, 8
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = numbers
    pose = read_pose(serialize_message(message))
    assert pose == (7 * SECOND + 8, frame, numbers[:3], numbers[3:])


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 64, b"\x63\x01\0\0 no"])
def test_what_is_no_serialised_message_is_refused(data):
    with pytest.raises(ValueError, match="not a serialised PoseArray"):
        read_pose_array(data)
    with pytest.raises(ValueError, match="not a serialised PoseStamped"):
        read_pose(data)


def test_an_array_places_all_bodies_at_one_moment(inputs):
    assert store(inputs, PLACES) == 3
    assert kept(inputs) == dict(zip(NAMES, PLACES, strict=True))
    assert {inputs.stamp_ns(name) for name in NAMES} == {10 * SECOND}
    assert sum(inputs.rejected.values()) == 0


def test_bodies_that_are_not_good_are_counted_one_by_one_and_keep_their_poses(inputs):
    store(inputs, PLACES)
    turns = UNIT.copy()
    turns[2] = 0.0, 0.0, 0.0, 1.1
    assert store(inputs, [[math.nan, 0, 0], [5.0, 0, 0], [6.0, 0, 0]], turns) == 1
    assert kept(inputs) == {"one": [1, 0, 0], "two": [5, 0, 0], "three": [3, 0, 0]}
    assert store(inputs, [[1e12, 0, 0], [7.0, 0, 0], [math.inf, 0, 0]]) == 1
    assert inputs.rejected[Reason.NOT_FINITE] == 2
    assert inputs.rejected[Reason.NOT_UNIT] == inputs.rejected[Reason.TOO_FAR] == 1


@pytest.mark.parametrize("count", [0, 2, 4])
def test_an_array_of_another_length_is_refused_whole(inputs, count):
    assert store(inputs, np.zeros((count, 3)), np.zeros((count, 4))) == 0
    assert inputs.rejected[Reason.LENGTH] == 1
    assert kept(inputs) == dict.fromkeys(NAMES)


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ({"frame": "map"}, Reason.FRAME),
        ({"stamp": 9 * SECOND}, Reason.STALE),
        ({"stamp": 11 * SECOND}, Reason.FUTURE),
    ],
)
def test_a_header_that_is_not_good_refuses_every_pose(inputs, header, reason):
    assert store(inputs, PLACES, **header) == 0
    assert inputs.rejected[reason] == 3
    assert kept(inputs) == dict.fromkeys(NAMES)


def test_order_is_judged_for_each_body_whatever_brought_its_poses(inputs):
    late = np.stack([pose_matrix((9.0, 0, 0), (0, 0, 0, 1))])
    assert inputs.store_many(["two"], late, 10 * SECOND, "cell", 10 * SECOND) == 1
    assert store(inputs, PLACES, stamp=10 * SECOND - 1) == 2
    assert kept(inputs) == {"one": [1, 0, 0], "two": [9, 0, 0], "three": [3, 0, 0]}
    assert inputs.rejected[Reason.ORDER] == 1


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (np.diag([1.0, 1.0, 1.001, 1.0]), Reason.NOT_RIGID),
        (np.diag([1.0, 1.0, -1.0, 1.0]), Reason.NOT_RIGID),
        (np.diag([1.0, 1.0, 1.0, 2.0]), Reason.NOT_RIGID),
        (np.full((4, 4), math.nan), Reason.NOT_FINITE),
        (np.full((4, 4), math.inf), Reason.NOT_FINITE),
        (pose_matrix((0.0, 2e9, 0.0), (0, 0, 0, 1)), Reason.TOO_FAR),
    ],
)
def test_matrices_that_are_no_poses_are_refused(inputs, change, reason):
    poses = np.stack([np.eye(4), change])
    assert inputs.store_many(["one", "two"], poses, 10 * SECOND, "cell", 10 * SECOND) == 1
    assert inputs.rejected[reason] == 1
    assert kept(inputs)["two"] is None


def test_an_attached_bodys_own_poses_are_counted_and_not_kept(inputs):
    inputs.attached = frozenset({"two"})
    assert store(inputs, PLACES) == 2
    pose = StampedPose(10 * SECOND, "cell", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    assert inputs.store("two", pose, 10 * SECOND) == Reason.ATTACHED
    assert inputs.rejected[Reason.ATTACHED] == 2
    assert kept(inputs)["two"] is None


def test_a_course_is_of_the_last_two_moments(inputs):
    assert inputs.course("one") is None
    store(inputs, PLACES, stamp=10 * SECOND - 400_000_000)
    assert inputs.course("one") is None
    store(inputs, [[2.0, 0, 0]] * 3, stamp=10 * SECOND - 300_000_000)
    store(inputs, [[4.0, 0, 0]] * 3, stamp=10 * SECOND - 300_000_000)  # the same moment again
    course = inputs.course("one")
    assert course.seconds == pytest.approx(0.1)
    assert (course.before[0, 3], course.after[0, 3]) == (1.0, 4.0)
    inputs.timeout_s = 0.05
    assert inputs.course("one") is None, "too long ago to tell a speed"


def cloud(points, *, kind=PointField.FLOAT64, big=False, gap=0, rows=1):
    """Return a cloud with an undeclared field before the coordinates and `gap` bytes after them."""
    letter = f"{'>' if big else '<'}{'f8' if kind == PointField.FLOAT64 else 'f4'}"
    size = int(letter[-1])
    record = np.dtype(
        {
            "names": ["i", "z", "y", "x"],
            "formats": ["u4", letter, letter, letter],
            "offsets": [0, 4, 4 + size, 4 + 2 * size],
            "itemsize": 4 + 3 * size + gap,
        }
    )
    data = np.zeros(len(points), record)
    for i, name in enumerate("xyz"):
        data[name] = np.array(points)[:, i]
    fields = [
        PointField(name=name, offset=record.fields[name][1], datatype=kind, count=1)
        for name in "zyx"
    ]
    return PointCloud2(
        height=rows,
        width=len(points) // rows,
        fields=fields,
        is_bigendian=big,
        point_step=record.itemsize,
        row_step=record.itemsize * (len(points) // rows),
        data=data.tobytes(),
    )


POINTS = [[0.5, 1.0, -2.0], [3.0, 4.25, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.5]]


@pytest.mark.parametrize("kind", [PointField.FLOAT32, PointField.FLOAT64])
@pytest.mark.parametrize("layout", [{}, {"big": True}, {"gap": 5}, {"rows": 2}])
def test_vertices_are_read_in_any_layout(kind, layout):
    assert read_points(cloud(POINTS, kind=kind, **layout)).tolist() == POINTS


def test_clouds_that_do_not_fit_their_description_are_refused():
    short = cloud(POINTS)
    short.width = 5
    narrow = cloud(POINTS)
    narrow.point_step = 20
    whole = cloud(POINTS)
    whole.fields[0].datatype = PointField.INT32
    lacking = cloud(POINTS)
    lacking.fields = lacking.fields[:2]
    folded = cloud(POINTS, rows=2)
    folded.row_step = 0  # overlapping rows: a few bytes would describe billions of points
    for bad in (short, narrow, whole, lacking, folded):
        with pytest.raises(ValueError, match="cloud"):
            read_points(bad)


def test_transforms_to_frames_named_like_bodies_are_poses(rclpy_context, world):
    import rclpy

    from proximity_monitor.ros.qos import Incompatible
    from proximity_monitor.ros.sources import Sources

    scene, models = world
    inputs = Inputs(["ball", "die"], "cell")
    inputs.timeout_s = 60.0
    node = rclpy.create_node("transforms")

    class Settings:
        frame, body_topics, tf = "cell", False, False

    called = []
    sources = Sources(
        node, scene, models, Settings, inputs, Incompatible(node),
        deform=None, on_poses=lambda: called.append(1),
    )  # fmt: skip
    now = node.get_clock().now()
    made = []
    for parent, child, x in (("cell", "ball", 1.0), ("cell", "camera", 2.0), ("map", "die", 3.0)):
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id, transform.header.stamp = parent, now.to_msg()
        transform.transform.translation.x = x
        transform.transform.rotation.w = 1.0
        made.append(transform)
    sources.take_transforms(made)
    assert kept(inputs, now.nanoseconds) == {"ball": [1, 0, 0], "die": None}
    assert inputs.rejected[Reason.FRAME] == 1
    assert called == [1]
    sources.destroy()
    node.destroy_node()


def test_a_clock_that_stands_is_told_of_while_ticks_take_all_of_the_time(monkeypatch):
    steady = [0.0]
    monkeypatch.setattr(still_clock.time, "monotonic", lambda: steady[0])
    clock = still_clock.StillClock(SimpleNamespace(ros_time_is_active=True))
    for k in range(20):  # the clock advances: the 0.6 s of a tick do not count
        assert not clock.update(k, 0.5)
        steady[0] += 0.6
        clock.pardon(0.6)
    for _ in range(40):  # the clock stands still
        clock.update(20, 0.5)
        if clock.still:
            break
        steady[0] += 0.02
        clock.pardon(0.02)
    assert clock.still
    assert steady[0] < 20 * 0.6 + 0.02 + 0.5 + 0.05


@pytest.mark.parametrize(
    "topic, told", [("poses", "/poses .*the poses of all"), ("/other", "/other .*the pose of a ")]
)
def test_one_topic_for_two_types_or_two_bodies_is_refused(rclpy_context, tmp_path, topic, told):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "version: 1\nunit: m\nbodies:\n"
        "  - {name: a, primitive: {sphere: {radius: 1}}, topic: other}\n"
        "  - {name: b, primitive: {sphere: {radius: 1}}, topic: " + topic + "}\n"
    )
    scene, node = load_scene(path), rclpy.create_node("topics")
    settings = SimpleNamespace(tf=False, body_topics=True, frame=scene.frame)
    with pytest.raises(ValueError, match=f"topic {told}.*of b"):
        Sources(
            node, scene, {}, settings, None, None, deform=lambda *_: None, on_poses=lambda: None
        )
    assert not any("other" in each.topic_name for each in node.subscriptions)
    node.destroy_node()
