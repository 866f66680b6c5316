"""Conversions between messages and numbers, tested without a running node."""

import math
from dataclasses import replace
from unittest.mock import MagicMock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from proximity_monitor import engine
from proximity_monitor.display.received import read_parts
from proximity_monitor.ros import messages
from proximity_monitor.ros.cloud_bodies import CloudBodies
from proximity_monitor.ros.diagnostics import Timing
from proximity_monitor.ros.looks import ROUNDNESS, Looks
from proximity_monitor.ros.markers import LABELS, NEAREST, ClearanceMarkers
from proximity_monitor.ros.parts import PartsMessage, to_quaternion
from proximity_monitor.ros.played import as_cloud
from proximity_monitor.scene import Body, Unit, pose_matrix
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.description import Cloud, Point
from proximity_monitor.scene.state import PairState, PairStatus, Tick

MM = Unit("millimetre", 0.001, "mm")
NAN3 = np.full(3, math.nan)


def pair(lower, upper=None, status=PairStatus.EXACT, silent=(), a="left", b="right", index=0):
    known = status is not PairStatus.UNKNOWN
    return PairState(
        a=a,
        b=b,
        lower=lower,
        upper=lower if upper is None else upper,
        point_a=np.zeros(3) if known else NAN3,
        point_b=np.array([0.0, 0.0, lower]) if known else NAN3,
        status=status,
        age_s=0.0,
        silent=silent,
        session_min=math.inf,
        session_min_lower=math.inf,
        index=index,
    )


UNKNOWN = pair(math.nan, status=PairStatus.UNKNOWN, silent=("left",))


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.dot(q, q) > 1e-3))
def test_quaternion_and_matrix_are_one_rotation(values):
    unit = np.array(values) / np.linalg.norm(values)
    rotation = pose_matrix((1.0, 2.0, 3.0), tuple(unit))
    assert rotation[:3, 3].tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(rotation[:3, :3] @ rotation[:3, :3].T, np.eye(3), atol=1e-15)
    back = np.array(to_quaternion(rotation[:3, :3]))
    assert abs(back @ unit) == pytest.approx(1.0, abs=1e-14)
    assert np.linalg.norm(back) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("axis", range(3))
def test_half_turns_have_quaternions_too(axis):
    half = -np.eye(3)
    half[axis, axis] = 1.0
    expected = [0.0] * 4
    expected[axis] = 1.0
    assert list(map(abs, to_quaternion(half))) == expected


@pytest.mark.parametrize(
    ("state", "text"),
    [
        (pair(0.0254), "25.4 mm exact"),
        (pair(0.0101, 0.02, PairStatus.BOUNDED), "10.1..20 mm bounded"),
        (pair(0.0, status=PairStatus.INTERSECTING), "0 mm intersecting"),
        (pair(0.001, silent=("right",)), "1 mm exact, no recent pose of right"),
        (UNKNOWN, "no pose yet of left"),
    ],
)
def test_a_clearance_reads_as_what_it_is(state, text):
    assert messages.clearance_text(state, MM) == text


def told(pairs, levels, frame="world"):
    data = messages.closest_points(
        pairs,
        levels,
        stamp=Time(sec=3, nanosec=4),
        frame=frame,
        unit=MM,
        pose_stamp_ns={"left": 2_000_000_001, "right": None}.get,
    )
    return deserialize_message(data, DiagnosticArray)


@pytest.mark.parametrize("frame", ["", "w", "wo", "wör", "worl"])
@pytest.mark.parametrize("least", [0.5, 0.25, 0.125, 0.0625])
def test_closest_points_are_read_as_they_were_written(frame, least):
    corners = np.array([[1.0, 0.0, 0.0], [0.25, 0.25, 0.5]])
    kinds = engine.TriangleMesh, engine.TriangleMesh
    near = replace(pair(0.5, index=1), kinds=kinds, elements=(7, 0), parameters=corners)
    far = replace(pair(2.0, index=2), session_min_lower=least)
    levels = [Level.STALE, Level.WARN, Level.CLEAR, Level.CLEAR]
    message = told([UNKNOWN, near, far, replace(far, index=3)], levels, frame)
    assert (message.header.stamp, message.header.frame_id) == (Time(sec=3, nanosec=4), frame)
    assert {status.hardware_id for status in message.status} == {frame}
    assert [status.level for status in message.status] == [b"\3", b"\1", b"\0", b"\0"]
    assert {status.name for status in message.status} == {"left - right"}
    assert message.status[1].message == "500 mm exact"
    told_of = [{each.key: each.value for each in status.values} for status in message.status]
    assert (told_of[1]["feature_a"], told_of[1]["feature_b"]) == (
        "vertex 7 1 0 0",
        "face 0 0.25 0.25 0.5",
    )
    assert not any("feature_a" in values for values in (told_of[0], *told_of[2:]))
    assert {float(values["session_min_lower_m"]) for values in told_of[2:]} == {least}


