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


def test_every_pair_to_a_range_and_some_of_their_own(load):
    """`all` is every body; the later of two entries about a pair counts."""
    pairs = load(
        BODIES.replace("tolerance", "range: 9\ntolerance")
        + """\
pairs:
  watch:
    - {between: [p1, p2], range: 4, question: within}
    - {between: [all, all], tolerance: {abs_err: 0.5}}
    - {between: [p1, wall], question: within, range: 5}
  exclude: [[floor, p2]]
"""
    ).pairs
    assert [(p.a, p.b, p.range, p.question, p.abs_err) for p in pairs] == [
        ("floor", "p1", 9.0, "distance", 0.5),
        ("p1", "wall", 5.0, "within", 0.01),
        ("p1", "p2", 9.0, "distance", 0.5),
        ("wall", "p2", 9.0, "distance", 0.5),
    ]


def test_a_body_may_be_called_all(load):
    text = BODIES.replace("p2", "all") + "pairs: {watch: [{between: [all, p1]}]}\n"
    assert names(load(text)) == ["p1 all"]


def test_who_asks_for_contact_alone_has_no_thresholds(load, problems):
    section = "pairs: {watch: [{between: [p1, p2], question: collide}]}\n"
    (pair,) = load(BODIES + section).pairs
    assert pair.question == "collide"
    assert pair.thresholds == Thresholds(0.0, 0.0, 0.0)
    assert pair.own_thresholds, "the scene's must not come in their place"
    (problem,) = problems(BODIES + section.replace("collide", "collide, thresholds: {warn: 3}"))
    assert problem.startswith("10: pairs.watch[0].thresholds: have no effect")


def test_lengths_are_in_the_unit_and_no_range_is_no_limit(load):
    text = BODIES.replace("unit: m", "unit: mm")
    assert [pair.range for pair in load(text).pairs] == [float("inf")] * 5
    assert {pair.range for pair in load(text + "range: 40\n").pairs} == {0.04}


@pytest.mark.parametrize(
    "text, expected",
    [
        ("range: 3.4\n", "10: range: range must not be less than warn + hysteresis"),
        ("range: 0\n", "10: range: must be greater than 0"),
        ("range: .inf\n", "10: range: "),
        ("question: near\n", "10: question: must be one of "),
        (
            "pairs:\n  watch:\n    - {between: [p1, p2], range: 3.4}\n",
            "12: pairs.watch[0].range: range must not be less than warn + hysteresis",
        ),
        (
            "range: 4\npairs:\n  watch:\n    - {between: [p1, p2], thresholds: {warn: 3.6}}\n",
            "13: pairs.watch[0].thresholds: range must not be less than warn + hysteresis",
        ),
    ],
)
def test_a_range_that_would_hide_alerts_is_a_mistake(problems, text, expected):
    (problem,) = problems(BODIES + text)
    assert problem.startswith(expected)


def test_what_a_file_says_of_being_solid(load, problems):
    for said, meant in (("true", True), ("false", False), ("robust", "robust")):
        text = BODIES.replace("name: p1,", f"name: p1, solid: {said},")
        assert [body.solid for body in load(text).bodies] == [None, meant, None, None]
        for wrong in ("1", "sturdy"):
            (problem,) = problems(text.replace(f"solid: {said}", f"solid: {wrong}"))
            assert problem.startswith("7: bodies[1].solid: must be one of true, false, 'robust'")


def test_half_a_million_pairs_load_without_being_made(load):
    bodies = "".join(
        f"  - {{name: b{i}, primitive: {{box: {{size: [1, 1, 1]}}}}, moving: true}}\n"
        for i in range(1000)
    )
    scene = load(f"version: 1\nunit: m\nrange: 0.5\nbodies:\n{bodies}pairs: all\n")
    assert len(scene.pairs) == 499_500
    assert (scene.pairs[-1].a, scene.pairs[-1].b) == ("b998", "b999")
