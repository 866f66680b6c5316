"""Constant-twist paths against screw motions: arcs, helices, and an independent power series."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from proximity_monitor.engine.poses import check_pose
from proximity_monitor.motion import screw
from proximity_monitor.scene import pose_matrix

number = st.floats(-1.0, 1.0)
vectors = st.tuples(number, number, number).map(np.array)
moderate = settings(max_examples=200, deadline=None)


@st.composite
def quaternions(draw):
    raw = np.array(draw(st.tuples(number, number, number, number)))
    assume(np.linalg.norm(raw) > 1e-3)
    return raw / np.linalg.norm(raw)


@st.composite
def walks(draw):
    """Draw a path through key poses at 0, 1, 2, ... seconds."""
    count = draw(st.integers(2, 5))
    positions = np.array([draw(vectors) for _ in range(count)])
    return screw.through(
        np.arange(count, dtype=float),
        positions,
        np.array([draw(quaternions()) for _ in range(count)]),
    )


def at(path, t):
    (pose,) = screw.Paths([path]).at(t)
    return pose


def keys(*poses, times=None):
    """Return the path through pairs of a position and a quaternion."""
    positions, turns = (np.array(each, dtype=float) for each in zip(*poses, strict=True))
    times = np.arange(len(poses)) if times is None else times
    return screw.through(np.array(times, dtype=float), positions, turns)


def turned(axis, degrees):
    half = math.radians(degrees) / 2.0
    return (*(math.sin(half) * np.array(axis) / np.linalg.norm(axis)), math.cos(half))


def assert_rigid(pose):
    check_pose(pose)
    assert np.array_equal(pose[3], [0.0, 0.0, 0.0, 1.0])
    assert np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max() < 3e-15
    assert np.linalg.det(pose[:3, :3]) > 0.0


def exponential(turn, way):
    """Return exp of the twist (turn, way) by its power series, halved first to a norm below 1/2."""
    x, y, z = turn
    twist = np.zeros((4, 4))
    twist[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    twist[:3, 3] = way
    halvings = max(0, math.frexp(math.hypot(*turn, *way))[1] + 1)  # to a norm below 1/2
    step, total = np.eye(4), np.eye(4)
    for n in range(1, 20):
        step = step @ (twist / 2.0**halvings) / n
        total = total + step
    for _ in range(halvings):
        total = total @ total
    return total


@moderate
@given(walks())
def test_a_key_is_met_to_the_bit(path):
    for t, pose in zip(path.times, path.poses, strict=True):
        assert np.array_equal(at(path, t), pose)


@moderate
@given(walks(), st.floats(0.0, 1.0))
def test_every_pose_is_rigid_to_rounding(path, part):
    assert_rigid(at(path, part * path.times[-1]))


@moderate
@given(walks())
def test_a_piece_ends_where_the_next_begins(path):
    for t, pose in zip(path.times[1:], path.poses[1:], strict=True):
        just_before = math.nextafter(t, 0.0)
        # The clock's last digit alone moves a body by 1e-15 of a piece, which is some metres long.
        assert np.abs(at(path, just_before) - pose).max() < 3e-14


@moderate
@given(walks(), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_equal_times_make_equal_motions(path, begin, span):
    """The twist is constant: motion in the body's own frame depends on the time span alone."""
    first, second = at(path, 0.0), at(path, span)
    third, fourth = at(path, begin), at(path, begin + span)
    done, again = np.linalg.solve(first, second), np.linalg.solve(third, fourth)
    assert np.abs(done - again).max() < 2e-14


@moderate
@given(vectors, quaternions(), st.tuples(number, number, number), vectors, st.floats(0.0, 1.0))
def test_a_path_is_the_exponential_of_its_twist(place, turn, axis, way, s):
    """Angles up to sqrt(3) < pi, so the shorter way is the twist itself."""
    start = pose_matrix(place, turn)
    angle = math.hypot(*axis)
    w = math.cos(angle / 2.0)
    scale = math.sin(angle / 2.0) / angle if angle > 0.0 else 0.5
    x, y, z = (scale * part for part in axis)
    bx, by, bz, bw = turn
    after = (  # turn * (x, y, z, w)
        bw * x + bx * w + by * z - bz * y,
        bw * y - bx * z + by * w + bz * x,
        bw * z + bx * y - by * x + bz * w,
        bw * w - bx * x - by * y - bz * z,
    )
    end = start @ exponential(axis, way)
    path = keys((place, turn), (end[:3, 3], after))
    expected = start @ exponential(s * np.array(axis), s * way)
    assert np.abs(at(path, s) - expected).max() < 1e-12


@pytest.mark.parametrize("s", [0.0, 0.25, 0.5, 0.9])
def test_a_quarter_turn_about_a_point_is_an_arc(s):
    path = keys(((1, 0, 0), turned((0, 0, 1), 0)), ((0, 1, 0), turned((0, 0, 1), 90)))
    angle = s * math.pi / 2.0
    pose = at(path, s)
    assert pose[:3, 3] == pytest.approx([math.cos(angle), math.sin(angle), 0.0], abs=1e-15)
    assert pose[:3, 0] == pytest.approx([math.cos(angle), math.sin(angle), 0.0], abs=1e-15)


def test_a_turn_with_a_rise_is_a_helix():
    path = keys(((2, 0, 0), turned((0, 0, 1), 0)), ((-1, math.sqrt(3), 3), turned((0, 0, 1), 120)))
    for s in (0.2, 0.5, 0.8):
        angle = s * math.radians(120)
        expected = [2 * math.cos(angle), 2 * math.sin(angle), 3 * s]
        assert at(path, s)[:3, 3] == pytest.approx(expected, abs=2e-15)


