"""A scene's motion section becomes a motion, in SI units whatever the file's unit."""

import math

import numpy as np
import pytest

from proximity_monitor import motion, scene

SCENE = """
version: 1
frame: world
unit: mm
bodies:
  - {name: table, primitive: {box: {size: [400, 400, 20]}}, pose: {position: [0, 0, 0]}}
  - {name: wheel, primitive: {cylinder: {radius: 30, height: 10}}, moving: true}
  - {name: ram, primitive: {sphere: {radius: 10}}, moving: true}
pairs: all
"""
MOTION = """
motion:
  slider_crank:
    crank: wheel
    crank_origin: [0, 0, 100]
    crank_axis: [0, 2, 0]
    slide_direction: [1, 0, 0]
    crank_radius: 30
    rod_length: 50
    rpm: 90
    pistons:
      ram: {phase_deg: 90, offset: [0, 40, 0]}
"""
ARM = "  - {name: arm, primitive: {box: {size: [9, 9, 9]}}, moving: true}\npairs"
DOOR = """
  script:
    bodies:
      arm: {hinge: {origin: [0, 0, 0], axis: [0, 0, 1], angles_deg: [[0, 0], [2, 90]]}}
"""


def load(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return scene.load_scene(path)


def test_lengths_are_metres_and_angles_radians(tmp_path):
    made = motion.from_scene(load(tmp_path, SCENE + MOTION))
    assert made.bodies == ("wheel", "ram")
    assert made.period_s == pytest.approx(60.0 / 90.0)
    assert made.describe() == "slider_crank: 2 bodies, 90 rpm"
    poses = made.poses(0.0)
    # At 90 degrees the rod is the hypotenuse of 30, 40, 50.
    assert poses["ram"][:3, 3] == pytest.approx([0.040, 0.040, 0.100])
    assert poses["wheel"][:3, 3] == pytest.approx([0.0, 0.0, 0.100])
    later = made.poses(made.period_s / 4.0)
    assert later["ram"][0, 3] == pytest.approx(0.020)
    assert math.atan2(later["wheel"][0, 2], later["wheel"][0, 0]) == pytest.approx(math.pi / 2)


def test_the_bundled_engine_drives_every_moving_body():
    sc = scene.load_scene(scene.bundled("engine"))
    made = motion.from_scene(sc)
    assert set(made.bodies) == {body.name for body in sc.bodies if body.moving}
    top, bottom = made.poses(0.0), made.poses(made.period_s / 2.0)
    assert top["piston_1"][2, 3] - bottom["piston_1"][2, 3] == pytest.approx(0.0755)


def test_a_scene_without_motion_says_so(tmp_path):
    with pytest.raises(ValueError, match=r"scene\.yaml: has no 'motion' section"):
        motion.from_scene(load(tmp_path, SCENE))


def test_several_effects_run_together_and_no_others(tmp_path):
    made = motion.from_scene(load(tmp_path, SCENE.replace("pairs", ARM) + MOTION + DOOR))
    assert made.bodies == ("wheel", "ram", "arm")
    assert made.describe().splitlines() == [
        "slider_crank: 2 bodies, 90 rpm",
        "script: 1 body, 2 s in a loop",
    ]
    assert made.period_s == 2.0
    poses = made.poses(1.0)
    assert poses["arm"][1, 0] == pytest.approx(math.sin(math.pi / 4))
    assert poses["ram"][2, 3] == pytest.approx(0.1)
    assert set(poses) == set(made.bodies)
    assert made.control_points(1.0) == {}
    assert made.joints(1.0) == {}


@pytest.mark.parametrize("section", [MOTION, "motion:\n" + DOOR, MOTION + DOOR])
def test_only_the_effects_that_a_scene_names_are_made(tmp_path, monkeypatch, section):
    made = []

    def counted(name, maker):
        def make(*args):
            made.append(name)
            return maker(*args)

        return make

    for name, maker in motion._EFFECTS.items():
        monkeypatch.setitem(motion._EFFECTS, name, counted(name, maker))
    described = load(tmp_path, SCENE.replace("pairs", ARM) + section)
    lines = motion.from_scene(described).describe().splitlines()
    assert made == list(described.motion) == [line.partition(":")[0] for line in lines]
    assert len(motion._EFFECTS) > len(made)


def test_parts_that_never_end_have_no_period():
    crank = motion.SliderCrank(
        "wheel", (0, 0, 0), (1, 0, 0), (0, 0, 1), 1.0, 2.0, 0.0,
        {"ram": {"phase": 0.0, "offset": (0, 0, 0)}},
    )  # fmt: skip
    times = {"times": np.array([0.0, 3.0]), "values": np.array([0.0, 1.0])}
    joints = motion.Script(bodies={}, joints={"elbow": times}, loop=True)
    assert motion.Together([joints, joints]).period_s == 3.0
    together = motion.Together([joints, crank])
    assert together.period_s is None
    assert together.joints(1.5) == {"elbow": 0.5}
    with pytest.raises(ValueError, match="'wheel' is driven by more than one effect"):
        motion.Together([crank, joints, crank])


def test_parts_repeat_at_once_after_a_multiple_of_all_their_periods():
    def script(joint, end_s, loop=True):
        times = {"times": np.array([0.0, end_s]), "values": np.array([0.0, 1.0])}
        return motion.Script(bodies={}, joints={joint: times}, loop=loop)

    made = motion.Together([script("elbow", 2.0), script("wrist", 3.0)])
    assert (made.period_s, made.once_s, made.repeats) == (6.0, 3.0, True)
    assert made.joints(7.0) == pytest.approx(made.joints(1.0))
    assert made.joints(4.0) != pytest.approx(made.joints(1.0))
    never = motion.Together([script("elbow", 2.0), script("wrist", math.sqrt(8.0))])
    assert (never.period_s, never.once_s) == (None, math.sqrt(8.0))
    partly = motion.Together([script("elbow", 2.0), script("wrist", 3.0, loop=False)])
    assert (partly.period_s, partly.once_s, partly.repeats) == (None, 3.0, True)
    resting = motion.Together(
        [script(joint, t, loop=False) for joint, t in (("a", 2.0), ("b", 3.0))]
    )
    assert (resting.period_s, resting.once_s, resting.repeats) == (3.0, 3.0, False)


def test_models_are_loaded_only_for_an_effect_that_asks_for_them(tmp_path):
    """The files of the models are gone when the motion is made."""
    (tmp_path / "ram.stl").write_text("")
    text = SCENE.replace("primitive: {sphere: {radius: 10}}", "model: ram.stl") + MOTION
    described = load(tmp_path, text)
    (tmp_path / "ram.stl").unlink()
    assert motion.from_scene(described).bodies == ("wheel", "ram")
