"""Reading the monitor's messages from their bytes, against rclpy's own serialisation."""

import contextlib
import dataclasses

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from proximity_monitor import cdr, engine
from proximity_monitor.cdr import as_octahedral, from_octahedral
from proximity_monitor.display import received, state
from proximity_monitor.display.connection import silent_bodies
from proximity_monitor.display.inbox import Inbox
from proximity_monitor.display.received import (
    OfAnotherSceneError,
    read_pairs,
    read_parts,
    read_poses,
)
from proximity_monitor.display.signs import feature
from proximity_monitor.display.state import LEVELS, STATUSES, Body, Frame, SceneInfo, Unit
from proximity_monitor.ros.pairs_message import PairsMessage, checksum
from proximity_monitor.ros.poses_message import PosesMessage
from proximity_monitor.scene import Thresholds
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.state import PairState, PairStatus, PoseSample, as_arrays


def pair(i, status, lower, upper, silent=(), names=("piston_1", "block")):
    nowhere = np.full(3, np.nan)
    known = status is not PairStatus.UNKNOWN
    return PairState(
        a=names[0],
        b=names[1],
        lower=lower,
        upper=upper,
        point_a=np.array([0.1 + i, -0.2, 3e-9]) if known else nowhere,
        point_b=np.array([0.1 + i, -0.2, 0.5]) if known else nowhere,
        status=status,
        age_s=0.25,
        silent=silent,
        session_min=upper,
        session_min_lower=lower,
        index=i,
    )


ONE = [pair(0, PairStatus.EXACT, 0.1, 0.1)]


def told(pairs, levels, frame="world", silent=None):
    """Return the message of a tick, and the scene as ~/scene tells it."""
    arrays = as_arrays(pairs)
    made = PairsMessage(arrays.names, frame)
    data = made.serialised(
        arrays,
        levels,
        stamp=Time(sec=5, nanosec=500_000_000),
        pose_stamp_ns=lambda name: 4_000_000_000,
        silent=silent or {},
    )
    return data, scene_of(arrays.names, made.words)


def scene_of(names, words=()):
    bodies = tuple(Body(name, True, None, False, "") for name in names)
    return SceneInfo(
        "cell", "", "world", Unit("mm", 1e-3), bodies, frozenset(), 1, Thresholds(2, 1, 0), {},
        False, {}, checksum=checksum(names), words=tuple(words),
    )  # fmt: skip


@pytest.mark.parametrize("frame", ["w", "wo", "wor", "worl", "world"])
def test_pairs_are_read_as_the_monitor_writes_them(frame):
    pairs = [
        pair(0, PairStatus.EXACT, 0.1, 0.1),
        pair(1, PairStatus.BOUNDED, 0.02, 0.3, ("block",), ("a", "block")),
        pair(2, PairStatus.UNKNOWN, np.nan, np.nan, ("a", "b"), ("a", "b")),
        pair(3, PairStatus.OVERLAPPING, -0.2, -0.1),
    ]
    levels = {0: Level.CLEAR, 1: Level.STALE, 2: Level.STALE, 3: Level.STOP}
    stamp_s, read = read_pairs(*told(pairs, levels, frame))
    assert stamp_s == 5.5
    assert read.names == (("piston_1", "block"), ("a", "block"), ("a", "b"), ("piston_1", "block"))
    np.testing.assert_array_equal(read.lower, [0.1, 0.02, np.nan, -0.2])
    np.testing.assert_array_equal(read.upper, [0.1, 0.3, np.nan, -0.1])
    assert [STATUSES[code] for code in read.status] == [p.status.value for p in pairs]
    assert [LEVELS[code] for code in read.level] == ["clear", "stale", "stale", "stop"]
    np.testing.assert_array_equal(read.points[0], [[0.1, -0.2, 3e-9], [0.1, -0.2, 0.5]])
    assert np.isnan(read.points[2]).all()
    np.testing.assert_array_equal(read.stamp_s, [4.0, 4.0, np.nan, 4.0])
    np.testing.assert_array_equal(read.age_s, [0.25, 0.25, np.nan, 0.25])
    assert read.silent == ("", "no recent pose of block", "no pose yet of a and b", "")
    assert read.silent_bodies == {1: ("block",), 2: ("a", "b")}
    np.testing.assert_array_equal(read.touching, [False, False, False, True])


