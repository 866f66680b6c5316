"""Breadth-first search: its memory, the vertices it keeps, and its bounds at any cut."""

from __future__ import annotations

from itertools import pairwise
from time import perf_counter

import numpy as np
import pytest
from engine_bodies import (
    IDENTITY,
    SMALL,
    VOLUMES,
    leaf_triangles,
    of,
    pose,
    soup,
    sphere,
    torus,
    translation,
)

from proximity_monitor import engine
from proximity_monitor.engine import Status
from proximity_monitor.engine.kernels.tree.layout import EMPTY, WIDTH
from proximity_monitor.engine.questions import run, search_memory, setup, slices

A, B = sphere(3), torus(24)
NESTED = sphere(4, 1.0), sphere(4, 1.3)
"""Two shells with many pairs of volumes at much the same distance, so that levels are long."""


def triangles_under(mesh, node):
    """Return the triangles under a node, in tree order."""
    found = []
    for child in mesh._hierarchy.tree.children[node * WIDTH : (node + 1) * WIDTH].tolist():
        if child >= 0:
            found += triangles_under(mesh, child)
        elif child != EMPTY:
            found += leaf_triangles(child)
    return found


@pytest.mark.parametrize("name", list(SMALL))
def test_kept_vertices_are_the_nodes_own_and_far_apart(name):
    mesh = SMALL[name]
    corners = mesh._hierarchy.tree.triangles.reshape(-1, 3)
    ranges, spread = mesh._hierarchy.ranges(), mesh._hierarchy.spread_corners()
    for node in range(len(spread)):
        under = triangles_under(mesh, node)
        assert sorted(under) == list(range(*ranges[node]))
        assert set(spread[node] // 3) <= set(under)
        points, kept = corners[3 * min(under) : 3 * max(under) + 3], corners[spread[node]]
        # Two points are at most twice as far apart as any one point is from its farthest point.
        assert np.ptp(points, axis=0).max() <= 2.0 * np.linalg.norm(kept - kept[0], axis=1).max()
        # Each vertex of a lowest node is no farther from the kept ones than these are from each
        # other. A higher node keeps vertices that its child nodes keep, or vertices of its leaves.
        children = mesh._hierarchy.tree.children[node * WIDTH : (node + 1) * WIDTH]
        if children[0] < 0:
            apart = np.linalg.norm(kept[:, None] - kept, axis=2)[np.triu_indices(4, 1)].min()
            nearest = np.linalg.norm(points[:, None] - kept, axis=2).min(axis=1)
            assert nearest.max() <= apart * (1.0 + 1e-12)
        else:
            leaves = children[(children < 0) & (children != EMPTY)].tolist()
            single = {3 * t + i for leaf in leaves for t in leaf_triangles(leaf) for i in range(3)}
            assert set(spread[node]) <= {*spread[children[children >= 0]].ravel(), *single}


def test_a_mesh_that_is_never_searched_so_keeps_no_vertices():
    a, b = sphere(2), sphere(2)
    engine.distance(a, IDENTITY, b, translation(3.0))
    engine.distance(a, IDENTITY, b, translation(3.0), order="priority", rel_err=0.1)
    assert a._hierarchy._spread is None
    engine.distance(a, IDENTITY, b, translation(3.0), order="breadth_first")
    assert a._hierarchy._spread is not None


@pytest.mark.parametrize("volume", VOLUMES)
def test_a_refit_renews_the_vertices(volume):
    a, b = of(sphere(3), volume), of(torus(24), volume)
    pair = engine.Pair(a, b)
    far = translation(4.0)
    pair.distance(far, IDENTITY, order="breadth_first")
    a.deform(a.vertices * (0.1, 3.0, 1.0))
    expected = engine.distance(of(a, volume), far, b, IDENTITY)
    found = pair.distance(far, IDENTITY, order="breadth_first")
    assert (found.lower, found.upper) == pytest.approx((expected.lower, expected.upper), abs=1e-13)
    spread = a._hierarchy.tree.triangles.reshape(-1, 3)[a._hierarchy.spread_corners()[1]]
    assert np.ptp(spread[:, 1]) == pytest.approx(6.0, rel=0.01), "far apart as it is now"


def test_the_vertices_kept_of_the_whole_models_are_its_first_upper_bound(monkeypatch):
    for name in ("_FIRST", "_FEW", "_LEAST", "_MOST"):
        monkeypatch.setattr(slices, name, 1)
    rng = np.random.default_rng(2)
    p, q = (
        m._hierarchy.tree.triangles.reshape(-1, 3)[m._hierarchy.spread_corners()[1]] for m in (A, B)
    )
    for _ in range(20):
        here = pose(rng, 4.0)
        placed = p @ here[:3, :3].T + here[:3, 3]
        apart = np.linalg.norm(placed[:, None] - q, axis=2).min()
        pair = engine.Pair(A, B)
        found = pair.distance(here, IDENTITY, order="breadth_first", budget_s=0.0)
        while found.bound_tests == 0 and found.status is Status.OUT_OF_TIME:
            found = pair.distance(here, IDENTITY, order="breadth_first", budget_s=1e-5)
        assert found.upper <= apart + 1e-13
        gap = np.linalg.norm(found.point_a - found.point_b)
        assert found.upper == pytest.approx(gap, abs=1e-13)


@pytest.mark.long
@pytest.mark.parametrize("length", [1 << 9, 1 << 10, 1 << 11])
def test_a_full_list_is_searched_from_its_end(length, monkeypatch):
    exact = engine.distance(*(x for mesh in NESTED for x in (mesh, IDENTITY)))
    whole = engine.Pair(*NESTED).distance(IDENTITY, IDENTITY, order="breadth_first")
    monkeypatch.setattr(search_memory, "_LIST", length)
    monkeypatch.setattr(setup, "_usual", setup._usual.__wrapped__)  # it keeps no sizes
    search = run.Search(*NESTED, "breadth_first")
    lower, code, longest = 0.0, None, 0
    while code != run.index.ENDED:
        deadline = perf_counter() + 2e-5
        code = search.run(IDENTITY, IDENTITY, deadline=deadline, fresh=code is None)
        lanes, bounds = search.pending()
        longest = max(longest, len(lanes))
        assert len(lanes) <= length
        # Each pair of lanes is in the list once, so no slot was written twice.
        assert len(np.unique(lanes, axis=0)) == len(lanes)
        assert lower <= search.answer[0] <= exact.upper
        lower = search.answer[0]
        if code != run.index.ENDED:
            assert lower <= max(bounds.min(), 0.0)
    assert longest > length - 600
    bounds = exact.lower, exact.upper
    assert search.answer[:2].tolist() == pytest.approx(bounds, abs=1e-14)
    assert (whole.lower, whole.upper) == pytest.approx(bounds, abs=1e-14)


def test_its_lower_bound_rises_level_by_level():
    """A depth-first search proves no more than the first level until it ends."""
    pairs = {order: engine.Pair(*NESTED) for order in ("depth_first", "breadth_first")}
    exact = pairs["depth_first"].distance(IDENTITY, IDENTITY)
    halfway = {}
    for order, pair in pairs.items():
        found = [pair.distance(IDENTITY, IDENTITY, order=order, budget_s=0.0)]
        while found[-1].status is Status.OUT_OF_TIME:
            found.append(pair.distance(IDENTITY, IDENTITY, order=order, budget_s=1e-5))
        for before, after in pairwise(found):
            assert before.lower <= after.lower <= exact.upper
            assert exact.lower <= after.upper <= before.upper
        half = found[-1].bound_tests / 2
        halfway[order] = next(f.lower for f in found if f.bound_tests >= half)
    assert halfway["breadth_first"] > 0.5 * exact.lower
    assert halfway["breadth_first"] > halfway["depth_first"]


def test_within_collide_and_many_poses_after_a_search_level_by_level():
    rng = np.random.default_rng(1)
    a, b = soup(1, 300), soup(2, 300)
    pair = engine.Pair(a, b)
    poses = np.array([pose(rng, 1.5) for _ in range(20)])
    many = engine.distances(a, poses, b, np.tile(IDENTITY, (20, 1, 1)), order="breadth_first")
    for here, lower, upper in zip(poses, many.lower, many.upper, strict=True):
        expected = engine.distance(a, here, b, IDENTITY)
        assert (lower, upper) == pytest.approx((expected.lower, expected.upper), abs=1e-13)
        pair.distance(here, IDENTITY, order="breadth_first", budget_s=1e-5)
        assert pair.within(here, IDENTITY, expected.upper).within
        found = pair.collide(here, IDENTITY, all_contacts=True)
        contacts = engine.collide(a, here, b, IDENTITY, all_contacts=True).contacts
        assert set(map(tuple, found.contacts.tolist())) == set(map(tuple, contacts.tolist()))
