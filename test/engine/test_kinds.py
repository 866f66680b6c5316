"""A new kind of model, balls, joins the search from outside: no kernel of the search knows it.

It brings a type of tree, and implements what `kernels/search/stubs.py` needs of a pair of kinds:
of balls with balls, and of balls with meshes.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
import pytest
from engine_bodies import pose, torus
from numba import njit

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base import state as index
from proximity_monitor.engine.kernels.base import tables
from proximity_monitor.engine.kernels.base.addressed import Addressed
from proximity_monitor.engine.kernels.base.jit import implements, inlined, kernel, specialised
from proximity_monitor.engine.kernels.base.linking import ROOT
from proximity_monitor.engine.kernels.base.state import DepthFirst
from proximity_monitor.engine.kernels.base.trees import MESHES, MeshTree
from proximity_monitor.engine.kernels.base.vectors import add, along, dot, moved, scaled, sub
from proximity_monitor.engine.kernels.elements.primitives import corners, keep, mixed
from proximity_monitor.engine.kernels.inside.nearest import point_triangle
from proximity_monitor.engine.kernels.search import descent, stubs
from proximity_monitor.engine.kernels.search.search import answer_queries
from proximity_monitor.engine.kernels.tree.layout import (
    EMPTY,
    EXTENT,
    STRIDE,
    WIDTH,
    first_of,
    last_of,
    leaf,
    read_vector,
    row,
)

BallTree = namedtuple("BallTree", "centres children sizes balls scale")
"""Up to sixteen balls (m, 4), each a centre and a radius in metres: the leaves of one node."""

ANY = (*MESHES, BallTree)
COUNT = 12


def balls(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack((rng.normal(size=(COUNT, 3)), rng.uniform(0.05, 0.3, COUNT)))


def tree_of(made: np.ndarray) -> BallTree:
    """Return a tree. Node 0 has one lane: node 1, which holds all balls. A node unit is a metre."""
    children = np.full(2 * WIDTH, EMPTY, np.int32)
    children[0] = 1
    children[WIDTH : WIDTH + COUNT] = [leaf.py_func(i, 1) for i in range(COUNT)]
    reach = float((np.linalg.norm(made[:, :3], axis=1) + made[:, 3]).max()) * (1.0 + 1e-12)
    sizes = np.zeros((2 * WIDTH, 2), np.float32)
    sizes[0] = reach
    sizes[WIDTH : WIDTH + COUNT, EXTENT] = made[:, 3]
    centres = np.array([[0.0, 0.0, 0.0, reach]] * 2)
    scale = np.array([1.0, 1.0, reach, 0.0, 0.0, 0.0])
    return BallTree(centres, children, sizes, made, scale)


LAYOUT = {
    "centres": (np.float64, 4), "children": (np.int32, 0), "sizes": (np.float32, 2),
    "balls": (np.float64, 4), "scale": (np.float64, 0),
}  # fmt: skip
tables.TREES[BallTree] = Addressed(BallTree, LAYOUT, readonly=True)


@implements(tables.is_tree_of, BallTree)
@inlined
def _is_tree_of(kind, model):
    return True  # here, models always come in the order of the entry's kinds


def sphere_of(tree, lane):
    """Stub: return centre and radius, metres, of a sphere around everything under a lane."""


@implements(sphere_of, BallTree)
@kernel
def _ball_of(tree, lane):
    child = tree.children[lane]
    if child >= 0:
        return row(tree.centres, child), tree.centres[child, 3]
    ball = tree.balls[first_of(child)]
    return (ball[0], ball[1], ball[2]), ball[3]


@implements(sphere_of, MESHES)
@kernel
def _sphere_of_volume(tree, lane):
    node = lane // WIDTH
    at = np.uint64(node * STRIDE + lane % WIDTH)
    centre = add(read_vector(tree.nodes, at), row(tree.centres, node))
    return scaled(centre, tree.scale[0]), 1.5 * np.float64(tree.sizes[lane, EXTENT]) * tree.scale[0]


def implements_all(stub):
    """Implement a stub for balls and balls, balls and meshes, meshes and balls."""

    def register(function):
        implements(stub, BallTree, ANY)(function)
        return implements(stub, MESHES, BallTree)(function)

    return register


@implements_all(stubs.slacks)
@kernel
def _slacks(tree_a, tree_b, apart, error):
    slack = (1e-13 + error) * (tree_a.scale[2] + tree_b.scale[2] + apart)
    return slack, slack


@implements_all(stubs.lane_bounds)
@kernel
def _lane_bounds(fixed, tree, lane, motions, node, slack, reach, inherited, scratch):
    centre, radius = sphere_of(fixed, lane)
    centre = moved(motions[0], centre)
    for k in range(WIDTH):
        scratch.found[k] = np.float32(1e30)
        if tree.children[node * WIDTH + k] != EMPTY:
            other, reach_of_it = sphere_of(tree, node * WIDTH + k)
            way = sub(other, centre)
            bound = np.sqrt(dot(way, way)) - radius - reach_of_it - slack
            bound -= 1e-6 * (abs(bound) + radius + reach_of_it)  # float32 rounds
            scratch.found[k] = np.float32(bound * tree.scale[1])
    return inherited


@implements_all(stubs.cross_leaves)
@kernel
def _cross_leaves(tree, fixed, node, lane, motion, flip, state, inherited, limit, scratch, n):
    return -1


@implements_all(stubs.resolve)
@kernel
def _resolve(tree_a, tree_b, state, n, steps, scratch):
    n -= 1  # one pair of leaves takes a step
    lanes = state.waiting.lanes
    if state.waiting.bounds[n] < state.progress[0].limit:
        child_a, child_b = tree_a.children[lanes[n, 0]], tree_b.children[lanes[n, 1]]
        for a in range(first_of(child_a), last_of(child_a) + 1):
            for b in range(first_of(child_b), last_of(child_b) + 1):
                state.progress[0].primitive_tests += 1
                stubs.measure(tree_a, tree_b, state, a, b, 0.0)
    return n, steps - 1


@implements_all(stubs.guess)
@kernel
def _guess(tree_a, tree_b, state):
    pass


@implements_all(stubs.approach)
@kernel
def _approach(tree_a, tree_b, state, steps, found):
    pass


@implements(stubs.witness, BallTree)
@kernel
def _witness(tree, element, weights):
    ball = tree.balls[element]
    return along((ball[0], ball[1], ball[2]), (weights[0], weights[1], weights[2]), ball[3])


@implements(stubs.parameters, BallTree)
@kernel
def _parameters(tree, element, weights):
    return (weights[0], weights[1], weights[2])


def nearest_to(tree, element, p):
    """Stub: return an element's core point nearest to p, its weights in a triangle, the radius."""


