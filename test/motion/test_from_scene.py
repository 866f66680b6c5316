"""A scene's motion section becomes a motion, in SI units whatever the file's."""

import math

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
