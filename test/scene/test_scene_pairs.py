"""Which pairs are watched, in which order, and with what."""

import pytest

from proximity_monitor.scene import Thresholds

BODIES = """\
version: 1
unit: m
tolerance: {rel_err: 0.1, abs_err: 0.01}
thresholds: {warn: 3, stop: 2, hysteresis: 0.5}
bodies:
  - {name: floor, primitive: {box: {size: [1, 1, 1]}}, pose: {position: [0, 0, 0]}}
  - {name: p1, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: wall, primitive: {box: {size: [1, 1, 1]}}, pose: {position: [0, 0, 0]}}
  - {name: p2, primitive: {box: {size: [1, 1, 1]}}, moving: true}
"""
ALL = ["floor p1", "floor p2", "p1 wall", "p1 p2", "wall p2"]
GROUPS = "  groups: {ps: [p2, p1], fixed: [wall, floor], mixed: [p1, wall]}\n"


def names(scene):
    return [f"{pair.a} {pair.b}" for pair in scene.pairs]


CHOICES = {
    "left out": ("", ALL),
    "all": ("pairs: all\n", ALL),
    "an empty mapping": ("pairs: {}\n", ALL),
    "all but some": ("pairs: {exclude: [[wall, p1], [p2, p1]]}\n", [ALL[0], ALL[1], ALL[4]]),
    "one, named backwards": ("pairs: {watch: [{between: [p2, floor]}]}\n", ["floor p2"]),
    "twice": ("pairs: {watch: [{between: [p1, p2]}, {between: [p2, p1]}]}\n", ["p1 p2"]),
    "group and body": (
        f"pairs:\n{GROUPS}  watch: [{{between: [ps, wall]}}]\n",
        ["p1 wall", "wall p2"],
    ),
    "two groups": (
        f"pairs:\n{GROUPS}  watch: [{{between: [ps, fixed]}}]\n",
        ["floor p1", "floor p2", "p1 wall", "wall p2"],
    ),
    "within a group": (f"pairs:\n{GROUPS}  watch: [{{between: [ps, ps]}}]\n", ["p1 p2"]),
    "groups that overlap": (
        f"pairs:\n{GROUPS}  watch: [{{between: [ps, mixed]}}]\n",
        ["p1 wall", "p1 p2", "wall p2"],
    ),
    "fixed ones among them": (
        f"pairs:\n{GROUPS}  watch: [{{between: [mixed, fixed]}}]\n",
        ["floor p1", "p1 wall"],
    ),
    "groups excluded": (f"pairs:\n{GROUPS}  exclude: [[ps, fixed]]\n", ["p1 p2"]),
}


@pytest.mark.parametrize("section, expected", CHOICES.values(), ids=CHOICES)
def test_choice_and_order(load, section, expected):
    assert names(load(BODIES + section)) == expected


def test_the_scenes_limits_are_the_defaults(load):
    for pair in load(BODIES).pairs:
        assert (pair.rel_err, pair.abs_err) == (0.1, 0.01)
        assert pair.thresholds == Thresholds(3.0, 2.0, 0.5)
        assert not pair.own_thresholds


def test_limits_of_their_own_take_the_rest_from_the_scene(load):
    first, second, third = load(
        BODIES
        + """\
pairs:
  watch:
    - {between: [floor, p1], thresholds: {warn: 2.5}}
    - {between: [floor, p2], tolerance: {rel_err: 0}}
    - {between: [p1, p2], tolerance: {abs_err: 0}, thresholds: {warn: 1, stop: 1, hysteresis: 0}}
"""
    ).pairs
    assert (first.thresholds, first.own_thresholds) == (Thresholds(2.5, 2.0, 0.5), True)
    assert (first.rel_err, first.abs_err) == (0.1, 0.01)
    assert (second.thresholds, second.own_thresholds) == (Thresholds(3.0, 2.0, 0.5), False)
    assert (second.rel_err, second.abs_err) == (0.0, 0.01)
    assert (third.thresholds, third.own_thresholds) == (Thresholds(1.0, 1.0, 0.0), True)
    assert (third.rel_err, third.abs_err) == (0.1, 0.0)


def test_of_two_entries_for_a_pair_the_later_one_counts(load):
    pairs = load(
        BODIES
        + f"pairs:\n{GROUPS}"
        + """\
  watch:
    - {between: [ps, fixed], thresholds: {warn: 9, stop: 8}}
    - {between: [p1, wall], thresholds: {warn: 5, stop: 4}}
"""
    ).pairs
    assert [pair.thresholds.warn for pair in pairs] == [9.0, 9.0, 5.0, 9.0]