@implements(nearest_to, BallTree)
@kernel
def _nearest_to_ball(tree, element, p):
    ball = tree.balls[element]
    return (ball[0], ball[1], ball[2]), (0.0, 0.0, 0.0), ball[3]


@implements(nearest_to, MESHES)
@kernel
def _nearest_to_triangle(tree, element, p):
    triangle = corners(tree.triangles, element)
    _, v, w = point_triangle(p, triangle[0], triangle[1], triangle[2])
    weights = (max(1.0 - v - w, 0.0), v, w)
    return mixed(triangle, weights), weights, 0.0


@implements_all(stubs.measure)
@kernel
def _measure(tree_a, tree_b, state, a, b, bound):
    motions, none = state.motions, (0.0, 0.0, 0.0)
    # The core of a ball is its centre, whatever p is. One of the two elements is a ball.
    p, wa, radius_a = nearest_to(tree_a, a, none)
    q, wb, radius_b = nearest_to(tree_b, b, moved(motions[1], p))
    p, wa, radius_a = nearest_to(tree_a, a, moved(motions[0], q))
    q, wb, radius_b = nearest_to(tree_b, b, moved(motions[1], p))
    way = sub(moved(motions[0], q), p)
    length = np.sqrt(dot(way, way))
    distance = max(length - radius_a - radius_b, 0.0)
    if distance < state.progress[0].distance:
        towards = scaled(way, 1.0 / max(length, 1e-300))
        r = motions[1]
        back = (dot((r[0], r[1], r[2]), towards), dot((r[3], r[4], r[5]), towards),
                dot((r[6], r[7], r[8]), towards))  # fmt: skip
        if radius_a > 0.0:
            wa = towards
        if radius_b > 0.0:
            wb = scaled(back, -1.0)
        keep(state, distance, a, b, wa, wb, scaled(towards, distance))
    return distance


