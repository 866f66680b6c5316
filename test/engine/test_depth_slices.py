"""A search for a depth can be cut in the middle of a cell. Its bounds hold, and it goes on."""

from __future__ import annotations

import math

import pytest
from engine_bodies import IDENTITY, sphere, torus, translation
from engine_surfaces import torus_patches
from test_revolution import cylinder
from test_revolution import torus as ring

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.state import CUT
from proximity_monitor.engine.kernels.inside.ball_state import BOUNDING
from proximity_monitor.engine.questions.ball import BallSearch

PAIRS = {
    "meshes": (torus(16), sphere(2), translation(0.9, 0.1, 0.05)),
    "surfaces": (
        engine.ParametricSurface(torus_patches(), solid=True),
        engine.ParametricSurface(torus_patches(), solid=True),
        translation(0.5, 0.0, 0.1),
    ),
    "solids of revolution": (cylinder(0.5, 0.5), ring(0.7, 0.3), translation(0.1, 0.0, 0.1)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_a_slice_ends_between_two_attempts_to_bound_a_cell(name):
    """There are eight. One at curved solids takes up to thirty microseconds."""
    a, b, there = PAIRS[name]
    whole, sliced = BallSearch(a, b), BallSearch(a, b)
    for each in (whole, sliced):
        each.begin(IDENTITY, there, 0.01, 0.0)
    assert whole.search(math.inf)
    least, most = whole.depth()[:2]
    code, next_ones, at = CUT, set(), sliced._at
    while code == CUT:
        code = sliced._slice(False, 1)
        if at["task"] == BOUNDING:
            next_ones.add(int(at["attempt"]))
        shallow, deep = sliced.depth()[:2]
        assert shallow <= most and least <= deep, "the cell at hand counts in the bounds"
    assert {1, 2, 3, 4, 5} <= next_ones
    if name != "meshes":
        assert 7 in next_ones, "between the bowls of both solids"
    assert sliced.depth() == whole.depth()
    assert sliced.points == whole.points


def test_where_a_seed_is_in_both_solids_one_slice_is_enough(monkeypatch):
    """Formerly, a second slice found that the first one had told all that was asked for."""
    asked = []

    def watch(owner, name):
        work = getattr(owner, name)
        monkeypatch.setattr(
            owner, name, lambda *given, **how: asked.append(name) or work(*given, **how)
        )

    pair = engine.Pair(sphere(3), sphere(3))
    watch(BallSearch, "_slice")
    watch(engine.Pair, "distance")
    for there in (translation(1.5), translation(1.4), translation(1.45, 0.1)):
        asked.clear()
        for depth_err in (math.inf, 0.01):
            found = pair.signed_distance(IDENTITY, there, depth_err=depth_err)
            assert found.upper < 0.0
            assert -found.lower >= 2.0 - math.dist(there[:3, 3], (0.0, 0.0, 0.0)) - 0.1
        assert asked == ["_slice", "_slice"]
