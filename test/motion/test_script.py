"""Scripts from scene files: keys, tables, hinges, slides and joints, looped or played once."""

import math

import numpy as np
import pytest

from proximity_monitor import motion, scene

BODIES = """
version: 1
unit: mm
bodies:
  - {name: table, primitive: {box: {size: [400, 400, 20]}}, pose: {position: [0, 0, 0]}}
  - {name: cart, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: door, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: drawer, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: hand, primitive: {box: {size: [1, 1, 1]}}, moving: true}
motion:
"""
SCRIPT = """
  script:
    bodies:
      cart:
        keys:
          - {t: 0, position: [1000, 0, 0]}
          - {t: 2, position: [0, 1000, 0], rotation: {axis: [0, 0, 5], angle_deg: 90}}
          - {t: 3, position: [0, 1000, 500], quaternion: [0, 0, 0.7071, 0.7071]}
      door:
        hinge:
          origin: [100, 0, 0]
          axis: [0, 0, 2]
          angles_deg: [[0, 0], [1, 90], [4, 90]]
          pose: {position: [100, 200, 0], rotation: {axis: [0, 0, 1], angle_deg: -90}}
      drawer:
        slide: {axis: [0, 3, 4], offsets: [[1, 0], [2, 10]]}
      hand: {csv: hand.csv}
"""
TABLE = """\
qw,t, x,y,z,qx,qy,qz,note
1,0,0,0,0,0,0,0,begin

0,1,10,0,0,1,0,0,"half a turn"
0,3,10,0,20,1,0,0,
"""


@pytest.fixture
def load(tmp_path):
    (tmp_path / "hand.csv").write_text(TABLE)

    def load(text):
        path = tmp_path / "scene.yaml"
        path.write_text(BODIES + text)
        return motion.from_scene(scene.load_scene(path))

    return load


def test_key_poses_are_met_and_screws_lie_between(load):
    made = load(SCRIPT)
    assert made.bodies == ("cart", "door", "drawer", "hand")
    root = math.sqrt(0.5)
    cart = made.poses(1.0)["cart"]
    assert cart[:3, 3] == pytest.approx([root, root, 0.0])
    assert cart[:3, 0] == pytest.approx([root, root, 0.0])
    assert made.poses(2.0)["cart"][:3, 3] == pytest.approx([0.0, 1.0, 0.0], abs=1e-16)
    assert made.poses(2.5)["cart"][:3, 3] == pytest.approx([0.0, 1.0, 0.25])


def test_a_hinge_carries_the_body_on_an_arc(load):
    door = load(SCRIPT).poses(0.5)["door"]
    root = math.sqrt(0.5)
    assert door[:3, 3] == pytest.approx([0.1 - 0.2 * root, 0.2 * root, 0.0])
    assert door[:3, 0] == pytest.approx([root, -root, 0.0])


def test_a_slide_carries_the_body_along_its_axis(load):
    made = load(SCRIPT)
    assert np.array_equal(made.poses(0.5)["drawer"], np.eye(4))
    assert made.poses(1.5)["drawer"][:3, 3] == pytest.approx([0.0, 0.003, 0.004])


def test_a_table_is_found_by_its_columns(load):
    made = load(SCRIPT)
    hand = made.poses(0.5)["hand"]
    assert hand[:3, 3] == pytest.approx([0.005, 0.0, 0.0])
    assert hand[:3, 1] == pytest.approx([0.0, 0.0, 1.0])
    assert made.poses(2.0)["hand"][:3, 3] == pytest.approx([0.01, 0.0, 0.01])


def test_it_begins_again_after_the_latest_key_of_all(load):
    made = load(SCRIPT)
    assert made.period_s == 4.0
    assert made.describe() == "script: 4 bodies, 4 s in a loop"
    assert made.repeats
    first, later, before = made.poses(1.25), made.poses(9.25), made.poses(-2.75)
    for name, pose in first.items():
        assert np.array_equal(pose, later[name])
        assert np.array_equal(pose, before[name])
    at_end = made.poses(4.0)["cart"]
    assert at_end[:3, 3] == pytest.approx([0.0, 1.0, 0.5])
    assert np.array_equal(made.poses(8.0)["cart"], at_end)
    assert made.poses(4.0 + 1e-9)["cart"] == pytest.approx(made.poses(0.0)["cart"], abs=1e-8)


def test_played_once_it_rests_at_its_end(load):
    made = load(SCRIPT.replace("script:", "script:\n    loop: false"))
    assert made.describe() == "script: 4 bodies, 4 s once"
    assert not made.repeats
    end = made.poses(4.0)
    assert end["cart"][:3, 3] == pytest.approx([0.0, 1.0, 0.5])
    for name, pose in made.poses(1e6).items():
        assert np.array_equal(pose, end[name])
    for name, pose in made.poses(-1.0).items():
        assert np.array_equal(pose, made.poses(0.0)[name])


def test_a_script_of_rests_has_no_period(load):
    made = load("\n  script: {bodies: {cart: {keys: [{t: 0, position: [1, 2, 3]}]}}}\n")
    assert made.period_s is None
    assert made.poses(7.0)["cart"][:3, 3] == pytest.approx([0.001, 0.002, 0.003])
    assert made.describe() == "script: 1 body, 0 s in a loop"


def test_joints_go_straight_between_their_keys():
    def keys(*pairs):
        times, values = np.array(pairs, dtype=float).T
        return {"times": times, "values": values}

    joints = {"elbow": {"kind": "angles_deg", **keys((0, 0), (2, 3))}, "wrist": keys((1, 5))}
    made = motion.Script(bodies={}, joints=joints, loop=True)
    assert made.bodies == ()
    assert made.poses(1.0) == {}
    assert made.joints(0.5) == {"elbow": 0.75, "wrist": 5.0}
    assert made.joints(2.5) == made.joints(0.5)
    assert made.describe() == "script: 2 joints, 2 s in a loop"


@pytest.mark.parametrize("t", [math.nan, math.inf])
def test_time_must_be_finite(load, t):
    made = load(SCRIPT)
    with pytest.raises(ValueError, match=rf"t: must be finite \(got {t}\)"):
        made.poses(t)
    with pytest.raises(ValueError, match=rf"t: must be finite \(got {t}\)"):
        made.joints(t)
