"""Bands: which places of a part are nearer than stop or warn, and how certain that is."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import ticks

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor import engine
from proximity_monitor.display import bands as bands_of
from proximity_monitor.display.banding import Banding
from proximity_monitor.display.bands import (
    ABOVE,
    BELOW_STOP,
    BELOW_WARN,
    BUDGET_S,
    FINEST,
    UNKNOWN,
    Other,
    bands,
    matrix,
    model_of,
)
from proximity_monitor.display.received import Part
from proximity_monitor.scene import Thresholds

THRESHOLDS = Thresholds(0.3, 0.1, 0.0)
HERE = np.array([0.0, 0, 0, 1, 0, 0, 0])
PLATE = np.array([[[0, 0, 0], [2, 0, 0], [2, 2, 0]], [[0, 0, 0], [2, 2, 0], [0, 2, 0]]], float)


def part(corners):
    return Part(HERE, np.ones(4), corners.reshape(-1, 3))


def point(*place, thresholds=THRESHOLDS):
    """Return a point at a place, as another part."""
    return Other(
        model_of(part(np.zeros((1, 3, 3))), True),
        matrix(np.array([*place, 1, 0, 0, 0])),
        thresholds,
    )


def distances(corners, place, rng):
    """Return the distances of random points of triangles from a place."""
    weights = rng.dirichlet(np.ones(3), size=(len(corners), 8))
    return np.linalg.norm(weights @ corners - place, axis=2)


def area(corners):
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0


def test_a_point_over_the_middle_of_a_plate_makes_bands_where_the_plate_has_no_corner():
    place = np.array([0.7, 1.1, 0.05])
    corners, of, sampled_m, *_ = bands(PLATE, [point(*place)], budget_s=60.0)
    assert area(corners).sum() == pytest.approx(4.0)
    assert 0.0 < sampled_m <= 2.0 * FINEST
    far = distances(corners, place, np.random.default_rng(3))
    for band, least, most in ((BELOW_STOP, 0, 0.1), (BELOW_WARN, 0.1, 0.3), (ABOVE, 0.3, 9)):
        found = far[of == band]
        assert ((found > least - sampled_m) & (found < most + sampled_m)).all()
    assert area(corners[of == BELOW_STOP]).sum() == pytest.approx(np.pi * 0.0075, rel=0.1)


def test_where_no_point_is_near_a_threshold_every_band_is_certain():
    _, of, sampled_m, *_ = bands(PLATE, [point(0.5, 0.5, 0.4)], budget_s=60.0)
    assert (of == ABOVE).all()
    assert sampled_m == 0.0


def test_a_fit_is_clear_although_its_gap_is_finer_than_the_finest_triangle():
    above = part(PLATE + np.array([0.0, 0.0, 1e-3]))
    tight = Other(model_of(above, False), np.eye(4), Thresholds(6e-4, 1e-4, 0.0))
    _, of, sampled_m, *_ = bands(PLATE, [tight], budget_s=60.0)
    assert (of == ABOVE).all()
    assert 1e-3 < sampled_m <= 2.0 * FINEST


def test_the_worst_of_all_parts_counts_each_with_its_own_limits():
    there = [
        point(0.5, 0.5, 0.2, thresholds=Thresholds(0.25, 0.22, 0.0)),
        point(0.5, 0.5, 0.15, thresholds=Thresholds(0.1, 0.05, 0.0)),
    ]
    of = bands(PLATE, there, budget_s=60.0).band
    assert (of == BELOW_STOP).any()
    of = bands(PLATE, there[1:], budget_s=60.0).band
    assert (of == ABOVE).all()
    assert (bands(PLATE, []).band == ABOVE).all()


def test_without_time_nothing_is_said_to_be_above():
    many = np.concatenate([PLATE] * 20_000)
    of = bands(many, [point(9.0, 9.0, 9.0)] * 3, budget_s=0.0).band
    assert (of == UNKNOWN).sum() > len(many) // 2
    assert bands(PLATE, [point(1.0, 1.0, 0.1)], budget_s=0.0).cut
    assert not bands(PLATE, [point(1.0, 1.0, 0.1)], budget_s=60.0).cut
    assert (of != BELOW_STOP).all()


def test_what_is_inside_a_solid_is_below_stop():
    low, high = np.full(3, -5.0), np.full(3, 5.0)
    side = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]).reshape(2, 3, 2)
    box = np.concatenate(
        [np.insert(side, axis, end, axis=2) for axis in range(3) for end in (0, 1)]
    )
    for first in (0, 6, 8):
        box[first : first + 2] = box[first : first + 2, ::-1]  # turned outwards
    solid = part(np.stack((low, high))[box, np.arange(3)])
    model = model_of(solid, False)
    assert model.is_solid
    assert model_of(solid, False) is model
    turned = matrix(np.array([0.3, 0, 0, 0.6, 0, 0.8, 0]))
    of = bands(PLATE, [Other(model, turned, THRESHOLDS)], budget_s=60.0).band
    assert (of == BELOW_STOP).all()


BALL = engine.SolidOfRevolution([engine.Curve([[0, -1], [2, -1], [2, 1], [0, 1]])])


def drawn(model, tolerance):
    """Return a model as the part that the page gets."""
    shown = model.display_mesh(tolerance)
    corners = shown.corners().reshape(-1, 3)
    return Part(HERE, np.ones(4), corners, solid=model.is_solid, deviation=shown.off)


def other(part, *place, thresholds=THRESHOLDS):
    return Other(
        model_of(part, False), matrix(np.array([*place, 1, 0, 0, 0])), thresholds, part.deviation
    )


def test_deep_inside_a_curved_solid_is_below_stop_though_its_triangles_do_not_close():
    part = drawn(BALL, 0.02)
    tiny = PLATE * 0.01
    assert (
        engine.signed_distance(
            BALL, np.eye(4), engine.shapes.points(tiny.reshape(-1, 3)), np.eye(4)
        ).upper
        < -0.3
    )
    found = bands(tiny, [other(part, 0, 0, 0)], budget_s=60.0)
    assert (found.band == BELOW_STOP).all()
    assert found.deviation_m == found.sampled_m == 0.0


def test_what_is_no_solid_is_clear_inside():
    low = np.array([[-5.0, -5, -5]])
    box = engine.shapes.box([10, 10, 10], solid=False).display_mesh(0.0).corners()
    part = Part(HERE, np.ones(4), box.reshape(-1, 3), solid=False)
    of = bands(PLATE + low * 0.2, [other(part, 0, 0, 0)], budget_s=60.0).band
    assert (of == ABOVE).all()


@pytest.mark.parametrize("own", [0.0, 0.02])
def test_no_band_is_certain_that_depends_on_how_far_what_is_drawn_is_off(own):
    square = drawn(engine.TriangleMesh(PLATE.reshape(-1, 3), np.arange(6).reshape(2, 3)), 0.0)
    for gap, deviation, certain in ((0.2, 0.05, True), (0.11, 0.05, False), (0.29, 0.05, False)):
        square.deviation = deviation - own
        there = Other(
            engine.shapes.triangles(
                PLATE.reshape(-1, 3), np.arange(6).reshape(2, 3), deviation=square.deviation
            ),
            matrix(np.array([0, 0, gap, 1, 0, 0, 0])),
            THRESHOLDS,
            square.deviation,
        )
        found = bands(PLATE, [there], budget_s=60.0, deviation=own)
        assert (found.band == BELOW_WARN).all()  # of the drawn triangles
        assert found.deviation_m == (0.0 if certain else pytest.approx(deviation))
    square.deviation = np.inf
    unknown = Other(model_of(square, False), np.eye(4), THRESHOLDS, np.inf)
    assert bands(PLATE, [unknown], budget_s=60.0).deviation_m == np.inf


def test_what_bands_depend_on_is_looked_up_once_a_tick_and_only_near_the_part(monkeypatch):
    names = tuple("abcdefgh")
    around = tuple(pairwise(names))
    told = ticks.frame(1.0, [0.3] * len(around), names=around)
    told = replace(told, poses=np.tile(HERE, (len(names), 1)))
    scene, _ = ticks.scene_and_frame()
    scene = replace(scene, bodies=tuple(replace(scene.bodies[0], name=name) for name in names))
    parts = [part(PLATE)] * len(names)
    looked, placed = [], Banding._placed
    monkeypatch.setattr(Banding, "_placed", lambda self, *x: looked.append(x) or placed(self, *x))
    banding = Banding(None, {}, scene)
    banding._due_s = np.inf
    for _ in range(3):
        banding.show(scene, told, parts, ["b", "c"], 0.0)
    assert sorted(name for name, *_ in looked) == ["a", "b", "c", "d"]
    banding.show(scene, replace(told, stamp_s=2.0), parts, ["b"], 0.0)
    assert len(looked) == 7


class Coats(dict):
    """Stands in for the page's parts without a browser, and keeps the drawn coats."""

    scale = 1.0

    def __missing__(self, name):
        return SimpleNamespace(coat=lambda api, coats: self.__setitem__("drawn", coats))


def test_bands_that_time_has_cut_are_made_again_with_more_of_it(monkeypatch):
    """Otherwise bands that were cut on a busy machine would stay coarse while all parts rest."""
    given, make = [], bands_of.bands

    def made(corners, others, budget_s, deviation):
        given.append(budget_s)
        return make(corners, others, 60.0 if len(given) > 3 else 0.0, deviation)

    monkeypatch.setattr(bands_of, "bands", made)
    told, (scene, _) = ticks.frame(1.0, [0.2], names=(("a", "b"),)), ticks.scene_and_frame()
    told = replace(told, poses=np.array([HERE, [0, 0, 0.2, 1, 0, 0, 0]]))
    scene = replace(scene, bodies=tuple(replace(scene.bodies[0], name=name) for name in "ab"))
    banding, parts = Banding(None, Coats(), scene), [part(PLATE), part(PLATE + 0.1)]
    for step in range(8):
        banding.show(scene, told, parts, ["a"], float(step))
        if banding._job is not None:
            banding._job.answer.result()
    assert given == [BUDGET_S, 2 * BUDGET_S, 4 * BUDGET_S, 8 * BUDGET_S]
