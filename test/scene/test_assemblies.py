"""An assembly in a scene: its parts become bodies, in one line."""

import importlib.util
import json
import re
from pathlib import Path

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene import SceneError, load_scene
from proximity_monitor.scene.assemblies import _names
from proximity_monitor.scene.naming import safe
from proximity_monitor.scene.opening import load_models

SCENES = Path(engine.__file__).parents[1] / "scene"
GEARBOX = SCENES / "bundled/gearbox/models/gearbox.step"
SCHEMA = SCENES / "schema.json"
TEXT = """
version: 1
unit: mm
thresholds: {{warn: 1, stop: 0.1, hysteresis: 0.1}}
bodies:
  - {{name: gearbox, model: {file}, {more}}}
  - {{name: bench, primitive: {{box: {{size: [200, 200, 5]}}}}, moving: true}}
{rest}
"""


def load(folder, more, rest=""):
    file = folder / "scene.yaml"
    file.write_text(TEXT.format(file=GEARBOX, more=more, rest=rest), encoding="utf-8")
    return load_scene(file)


def test_without_opencascade_the_message_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(SceneError, match=r"yaml:6: .*pip install '\.\[cad\]'"):
        load(tmp_path, "moving: true")
    with pytest.raises(engine.ModelError, match=r"pip install '\.\[cad\]'"):
        engine.load(GEARBOX)


def test_what_names_parts_of_an_assembly_that_cannot_be_read_is_no_problem(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    another = f"  - {{name: spare, model: {GEARBOX}, moving: true}}\n"
    rest = "pairs: {watch: [{between: [pinion, wheel]}]}"
    with pytest.raises(SceneError) as caught:
        load(tmp_path, "moving: true", another + rest)
    first, second = str(caught.value).splitlines()
    assert "bodies[0].model" in first
    assert "bodies[2].model" in second


@pytest.fixture
def needs_opencascade():
    pytest.importorskip("OCP", reason="needs OpenCASCADE: pip install cadquery-ocp")


@pytest.mark.usefixtures("needs_opencascade")
def test_parts_become_bodies_where_the_file_places_them(tmp_path):
    turned = "pose: {position: [0, 0, 100], quaternion: [0, 0, 1, 0]}"
    made = load(tmp_path, turned)
    bodies = {body.name: body for body in made.bodies}
    assert len(bodies) == 20
    wheel, bolt = bodies["wheel"], bodies["bolt 2"]
    np.testing.assert_allclose(wheel.pose[:3, 3], [-0.0352, 0.0, 0.095], atol=1e-12)
    turn = np.pi + np.pi / 34  # the assembly's turn, and half a tooth
    assert wheel.pose[:2, 0] == pytest.approx([np.cos(turn), np.sin(turn)])
    assert wheel.colour == pytest.approx((0.8, 0.45, 0.15, 1.0), abs=1e-6)
    assert not bolt.moving
    models = load_models(made)
    assert models["bolt 1"] is models["bolt 8"]
    assert {models[each].kind for each in ("wheel", "bolt 2")} == {"surface"}
    assert models["seal 2"].name == "seal 1"


@pytest.mark.usefixtures("needs_opencascade")
def test_some_parts_move_and_a_group_holds_all(tmp_path):
    more = "pose: {position: [0, 0, 0]}, moving_parts: [pinion, input shaft], colour: [1, 0, 0]"
    made = load(tmp_path, more, "pairs: {watch: [{between: [gearbox, bench]}]}")
    moving = {body.name: body.topic for body in made.bodies[:-1] if body.moving}
    assert moving == {
        "pinion": "bodies/pinion/pose",
        "input shaft": f"bodies/{safe('input shaft')}/pose",
    }
    assert len(made.pairs) == 19  # all parts are in the group
    assert {body.colour for body in made.bodies[:-1]} == {(1.0, 0.0, 0.0, 1.0)}


@pytest.mark.usefixtures("needs_opencascade")
def test_an_assembly_may_be_one_rigid_body(tmp_path):
    made = load(tmp_path, "topic: there, parts: false")
    assert [body.name for body in made.bodies] == ["gearbox", "bench"]
    assert len(load_models(made)["gearbox"].nets) == 544


@pytest.mark.usefixtures("needs_opencascade")
@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("topic: there", "topic: each part of an assembly has its own topic"),
        ("pose: {position: [0, 0, 0]}, moving_parts: [lid]", "there is no part 'lid'; known: "),
        (
            "moving: true, parts: false, moving_parts: [lid]",
            "is only for an assembly of several parts",
        ),
    ],
)
def test_what_means_nothing_is_refused(tmp_path, more, message):
    with pytest.raises(SceneError, match=message):
        load(tmp_path, more)


