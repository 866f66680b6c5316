"""What a search keeps for the next tick saves tests and changes no answer."""

import itertools
from functools import partial

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, from_python, rotation, soup, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base import state as index
from proximity_monitor.engine.kernels.base.motion import relative_motions
from proximity_monitor.engine.kernels.search import coherence
from proximity_monitor.engine.questions import run

displacement = from_python(coherence._displacement)
motions_of = from_python(relative_motions)
slot_of, make_room = from_python(coherence._slot_of), from_python(coherence._make_room)
BODIES = {
    "tori": lambda: (torus(), torus(18)),
    "spheres": lambda: (sphere(3), sphere(3)),
    "boxes": lambda: (box(), box((0.3, 0.2, 2.0))),
    "soups": lambda: (soup(1, 300, 0.1), soup(2, 300, 0.1)),
}
STEPS = (0.0, 1e-15, 1e-9, 1e-4, 1e-3, 1e-2, 0.1)


def pose(turn, at):
    """Return a pose (4, 4) from a rotation and a position."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, at
    return matrix


def turned(axis, angle):
    """Return a rotation (3, 3)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew


def wander(rng, step, count, nearest=1.0):
    """Yield poses of a body that moves and turns around another, by about `step` each time."""
    at, turn = rng.normal(size=3), rotation(rng)
    at *= rng.uniform(nearest, 3.0) / np.linalg.norm(at)
    for _ in range(count):
        u, _, v = np.linalg.svd(turn)
        yield pose(u @ v, at)
        at = at + step * rng.normal(size=3) - step * 0.3 * at
        turn = turned(rng.normal(size=3), step) @ turn


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_no_vertex_moves_farther_than_the_bound(size):
    rng = np.random.default_rng(5)
    model = engine.TriangleMesh(size * (soup(3).vertices + rng.normal(size=3)), soup(3).faces)
    for step in (1e-12, 1e-6, 1e-2, 1.0, 3.0):
        turn = rotation(rng)
        poses = [pose(turn, rng.normal(size=3))]
        there = poses[0][:3, 3] + step * rng.normal(size=3)
        poses.append(pose(turned(rng.normal(size=3), step) @ turn, there))
        found = np.empty((2, 2, 12))
        for k, at in enumerate(poses):
            motions_of(IDENTITY, at, found[k, 0], found[k, 1])
        moved = [model.vertices @ m[0, :9].reshape(3, 3).T + m[0, 9:] for m in found]
        farthest = np.linalg.norm(moved[1] - moved[0], axis=1).max()
        bound = displacement(model._hierarchy.tree, found[0, 0], found[1, 0])
        assert farthest <= bound * (1.0 + 1e-15) + 1e-14 * (size + 5.0)
        assert bound <= 4.0 * farthest + 1e-14 * (size + 5.0)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("bodies", BODIES)