def entry_of(kind_a, kind_b):
    kinds = {"KIND_A": kind_a, "KIND_B": kind_b, "ORDER": DepthFirst, "WAITING": index.Waiting}
    compiled = njit(error_model="numpy", no_cfunc_wrapper=True, _nrt=False, pipeline_class=ROOT)
    return compiled(specialised(answer_queries, f"search_{kind_a.__name__}", **kinds))


class Asker:
    """A search over two trees, and its memory."""

    def __init__(self, entry, *trees):
        self.entry, self.trees = entry, trees
        self.labels = np.arange(4096, dtype=np.int32)
        self.models = np.stack([tables.model_table(self.labels, tree) for tree in trees])
        waiting = np.empty((descent.WAITING_ROOM, 2), np.int32), np.empty(descent.WAITING_ROOM)
        self.state = index.State(
            np.zeros((2, 12)),
            np.zeros(1, index.PROGRESS),
            DepthFirst(np.empty((512, 2), np.int32), np.empty(512)),
            index.Waiting(*waiting),
            np.empty((0, 3)),
            np.empty(0, index.FAR),
        )
        self.memory = tables.state_table(self.state)

    def rows(self, pose_a, pose_b, steps):
        """Yield the answer after each slice of `steps` steps."""
        query = np.zeros(1, index.QUERY)
        query["bodies"], query["limit"] = (0, 1), np.inf
        asked = tables.table((query,))
        fresh, code = True, index.CUT
        while code == index.CUT:
            answers = np.empty((1, index.ANSWER))
            code, _ = self.entry(
                self.models, self.memory, pose_a, pose_b, asked, 0, 1, 1, steps, fresh, answers[0]
            )
            fresh = False
            yield answers[0]
        assert code == index.ENDED


def check(asker, brute, pose_a, pose_b):
    """Check every slice's bounds and the last points; count slices, and those with pairs left."""
    truth = brute(pose_a, pose_b)
    slices = waited = 0
    for answer in asker.rows(pose_a, pose_b, 3):
        lower, upper = answer[index.LOWER], answer[index.UPPER]
        assert lower - 1e-9 <= truth <= upper + 1e-9
        slices += 1
        waited += asker.state.progress["waiting"][0] > 0
    assert upper - lower <= 1e-9
    p, q = answer[index.POINT_A : index.POINT_A + 3], answer[index.POINT_B : index.POINT_B + 3]
    if truth > 0.0:
        assert np.linalg.norm(q - p) == pytest.approx(truth, abs=1e-9)
    return slices, waited


@pytest.mark.long
def test_balls_against_balls():
    own, other = balls(1), balls(2)
    asker = Asker(entry_of(BallTree, BallTree), tree_of(own), tree_of(other))

    def brute(pose_a, pose_b):
        p = own[:, :3] @ pose_a[:3, :3].T + pose_a[:3, 3]
        q = other[:, :3] @ pose_b[:3, :3].T + pose_b[:3, 3]
        apart = np.linalg.norm(p[:, None] - q[None], axis=2) - own[:, 3, None] - other[None, :, 3]
        return max(apart.min(), 0.0)

    rng = np.random.default_rng(3)
    found = [check(asker, brute, pose(rng, 1.5), pose(rng, 1.5)) for _ in range(20)]
    assert np.min(found, axis=0)[0] > 1
    assert np.sum(found, axis=0)[1] > 0, "leaf work was left over at the end of a slice"


@pytest.mark.long
def test_balls_against_a_mesh():
    """The oracle is the distance of the balls' centres from the mesh, minus their radii."""
    own, mesh = balls(4), torus(16)
    asker = Asker(entry_of(BallTree, MeshTree), tree_of(own), mesh._hierarchy.tree)

    def brute(pose_a, pose_b):
        p = own[:, :3] @ pose_a[:3, :3].T + pose_a[:3, 3]
        found = engine.closest_points(mesh, pose_b, p)
        return max((found.upper - own[:, 3]).min(), 0.0)

    rng = np.random.default_rng(5)
    found = [check(asker, brute, pose(rng, 1.5), pose(rng, 1.5)) for _ in range(20)]
    assert np.sum(found, axis=0)[1] > 0
