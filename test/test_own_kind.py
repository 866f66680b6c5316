"""A kind of model from another package, from file to monitor; `test_page.py` shows it on the page.

The other package is in `kinds/`, with the metadata that an installer writes about it.
"""

import math
import pickle

import numpy as np
import pytest
from round_things import Ball

from proximity_monitor import engine
from proximity_monitor.__main__ import main
from proximity_monitor.engine.files import readers
from proximity_monitor.motion.dynamics import ContactLaw, Forces, RigidBody, World
from proximity_monitor.scene import load_scene
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PairStatus, PoseSample

RADIUS = 0.1
SCENE = """
version: 1
frame: cell
unit: mm
thresholds: {warn: 20, stop: 5}
bodies:
  - {name: table, primitive: {box: {size: [800, 800, 50]}}, pose: {position: [0, 0, -25]}}
  - {name: ball, model: a.ball, moving: true, deforming: true}
  - {name: other, model: b.BALL, scale: 2, solid: false, pose: {position: [0, 300, 200]}}
pairs: all
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "a.ball").write_text("0 0 0 100")
    (tmp_path / "b.BALL").write_text("0 0 0 25")
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path / "scene.yaml"


def at(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def test_every_question_is_answered():
    ball, box = Ball((0.0, 0.0, 0.0), RADIUS), engine.shapes.box((0.2, 0.2, 0.2))
    far, inside = at(0.0, 0.0, 0.5), at(0.0, 0.0, 0.15)
    here = np.eye(4)
    found = engine.distance(ball, far, box, here)
    assert found.lower <= 0.3 <= found.upper and found.upper - found.lower < 1e-12
    np.testing.assert_allclose(found.point_a, (0.0, 0.0, 0.4), atol=1e-12)
    assert (found.feature_a.kind, found.feature_a.index) == ("ball", 0)
    assert found.feature_b.kind in ("vertex", "edge", "face")
    assert engine.signed_distance(ball, inside, ball, here).upper == pytest.approx(-0.05)
    assert engine.within(box, here, ball, far, 0.31).within
    assert not engine.collide(ball, far, ball, here).colliding
    assert engine.closest_points(ball, far, np.zeros((1, 3))).upper == pytest.approx(0.4)
    many = engine.distances(ball, [far, inside], box, [here, here])
    np.testing.assert_allclose(many.upper, (0.3, 0.0), atol=1e-12)
    again = pickle.loads(pickle.dumps((found, ball)))
    assert again[0].feature_a.kind == again[1].kind == "ball"


def test_a_file_of_it_is_read_and_one_that_is_not_what_it_should_be_refused(file, monkeypatch):
    ball = engine.load(file.parent / "b.BALL", unit=0.001, scale=2.0, deviation=0.002)
    assert (type(ball), ball.name, ball.size, ball.deviation) == (Ball, "b", 0.05, 0.002)
    bad = file.parent / "bad.ball"
    for text, message in (
        ("1 2 x 4", r"bad\.ball: not a readable BALL file: ValueError: could not convert"),
        ("0 0 0 -1", r"bad\.ball: ball: radius = -1.0: must be from 0 to"),
    ):
        bad.write_text(text)
        with pytest.raises(engine.ModelError, match=message):
            engine.load(bad)
    monkeypatch.setitem(readers._READERS, ".ball", lambda *_: None)
    with pytest.raises(engine.ModelError, match="its reader returned NoneType, not a Model"):
        engine.load(bad)
    (file.parent / "a.cube").write_text("1")
    with pytest.raises(engine.ModelError, match=r"a\.cube: unknown extension .*\.stp, \.ball$"):
        engine.load(file.parent / "a.cube")


def test_a_scene_watches_it(file, capsys):
    scene = load_scene(file)
    models = load_models(scene)
    monitor = Monitor(scene, models)

    def tick(z):
        pairs = monitor.tick({"ball": PoseSample(at(0.0, 0.0, z))}, 1.0).pairs
        return {(pair.a, pair.b): pair for pair in pairs}

    seen = tick(0.3)
    assert seen["table", "ball"].upper == pytest.approx(0.2)
    to_other = seen["ball", "other"]
    assert to_other.upper == pytest.approx(math.hypot(0.3, 0.1) - 0.15)
    assert [feature.kind for feature in to_other.features] == ["ball", "ball"]
    monitor.deform("ball", [[0.0, 0.0, -0.1]])
    carried = monitor.tick({"ball": PoseSample(at(0.0, 0.0, 0.3))}, 0.0).pairs[0]
    assert carried.lower <= 0.1 <= carried.upper and carried.lower == pytest.approx(0.1)
    overlap = tick(0.15)["table", "ball"]
    assert overlap.status is PairStatus.OVERLAPPING
    assert overlap.lower <= -0.05 <= overlap.upper < -0.049
    assert main(["scene", "check", str(file)]) == 0
    assert "body ball: a ball 200 mm across, solid, moving" in capsys.readouterr().out


def test_it_falls_and_comes_to_rest():
    law = ContactLaw("impulse", 0.001)
    forces = Forces(np.array([0.0, 0.0, -9.81]), law, restitution=0.0, linear_damping=1.0)
    floor = RigidBody("floor", engine.shapes.box((1.0, 1.0, 0.2)), at(0.0, 0.0, -0.1))
    ball = RigidBody("ball", Ball((0.0, 0.0, 0.0), RADIUS), at(0.0, 0.0, 0.15), 1000.0)
    world = World([ball, floor], forces, 0.0025)
    for _ in range(100):
        world.step()
    # The ball falls as the triangles that display it; their corners lie on the ball.
    assert RADIUS < world.poses()[0][2, 3] < 1.02 * RADIUS