@pytest.mark.parametrize("names", [("bolt (left)", "M8×40"), ("pose", "arm")])
def test_silent_bodies_are_known_whatever_they_are_called(names):
    silent = [pair(0, PairStatus.EXACT, 0.1, 0.1, names[1:], names)]
    read = read_pairs(*told(silent, {0: Level.STALE}))[1]
    assert read.silent_bodies == {0: names[1:]}
    tick = Frame(5.5, np.zeros((2, 7)), read)
    assert silent_bodies(tick) == {names[1]: "1.5 s"}
    assert silent_bodies(tick) is silent_bodies(tick)  # once, not at each step of the page


def test_why_pairs_are_silent_is_told_anew_only_where_it_changes(monkeypatch):
    silent = [pair(0, PairStatus.EXACT, 0.1, 0.1, ("x of the cell",), ("x of the cell", "y"))]
    data, scene = told(silent, {0: Level.STALE})
    first = read_pairs(data, scene)[1]
    assert first.silent_bodies == {0: ("x of the cell",)}
    monkeypatch.setattr(received, "silence", lambda *_: pytest.fail("it was told anew"))
    assert read_pairs(data, scene)[1].silent == first.silent


def test_features_of_near_pairs_are_read_as_the_monitor_writes_them():
    near = dataclasses.replace(
        pair(1, PairStatus.EXACT, 0.1, 0.1),
        kinds=(engine.Patch, engine.TriangleMesh),
        elements=(4, 12),
        parameters=np.array([[1.0, 0.803846512, 0.0], [0.5, 0.5, 0.0]]),
    )
    pairs = [pair(0, PairStatus.EXACT, 0.1, 0.1), near]
    data, scene = told(pairs, {0: Level.CLEAR, 1: Level.WARN})
    read = read_pairs(data, scene)[1]
    assert read.features == {1: ("patch 4 1 0.803846512", "edge 12 0.5 0.5 0")}
    assert [feature(each) for each in read.features[1]] == [
        "patch 4, u 1.000, v 0.804",
        "edge 12, 0.500, 0.500, 0.000",
    ]


def test_what_a_new_word_means_comes_with_the_scene():
    silent = [pair(0, PairStatus.EXACT, 0.1, 0.1, ("block",))]
    data, scene = told(silent, {0: Level.STALE}, silent={"block": "no recent vertices"})
    assert scene.words[0] == "no recent vertices"
    assert read_pairs(data, scene)[1].silent == ("no recent vertices of block",)
    before = dataclasses.replace(scene, words=())
    assert read_pairs(data, before)[1].silent == ("no news of block",)


def test_a_text_that_is_cut_is_no_text():
    whole = cdr.stamped(0, 0)[:4] + cdr.text("crate")
    assert cdr.Reader(whole).text() == "crate"
    for size in (7, 8, 12, 13):
        with pytest.raises(ValueError, match="ends too early"):
            cdr.Reader(whole[:size]).text()


def test_it_is_a_cloud_of_which_each_point_is_a_pair():
    cloud = deserialize_message(told(ONE, {0: Level.CLEAR})[0], PointCloud2)
    assert (cloud.height, cloud.width, cloud.header.frame_id) == (1, 1, "world")
    assert len(cloud.data) == cloud.row_step == cloud.point_step
    at = {field.name: field.offset for field in cloud.fields}
    numbers = np.frombuffer(cloud.data, np.uint8)
    first = numbers[at["x"] : at["x"] + 24].view("<f8")
    np.testing.assert_array_equal(first, [0.1, -0.2, 3e-9])
    assert numbers[at["lower"] : at["lower"] + 8].view("<f8")[0] == 0.1