def test_published_bounds_keep_every_digit():
    lower, upper = 0.1 + 0.2, math.nextafter(0.1 + 0.2, 1.0)
    message = told([pair(lower, upper, PairStatus.BOUNDED)], [Level.CLEAR])
    values = {each.key: each.value for each in message.status[0].values}
    assert (float(values["lower_m"]), float(values["upper_m"])) == (lower, upper)
    assert values["stamp"] == "2.000000001"
    assert values["session_min_m"] == "nan"


def test_labels_go_to_pairs_that_are_not_clear_and_to_the_nearest_and_leave_one_by_one():
    marks = ClearanceMarkers("world", MM, size=1.0)
    pairs = [pair(0.1 * (i + 1), index=i) for i in range(6)]
    levels = [Level.CLEAR] * 6
    levels[5] = Level.WARN

    def labels(action):
        message = marks.message(pairs, levels, Time())
        return {m.id for m in message.markers if m.ns == "label" and m.action == action}

    assert labels(Marker.ADD) == {*range(NEAREST), 5}
    levels[5] = Level.CLEAR
    assert labels(Marker.DELETE) == {5}
    assert labels(Marker.DELETE) == set()
    assert {m.action for m in marks.farewell(Time()).markers} == {Marker.DELETE}


def test_labels_are_few_however_many_pairs_are_not_clear():
    marks = ClearanceMarkers("world", MM, size=1.0)
    many = [pair(1.0 / (i + 1), index=i) for i in range(4 * LABELS)]
    markers = marks.message(many, [Level.WARN] * len(many), Time()).markers
    labelled = {m.id for m in markers if m.ns == "label"}
    assert labelled == set(range(3 * LABELS, 4 * LABELS)), "the nearest"


def test_pairs_without_poses_are_not_drawn_and_leave_no_empty_list_behind():
    marks = ClearanceMarkers("world", MM, size=1.0)
    both = [UNKNOWN, pair(0.1, index=1)]
    assert len(marks.message(both, [Level.STALE] * 2, Time()).markers[0].points) == 2
    alone = marks.message([UNKNOWN], [Level.STALE], Time())
    assert {marker.action for marker in alone.markers} == {Marker.DELETE}


def test_every_corner_of_every_body_is_in_the_parts():
    rng = np.random.default_rng(5)
    bodies, models = [], {}
    for i, count in enumerate((1, 2, 7, 1000, 1)):
        name = f"body{i}"
        bodies.append(Body(name, None, None, 1.0, None, "t", (0.1, 0.2, 0.3, 0.4)))
        faces = rng.permutation(3 * count).reshape(-1, 3)
        models[name] = engine.TriangleMesh(rng.normal(size=(3 * count, 3)), faces)
    parts = PartsMessage(bodies, models, "world")
    pose = pose_matrix((1.5, -2.5, 3.5), (0.5, 0.5, 0.5, 0.5))
    for body in bodies:
        parts.place({body.name: pose})
    for i, marker in enumerate(deserialize_message(parts.serialised(), MarkerArray).markers):
        model = models[f"body{i}"]
        points = [(p.x, p.y, p.z) for p in marker.points]
        assert np.array_equal(points, model.vertices[model.faces].reshape(-1, 3))
        assert marker.pose.position.y == -2.5
        assert (marker.id, marker.action, marker.text) == (
            i,
            Marker.ADD,
            '{"solid": false, "off_m": 0.0}',
        )


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (1, 2, 0)])
def test_normals_of_curved_bodies_are_in_the_parts_and_read_by_the_page(order):
    rng = np.random.default_rng(6)
    shapes = (
        engine.TriangleMesh(rng.normal(size=(3, 3)), [[0, 1, 2]]),
        engine.Patch(rng.normal(size=(4, 3, 3)), deviation=0.5),
        engine.Patch(rng.normal(size=(2, 5, 3))),
    )
    models = {f"body{i}": shapes[k] for i, k in enumerate(order)}
    bodies = [Body(name, None, None, 1.0, None, "t", (0.1, 0.2, 0.3, 0.4)) for name in models]
    told = read_parts(PartsMessage(bodies, models, "world").serialised())
    for part, model in zip(told, models.values(), strict=True):
        shown = model.display_mesh(ROUNDNESS * model.radius)
        assert (part.solid, part.deviation) == (model.is_solid, shown.off + model.deviation)
        np.testing.assert_array_equal(part.corners, shown.corners().reshape(-1, 3))
        normals = shown.corner_normals()
        if normals is None:
            assert part.normals is None
        else:
            np.testing.assert_allclose(part.normals, normals.reshape(-1, 3), atol=1e-6)


