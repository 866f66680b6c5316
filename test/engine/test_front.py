"""The front that a search leaves to the next: it covers everything and changes no answer."""

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose
from test_reaches import chess
from test_revolution import torus, vase

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.trees import NONE
from proximity_monitor.engine.kernels.revolution.front import FRONT

PAIRS = [("pawn", "cup"), ("table", "pawn"), ("cup", "cup")]


def steps(rng, count, from_m, step_m):
    """Return poses on a straight way past the first solid, `step_m` apart."""
    poses, way = np.tile(pose(rng), (count, 1, 1)), rng.normal(size=3)
    way /= np.linalg.norm(way)
    across = np.cross(way, (0.3, 0.5, 0.8))
    across *= from_m / np.linalg.norm(across)
    for k in range(count):
        poses[k, :3, 3] = across + way * step_m * (k - count / 2)
    return poses


def share(hierarchy, own, part):
    """Return the total length of the parameters of a part's pieces."""
    arcs, sum_, left = hierarchy.arcs, 0.0, [int(part)]
    while left:
        i = left.pop()
        arc = arcs[i] if i < len(arcs) else own[i - len(arcs)]
        if arc["curve"] == NONE:
            left += [int(arc["child"]), int(arc["child"]) + 1]
        else:
            sum_ += arc["high"] - arc["low"]
    return sum_


def covered(pair):
    """Return how many pairs the front has, and the share of parameters times angles they cover."""
    state = pair._search.state
    progress, waiting = state.progress[0], state.waiting
    front = waiting.front[FRONT * progress["front_half"] :][: progress["front"]]
    a, b = pair.a._hierarchy, pair.b._hierarchy
    whole = share(a, waiting.arcs_a, 0) * share(b, waiting.arcs_b, 0) * np.pi
    parts = sum(
        share(a, waiting.arcs_a, each["a"]) * share(b, waiting.arcs_b, each["b"]) * each["half"]
        for each in front
    )
    return len(front), parts / whole


@pytest.mark.parametrize("names", PAIRS, ids=" ".join)
def test_a_front_is_all_that_turns_and_answers_are_those_of_a_new_search(names):
    a, b = (chess(name) for name in names)
    size = a.radius + b.radius
    pair, rng = engine.Pair(a, b), np.random.default_rng(3)
    fronts = []
    for err in (1e-3 * size, 1e-6 * size, 0.0):
        for k, at in enumerate(steps(rng, 25, 0.8 * size, 1e-3 * size)):
            # Some searches are cut, and leave the front as it was.
            budget = 0.0 if k % 11 == 10 else None
            found = pair.distance(IDENTITY, at, abs_err=err, budget_s=budget)
            fresh = engine.distance(a, IDENTITY, b, at)
            assert found.lower <= fresh.upper and fresh.lower <= found.upper
            if budget is None:
                assert found.upper - found.lower <= err + 1e-10 * size
            count, of_all = covered(pair)
            if count:
                assert of_all == pytest.approx(1.0, abs=1e-12)
                fronts.append(count)
    assert len(fronts) > 30, "most searches have a front"


def test_a_front_of_another_shape_is_forgotten():
    a, b = vase(), torus(0.8, 0.2)
    pair, rng = engine.Pair(a, b), np.random.default_rng(5)
    shapes = [vase(0.6 + 0.05 * k).control_points for k in range(3)]
    for k, at in enumerate(steps(rng, 60, 1.6, 0.01)):
        if k % 4 == 3:
            a.deform(shapes[(k // 4) % 3])
        found = pair.distance(IDENTITY, at, abs_err=1e-4)
        fresh = engine.distance(a, IDENTITY, b, at)
        assert found.lower <= fresh.upper and fresh.lower <= found.upper
        assert found.upper - found.lower <= 1e-4 + 1e-12
        count, of_all = covered(pair)
        if count:
            assert of_all == pytest.approx(1.0, abs=1e-12)
