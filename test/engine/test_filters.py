"""Filters dismiss pairs of triangles untested, by lower bounds of their exact distance."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, from_python, leaf_triangles, pose
from engine_oracles import exact_motion, exact_squared_distance, exactly_moved, root
from triangle_cases import KINDS

from proximity_monitor import engine
from proximity_monitor.engine.kernels.bounds import cross
from proximity_monitor.engine.kernels.bounds import gaps as filters
from proximity_monitor.engine.kernels.bounds.gaps import BATCH, CORNERS
from proximity_monitor.engine.kernels.elements import direction
from proximity_monitor.engine.kernels.tree.layout import EMPTY

gather, shift = from_python(filters.gather), from_python(filters.shift)
gaps, gap_along = from_python(filters.gaps), from_python(direction.gap_along)
node_apart = from_python(cross.along_node)

EACH = 4
"""Triangles of each model. All their pairs make one batch."""
ROUNDS = 8


def crowds(kind):
    """Yield two models of triangles that are near each other in hard ways, and their poses."""
    rng = np.random.default_rng(list(KINDS).index(kind))
    faces = np.arange(3 * EACH).reshape(-1, 3)
    for case in range(ROUNDS):
        pairs = [KINDS[kind](rng) for _ in range(EACH)]
        if case % 2:  # ties: the same pair again, beside its mirror image
            pairs[1] = pairs[0]
            pairs[2] = tuple(-1.0 * corners for corners in pairs[0])
        a, b = (np.concatenate([pair[side] for pair in pairs]) for side in range(2))
        poses = (IDENTITY, IDENTITY) if case < 2 else (pose(rng, 1.0), pose(rng, 1.0))
        yield engine.TriangleMesh(a, faces), engine.TriangleMesh(b, faces), *poses


def exact_distances(a, b, pose_a, pose_b):
    """Return the distances of all pairs in tree order, b's fastest; Fractions, right to 2^-150."""
    motion = exact_motion(pose_a, pose_b)
    first = a._hierarchy.tree.triangles.reshape(-1, 3, 3)
    second = [exactly_moved(motion, t) for t in b._hierarchy.tree.triangles.reshape(-1, 3, 3)]
    return [root(exact_squared_distance(p.tolist(), q)) for p in first for q in second]


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_no_filter_exceeds_the_exact_distance(kind):
    corners, local = np.empty(CORNERS), np.empty(CORNERS - 3 * BATCH, np.float32)
    found = np.empty(BATCH, np.float32)
    for a, b, pose_a, pose_b in crowds(kind):
        pair = engine.Pair(a, b)
        pair.distance(pose_a, pose_b)
        search = pair._search
        progress, motion = search.state.progress[0], search.state.motions[0]
        first, second = a._hierarchy.tree.triangles, b._hierarchy.tree.triangles
        for k in range(BATCH):
            gather(first, k // EACH, second, k % EACH, k, corners)
        scale = min(a._hierarchy.tree.scale[1], b._hierarchy.tree.scale[1])
        shift(corners, motion, scale, local)
        gaps(local, np.float32(progress["slack"] * scale * (1.0 + 1e-6)), found)
        for k, exact in enumerate(exact_distances(a, b, pose_a, pose_b)):
            along = gap_along(progress, first, k // EACH, second, k % EACH)
            assert Fraction(along) <= exact
            # The search compares it with the limit in single precision, rounded up as here.
            assert Fraction(float(found[k])) <= exact * Fraction(scale) * Fraction(1.0 + 1e-6)


@pytest.mark.parametrize("kind", ["apart", "close", "far_from_origin"])
def test_the_filters_are_tight_where_it_counts(kind):
    """Along the search direction, the nearest pair's gap is its distance, so ties are dismissed."""
    for a, b, pose_a, pose_b in crowds(kind):
        pair = engine.Pair(a, b)
        answer = pair.distance(pose_a, pose_b)
        if answer.lower == 0.0:
            continue
        progress = pair._search.state.progress[0]
        ta, tb = progress["element_a"], progress["element_b"]
        along = gap_along(
            progress, a._hierarchy.tree.triangles, ta, b._hierarchy.tree.triangles, tb
        )
        slack = progress["slack"]
        assert along >= answer.upper - 3.0 * slack or np.isclose(along, answer.upper, rtol=1e-12)


def lowest_node(mesh):
    """Return a small mesh's one node that holds triangles, and (lane, triangle) for each."""
    children = mesh._hierarchy.tree.children.reshape(-1, 16)
    node = int(children[0, 0])  # the first node has only one lane: the whole mesh
    lanes = [
        (k, triangle)
        for k, child in enumerate(children[node].tolist())
        if child != EMPTY
        for triangle in leaf_triangles(child)
    ]
    assert sorted(triangle for _, triangle in lanes) == list(range(len(mesh.faces)))
    return node, lanes


def check_along_the_direction(a, b, pose_a, pose_b):
    """Check the bounds of volumes along the direction; return how many pairs these dismiss."""
    lows = np.empty((2, 16), np.float32)
    pair = engine.Pair(a, b)
    upper = pair.distance(pose_a, pose_b).upper
    progress = pair._search.state.progress[0]
    (node_a, lanes_a), (node_b, lanes_b) = lowest_node(a), lowest_node(b)
    between = node_apart(a._hierarchy.tree, node_a, progress["normal_a"], -1.0, lows[0])
    between += node_apart(b._hierarchy.tree, node_b, progress["normal_b"], 1.0, lows[1])
    between += progress["offset"] - progress["bound_slack"]
    exact = exact_distances(a, b, pose_a, pose_b)
    dismissed = 0
    for k, ta in lanes_a:
        for m, tb in lanes_b:
            own, other = (
                lows[0, k] * a._hierarchy.tree.scale[0],
                lows[1, m] * b._hierarchy.tree.scale[0],
            )
            bound = float(between + own + other)
            assert Fraction(bound) <= exact[len(b.faces) * ta + tb]
            dismissed += bound >= upper
    return dismissed


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_volumes_of_two_nodes_are_no_farther_along_the_direction_than_their_triangles(kind):
    for crowd in crowds(kind):
        check_along_the_direction(*crowd)


def test_the_direction_dismisses_most_triangles_of_bodies_that_are_apart():
    rng = np.random.default_rng(8)
    cube, dismissed = box((1.0, 0.8, 0.6)), 0
    for _ in range(ROUNDS):
        pose_a, pose_b = pose(rng, 0.0), pose(rng, 0.0)
        pose_b[0, 3] = 2.0
        dismissed += check_along_the_direction(cube, cube, pose_a, pose_b)
    assert dismissed > 0.5 * ROUNDS * len(cube.faces) ** 2
