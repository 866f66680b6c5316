"""Solution manifolds: every pair that may hold the minimum, against brute force over all pairs."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from time import perf_counter

import numpy as np
import pytest
import trimesh
from engine_bodies import (
    IDENTITY,
    ORDERS,
    SMALL,
    VOLUMES,
    from_trimesh,
    of,
    plate,
    pose,
    soup,
    sphere,
    torus,
    translation,
)
from engine_oracles import pairwise_distances, triangles
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.engine import Status


def cylinder(radius, sections=24):
    return from_trimesh(trimesh.creation.cylinder(radius, 2.0, sections), "cylinder")


CONTINUA = {
    "concentric spheres": (sphere(2), sphere(2, 1.1), IDENTITY),
    "parallel plates": (plate(8), plate(8), translation(0.03, 0.01, 0.2)),
    "coaxial cylinders": (cylinder(1.0), cylinder(0.8), IDENTITY),
    "one inside its twin": (torus(12), torus(12), IDENTITY),
}
"""Bodies whose nearest points are a continuum or many ties."""


@cache
def distances_of(name):
    """Return distances (m, n) of all triangles of two bodies, cached as brute force is slow."""
    a, b, pose_b = CONTINUA[name]
    return pairwise_distances(triangles(a), triangles(b, pose_b))


def pairs(manifold):
    """Return which pairs of faces (m, n) a manifold holds. Each pair is in it at most once."""
    held = np.zeros((len(manifold.faces_a), len(manifold.faces_b)), int)
    for k in range(len(manifold)):
        held[np.ix_(*manifold.faces(k))] += 1
    assert held.max(initial=0) <= 1
    return held.astype(bool)


def check(found, distances, rounding):
    """Check that no pair is missing, that no pair is needless, and that each pair's bounds hold."""
    m = found.manifold
    held = pairs(m)
    assert held[distances <= found.upper - rounding].all()
    assert held[distances == distances.min()].any()
    assert (m.lower <= found.upper).all()
    assert found.lower <= m.lower.min() + rounding
    for k in range(len(m)):
        least = distances[np.ix_(*m.faces(k))].min()
        assert m.lower[k] - rounding <= least <= m.upper[k] + rounding
    return held


@pytest.mark.long
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", list(CONTINUA))
def test_continua_are_found_whole(name, order):
    a, b, pose_b = CONTINUA[name]
    distances = distances_of(name)
    found = engine.distance(a, IDENTITY, b, pose_b, order=order, manifold=True)
    plain = engine.distance(a, IDENTITY, b, pose_b, order=order)
    assert (found.lower, found.upper) == pytest.approx((plain.lower, plain.upper), abs=1e-14)
    assert found.status is plain.status
    held = check(found, distances, 1e-14)
    assert (distances[held] <= distances.min() + 1e-13).all()
    assert held.sum() == len(found.manifold) > 20  # pairs of triangles, not of volumes


@pytest.mark.long
@pytest.mark.parametrize("name", list(SMALL))
def test_bodies_anywhere(name):
    rng = np.random.default_rng(1)
    for other in SMALL.values():
        pose_a, pose_b = pose(rng, 1.0), pose(rng, 1.0)
        a, b = SMALL[name], other
        distances = pairwise_distances(triangles(a, pose_a), triangles(b, pose_b))
        for volume in VOLUMES:
            found = engine.distance(of(a, volume), pose_a, of(b, volume), pose_b, manifold=True)
            held = check(found, distances, 1e-13)
            assert (distances[held] <= found.upper + 1e-13).all()


@pytest.mark.long
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("tolerance", [{"rel_err": 0.1}, {"abs_err": 0.05}, {"abs_err": np.inf}])
def test_a_tolerance_leaves_volumes_alone_and_misses_nothing(tolerance, order):
    for name, (a, b, pose_b) in CONTINUA.items():
        distances = distances_of(name)
        found = engine.distance(a, IDENTITY, b, pose_b, order=order, manifold=True, **tolerance)
        exact = engine.distance(a, IDENTITY, b, pose_b, order=order, manifold=True)
        held = check(found, distances, 1e-14)
        # Allow for an opening or two: equal bounds come in another order.
        assert found.bound_tests <= 1.01 * exact.bound_tests
        assert held[pairs(exact.manifold)].all()
        if exact.lower > 0.0:
            assert found.status is Status.WITHIN_TOLERANCE
            assert found.lower <= found.manifold.lower.min()


@pytest.mark.long
@pytest.mark.parametrize("order", ORDERS)
def test_a_cut_search_has_all_that_is_left_and_goes_on(order):
    a, b = sphere(2), sphere(2, 1.02)
    distances = pairwise_distances(triangles(a), triangles(b))
    for tolerance in ({}, {"rel_err": 0.05}):
        pair = engine.Pair(a, b)
        options = {"order": order, "manifold": True, **tolerance}
        found = [pair.distance(IDENTITY, IDENTITY, budget_s=0.0, **options)]
        while found[-1].status is Status.OUT_OF_TIME:
            found.append(pair.distance(IDENTITY, IDENTITY, budget_s=0.0, **options))
        assert len(found) > 3
        left = [check(answer, distances, 1e-14) for answer in found]
        for before, after in pairwise(left):
            assert before[after].all()
        whole = engine.distance(a, IDENTITY, b, IDENTITY, **options)
        assert found[-1].upper == pytest.approx(whole.upper, abs=1e-14)
        assert found[-1].status is whole.status
        assert np.array_equal(left[-1], pairs(whole.manifold))