def test_a_look_is_kept_until_the_shape_changes():
    looks, patch = Looks(), engine.Patch(np.random.default_rng(7).normal(size=(4, 3, 3)))
    before = looks.of(patch)
    assert looks.of(patch) is before
    patch.deform(2.0 * patch.control_points)
    assert looks.of(patch) is not before
    assert np.ptp(looks.of(patch).corners) > 1.5 * np.ptp(before.corners)


@pytest.mark.parametrize("frame", ["", "w", "world", "a_longer_frame_name"])
def test_poses_are_written_into_the_serialised_parts(frame):
    triangle = engine.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    names = ["one", "two", "three"]
    bodies = [Body(n, None, None, 1.0, None, "t", (0.1, 0.2, 0.3, 0.4)) for n in names]
    parts = PartsMessage(bodies, dict.fromkeys(names, triangle), frame)

    def read():
        return deserialize_message(parts.serialised(), MarkerArray).markers

    assert [marker.action for marker in read()] == [Marker.DELETE] * 3
    turned = pose_matrix((1.5, -2.5, 3.5), (0.5, 0.5, 0.5, 0.5))
    parts.place({"two": turned})
    assert [m.action for m in read()] == [Marker.DELETE, Marker.ADD, Marker.DELETE]
    two = read()[1]
    place, turn = two.pose.position, two.pose.orientation
    assert (place.x, place.y, place.z) == (1.5, -2.5, 3.5)
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((0.5, 0.5, 0.5, 0.5))
    assert [(p.x, p.y, p.z) for p in two.points] == [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    assert two.header.frame_id == frame
    parts.place({"two": None})
    assert [marker.action for marker in read()] == [Marker.DELETE] * 3


def test_timing_counts_overruns_of_budget_and_period_and_keeps_a_window():
    timing = Timing()
    assert timing.values()["tick_p99_ms"] == "nan"
    for i in range(2000):
        late = i % 100 == 0
        searched = 0.02 if late else 0.004
        tick = Tick((), searched, budget_s=0.005, searched=(), left=0)
        timing.record(i * 0.01, tick, searched + 0.001, period_s=0.01)
    values = timing.values()
    assert values["rate_achieved_hz"] == "100.00"
    assert values["search_p50_ms"] == "4.000"
    assert values["tick_p50_ms"] == "5.000"
    assert values["budget_overruns"] == values["period_overruns"] == "20"


def test_the_model_of_a_cloud_has_the_deviation_and_the_radius_of_its_body():
    body = Body(
        name="scan", model=None, primitive=Point(), scale=1.0, pose=None, topic=None,
        colour=(1.0, 1.0, 1.0, 1.0), deviation=0.003, cloud=Cloud("scan", 0.01, ""),
    )  # fmt: skip
    node, inputs, made = MagicMock(), MagicMock(), {}
    inputs.judge_shape.return_value = ""
    clouds = CloudBodies(node, [body], "cell", inputs, MagicMock(), made.__setitem__)
    arrive = node.create_subscription.call_args.args[2]
    arrive(serialize_message(as_cloud(np.array([[0.0, 0.0, 0.1]]), Header(frame_id="cell"))))
    clouds.build(1)
    tip, here = engine.points([[0.0, 0.0, 0.0]]), np.eye(4)
    found = engine.distance(made["scan"], here, tip, here)
    assert found.lower == pytest.approx(0.087) and found.upper == pytest.approx(0.093)