@pytest.mark.usefixtures("needs_opencascade")
def test_a_second_assembly_s_parts_are_called_after_it_where_a_name_is_taken(tmp_path):
    again = f"""\
  - {{name: wheel of another, model: {GEARBOX}, moving: true}}
pairs: {{watch: [{{between: [pinion, wheel of another/pinion]}}]}}"""
    made = load(tmp_path, "moving: true", again)
    names = [body.name for body in made.bodies]
    assert len(set(names)) == len(names) == 39
    assert {"bolt 2", "wheel of another/bolt 2"} <= set(names)
    assert [(pair.a, pair.b) for pair in made.pairs] == [("pinion", "wheel of another/pinion")]


@pytest.mark.parametrize(
    ("loose", "moving"),
    [(["bolt"], ["bolt"]), (["bolt 2"], ["bolt 2"]), (["nut - m"], ["nut-m", "nut-m 2"])],
)
def test_a_name_means_its_own_body_and_else_all_parts_of_the_file(
    tmp_path, monkeypatch, loose, moving
):
    names = "bolt", "bolt", "nut - m", "nut - m"
    placed = [
        engine.Placement(name=name, model=str(k), pose=np.eye(4), colour=None)
        for k, name in enumerate(names)
    ]
    monkeypatch.setattr(engine, "load_placements", lambda *_, **__: placed)
    scene = load(tmp_path, f"pose: {{position: [0, 0, 0]}}, moving_parts: {loose}")
    assert [body.name for body in scene.bodies[:-1] if body.moving] == moving


def test_a_robot_is_not_called_like_an_assembly(tmp_path, monkeypatch):
    placed = [engine.Placement(name=name, model=name, pose=np.eye(4), colour=None) for name in "ab"]
    monkeypatch.setattr(engine, "load_placements", lambda *_, **__: placed)
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    (tmp_path / "one.urdf").write_text(f'<robot name="r"><link name="x">{box}</link></robot>')
    with pytest.raises(SceneError, match="'gearbox' is already used; choose another name"):
        load(tmp_path, "moving: true", "robots: [{name: gearbox, urdf: one.urdf}]\n")


def test_a_problem_is_told_of_the_entry_in_the_file_not_of_the_body(tmp_path, monkeypatch):
    placed = [engine.Placement(name=name, model=name, pose=np.eye(4), colour=None) for name in "ab"]
    monkeypatch.setattr(engine, "load_placements", lambda *_, **__: placed)
    rest = "  - {name: scan, cloud: {topic: points, frame: nose}}\n"
    with pytest.raises(SceneError, match=r"8: bodies\[2\]\.cloud\.frame: 'nose' is not a body"):
        load(tmp_path, "moving: true", rest)
    rest = "pairs: {groups: {gearbox: [bench]}}\n"
    with pytest.raises(SceneError, match="'gearbox' is an assembly; give the group another name"):
        load(tmp_path, "moving: true", rest)


NAME = re.compile(json.loads(SCHEMA.read_text(encoding="utf-8"))["$defs"]["name"]["pattern"])


def test_names_of_cad_stay_as_they_are_where_a_body_may_have_them():
    same = ["Schraube M8×40", "轴承座 左", "input shaft", "a/b", "x-1", "-", "Part1:1"]
    assert _names("whole", same, ()) == same
    told = ["M8 - 40", " two\nlines\t", "x" * 300, "a - - b", "whole", "M8-40", "x" * 201]
    made = _names("whole", told, {"whole"})
    assert made[:2] == ["M8-40", "two lines"]
    assert made[4:6] == ["whole/whole", "M8-40 2"]
    assert made[2][:190] == made[6][:190] == "x" * 190 and made[6].endswith("x 2")
    assert len(set(made)) == len(made)
    for name in (*same, *made):
        assert NAME.search(name), name