def test_without_a_turn_it_goes_straight():
    turn = turned((1, 2, 3), 50)
    path = keys(((1, 2, 3), turn), ((5, 0, 4), turn))
    middle = at(path, 0.5)
    assert middle[:3, 3] == pytest.approx([3.0, 1.0, 3.5], abs=1e-15)
    assert np.abs(middle[:3, :3] - path.poses[0][:3, :3]).max() < 1e-15


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_turns_the_shorter_way_whatever_the_quaternions_sign(sign):
    there = sign * np.array(turned((0, 0, 1), 270))
    path = keys(((0, 0, 0), turned((0, 0, 1), 0)), ((0, 0, 0), there))
    quarter = at(path, 1.0 / 3.0)
    assert quarter[:3, 0] == pytest.approx([math.cos(math.pi / 6), -0.5, 0.0], abs=1e-15)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_half_a_turn_is_right_handed_about_the_axis_as_it_is_written(sign):
    path = keys(((1, 0, 0), (0, 0, 0, 1)), ((-1, 0, 0), (0, 0, sign, 0)))
    for s in (0.1, 0.5, 0.99):
        angle = sign * s * math.pi
        pose = at(path, s)
        assert_rigid(pose)
        assert pose[:3, 3] == pytest.approx([math.cos(angle), math.sin(angle), 0.0], abs=1e-15)
        assert pose[1, 0] == pytest.approx(math.sin(angle), abs=1e-15)


@pytest.mark.parametrize("short", [1e-9, -1e-9])
def test_close_to_half_a_turn_it_takes_the_shorter_way(short):
    path = keys(((1, 0, 0), (0, 0, 0, 1)), ((-1, 0, 0), turned((0, 0, 1), 180.0 - short)))
    assert at(path, 0.5)[1, 3] == pytest.approx(math.copysign(1.0, short), abs=1e-9)
    assert_rigid(at(path, 0.5))


@pytest.mark.parametrize("half", [1e-3, 1e-8, 1e-16, 1e-160, 1e-308, 5e-324])
def test_a_tiny_turn_about_a_far_point_is_as_good_as_any(half):
    """The turn about (1, 1, 0) is tiny and the way long, so the centre of rotation is far off."""
    turn = np.array([half, half, 0.0, 1.0])
    turn /= np.linalg.norm(turn)
    path = keys(((0, 0, 0), (0, 0, 0, 1)), ((3, -4, 5), turn))
    angle = 2.0 * math.atan2(math.hypot(turn[0], turn[1]), turn[3])
    pose = at(path, 0.5)
    assert_rigid(pose)
    # The place is off the chord by the sagitta; the chord is the way across the axis.
    along = np.array([-0.5, -0.5, 0.0])
    chord = np.array([3.0, -4.0, 5.0]) - along
    aside = np.cross(chord, [math.sqrt(0.5), math.sqrt(0.5), 0.0])
    expected = 0.5 * (along + chord) + 0.5 * math.tan(angle / 4.0) * aside
    assert pose[:3, 3] == pytest.approx(expected, abs=4e-15)
    assert pose[2, 1] == pytest.approx(math.sin(angle / 2.0) * math.sqrt(0.5), rel=1e-12)


@pytest.mark.parametrize("t", [-1.0, 0.0, 0.9, 3.0, 1e9])
def test_a_body_rests_before_its_first_key_and_after_its_last(t):
    path = keys(((0, 0, 0), (0, 0, 0, 1)), ((1, 0, 0), turned((1, 1, 0), 77)), times=(1.0, 2.5))
    assert np.array_equal(at(path, t), path.poses[0] if t < 1.0 else path.poses[1])


def test_one_key_is_a_place_to_rest():
    path = keys(((1, 2, 3), turned((1, 0, 0), 30)))
    assert np.array_equal(at(path, 0.0), path.poses[0])
    assert np.array_equal(at(path, 5.0), path.poses[0])


@moderate
@given(vectors, vectors, quaternions(), vectors, st.floats(-50.0, 50.0), st.floats(0.0, 1.0))
def test_a_hinge_keeps_the_axis_and_turns_by_the_angle(place, origin, turn, axis, angle, s):
    assume(np.linalg.norm(axis) > 1e-3)
    axis = axis / np.linalg.norm(axis)
    rest = pose_matrix(place, turn)
    path = screw.hinged(np.array([0.0, 2.0]), np.array([0.0, angle]), origin, axis, rest)
    pose = at(path, 2.0 * s)
    assert_rigid(pose)
    moved = exponential(s * angle * axis, np.zeros(3))[:3, :3]
    assert np.abs(pose[:3, :3] - moved @ rest[:3, :3]).max() < 1e-11
    assert np.abs(pose[:3, 3] - origin - moved @ (place - origin)).max() < 1e-11


@moderate
@given(vectors, quaternions(), vectors, st.floats(-9.0, 9.0), st.floats(0.0, 1.0))
def test_a_slide_keeps_the_orientation(place, turn, axis, offset, s):
    assume(np.linalg.norm(axis) > 1e-3)
    axis = axis / np.linalg.norm(axis)
    rest = pose_matrix(place, turn)
    pose = at(screw.sliding(np.array([0.0, 1.0]), np.array([0.0, offset]), axis, rest), s)
    assert np.abs(pose[:3, :3] - rest[:3, :3]).max() < 1e-15
    assert pose[:3, 3] == pytest.approx(place + s * offset * axis, abs=1e-14)


@moderate
@given(st.lists(walks(), min_size=1, max_size=4), st.floats(-1.0, 6.0))
def test_paths_together_are_the_paths_alone(paths, t):
    together = screw.Paths(paths).at(t)
    assert np.array_equal(together, np.array([at(path, t) for path in paths]))


def test_no_paths_have_no_poses():
    assert screw.Paths([]).at(1.0).shape == (0, 4, 4)
