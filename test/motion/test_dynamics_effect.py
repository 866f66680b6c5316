"""The effect `dynamics` of a scene file: settings, time, limits, and the bundled scenes."""

import itertools

import numpy as np
import pytest
from dynamics_bodies import nearest

from proximity_monitor import motion, scene

SCENE = """
version: 1
frame: world
unit: mm
bodies:
  - {name: crate, primitive: {box: {size: [100, 100, 100]}}, moving: true}
  - {name: drone, primitive: {box: {size: [100, 100, 100]}}, moving: true}
  - {name: table, primitive: {box: {size: [900, 900, 100]}}, pose: {position: [0, 0, -50]}}
motion:
  dynamics:
    bodies:
      crate:
        density: 500
        pose: {position: [0, 0, 300]}
        velocity: [200, 0, 0]
        spin_deg_s: [0, 0, 180]
"""
CONTACTS = """
    gravity: [0, 0, -9.81]
    contacts: {method: impulse}
    friction: 0.5
"""


def load(tmp_path, text, **options):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return motion.from_scene(scene.load_scene(path), **options)


def same(one, other):
    return all(np.array_equal(one[name], other[name]) for name in one)


def test_only_what_is_named_acts(tmp_path):
    made = load(tmp_path, SCENE)
    assert made.bodies == ("crate",)
    assert made.period_s is None
    assert made.describe() == "dynamics: 1 body, steps of 2.5 ms"
    pose = made.poses(1.0)["crate"]
    assert pose[:3, 3] == pytest.approx([0.2, 0.0, 0.3])
    assert pose[:3, 0] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)  # half a turn
    assert made.world.searches == made.world.rubbings == 0


def test_forces_are_in_si_whatever_the_unit(tmp_path):
    made = load(tmp_path, SCENE + "    gravity: [0, 0, -9.81]\n")
    assert made.poses(0.1)["crate"][2, 3] == pytest.approx(0.3 - 0.5 * 9.81 * 0.01)


def test_contacts_meet_every_fixed_body(tmp_path):
    made = load(tmp_path, SCENE + CONTACTS)
    for t in np.arange(0.0, 1.5, 0.01):
        pose = made.poses(t)["crate"]
    assert 0.05 < pose[2, 3] < 0.0504
    assert "gravity 9.81 m/s², contacts by impulse, friction 0.5" in made.describe()
    assert made.world.searches > 0 < made.world.rubbings


def test_poses_do_not_depend_on_how_they_are_asked_for(tmp_path):
    often, once = (load(tmp_path, SCENE + CONTACTS) for _ in range(2))
    for t in np.arange(0.0, 0.4, 0.01):
        often.poses(t)
    assert same(often.poses(0.4), once.poses(0.4))
    later = once.poses(0.5)
    assert not same(later, once.poses(0.2))  # an earlier time starts again
    assert same(later, once.poses(0.5))


def test_it_begins_again_after_its_period(tmp_path):
    made = load(tmp_path, SCENE + CONTACTS + "    period_s: 0.3\n")
    assert made.period_s == pytest.approx(0.3)
    first = made.poses(0.1)
    made.poses(0.25)
    assert same(first, made.poses(0.4))
    assert same(first, made.poses(30.1))


def test_the_end_of_a_period_is_its_own(tmp_path):
    text = SCENE + "    period_s: 0.3\n"
    made, free = load(tmp_path, text), load(tmp_path, SCENE)
    assert same(made.poses(0.3), free.poses(0.3))
    assert same(made.poses(0.6), free.poses(0.3))
    assert same(made.poses(0.6025), free.poses(0.0025))


def test_limits_make_a_live_motion_late_and_no_different(tmp_path):
    text = SCENE + CONTACTS + "    max_substeps: 3\n"
    free, late = load(tmp_path, text), load(tmp_path, text, live=True)
    for k in range(1, 21):
        pose = late.poses(0.01 * k)  # four steps are due, and three are done
        assert late.lag_s == pytest.approx(0.0025 * k)
        assert same(pose, free.poses(0.0075 * k))
    assert late.describe().endswith("0.05 s late")


