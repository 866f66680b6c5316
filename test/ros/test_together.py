"""The places of two bodies at one moment, from poses with different stamps."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from proximity_monitor.ros.bulk import StampedPose
from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.whereabouts import Whereabouts
from proximity_monitor.scene import load_scene

MS = 1_000_000
SCENE = """
version: 1
unit: m
bodies:
  - {name: hand, primitive: {sphere: {radius: 1}}, moving: true}
  - {name: cup, primitive: {sphere: {radius: 1}}, moving: true}
  - {name: lid, primitive: {sphere: {radius: 1}}, moving: true}
"""


class Cell:
    """A hand that moves along x, and a cup that it is to carry."""

    def __init__(self, path):
        path.write_text(SCENE)
        scene = load_scene(path)
        self.inputs = Inputs(scene.pairs.names, "world")
        self.warned = []
        node = SimpleNamespace(
            get_clock=lambda: SimpleNamespace(ros_time_is_active=False),
            get_logger=lambda: SimpleNamespace(warning=self.warned.append),
        )
        clouds = SimpleNamespace(place=lambda *_: None, absent=lambda *_: frozenset())
        self.where = Whereabouts(node, scene, self.inputs, clouds, lambda _: None)

    def tell(self, name, ms, x, turn=0.0):
        wise = (0.0, 0.0, float(np.sin(turn / 2)), float(np.cos(turn / 2)))
        pose = StampedPose(ms * MS, "world", (float(x), 0.0, 0.0), wise)
        assert self.inputs.store(name, pose, 300 * MS) is None

    def attached(self):
        self.where.attach({"cup": "hand"}, 300 * MS)
        self.tell("hand", 290, 0.0)
        return self.where.samples(300 * MS)["cup"].pose[:3, 3]


@pytest.fixture
def cell(tmp_path):
    return Cell(tmp_path / "scene.yaml")


def test_a_hand_that_moved_since_the_cup_s_pose_is_taken_where_it_was_then(cell):
    cell.tell("cup", 150, 6.0)
    cell.tell("cup", 200, 7.0)
    cell.tell("hand", 100, 0.0)
    cell.tell("hand", 260, 8.0)
    np.testing.assert_allclose(cell.attached(), (2.0, 0.0, 0.0), atol=1e-12)  # the hand was at 5 m
    assert not cell.warned


def test_a_turn_goes_on_evenly_between_the_poses(cell):
    cell.tell("cup", 150, 0.0)
    cell.tell("cup", 200, 1.0)
    cell.tell("hand", 100, 0.0)
    cell.tell("hand", 250, 0.0, 1.5)
    found = cell.attached()  # the hand was turned by 1 rad
    np.testing.assert_allclose(found, (np.cos(1.0), -np.sin(1.0), 0.0), atol=1e-12)


@pytest.mark.parametrize("stamps_ms", [(140,), (100, 140, 240, 250)])
def test_what_rests_is_where_it_was(cell, stamps_ms):
    cell.inputs.timeout_s = 0.25
    cell.tell("cup", 150, 6.0)
    cell.tell("cup", 200, 7.0)
    for ms in stamps_ms:
        cell.tell("hand", ms, 4.0)
    cell.tell("hand", 260, 4.0)
    cell.inputs.timeout_s = 0.11
    np.testing.assert_allclose(cell.attached(), (3.0, 0.0, 0.0), atol=1e-12)
    assert not cell.warned


@pytest.mark.parametrize("hand_ms, warned", [((100, 190), False), ((150, 190), True)])
def test_that_a_body_rested_until_its_stamp_does_not_say_where_it_is_now(cell, hand_ms, warned):
    for ms in (0, 100):
        cell.tell("cup", ms, 5.0)
    for ms, x in zip(hand_ms, (0.0, 9.0), strict=True):
        cell.tell("hand", ms, x)
    np.testing.assert_allclose(cell.attached(), (-4.0 if warned else 5.0, 0.0, 0.0), atol=1e-12)
    assert bool(cell.warned) == warned


def test_the_first_pose_of_a_stamp_is_of_that_moment():
    inputs = Inputs(["link", "cup"], "world")
    for ms, link, cup in ((50, -5.0, 0.0), (100, 0.0, 5.0), (100, 3.0, 5.0), (100, 6.0, 5.0)):
        for name, x in (("link", link), ("cup", cup)):
            pose = np.eye(4)
            pose[0, 3] = x
            assert inputs.store_many([name], pose[None], ms * MS, "world", 300 * MS) == 1
    at, other, apart_s = inputs.together("link", "cup")
    assert (at[0, 3], other[0, 3], apart_s) == (0.0, 5.0, 0.0)
    cup = np.eye(4)
    cup[0, 3] = 2.5
    inputs.forget_pose("cup")
    inputs.store_many(["cup"], cup[None], 75 * MS, "world", 300 * MS)
    at, other, apart_s = inputs.together("link", "cup")
    np.testing.assert_allclose((at[0, 3], other[0, 3], apart_s), (-2.5, 2.5, 0.0))


@pytest.mark.parametrize("before_ms, timeout_s", [(220, 0.5), (100, 0.1)])
def test_poses_that_are_apart_for_all_that_is_known_are_told(cell, before_ms, timeout_s):
    cell.inputs.timeout_s = timeout_s + 0.1
    cell.tell("cup", 200, 7.0)
    cell.tell("hand", before_ms, 4.0)
    cell.tell("hand", 250, 5.0)
    cell.inputs.timeout_s = timeout_s
    np.testing.assert_allclose(cell.attached(), (2.0, 0.0, 0.0), atol=1e-12)
    assert cell.warned == [
        "cup is attached to hand by poses that are 0.05 s apart, the closest ones known: if both"
        " move, attach it again while one of them rests"
    ]


def test_only_a_body_and_what_holds_it_are_not_watched_against_each_other(cell):
    cell.where.attach({"cup": "hand", "lid": "cup"}, 300 * MS)
    assert (cell.where.attachments.held, cell.where.attached_pairs) == ({}, ()), "all wait"
    for name in ("hand", "cup", "lid"):
        cell.tell(name, 290, 0.0)
    cell.where.samples(300 * MS)
    assert cell.where.attachments.held == {"cup": "hand", "lid": "cup"}
    assert cell.where.attached_pairs == (0, 2), "and not hand - lid"
    assert cell.where.unwatched.keys() == {0, 2}
