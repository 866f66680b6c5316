"""The page's model, without a browser: scene, signs, holds, geometry, motion."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest
from ticks import pairs

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.event_picture import _figure
from proximity_monitor.display.events import Event
from proximity_monitor.display.geometry import (
    feature_edges,
    from_degrees,
    moved,
    rotate,
    to_degrees,
)
from proximity_monitor.display.holds import Hand, Holds
from proximity_monitor.display.signs import (
    CLEAR_SIGN,
    STOP_SIGN,
    clearance,
    length,
    ramp,
    sign,
    uncertain,
)
from proximity_monitor.display.state import (
    BOUNDED,
    INTERSECTING,
    OVERLAPPING,
    STALE,
    STOP,
    UNKNOWN,
    WARN,
    Pairs,
    Playing,
    SceneInfo,
    Thresholds,
    Unit,
)

MM = Unit("mm", 0.001)
TOLD = {
    "name": "cell",
    "path": "/scenes/cell.yaml",
    "description": "",
    "frame": "world",
    "unit": {"symbol": "mm", "to_metre": 0.001},
    "bodies": [
        {"name": "a", "moving": False, "topic": None, "point": False, "mesh": "1"},
        {"name": "b", "moving": True, "topic": "/bodies/b/pose", "point": False, "mesh": "2"},
        {"name": "c", "moving": True, "topic": None, "point": True, "mesh": "3"},
    ],
    "checksum": 1,
    "words": [],
    "deforming": [],
    "pairs": 2,
    "thresholds": {"warn": 0.1, "stop": 0.02, "hysteresis": 0.0},
    "own_thresholds": [{"a": "a", "b": "c", "warn": 0.2, "stop": 0.1, "hysteresis": 0.0}],
    "attachments": {},
    "held": {},
    "unwatched": [],
    "own_parameters": True,
    "settings": {"rate_hz": 30.0},
}
CELL = SceneInfo.read(json.dumps(TOLD))
MOTION = {"moment_s": 2.0, "stamp_s": 10.0, "speed": 0.5, "period_s": 3.0}


def test_a_scene_is_read():
    scene = SceneInfo.read(json.dumps(TOLD))
    assert scene.moving == ("b", "c")
    assert scene.body("c").point
    assert scene.thresholds_of(("a", "b")) == Thresholds(0.1, 0.02, 0.0)
    assert scene.thresholds_of(("a", "c")) == Thresholds(0.2, 0.1, 0.0)


def last_body(**changed):
    return {"bodies": [*TOLD["bodies"][:2], TOLD["bodies"][2] | changed]}


@pytest.mark.parametrize(
    "changed, other",
    [
        ({"name": "cell_2"}, True),
        ({"frame": "base"}, True),
        ({"unit": {"symbol": "in", "to_metre": 0.0254}}, True),
        (last_body(mesh="4"), True),
        (
            {"bodies": [TOLD["bodies"][0] | {"pose": [1, 0, 0, 1, 0, 0, 0]}, *TOLD["bodies"][1:]]},
            True,
        ),
        ({"bodies": [TOLD["bodies"][0] | {"colour": [1, 0, 0, 1]}, *TOLD["bodies"][1:]]}, True),
        ({"settings": {"rate_hz": 10.0}, "deforming": ["b"]}, False),
    ],
)
def test_what_makes_it_another_scene(changed, other):
    before, after = (SceneInfo.read(json.dumps(told)) for told in (TOLD, TOLD | changed))
    assert (before.key != after.key) is other


@pytest.mark.parametrize("text", ["[]", "{}", json.dumps(TOLD | {"unit": {"symbol": "mm"}})])
def test_what_is_no_scene_is_refused_with_the_way_out(text):
    with pytest.raises(ValueError, match="do monitor and display have the same"):
        SceneInfo.read(text)


def test_a_text_that_no_browser_can_be_told_makes_it_unreadable():
    with pytest.raises(ValueError, match=r"not Unicode: it has the lone surrogate \\ud83d"):
        SceneInfo.read(json.dumps(TOLD | {"description": "ok \ud83d"}))


def test_numbers_bear_their_unit():
    assert length(0.00002, MM) == "0.020 mm"
    assert length(-0.5, Unit("m", 1.0)) == "-0.50000 m"
    assert length(0.0254, Unit("in", 0.0254)) == "1.0000 in"
    assert length(np.inf, MM) == "∞ mm"


def test_what_rounds_to_zero_has_no_minus():
    assert length(-1e-8, MM) == length(0.0, MM) == "0.000 mm"
    assert length(-6e-7, MM) == "-0.001 mm"


def test_an_event_whose_bounds_read_the_same_has_one_number():
    then = SimpleNamespace(lower=0.0574760, upper=0.0574761)
    given = Event(0, 1.0, ("a", "b"), CLEAR_SIGN, STOP_SIGN, "", then)
    scene = SimpleNamespace(unit=MM)
    assert "STOP, 57.476 mm<" in _figure(given, None, "", scene, 0.0)
    then.upper = 0.0575
    assert "STOP, between 57.476 mm and 57.500 mm<" in _figure(given, None, "", scene, 0.0)


def test_one_number_where_it_is_known_and_both_bounds_where_they_differ():
    assert clearance(pairs([0.001, 0], [0.001, 0]), 0, MM) == "1.000 mm"
    cut = pairs([0.001, 0], [0.0025, 0], status=BOUNDED)
    assert clearance(cut, 0, MM) == "1.000 … 2.500 mm"
    assert uncertain(cut, 0)
    assert clearance(pairs([-0.003, 0], [-0.001, 0], status=OVERLAPPING), 0, MM) == (
        "1.000 … 3.000 mm deep"
    )
    assert clearance(pairs([np.nan, 0], [np.nan, 0], status=UNKNOWN), 0, MM) == "no pose"
    assert clearance(pairs([0.001, 0], [0.001, 0], level=STALE), 0, MM) == "last 1.000 mm"


def test_every_state_has_a_glyph_and_a_word_of_its_own():
    told = [
        sign(pairs([0.01, 0], [0.01, 0], status, level), 0, CELL)
        for status, level in (
            (0, 0),
            (0, WARN),
            (0, STOP),
            (INTERSECTING, STOP),
            (0, STALE),
        )
    ]
    assert len({each.glyph for each in told}) == len({each.word for each in told}) == 5
    assert sign(pairs([-0.1, 0], [-0.1, 0], OVERLAPPING, STOP), 0, CELL).word == "OVERLAP"


@pytest.mark.parametrize("level, threshold, word", [(STOP, 0.02, "STOP"), (WARN, 0.1, "warn")])
def test_bounds_that_enclose_a_threshold_prove_nothing_and_look_so(level, threshold, word):
    sure = sign(pairs([0.5 * threshold, 0], [threshold, 0], BOUNDED, level), 0, CELL)
    open_ = sign(pairs([threshold, 0], [1.5 * threshold, 0], BOUNDED, level), 0, CELL)
    kept = sign(
        pairs([1.1 * threshold, 0], [1.5 * threshold, 0], BOUNDED, level), 0, CELL
    )  # hysteresis
    assert (sure.word, open_.word, kept.word) == (word, f"{word}?", word)
    assert sure.glyph != open_.glyph


def test_the_colour_runs_from_stop_over_warn_to_clear():
    thresholds = Thresholds(warn=0.1, stop=0.02, hysteresis=0.0)

    def colour(metres, touching=False, stale=False):
        return tuple(ramp(metres, thresholds, touching=touching, stale=stale))

    assert colour(0.0) == colour(0.02) != colour(0.0201)
    assert colour(0.1) != colour(0.2) != colour(0.4) == colour(9.0)
    between = np.array(colour(0.06))
    np.testing.assert_allclose(between, (np.array(colour(0.02)) + colour(0.1)) / 2.0)
    assert len({colour(0.0), colour(0.0, touching=True), colour(0.0, stale=True)}) == 3
    # Thresholds of 0 cause no division by zero.
    assert np.isfinite(ramp(0.0, Thresholds(0.0, 0.0, 0.0), touching=False, stale=False)).all()


START, THERE, FAR = (np.array([x, 0, 0, 1.0, 0, 0, 0]) for x in (0.0, 1.0, 2.0))


@pytest.fixture
def holds():
    return Hand(Holds(), "one")


def test_a_held_body_is_published_until_it_is_let_go(holds):
    holds.move("b", THERE)
    assert not holds.poses  # only a taken body moves
    holds.take("b", START)
    holds.move("b", THERE)
    assert holds.poses["b"] is THERE
    holds.release("b")
    assert not holds.poses
    assert not holds.can_undo


def test_a_drag_is_one_step_and_steps_are_undone_one_by_one(holds):
    holds.take("b", START)
    holds.move("b", THERE)
    holds.move("b", FAR)
    holds.place("b", THERE, now=START)
    assert holds.undo() == "b"
    assert holds.poses["b"] is FAR
    assert holds.undo() == "b"
    assert holds.poses["b"] is START
    assert holds.undo() is None


def test_a_reset_goes_back_to_the_first_pose_and_can_be_undone(holds):
    holds.place("b", THERE, now=START)
    holds.place("b", FAR, now=START)
    holds.reset("b")
    assert holds.poses["b"] is START
    holds.undo()
    assert holds.poses["b"] is FAR


def test_releasing_all_forgets_all(holds):
    holds.place("b", THERE, now=START)
    holds.place("c", THERE, now=START)
    holds.release()
    assert not holds.poses


def test_a_body_has_one_owner_until_it_lets_go_gives_it_over_or_leaves():
    holds = Holds()
    one, two = Hand(holds, "one"), Hand(holds, "two")
    assert one.take("b", START)
    assert not two.take("b", START)
    two.move("b", FAR)
    two.place("b", FAR, now=START)
    two.reset("b")
    two.release("b")
    assert holds.poses["b"] is START
    assert not two.can_undo
    assert (two.other("b"), one.other("b")) == (one, None)
    one.move("b", THERE)
    two.take_over("b")
    assert holds.owner("b") is two
    assert holds.poses["b"] is THERE
    one.move("b", FAR)
    assert holds.poses["b"] is THERE
    assert not one.can_undo
    one.take("c", START)
    two.leave()
    assert holds.poses.keys() == {"c"}
    assert not two.take("b", START)  # a late message of a browser that has left


def test_an_ignored_pair_is_no_longer_highlighted_and_comes_back():
    choice = Choice(pair=("a", "b"))
    choice.ignore(("a", "b"))
    assert choice.pair is None
    assert ("a", "b") in choice.ignored
    choice.ignore(("a", "b"))
    assert not choice.ignored


@pytest.mark.parametrize("angles", [(10.0, 20.0, 30.0), (-170.0, 80.0, 5.0), (0.0, 0.0, 180.0)])
def test_degrees_and_quaternions_agree(angles):
    turn = from_degrees(*angles)
    np.testing.assert_allclose(to_degrees(turn), angles, atol=1e-9)
    assert np.linalg.norm(turn) == pytest.approx(1.0)


@pytest.mark.parametrize("pitch", [90.0, -90.0, 90.0 - 1e-8, 89.9999, 90.0005])
@pytest.mark.parametrize("roll, yaw", [(30.0, 0.0), (30.0, 10.0), (123.0, -77.0), (0.0, 180.0)])
def test_angles_of_a_part_that_points_straight_up_or_down_are_its_own(roll, pitch, yaw):
    turn = from_degrees(roll, pitch, yaw)
    told = to_degrees(turn)
    there = abs(turn @ from_degrees(*told))
    assert np.degrees(2.0 * np.arccos(min(1.0, there))) < 1e-5
    if abs(pitch) == 90.0:
        assert told[2] == 0.0


def test_roll_pitch_and_yaw_turn_about_fixed_axes_in_this_order():
    turn = from_degrees(90.0, 0.0, 90.0)  # roll turns y to z, and yaw leaves z alone
    np.testing.assert_allclose(rotate(turn, np.array([0.0, 1, 0])), [0, 0, 1], atol=1e-15)
    pose = np.array([5.0, 0, 0, *turn])
    np.testing.assert_allclose(moved(pose, np.array([0.0, 1, 0]))[:3], [5, 0, 1], atol=1e-15)


def test_a_box_has_twelve_feature_edges_and_a_flat_sheet_its_border():
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    edges = feature_edges(box.triangles.reshape(-1, 3))
    assert len(edges) == 12
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    assert sorted(lengths.round(9)) == [1.0] * 4 + [2.0] * 4 + [3.0] * 4
    sheet = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    assert len(feature_edges(sheet)) == 4


def test_the_moment_of_a_motion_follows_from_what_its_player_told():
    playing = Playing.read(json.dumps(MOTION))
    assert [playing.at(stamp_s) for stamp_s in (9.0, 10.0, 11.0, 13.0)] == [2.0, 2.0, 2.5, 0.5]
    endless = Playing.read(json.dumps(MOTION | {"period_s": None}))
    assert endless.at(13.0) == 3.5
    resting = Playing.read(json.dumps(MOTION | {"repeats": False}))
    assert resting.at(13.0) == resting.period_s


@pytest.mark.parametrize(
    "told", [[], {}, MOTION | {"speed": "x"}, MOTION | {"stamp_s": float("inf")}, MOTION | {"x": 1}]
)
def test_another_program_s_motion_is_refused(told):
    with pytest.raises(ValueError, match="~/motion"):
        Playing.read(json.dumps(told))


class Counted(str):
    """A name that counts how often it is hashed."""

    hashed = 0

    def __hash__(self):
        Counted.hashed += 1
        return super().__hash__()


def test_the_names_of_a_tick_are_hashed_once_however_often_rows_are_looked_up():
    names = ((Counted("a"), Counted("b")), (Counted("a"), Counted("c")))
    zeros = np.zeros(2)
    pairs = Pairs(names, zeros, zeros, np.zeros((2, 2, 3)), zeros, zeros, zeros, zeros, ("", ""))
    assert pairs.places["a", "c"] == 1
    before = Counted.hashed
    for _ in range(100):
        assert pairs.places["a", "b"] == 0
    assert Counted.hashed == before


def test_warn_and_stop_of_all_pairs_are_those_of_each():
    own = {("a", "b"): Thresholds(0.5, 0.25, 0.0)}
    scene = dataclasses.replace(CELL, thresholds=Thresholds(2, 1, 0), own_thresholds=own)
    warn, stop = scene.warn_and_stop((("a", "c"), ("a", "b")))
    assert (warn.tolist(), stop.tolist()) == ([2.0, 0.5], [1.0, 0.25])