def test_a_live_motion_keeps_within_its_budget_of_time(tmp_path):
    made = load(tmp_path, SCENE + "    budget_ms: 0.000001\n", live=True)
    assert same(made.poses(5.0), made.poses(5.0))
    assert made.lag_s == pytest.approx(5.0)


@pytest.mark.parametrize("limit", ["max_substeps: 1", "budget_ms: 0.000001"])
def test_a_live_motion_begins_later_without_being_late(tmp_path, limit):
    text = SCENE + CONTACTS
    free, made = load(tmp_path, text), load(tmp_path, text + f"    {limit}\n", live=True)
    made.seek(0.3)
    sought = free.poses(0.3)
    assert same(made.poses(0.3), sought)
    made.poses(0.4)
    assert made.lag_s == pytest.approx(0.1, abs=0.003)  # the limits hold from there on
    assert same(made.poses(0.3), sought)  # the clock ran back
    assert made.lag_s == 0.0


def test_a_live_motion_that_is_late_is_sought_without_being_late(tmp_path):
    text = SCENE + CONTACTS
    free, made = load(tmp_path, text), load(tmp_path, text + "    max_substeps: 1\n", live=True)
    for k in range(1, 21):
        made.poses(0.01 * k)
    assert made.lag_s == pytest.approx(0.15)
    for moment in (0.4, 0.1):
        made.seek(moment)
        assert made.lag_s == 0.0
        assert same(made.poses(moment), free.poses(moment))


@pytest.mark.parametrize("limit", ["max_substeps: 9", "budget_ms: 5000"])
def test_a_live_motion_waits_where_the_clock_is_set_back(tmp_path, limit):
    text = SCENE + CONTACTS
    free, made = load(tmp_path, text), load(tmp_path, text + f"    {limit}\n", live=True)
    made.seek(0.2)
    now = made.poses(0.21)
    assert same(now, free.poses(0.21))
    assert same(made.poses(0.2051), now)
    assert same(made.poses(0.2149), free.poses(0.2149))
    assert made.lag_s == 0.0


def test_a_live_motion_has_a_limit_unless_the_scene_names_one(tmp_path):
    made = load(tmp_path, "rate_hz: 500" + SCENE, live=True)
    made.poses(1e6)
    assert made.lag_s > 9e5


def test_nobody_waits_for_a_motion_that_is_stopped(tmp_path):
    asked = []

    def stopped():
        asked.append(True)
        return len(asked) > 20

    made = load(tmp_path, SCENE, stopped=stopped)
    made.seek(1e9)
    made.poses(1e9)
    fast = SCENE.replace("[200, 0, 0]", "[0, 0, 1.0e+6]") + CONTACTS
    asked.clear()
    made = load(tmp_path, fast, stopped=stopped)
    made.poses(1.0)  # a single step has more parts than that
    assert made.world.time_s <= 0.0025 * 20
    assert len(asked) < 25


def test_what_moves_beside_it_begins_later_as_well(tmp_path):
    text = SCENE + "    budget_ms: 0.000001\n  script:\n    bodies:\n"
    text += "      drone: {keys: [{t: 0, position: [0, 0, 0]}, {t: 1, position: [80, 0, 0]}]}\n"
    made = load(tmp_path, text, live=True)
    made.seek(0.5)
    poses = made.poses(0.5)
    assert poses["drone"][0, 3] == pytest.approx(0.04)
    assert poses["crate"][0, 3] == pytest.approx(0.1)