def test_answers_along_a_path_are_those_of_single_questions(bodies, step):
    a, b = BODIES[bodies]()
    rng = np.random.default_rng(7)
    for _ in range(3):
        pair = engine.Pair(a, b)
        for k, at in enumerate(wander(rng, step, 40)):
            alone = engine.distance(a, IDENTITY, b, at)
            if k % 5 == 2:  # other queries in between
                assert pair.within(IDENTITY, at, 0.5).within == (alone.lower <= 0.5)
                assert pair.collide(IDENTITY, at).colliding == (alone.lower == 0.0)
            if k % 7 == 3:
                cut = pair.distance(IDENTITY, at, budget_s=0.0)
                assert cut.lower <= alone.upper
                assert cut.upper >= alone.lower
            rel_err = 0.1 if k % 3 == 1 else 0.0
            found = pair.distance(IDENTITY, at, rel_err=rel_err)
            assert found.lower <= alone.upper
            assert alone.lower <= found.upper <= (1.0 + rel_err) * alone.upper + 1e-14
            if rel_err == 0.0:
                assert found.upper == pytest.approx(alone.upper, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("order", ["priority", "breadth_first"])
@pytest.mark.parametrize("volume", ["rss", "pss", "obb", "aabb"])
def test_every_order_and_volume_keeps_its_answers(order, volume):
    a, b = (engine.TriangleMesh(m.vertices, m.faces, volume=volume) for m in BODIES["tori"]())
    pair = engine.Pair(a, b)
    for at in wander(np.random.default_rng(11), 1e-3, 25):
        found = pair.distance(IDENTITY, at, order=order)
        alone = engine.distance(a, IDENTITY, b, at)
        assert found.upper == pytest.approx(alone.upper, rel=1e-12, abs=1e-14)
        whole = pair.distance(IDENTITY, at, order=order, manifold=True)
        assert len(whole.manifold) == len(
            engine.Pair(a, b).distance(IDENTITY, at, manifold=True).manifold
        )


def _tests(search, path):
    """Return how many bound tests a search makes along a path, without its first three poses."""
    made = []
    for at in path:
        search.run(IDENTITY, at)
        made.append(search.answer[index.TESTS])
    return sum(made[3:])


def leaps(rng, count, nearest):
    """Yield unrelated poses around the other body."""
    for _ in range(count):
        yield next(wander(rng, 0.0, 1, nearest))


def test_it_spares_tests_where_the_models_move_little_and_adds_none_where_they_leap():
    a, b = sphere(4), torus(48)
    rng = np.random.default_rng(13)
    small, large = list(wander(rng, 1e-4, 60, nearest=2.6)), list(leaps(rng, 60, nearest=2.6))
    for path, least, most in ((small, 0.2, 0.8), (large, 0.8, 1.0)):
        spared = _tests(run.Search(a, b), path) / _tests(run.Search(a, b, coherent=False), path)
        assert least <= spared <= most


def test_with_a_tolerance_the_nearest_points_stay_near_and_half_the_volumes_are_opened():
    a, b = torus(96), sphere(4)
    rng = np.random.default_rng(1)
    axis = rng.normal(size=3)
    start = np.cross(axis, rng.normal(size=3))
    start *= 2.9 / np.linalg.norm(start)
    path = []
    for k in range(150):  # steps of some 4 % of the distance
        turn = turned(axis, 0.01 * k)
        path.append(pose(turn, (1.0 + 0.03 * np.sin(0.1 * k)) * turn @ start))
    found = {}
    for coherent in (True, False):
        search, answers = run.Search(a, b, coherent=coherent), []
        for at in path:
            search.run(IDENTITY, at, rel_err=0.1)
            answers.append(search.answer[[index.UPPER, index.TESTS]])
        found[coherent] = np.array(answers)[3:]
    exact = np.array([engine.distance(a, IDENTITY, b, at).upper for at in path])[3:]
    (upper, tests), (_, as_often) = found[True].T, found[False].T
    assert np.all(upper <= 1.1 * exact + 1e-14)
    assert np.mean(upper / exact) < 1.025
    assert tests.sum() < 0.5 * as_often.sum()


def test_a_search_that_is_cut_knows_bounds_of_what_it_did_not_look_at_again():
    a, b = torus(96), sphere(4)
    axis = np.array([0.3, 0.2, 1.0])
    start = np.cross(axis, [1.0, 0.0, 0.0])
    start *= 2.9 / np.linalg.norm(start)
    pair = engine.Pair(a, b)
    for k in range(100):
        turn = turned(axis, 0.01 * k)
        at = pose(turn, (1.0 + 0.03 * np.sin(0.1 * k)) * turn @ start)
        exact = engine.distance(a, IDENTITY, b, at)
        if k % 2 == 0:
            pair.distance(IDENTITY, at)
        else:
            cut = pair.distance(IDENTITY, at, budget_s=0.0)
            assert 0.85 * exact.lower <= cut.lower <= exact.upper


def test_a_model_that_was_refitted_is_looked_at_anew():
    rng = np.random.default_rng(17)
    for _ in range(40):
        a, b = sphere(4), torus()
        at = pose(rotation(rng), (0.0, 0.0, 2.5))
        pair = engine.Pair(a, b)
        for _ in range(3):
            found = pair.distance(IDENTITY, at)
        # A vertex not far from the nearest point moves a little nearer.
        vertices = np.array(a.vertices)
        away = np.linalg.norm(vertices - found.point_b, axis=1)
        k = np.argsort(away)[rng.integers(5, 300)]
        nearer = rng.uniform(0.7, 0.99) * found.upper / away[k]
        vertices[k] = found.point_b + nearer * (vertices[k] - found.point_b)
        a.deform(vertices)
        found, alone = pair.distance(IDENTITY, at), engine.distance(a, IDENTITY, b, at)
        assert found.upper == pytest.approx(alone.upper, rel=1e-12, abs=1e-14)


def test_the_ideal_search_knows_nothing_of_before():
    a, b = sphere(4), sphere(4)
    at = pose(np.eye(3), (2.1, 0.0, 0.0))
    pair = engine.Pair(a, b)
    ask = partial(pair.distance, IDENTITY, at)
    first = ask()
    ideal = pair.ideal(IDENTITY, at).bound_tests
    ask()
    assert ask().bound_tests < ideal <= first.bound_tests
    forgetful = engine.Pair(a, b, coherent=False)
    for _ in range(3):
        again = forgetful.distance(IDENTITY, at)
    assert again.bound_tests == ideal
    assert forgetful.distance(IDENTITY, at, order="priority").bound_tests == ideal
    assert pair.ideal(IDENTITY, at).bound_tests == ideal


def test_a_search_begins_with_the_points_that_were_nearest():
    """With a large tolerance these points suffice: no two triangles are compared."""
    a, b = sphere(4), torus(48)
    pair = engine.Pair(a, b)
    path = list(wander(np.random.default_rng(23), 1e-4, 20, nearest=2.6))
    for at in path[:5]:
        pair.distance(IDENTITY, at)
    for at in path[5:]:
        found, alone = pair.distance(IDENTITY, at, rel_err=1.0), engine.distance(a, IDENTITY, b, at)
        assert found.primitive_tests == 0
        assert found.lower <= alone.upper <= found.upper <= (1.0 + 1e-3) * alone.upper
        apart = np.linalg.norm(found.point_b - found.point_a)
        assert found.upper == pytest.approx(apart, rel=1e-12)


def test_a_long_search_gets_more_slots_and_forgets_nothing():
    a, b = sphere(5, 1.0), sphere(5, 1.1)
    search = run.Search(a, b)
    progress, far = search.progress, search.state.far
    seen = [int(progress["far_slots"])]
    for at in wander(np.random.default_rng(3), 0.0, 6):
        at[:3, 3] *= 1e-3
        search.run(IDENTITY, at)
        used = far[: int(progress["far_slots"])]
        keys = used["key"][used["key"] != index.NO_KEY]
        places = [slot_of(search.state, key) for key in keys]
        assert np.array_equal(np.flatnonzero(used["key"] != index.NO_KEY), places)
        assert len(set(keys)) == len(keys)
        alone = engine.distance(a, IDENTITY, b, at)
        assert search.answer[index.LOWER] <= alone.upper
        assert search.answer[index.UPPER] == pytest.approx(alone.upper, rel=1e-12)
        seen.append(len(used))
    assert seen[0] == 1 << 10
    assert seen[-1] == len(far) == 1 << 13
    assert all(more <= 2 * few for few, more in itertools.pairwise(seen))


def test_a_pair_stays_in_its_slot_or_moves_to_that_slot_of_the_new_half():
    search = run.Search(sphere(5), sphere(3))
    progress, far = search.progress, search.state.far
    slots = int(progress["far_slots"])
    known = {}
    for key in range(3 * slots):
        place = slot_of(search.state, key)
        far[place]["key"], far[place]["reach"] = key, key
        known[place] = key
    progress["bound_tests"] = 16 * slots
    make_room(search.state)
    assert progress["far_slots"] == 2 * slots
    used = far[: 2 * slots]
    there = used["key"] != index.NO_KEY
    assert set(used["key"][there]) == set(known.values())
    assert (used["reach"][there] == used["key"][there]).all()
    assert all(slot_of(search.state, int(used[i]["key"])) == i for i in np.flatnonzero(there))
