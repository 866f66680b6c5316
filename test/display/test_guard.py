"""Drags that stop at a limit: how far the bounds of a tick let a part move."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from ticks import scene_and_frame

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.display import state as states
from proximity_monitor.display.geometry import IDENTITY, between, from_rotation_vector, rotate
from proximity_monitor.display.guard import (
    AT_CONTACT,
    AT_STOP,
    SURELY,
    carried,
    farthest,
    radius_of,
    reach,
    slack,
)
from proximity_monitor.display.state import STALE, UNKNOWN, Thresholds


def pose_of(rng):
    turn = rng.normal(size=4)
    return np.concatenate((rng.normal(size=3), turn / np.linalg.norm(turn)))


def test_no_point_of_a_ball_moves_farther_than_it_is_said_to():
    rng = np.random.default_rng(7)
    for share in (1e-6, 1e-2, 0.5, 1.0):
        before, other, centre = pose_of(rng), pose_of(rng), rng.normal(size=3)
        after = between(before, other, share)
        points = rng.normal(size=(2000, 3))
        points = centre + 0.7 * points / np.linalg.norm(points, axis=1)[:, None]
        moved = [pose[:3] + rotate(pose[3:], points) for pose in (before, after)]
        most = np.linalg.norm(moved[1] - moved[0], axis=1).max()
        bound = reach(before, after, centre, 0.7)
        assert most <= bound * (1.0 + 1e-12)
        assert most > 0.3 * bound


def test_a_guarded_drag_goes_as_far_as_the_bounds_allow_and_then_on_with_the_next_tick():
    rng, centre = np.random.default_rng(8), np.array([0.1, 0.0, 0.2])
    now, target = pose_of(rng), pose_of(rng)
    assert farthest(now, now, target, centre, 0.5, np.inf) is target
    for slack_m in (0.2, 0.01, 1e-6):
        there = farthest(now, now, target, centre, 0.5, slack_m)
        assert slack_m * 0.999 < reach(now, there, centre, 0.5) < slack_m
    for slack_m in (0.0, -1.0):
        np.testing.assert_array_equal(farthest(now, now, target, centre, 0.5, slack_m), now)


@pytest.mark.parametrize(
    "where, unlisted, room",
    [(AT_STOP, 0, 0.01), (AT_CONTACT, 0, 0.04), (AT_CONTACT, 1, 0.04), (AT_STOP, 1, 0.01)],
)
def test_a_part_s_room_is_that_of_its_own_pairs(where, unlisted, room):
    scene, frame = scene_and_frame(unlisted=unlisted)
    assert slack({"a"}, frame, scene, where) == pytest.approx(room)
    # b is 0.001 m from c, which does not limit a. An unlisted pair is beyond its range.
    for range_m, beyond in ((0.05, 0.1), (0.4, 0.4), (np.inf, 9.0)):
        scene, frame = scene_and_frame(unlisted=1, range_m=range_m)
        frame.pairs.lower[:] = 9.0
        assert slack({"a"}, frame, scene, AT_CONTACT) == pytest.approx(beyond)
    frame.pairs.status[0] = UNKNOWN
    assert slack({"a"}, frame, scene, AT_CONTACT) == 0.0


def test_silent_parts_leave_no_room_whether_their_pairs_are_listed_or_not(monkeypatch):
    scene, frame = scene_and_frame(unlisted=1)
    frame.pairs.lower[:] = 9.0
    frame.pairs.level[2] = STALE  # b and c
    assert slack({"a"}, frame, scene, AT_CONTACT) == pytest.approx(0.1)
    assert slack({"b"}, frame, scene, AT_CONTACT) == 0.0
    # A tick with LISTED_SILENT silent pairs need not list all of them.
    monkeypatch.setattr(states, "LISTED_SILENT", 1)
    scene, frame = scene_and_frame(unlisted=1)
    frame.pairs.level[2] = STALE
    assert slack({"a"}, frame, scene, AT_CONTACT) == 0.0
    assert slack({"a"}, frame, replace(scene, pairs=3), AT_CONTACT) == pytest.approx(0.04)


def test_a_warn_that_is_stop_leaves_room_up_to_the_range():
    scene, frame = scene_and_frame(unlisted=1, range_m=0.5)
    frame.pairs.lower[:] = 9.0
    scene = replace(scene, thresholds=Thresholds(0.02, 0.02, 0.0))
    assert slack({"b"}, frame, scene, AT_STOP) == pytest.approx(0.48)


def test_what_a_part_carries_counts_as_the_part_itself():
    scene, frame = scene_and_frame()
    scene = replace(scene, held={"b": "a", "d": "b"})
    assert carried("a", scene.held) == {"a", "b", "d"}
    assert carried("b", scene.held) == {"b", "d"}
    # a and b move together. The pair c - a leaves 0.01 m; b - c is nearer than its limit.
    assert slack({"a", "b"}, frame, scene, AT_STOP) == pytest.approx(0.001 - 0.02)
    frame.pairs.lower[:] = 0.001, 0.3, 0.3
    assert slack({"a", "b"}, frame, scene, AT_STOP) == pytest.approx(0.27)
    poses = np.array([[0, 0, 0, 1, 0, 0, 0], [3, 0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0, 0.0]])
    corner = np.ones(3)
    view = SimpleNamespace(low=-corner, high=corner, centre=np.zeros(3), deviation=0.25)
    parts = Views(dict.fromkeys("abc", view))
    frame = replace(frame, poses=poses)
    half = SURELY * np.sqrt(3.0) + 0.25
    assert radius_of("a", {"a"}, frame, scene, parts) == pytest.approx(half)
    assert radius_of("a", {"a", "b"}, frame, scene, parts) == pytest.approx(3.0 + half)
    poses[1] = 0.0
    assert radius_of("a", {"a", "b"}, frame, scene, parts) is None


class Views(dict):
    scale = 1.0


def test_what_reaches_nobody_knows_how_far_is_shifted_but_not_turned():
    shifted = IDENTITY + np.array([0.3, 0, 0, 0, 0, 0, 0])
    there = farthest(IDENTITY, IDENTITY, shifted, np.ones(3), np.inf, 0.1)
    assert 0.0999 < there[0] < 0.1
    turned = np.concatenate((shifted[:3], from_rotation_vector(np.array([0.0, 0, 1e-6]))))
    assert farthest(IDENTITY, IDENTITY, turned, np.ones(3), np.inf, 0.1) is IDENTITY


def test_a_turn_that_is_hardly_one_reaches_as_far_as_it_does():
    turned = np.concatenate((np.zeros(3), from_rotation_vector(np.array([0.0, 0, 1e-9]))))
    assert reach(IDENTITY, turned, np.zeros(3), 1.0) == pytest.approx(1e-9, abs=0.0)