def test_time_must_be_finite(tmp_path):
    made = load(tmp_path, SCENE)
    for ask in (made.poses, made.seek):
        with pytest.raises(ValueError, match=r"t: must be finite \(got inf\)"):
            ask(np.inf)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("        density: 500\n", "", "dynamics.bodies.crate: needs the key 'density'"),
        ("      crate:", "      chest:", "no body is named 'chest'"),
        ("      crate:", "      table:", "'table' is fixed"),
        ("    bodies:", "    friction: 0.5\n    bodies:", "friction: needs 'contacts'"),
        (
            "    bodies:",
            "    contacts: {method: penalty}\n    bodies:",
            "needs the key 'stiffness'",
        ),
        (
            "    bodies:",
            "    contacts: {method: penalty, stiffness: 9}\n    restitution: 1\n    bodies:",
            "restitution: can be used only with the method 'impulse'",
        ),
        (
            "    bodies:",
            "    contacts: {method: impulse, obstacles: [drone]}\n    bodies:",
            r"obstacles\[0\]: 'drone' moves",
        ),
        (
            "    bodies:",
            "    contacts: {method: impulse, stiffness: 9}\n    bodies:",
            "stiffness: can be used only with the method 'penalty'",
        ),
        ("velocity: [200, 0, 0]", "velocity: [1.0e+308, 0, 0]", r"crate.velocity\[0\]: "),
        ("spin_deg_s: [0, 0, 180]", "spin_deg_s: [0, 0, -1.0e+7]", r"crate.spin_deg_s\[2\]: "),
        ("    bodies:", "    gravity: [0, 1.0e+7, 0]\n    bodies:", r"dynamics.gravity\[1\]: "),
        ("density: 500", "density: 1.0e+308", "crate.density: "),
        (
            "    bodies:",
            "    contacts: {method: penalty, stiffness: 1.0e+308}\n    bodies:",
            "contacts.stiffness: ",
        ),
        (
            "position: [0, 0, 300]}",
            "position: [0, 0, 300], quaternion: [1, 1, 0, 0]}",
            "quaternion",
        ),
    ],
)
def test_bad_settings_are_refused_by_key(tmp_path, old, new, words):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace(old, new, 1))
    with pytest.raises(scene.SceneError, match=words):
        scene.load_scene(path)


def test_touching_bodies_are_refused_with_the_file(tmp_path):
    text = (SCENE + CONTACTS).replace("[0, 0, 300]", "[0, 0, 50]")
    with pytest.raises(
        ValueError, match=r"scene\.yaml: motion\.dynamics: 'crate' and 'table' touch"
    ):
        load(tmp_path, text)


def linked(first, second):
    """Return Gauss's linking number of the centre circles of two rings: 1 or -1 if interlocked."""
    angle = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    circle = 0.05 * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    tangent = np.stack((-np.sin(angle), np.cos(angle), 0.0 * angle), axis=1)
    (p, s), (q, t) = (
        (circle @ pose[:3, :3].T + pose[:3, 3], tangent @ pose[:3, :3].T)
        for pose in (first, second)
    )
    apart = p[:, None] - q[None, :]
    step = 0.05 * 2.0 * np.pi / 120
    area = np.einsum("ijk,ijk->ij", apart, np.cross(s[:, None], t[None, :]))
    return (area / np.linalg.norm(apart, axis=2) ** 3).sum() * step**2 / (4.0 * np.pi)


def test_the_bundled_rings_stay_interlocked_above_the_floor():
    made = motion.from_scene(scene.load_scene(scene.bundled("rings")))
    energy, least = made.world.energy(), np.inf
    names = [f"ring_{k}" for k in range(1, 11)]
    for t in np.arange(0.01, 0.5, 0.01):
        poses = made.poses(t)
        least = min(least, nearest(made.world))
        assert made.world.energy() <= energy * (1.0 + 1e-9)
        energy = made.world.energy()
    assert least > 0.0
    assert made.world.stops == 0
    for first, second in itertools.pairwise(names):
        assert abs(linked(poses[first], poses[second])) == pytest.approx(1.0, abs=0.1)
    heights = np.array([poses[name][2, 3] for name in names])
    assert heights.min() < 0.08 and heights.max() > 0.25  # the ends are down, the middle hangs


def test_the_bundled_torus_falls_through_the_other_onto_the_floor():
    made = motion.from_scene(scene.load_scene(scene.bundled("falling-tori")))
    heights, least = [], np.inf
    for t in np.arange(0.0, 4.0, 0.05):
        heights.append(made.poses(t)["warped"][2, 3])
        least = min(least, nearest(made.world))
    assert heights[0] == pytest.approx(1.2)
    assert -1.6 < heights[-1] < -1.0  # below the lumpy one, on the floor
    assert np.ptp(heights[-10:]) < 0.05  # it lies, and rocks only a little
    assert least > 0.0
