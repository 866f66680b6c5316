"""The slider-crank against the triangle of throw, rod and slide, solved by bisection."""

import math

import numpy as np
import pytest

from proximity_monitor.motion import SliderCrank

RADIUS, ROD = 0.03775, 0.120


def mechanism(**changes):
    values = {
        "crank": "crankshaft",
        "crank_origin": (0.1, -0.2, 0.3),
        "crank_axis": (1.0, 0.0, 0.0),
        "slide_direction": (0.0, 0.0, 1.0),
        "crank_radius": RADIUS,
        "rod_length": ROD,
        "speed": 2.0,
        "pistons": {
            "piston_1": {"phase": 0.0, "offset": (-0.126, 0.0, 0.0)},
            "piston_2": {"phase": math.pi, "offset": (-0.042, 0.0, 0.0)},
            "piston_3": {"phase": 0.7, "offset": (0.0, 0.0, 0.0)},
        },
    }
    return SliderCrank(**values | changes)


def oblique(**changes):
    """Return the mechanism in a frame where none of its directions is a coordinate axis."""
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    slide = np.array([2.0, 1.0, 2.0]) / 3.0
    pistons = {
        "piston_1": {"phase": 0.0, "offset": -0.126 * axis},
        "piston_2": {"phase": math.pi, "offset": 0.042 * axis},
    }
    return mechanism(crank_axis=axis, slide_direction=slide, pistons=pistons, **changes)


def in_line(angle):
    """Return the wrist pin's height above the crank's centre, by bisection on the rod's length."""
    pin = RADIUS * np.array([math.sin(angle), math.cos(angle)])
    low, high = pin[1], pin[1] + ROD
    for _ in range(80):
        middle = 0.5 * (low + high)
        if math.hypot(pin[0], middle - pin[1]) < ROD:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@pytest.mark.parametrize("t", np.linspace(-1.0, 7.0, 41))
def test_height_solves_the_triangle(t):
    poses = mechanism().poses(t)
    for name, phase in (("piston_1", 0.0), ("piston_2", math.pi), ("piston_3", 0.7)):
        assert poses[name][2, 3] - 0.3 == pytest.approx(in_line(2.0 * t + phase), abs=1e-15)
        assert poses[name][1, 3] == -0.2


@pytest.mark.parametrize("make", [mechanism, oblique])
@pytest.mark.parametrize("speed", [2.0, -55.0])
def test_the_turning_crankpin_keeps_its_distance_from_the_wrist_pin(make, speed):
    made = make(speed=speed)
    start = made.poses(0.0)
    crank = start["crankshaft"]
    for name in ("piston_1", "piston_2"):
        # The pin's place in the crank's model: on the line from the axis to the wrist pin at
        # angle 0, towards the wrist pin for phase 0 and away from it for half a turn.
        along = start[name][:3, 3] - crank[:3, 3]
        axis = np.array([1.0, 0, 0]) if make is mechanism else np.array([1.0, 2.0, -2.0]) / 3.0
        upward = along - (along @ axis) * axis
        upward /= np.linalg.norm(upward)
        sign = 1.0 if name == "piston_1" else -1.0
        pin = np.append((along @ axis) * axis + sign * RADIUS * upward, 1.0)
        for t in np.linspace(0.0, 5.0, 57):
            poses = made.poses(t)
            rod = (poses["crankshaft"] @ pin)[:3] - poses[name][:3, 3]
            assert np.linalg.norm(rod) == pytest.approx(ROD, abs=1e-15)


def test_dead_centres():
    made = mechanism(speed=math.pi)
    assert made.poses(0.0)["piston_1"][2, 3] - 0.3 == pytest.approx(ROD + RADIUS, abs=1e-16)
    assert made.poses(1.0)["piston_1"][2, 3] - 0.3 == pytest.approx(ROD - RADIUS, abs=1e-16)
    assert made.poses(1.0)["piston_2"][2, 3] - 0.3 == pytest.approx(ROD + RADIUS, abs=1e-16)


@pytest.mark.parametrize("make", [mechanism, oblique])
def test_every_pose_is_a_rigid_motion(make):
    for t in (-3.0, 0.0, 0.1, 1e6):
        poses = make().poses(t)
        assert set(poses) == set(make().bodies)
        for pose in poses.values():
            assert pose.shape == (4, 4)
            assert pose.dtype == np.float64
            assert np.array_equal(pose[3], [0.0, 0.0, 0.0, 1.0])
            assert np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max() < 1e-15
            assert np.linalg.det(pose[:3, :3]) > 0.0


def test_the_crank_turns_right_handed_about_its_axis():
    quarter = mechanism(speed=math.pi / 2).poses(1.0)["crankshaft"]
    assert quarter[:3, 3] == pytest.approx([0.1, -0.2, 0.3])
    assert quarter[:3, :3] @ [1.0, 0.0, 0.0] == pytest.approx([1.0, 0.0, 0.0])
    assert quarter[:3, :3] @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.parametrize("speed", [2.0, -2.0, 300.0])
def test_poses_repeat_after_a_period(speed):
    made = mechanism(speed=speed)
    assert made.period_s == pytest.approx(2.0 * math.pi / abs(speed))
    now, later = made.poses(0.3), made.poses(0.3 + made.period_s)
    for name, pose in now.items():
        assert np.abs(pose - later[name]).max() < 1e-12


def test_a_crank_at_rest_has_no_period():
    made = mechanism(speed=0.0)
    assert made.period_s is None
    assert np.array_equal(made.poses(0.0)["piston_3"], made.poses(9.0)["piston_3"])


def test_it_says_what_it_is():
    assert mechanism(speed=2.0 * math.pi).describe() == "slider_crank: 4 bodies, 60 rpm"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"crank_radius": 0.0}, "crank_radius: must be positive"),
        ({"rod_length": RADIUS}, "rod_length: .* must exceed crank_radius"),
        ({"speed": math.nan}, "speed: nan is not finite"),
        ({"crank_axis": (2.0, 0.0, 0.0)}, "crank_axis: must be a unit vector"),
        ({"crank_axis": (0.0, 0.0, 0.0)}, "crank_axis: must be a unit vector"),
        ({"crank_axis": (0.0, 0.0, 1.0)}, "slide_direction: must be perpendicular"),
        ({"slide_direction": (0.0, 1.0)}, "slide_direction: needs three numbers"),
        ({"crank_origin": (0.0, math.inf, 0.0)}, "crank_origin: .* is not finite"),
        ({"pistons": {}}, "pistons: must name at least one piston"),
        ({"pistons": {"crankshaft": {"phase": 0.0, "offset": (0, 0, 0)}}}, "pistons: .* the crank"),
        (
            {"pistons": {"p": {"phase": 0.0, "offset": (0, 0.01, 0)}}},
            r"pistons\.p\.offset: must be parallel",
        ),
    ],
)
def test_bad_values_are_refused_by_key(changes, words):
    with pytest.raises(ValueError, match=r"slider_crank\." + words):
        mechanism(**changes)


def test_time_must_be_finite():
    with pytest.raises(ValueError, match=r"t: must be finite \(got nan\)"):
        mechanism().poses(math.nan)
