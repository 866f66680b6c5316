"""An assembly in a scene: its parts become bodies, in one line."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene import SceneError, load_scene
from proximity_monitor.scene.opening import load_models

GEARBOX = Path(engine.__file__).parents[1] / "scene/bundled/gearbox/models/gearbox.step"
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
    with pytest.raises(SceneError, match=r"yaml:6: .*pip install proximity_monitor\[cad\]"):
        load(tmp_path, "moving: true")
    with pytest.raises(engine.ModelError, match=r"pip install proximity_monitor\[cad\]"):
        engine.load(GEARBOX)


@pytest.fixture
def needs_opencascade():
    pytest.importorskip("OCP", reason="needs OpenCASCADE: pip install cadquery-ocp")


@pytest.mark.usefixtures("needs_opencascade")
def test_parts_become_bodies_where_the_file_places_them(tmp_path):
    turned = "pose: {position: [0, 0, 100], quaternion: [0, 0, 1, 0]}"
    made = load(tmp_path, turned)
    bodies = {body.name: body for body in made.bodies}
    assert len(bodies) == 16
    wheel, bolt = bodies["gearbox_wheel"], bodies["gearbox_bolt_2"]
    np.testing.assert_allclose(wheel.pose[:3, 3], [-0.0352, 0.0, 0.095], atol=1e-12)
    turn = np.pi + np.pi / 34  # that of the assembly, and half a tooth
    assert wheel.pose[:2, 0] == pytest.approx([np.cos(turn), np.sin(turn)])
    assert wheel.colour == pytest.approx((0.8, 0.45, 0.15, 1.0), abs=1e-6)
    assert not bolt.moving
    models = load_models(made)
    assert models["gearbox_bolt_1"] is models["gearbox_bolt_4"]
    assert {models[f"gearbox_{each}"].kind for each in ("wheel", "bolt_2")} == {"surface"}
    assert models["gearbox_seal_2"].name == "seal 1"


@pytest.mark.usefixtures("needs_opencascade")
def test_some_parts_move_and_a_group_holds_all(tmp_path):
    more = "pose: {position: [0, 0, 0]}, moving_parts: [pinion, gearbox_wheel], colour: [1, 0, 0]"
    made = load(tmp_path, more, "pairs: {watch: [{between: [gearbox, bench]}]}")
    moving = {body.name: body.topic for body in made.bodies[:-1] if body.moving}
    assert moving == {
        "gearbox_pinion": "bodies/gearbox_pinion/pose",
        "gearbox_wheel": "bodies/gearbox_wheel/pose",
    }
    assert len(made.pairs) == 15  # all parts are in the group
    assert {body.colour for body in made.bodies[:-1]} == {(1.0, 0.0, 0.0, 1.0)}


@pytest.mark.usefixtures("needs_opencascade")
def test_an_assembly_may_be_one_rigid_body(tmp_path):
    made = load(tmp_path, "topic: there, parts: false")
    assert [body.name for body in made.bodies] == ["gearbox", "bench"]
    assert len(load_models(made)["gearbox"].nets) == 452


@pytest.mark.usefixtures("needs_opencascade")
@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("topic: there", "topic: an assembly's parts have topics of their own"),
        ("pose: {position: [0, 0, 0]}, moving_parts: [lid]", "there is no part 'lid'; there are"),
        ("moving: true, parts: false, moving_parts: [lid]", "is no assembly of several parts"),
    ],
)
def test_what_means_nothing_is_refused(tmp_path, more, message):
    with pytest.raises(SceneError, match=message):
        load(tmp_path, more)
