"""The page reads the scene from the message that the monitor writes."""

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from proximity_monitor.display.state import SceneInfo, Unit
from proximity_monitor.ros.pairs_message import checksum
from proximity_monitor.ros.scene_message import SceneMessage
from proximity_monitor.ros.scene_parameters import Settings
from proximity_monitor.scene import Thresholds, load_scene
from proximity_monitor.scene.opening import load_models

SCENE = """
version: 1
frame: cell
unit: mm
bodies:
  - {name: table, primitive: {box: {size: [800, 800, 50]}}, pose: {position: [0, 0, -25]}}
  - {name: ball, primitive: {sphere: {radius: 100}}, moving: true}
  - {name: cursor, primitive: {point: {}}, topic: hand}
"""


HELD = {"cursor": "ball"}


def described(folder, text, **settings):
    path = folder / "cell.yaml"
    path.write_text(text)
    scene = load_scene(path)
    made = SceneMessage(scene, load_models(scene), lambda topic: f"/left/{topic}")
    in_force = dict.fromkeys(Settings._fields) | {
        "frame": "cell", "budget_s": 0.01, "body_topics": True,
        "thresholds": (Thresholds(2, 1, 0),), "attachments": {"ball": "table", "cursor": "ball"},
    } | settings  # fmt: skip
    return SceneInfo.read(made.message(Settings(**in_force), (), ["a word"], HELD, [1]).data)


def test_the_scene_is_read_as_the_monitor_writes_it(tmp_path):
    scene = described(tmp_path, SCENE)
    assert scene.unit == Unit("mm", 0.001)
    assert scene.moving == ("ball", "cursor")
    assert scene.attachments == {"ball": "table", "cursor": "ball"}
    assert scene.held == HELD
    assert scene.unwatched == {("table", "cursor")}
    assert scene.path == str(tmp_path / "cell.yaml")
    assert scene.checksum == checksum(("table", "ball", "cursor"))
    assert scene.words == ("a word",)
    topics = [body.topic for body in scene.bodies]
    assert topics == [None, "/left/bodies/ball/pose", "/left/hand"]
    assert [body.point for body in scene.bodies] == [False, False, True]
    table, ball, _ = scene.bodies
    assert table.pose == pytest.approx((0.0, 0.0, -0.025, 1.0, 0.0, 0.0, 0.0))
    assert ball.pose is None
    assert len(ball.colour) == 4
    in_bulk = described(tmp_path, SCENE, body_topics=False)
    assert [body.topic for body in in_bulk.bodies] == [None] * 3


@pytest.mark.parametrize(
    "before, after",
    [
        ("radius: 100}}", "radius: 101}}"),
        ("0, -25]}", "0, -26]}"),
        ("0, -25]}", "0, -25]}, colour: [1, 0, 0, 1]"),
        ("moving: true}", "moving: true, colour: [1, 0, 0, 1]}"),
    ],
)
def test_what_looks_otherwise_or_stands_elsewhere_makes_it_another_scene(tmp_path, before, after):
    key = described(tmp_path, SCENE).key
    assert described(tmp_path, SCENE).key == key
    assert described(tmp_path, SCENE.replace(before, after)).key != key


def test_the_least_range_of_a_body_s_pairs_is_told(tmp_path):
    watch = """
pairs:
  watch:
    - {between: [table, ball], thresholds: {warn: 20, stop: 10}}
    - {between: [table, cursor], thresholds: {warn: 20, stop: 10}, range: 300}
"""
    scene = described(tmp_path, SCENE + watch, thresholds=(Thresholds(0.02, 0.01, 0),) * 2)
    assert [body.range for body in scene.bodies] == pytest.approx([0.3, np.inf, 0.3])