@pytest.mark.parametrize("order", ORDERS)
def test_contacts_are_all_there_when_the_search_says_so(order):
    """A contact ends other searches, but not the search for a manifold."""
    a = plate(20)
    whole = engine.distance(a, IDENTITY, a, IDENTITY, order=order, manifold=True)
    pair, answers = engine.Pair(a, a), []
    while not answers or answers[-1].status is Status.OUT_OF_TIME:
        options = {"order": order, "manifold": True, "budget_s": 0.0}
        answers.append(pair.distance(IDENTITY, IDENTITY, **options))
        assert len(answers) < 10_000
    assert len(answers) > 3
    assert answers[-1].status is whole.status is Status.INTERSECTING
    assert np.array_equal(pairs(answers[-1].manifold), pairs(whole.manifold))


def test_intersecting_bodies_give_every_contact():
    rng = np.random.default_rng(2)
    a, b = soup(1, 400, 3.0), soup(2, 400, 3.0)
    for _ in range(3):
        here = pose(rng, 0.3)
        found = engine.distance(a, here, b, IDENTITY, manifold=True)
        contacts = engine.collide(a, here, b, IDENTITY, all_contacts=True).contacts
        assert found.status is Status.INTERSECTING
        assert np.array_equal(np.argwhere(pairs(found.manifold)), np.unique(contacts, axis=0))
        assert len(contacts) > 4096  # more than the first buffer holds


@pytest.mark.parametrize("order", ORDERS)
def test_a_budget_is_kept(order):
    """The best of many runs counts: a busy machine may delay some, but the search must not."""
    a, b = sphere(5), sphere(5, 1.05)
    pair = engine.Pair(a, b)
    pair.distance(IDENTITY, IDENTITY, order=order, manifold=True, budget_s=0.0)
    late = []
    for budget in (1e-4, 1e-3, 1e-2):
        for _ in range(5):
            pair.distance(translation(3.0), IDENTITY, order=order, budget_s=0.0)
            start = perf_counter()
            found = pair.distance(IDENTITY, IDENTITY, order=order, manifold=True, budget_s=budget)
            assert found.elapsed_s <= perf_counter() - start
            if found.status is Status.OUT_OF_TIME:
                late.append(found.elapsed_s - budget)
            else:  # a fast machine finishes within the longest of these budgets
                assert found.elapsed_s < budget
    assert min(late) < 1e-3


def test_ordinary_questions_have_none():
    pair = engine.Pair(sphere(2), torus(12))
    assert pair.distance(IDENTITY, translation(3.0)).manifold is None
    assert pair.distance(IDENTITY, translation(3.0), manifold=True).manifold is not None
    again = pair.distance(IDENTITY, translation(3.0), budget_s=1.0)
    assert again.manifold is None
    assert pair.ideal(IDENTITY, translation(3.0)).manifold is None


def test_ties_that_are_apart_are_groups_of_their_own():
    """Two points above a plate: each is nearest to a few triangles that meet below it."""
    tops = engine.points([[0.26, 0.24, 0.5], [0.74, 0.76, 0.5]])
    found = engine.distance(plate(8), IDENTITY, tops, IDENTITY, manifold=True)
    assert found.solution_set is not None
    first, second = found.solution_set
    assert len(first) + len(second) == len(found.manifold)
    assert {int(group.faces(0)[1][0]) for group in (first, second)} == {0, 1}
    whole = engine.distance(plate(8), IDENTITY, plate(8), translation(0, 0, 0.2), manifold=True)
    assert [len(group) for group in whole.solution_set] == [len(whole.manifold)]
    assert engine.distance(plate(8), IDENTITY, tops, IDENTITY).solution_set is None


@pytest.mark.parametrize("kind", ["meshes", "surfaces"])
def test_an_answer_keeps_its_rows_while_the_pair_goes_on(kind):
    """Manifold and solution set are made on reading, but belong to their own question."""
    a, b = sphere(3, 1.0), sphere(3, 0.5)
    if kind == "surfaces":
        a = b = engine.ParametricSurface(torus_patches())
    places = [translation(0.9), translation(0.0, 0.7), translation(0.3, 0.2, 0.6)]

    def asked(at_once):
        pair, found = engine.Pair(a, b), []
        for at in places:
            found.append(pair.distance(IDENTITY, at, manifold=True))
            found.append(pair.collide(IDENTITY, at, all_contacts=True))
            if at_once:
                assert len(found[-2].manifold) + len(found[-1].contacts)
        return found

    for one, other in zip(asked(True), asked(False), strict=True):
        if isinstance(one, engine.Distance):
            one, other = one.manifold, other.manifold
            names = "lower", "upper", "ranges_a", "ranges_b", "faces_a", "faces_b"
        else:
            names = "contacts", "points", "normals"
        for name in names:
            assert np.array_equal(getattr(one, name), getattr(other, name)), name
