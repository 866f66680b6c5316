"""Direction of escape and closing speed, against motions whose answer is known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pair_states import NOWHERE, pair

from proximity_monitor.scene import pose_matrix
from proximity_monitor.scene.relative_motion import Course, relative_motion
from proximity_monitor.scene.state import PairStatus

STILL = Course(np.eye(4), np.eye(4), math.inf)
POINTS = ((0.0, 0.0, 1.0), (0.0, 0.0, 0.5))
small = st.floats(-1.0, 1.0)


def moved(course_or_velocity, seconds=0.01):
    after = np.eye(4)
    before = np.eye(4)
    before[:3, 3] = -np.array(course_or_velocity) * seconds
    return Course(before, after, seconds)


def test_the_moving_body_gets_away_from_the_others_point_to_its_own():
    near = pair(0.5, points=POINTS)
    found = relative_motion(near, {"piston": moved((0, 0, -2.0)), "block": STILL}.get)
    assert (found.body, found.escape.tolist()) == ("piston", [0.0, 0.0, 1.0])
    assert found.closing == pytest.approx(2.0)
    found = relative_motion(near, {"piston": STILL, "block": moved((0, 0, -2.0))}.get)
    assert (found.body, found.escape.tolist()) == ("block", [0.0, 0.0, -1.0])
    assert found.closing == pytest.approx(-2.0), "they part"


def test_where_both_move_the_first_is_named_and_only_the_relative_speed_counts():
    both = {"piston": moved((5.0, 1.0, -3.0)), "block": moved((-4.0, 7.0, -2.0))}
    found = relative_motion(pair(0.5, points=POINTS), both.get)
    assert found.body == "piston"
    assert found.closing == pytest.approx(1.0)


@given(
    turn=st.tuples(small, small, small),
    rate=st.floats(-3.0, 3.0),
    centre=st.tuples(small, small, small),
)
def test_the_speed_of_a_turning_body_is_that_of_its_point(turn, rate, centre):
    axis = np.array(turn)
    length = float(np.linalg.norm(axis))
    axis, rate = (axis / length, rate) if length > 0.1 else (np.array([0.0, 0.0, 1.0]), 0.0)
    seconds = 1e-5

    def at(angle):
        half = angle / 2.0
        return pose_matrix(centre, (*(math.sin(half) * axis), math.cos(half)))

    course = Course(at(0.3 - rate * seconds), at(0.3), seconds)
    found = relative_motion(pair(0.5, points=POINTS), {"piston": course, "block": STILL}.get)
    velocity = rate * np.cross(axis, np.array(POINTS[0]) - np.array(centre))
    assert found.closing == pytest.approx(-velocity[2], abs=1e-3)


def test_overlapping_solids_part_the_short_way_out():
    # A begins 0.2 below B's surface at z = 1.
    deep = pair(-0.2, points=((0.0, 0.0, 0.8), (0.0, 0.0, 1.0)), status=PairStatus.OVERLAPPING)
    found = relative_motion(deep, {"piston": moved((0, 0, -1.0)), "block": STILL}.get)
    assert found.escape.tolist() == [0.0, 0.0, 1.0]
    assert found.closing == pytest.approx(1.0), "it gets deeper"


def test_nothing_is_made_up_where_poses_or_points_do_not_tell_it():
    found = relative_motion(pair(0.5, points=POINTS), lambda name: None)
    assert found.escape.tolist() == [0.0, 0.0, 1.0]
    assert math.isnan(found.closing)
    courses = {"piston": moved((0, 0, 1.0)), "block": STILL}.get
    assert relative_motion(pair(0.0), courses).escape is None, "the points coincide"
    unknown = pair(math.nan, status=PairStatus.UNKNOWN, points=(NOWHERE, NOWHERE))
    assert relative_motion(unknown, courses).escape is None


@pytest.mark.parametrize(("closing", "seconds"), [(0.5, 0.4), (-0.5, math.nan), (0.0, math.nan)])
def test_time_is_left_only_while_they_close(closing, seconds):
    courses = {"piston": moved((0, 0, -closing)), "block": STILL}.get
    found = relative_motion(pair(0.5, points=POINTS), courses)
    assert found.seconds_to(0.2) == pytest.approx(seconds, nan_ok=True)
    if closing > 0.0:
        assert found.seconds_to(-0.1) == 0.0