def test_unit_vectors_come_back_from_the_octahedron():
    random = np.random.default_rng(8).normal(size=(1000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    axes = np.concatenate((np.eye(3), -np.eye(3), np.zeros((1, 3))))
    vectors = np.concatenate((random, axes, random * (1, 1, 0) / np.hypot(*random.T[:2])[:, None]))
    told = as_octahedral(vectors).astype(np.float32)
    np.testing.assert_allclose(from_octahedral(told), vectors, atol=3e-7)


def test_a_message_without_pairs_is_read():
    assert len(read_pairs(*told([], {}))[1]) == 0


def test_levels_and_statuses_stand_where_their_names_say():
    assert [LEVELS[i] for i in (state.WARN, state.STOP, state.STALE)] == ["warn", "stop", "stale"]
    named = (state.BOUNDED, state.INTERSECTING, state.OVERLAPPING, state.UNKNOWN)
    words = ["bounded", "intersecting", "overlapping", "unknown pose"]
    assert [STATUSES[i] for i in named] == words


def test_what_is_no_pair_is_refused():
    data, scene = told(ONE, {0: Level.CLEAR})
    for name in (b"lower", b"silent_b"):
        with pytest.raises(ValueError, match=f"~/pairs lacks the fields {name.decode()}"):
            read_pairs(data.replace(name, name[:-1] + b"?"), scene)
    with pytest.raises(ValueError, match="~/pairs lacks the fields"):
        read_pairs(serialize_message(PointCloud2(width=1, height=1, point_step=8)), scene)


def test_a_state_of_another_version_is_refused():
    data, scene = told(ONE, {0: Level.CLEAR})
    read_pairs(data, scene)
    for status in (9, 200):
        with pytest.raises(ValueError, match="an unknown level or status"):
            read_pairs(of_another_version(data, status), scene)


def of_another_version(data, status=9):
    """Return the message with an unknown status, which is the last byte of its only pair."""
    assert data[-2:] == b"\0\0"
    return data[:-2] + bytes((status, 0))


def test_pairs_of_another_scene_are_not_taken_for_those_of_this_one():
    data, _ = told(ONE, {0: Level.CLEAR})
    with pytest.raises(OfAnotherSceneError):
        read_pairs(data, scene_of(("piston_1", "lid")))


@pytest.mark.parametrize("read", [read_pairs, read_poses, read_parts])
def test_a_message_that_ends_too_early_is_refused(read):
    whole = {
        read_pairs: told(ONE, {0: Level.CLEAR}),
        read_poses: (serialize_message(PoseArray(poses=[Pose()])),),
        read_parts: (serialize_message(MarkerArray(markers=[marker(1, 1)])),),
    }[read]
    read(*whole)
    data, *scene = whole
    for end in range(len(data)):  # a cut within the last texts may go unnoticed
        with contextlib.suppress(ValueError):
            read(data[:end], *scene)
    with pytest.raises(ValueError):
        read(data[: len(data) // 2], *scene)


def test_ticks_with_the_same_pairs_share_their_names():
    message = told(ONE, {0: Level.CLEAR})
    assert read_pairs(*message)[1].names is read_pairs(*message)[1].names


def test_ticks_that_come_while_the_page_is_busy_are_not_lost():
    inbox = Inbox()
    _, scene = told(ONE, {0: Level.CLEAR})
    inbox.tell(scene=scene)
    ticks = []
    for second in (5, 6, 7):
        stamp = Time(sec=second)
        data = PairsMessage(scene.names, "world").serialised(
            as_arrays(ONE), {0: Level.CLEAR}, stamp=stamp, pose_stamp_ns={}.get, silent={}
        )
        ticks.append((data, serialize_message(PoseArray(header=Header(stamp=stamp)))))
    for data, _ in ticks[:2]:
        inbox.put_pairs(data)
    for _, poses in ticks:  # the two topics are not in step
        inbox.put_poses(poses)
    inbox.put_pairs(ticks[2][0])
    news = inbox.read()
    assert [frame.stamp_s for frame in (*news.passed, news.frame)] == [5.0, 6.0, 7.0]
    news = inbox.read()
    assert (news.frame.stamp_s, news.passed) == (7.0, ())


def test_a_tick_is_of_the_moment_in_which_it_came_and_only_if_it_can_be_read():
    inbox = Inbox()
    pairs, scene = told(ONE, {0: Level.CLEAR})
    stamp = Time(sec=5, nanosec=500_000_000)
    poses = serialize_message(PoseArray(header=Header(stamp=stamp), poses=[Pose()]))
    inbox.tell(scene=scene)
    inbox.put_pairs(pairs)
    assert inbox.read().frame is None
    inbox.put_poses(poses)
    good = inbox.read()
    assert (good.frame.stamp_s, good.unreadable) == (5.5, {})
    inbox.put_pairs(of_another_version(pairs))
    inbox.put_poses(poses)
    bad = inbox.read()
    assert bad.frame is good.frame
    assert bad.frame_at_s == good.frame_at_s
    assert "unknown level" in bad.unreadable["tick"]
    inbox.put_parts(serialize_message(MarkerArray(markers=[marker(1, 1)])))
    assert "tick" in inbox.read().unreadable
    inbox.put_pairs(pairs)
    inbox.put_poses(poses)
    better = inbox.read()
    assert better.frame_at_s > good.frame_at_s
    assert not better.unreadable
    inbox.tell(scene=scene_of(("piston_1", "lid")))
    inbox.put_pairs(pairs)
    inbox.put_poses(poses)
    other = inbox.read()
    assert other.frame is better.frame
    assert not other.unreadable, "it was under way when the scene changed"


def test_another_serialisation_is_refused():
    with pytest.raises(ValueError, match="plain CDR"):
        read_poses(b"\x00\x07\x00\x00" + bytes(40))


@pytest.mark.parametrize("frame", ["", "w", "wo", "wor", "worl", "world"])
def test_poses_are_read_as_rclpy_writes_them(frame):
    poses = PoseArray(header=Header(stamp=Time(sec=1, nanosec=2), frame_id=frame))
    for i in range(3):
        place = Point(x=float(i), y=2.0, z=3.0)
        poses.poses.append(Pose(position=place, orientation=Quaternion(x=0.1, y=0.2, z=0.3, w=0.4)))
    stamp_s, read = read_poses(serialize_message(poses))
    assert stamp_s == pytest.approx(1.000000002, abs=1e-12)
    np.testing.assert_array_equal(read[2], [2.0, 2.0, 3.0, 0.4, 0.1, 0.2, 0.3])


@pytest.mark.parametrize("frame", ["w", "wo", "wor", "worl", "world"])
def test_the_monitor_s_own_pose_messages_are_those_of_rclpy(frame):
    turned = np.array([[0.0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
    made = PosesMessage(["a", "b"], frame).serialised(
        {"a": PoseSample(turned), "b": None}, Time(sec=7, nanosec=8)
    )
    half = np.sqrt(0.5)
    first = Pose(
        position=Point(x=1.0, y=2.0, z=3.0), orientation=Quaternion(x=0.0, y=0.0, z=half, w=half)
    )
    nothing = Pose(orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=0.0))
    header = Header(stamp=Time(sec=7, nanosec=8), frame_id=frame)
    expected = serialize_message(PoseArray(header=header, poses=[first, nothing]))
    stamp_s, read = read_poses(made)
    np.testing.assert_allclose(read, read_poses(expected)[1], atol=1e-15)
    assert stamp_s == read_poses(expected)[0]
    assert len(made) == len(expected)


def marker(i, triangles, **fields):
    points = [Point(x=float(i), y=float(k), z=0.5) for k in range(3 * triangles)]
    fields = {"text": '{"solid": false, "off_m": null}'} | fields
    made = Marker(id=i, ns="parts"[:i], type=Marker.TRIANGLE_LIST, points=points, **fields)
    made.header.frame_id = "cell"[: i + 1]
    made.pose.position.x = i + 0.5
    made.pose.orientation.w = 1.0
    made.color = ColorRGBA(r=0.25, g=0.5, b=0.75, a=1.0)
    return made


@pytest.mark.parametrize("text", ["bolt", "[]", "{}", '{"solid": true, "off_m": "far"}'])
def test_parts_of_another_version_are_refused(text):
    with pytest.raises(ValueError, match="a body in ~/parts cannot be interpreted"):
        read_parts(serialize_message(MarkerArray(markers=[marker(0, 1, text=text)])))


def test_parts_are_read_as_rclpy_writes_them():
    markers = [
        marker(0, 1),
        marker(1, 2, text='{"solid": true, "off_m": 0.25}', mesh_resource="x"),
        marker(2, 0, action=Marker.DELETE),
        marker(3, 3, colors=[ColorRGBA()] * 9),
        marker(4, 1, action=Marker.DELETE),
    ]
    markers[1].mesh_file.data = [1, 2, 3]
    markers[3].texture.data = [1]
    parts = read_parts(serialize_message(MarkerArray(markers=markers)))
    assert [len(part.corners) for part in parts] == [3, 6, 0, 9, 3]
    assert [part.solid for part in parts] == [False, True, False, False, False]
    assert [part.deviation for part in parts] == [np.inf, 0.25, np.inf, np.inf, np.inf]
    assert [part.pose is None for part in parts] == [False, False, True, False, True]
    np.testing.assert_array_equal(parts[3].corners[-1], [3.0, 8.0, 0.5])
    np.testing.assert_array_equal(parts[1].pose, [1.5, 0, 0, 1, 0, 0, 0])
    np.testing.assert_array_equal(parts[4].colour, [0.25, 0.5, 0.75, 1.0])
