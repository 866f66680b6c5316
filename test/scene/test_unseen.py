"""Which pairs cannot see containment, where that is reported, and that the other pairs do."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from crowds import placed, samples

from proximity_monitor import __main__, engine
from proximity_monitor.scene import load_scene
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.unseen import unseen_containment

STILL = [0, 0, 0, 1]
LIMITS = "thresholds: {warn: 0.02, stop: 0.01}"


def open_box(size):
    """Return a box without its lid."""
    made = trimesh.creation.box(size)
    made.update_faces(made.triangles_center[:, 2] < size[2] / 2.0 - 1e-9)
    return made


@pytest.fixture
def scene(tmp_path):
    """Return a function that makes a scene of a zone, a part and a tip from these keys."""
    open_box((1.0, 1.0, 1.0)).export(tmp_path / "zone.stl")

    def made(zone="primitive: {box: {size: [1, 1, 1]}}", part="", head=LIMITS):
        path = tmp_path / "scene.yaml"
        path.write_text(
            f"version: 1\nunit: m\n{head}\nbodies:\n"
            f"  - {{name: zone, {zone}, pose: {{position: [0, 0, 0]}}}}\n"
            "  - {name: part, primitive: {box: {size: [0.05, 0.05, 0.05]}}, moving: true"
            f"{part}}}\n"
            "  - {name: tip, primitive: {point: {}}, moving: true}\n"
        )
        loaded = load_scene(path)
        return loaded, load_models(loaded)

    return made


def bounds(monitor, budget_s=1.0, **positions):
    """Return the bounds of the zone's pairs after one tick, by the other body."""
    poses = {name: placed([x, 0.003, 0.002], STILL) for name, x in positions.items()}
    tick = monitor.tick(samples(poses), budget_s)
    assert tick.left == 0 or budget_s < 1.0
    return {pair.b: (pair.lower, pair.upper) for pair in tick.pairs if pair.a == "zone"}


SIGHTED = {
    "both solid": ("primitive: {box: {size: [1, 1, 1]}}", ""),
    "the zone alone": ("primitive: {box: {size: [1, 1, 1]}}", ", solid: false"),
    "robust zone": ("model: zone.stl, solid: robust", ""),
    "robust zone, surface": ("model: zone.stl, solid: robust", ", solid: false"),
}


@pytest.mark.parametrize("question", ["distance", "within", "collide"])
@pytest.mark.parametrize("zone, part", SIGHTED.values(), ids=SIGHTED)
def test_a_slow_drive_through_the_wall_is_never_clear_once_it_touches(scene, zone, part, question):
    """It is not clear even in the middle, where it is 0.475 m from every wall."""
    limits = {"distance": LIMITS, "within": f"{LIMITS}\nquestion: within"}
    monitor = Monitor(*scene(zone, part, limits.get(question, f"question: {question}")))
    for x in np.arange(0.7, -0.7, -0.0137):
        for name, (lower, upper) in bounds(monitor, part=x, tip=x).items():
            apart = abs(x) - 0.5 - (0.025 if name == "part" else 0.0)
            if apart <= 0.0:
                assert lower <= 0.0, (name, x)
            elif apart > 0.01:  # a nearer pair is at stop, and no more may be known
                assert lower > 0.0, (name, x)
            assert lower <= upper
            if apart < 0.0 and question == "distance" and name == "tip":
                assert upper < 0.0


@pytest.mark.parametrize("budget_s", [0.0, 1e-5, 1.0])
def test_what_appears_in_the_middle_is_not_clear_whatever_the_time(scene, budget_s):
    loaded, models = scene()
    for inside in ({"part": 0.0, "tip": 0.0}, {"part": 0.3, "tip": 0.2}):
        monitor = Monitor(loaded, models)
        bounds(monitor, part=3.0, tip=3.0)
        for lower, _ in bounds(monitor, budget_s, **inside).values():
            assert lower < 0.0


def test_bounds_of_a_robust_solid_hold_while_a_tip_passes_its_hole(scene):
    """The distance jumps at the hole, so bounds from one side are not used on the other."""
    loaded, models = scene("model: zone.stl, solid: robust")
    monitor, tip = Monitor(loaded, models), engine.points([[0.0, 0.0, 0.0]])
    for k, z in enumerate(np.arange(0.9, 0.1, -0.011)):
        pose = placed([0.003, 0.002, z], STILL)
        tick = monitor.tick(samples({"tip": pose, "part": placed([5, 0, 0], STILL)}), float(k % 2))
        (pair,) = (pair for pair in tick.pairs if (pair.a, pair.b) == ("zone", "tip"))
        true = engine.signed_distance(models["zone"], np.eye(4), tip, pose)
        assert pair.lower <= true.upper
        assert true.lower <= pair.upper
        assert k % 2 == 0 or pair.upper - pair.lower < 1e-9


def test_pairs_of_surfaces_are_named_with_the_reason_and_the_way_out(scene):
    loaded, models = scene("model: zone.stl", ", solid: false")
    unseen = unseen_containment(loaded, models)
    assert (unseen.count, unseen.pairs[0]) == (3, ("zone", "part"))
    text = str(unseen)
    assert "3 watched pairs cannot detect one body inside the other" in text
    assert "zone - part, zone - tip, part - tip" in text
    assert "'solid: robust'" in text
    assert "not a solid: zone: not watertight: 4 open edges" in text
    assert "not a solid: part: it is declared a surface" in text
    assert "not a solid: tip" not in text, "a point holds nothing"
    for seen in (scene(), scene("model: zone.stl, solid: robust")):
        assert unseen_containment(*seen).count == 0
        assert str(unseen_containment(*seen)) == ""


def test_a_solid_is_not_seen_inside_a_larger_surface_though_inside_a_larger_solid(scene):
    loaded, models = scene("model: zone.stl")
    unseen = unseen_containment(loaded, models)
    assert unseen.pairs == (("zone", "part"), ("zone", "tip"))
    assert bounds(Monitor(loaded, models), part=0.0)["part"][0] > 0.4
    assert unseen_containment(*scene(part=", solid: false")).pairs == (("part", "tip"),)


def test_a_pair_of_equal_surfaces_counts_once(tmp_path):
    path = tmp_path / "scene.yaml"
    body = "primitive: {box: {size: [1, 1, 1]}}, moving: true, solid: false"
    path.write_text(
        f"version: 1\nunit: m\nbodies:\n  - {{name: a, {body}}}\n  - {{name: b, {body}}}\n"
    )
    loaded = load_scene(path)
    assert unseen_containment(loaded, load_models(loaded)).pairs == (("a", "b"),)


def test_scene_check_says_which_pairs_cannot_see_containment(scene, capsys):
    loaded, _ = scene("model: zone.stl", ", solid: false")
    assert __main__.main(["scene", "check", str(loaded.path)]) == 0
    assert "warning: 3 watched pairs cannot detect" in capsys.readouterr().out
    loaded, _ = scene()
    assert __main__.main(["scene", "check", str(loaded.path)]) == 0
    assert "cannot detect" not in capsys.readouterr().out


def test_a_file_that_must_be_a_solid_and_is_none_is_refused_by_key_and_line(scene):
    expected = r"scene.yaml:5: bodies\[0\]\.solid: true, but body 'zone' is not a solid: not water"
    with pytest.raises(engine.ModelError, match=expected):
        scene("model: zone.stl, solid: true")


def test_two_points_have_nothing_to_see(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "version: 1\nunit: m\nbodies:\n"
        "  - {name: a, primitive: {point: {}}, moving: true}\n"
        "  - {name: b, primitive: {point: {}}, moving: true}\n"
    )
    loaded = load_scene(path)
    assert unseen_containment(loaded, load_models(loaded)).count == 0
