"""Bounds between boxes are certified and tight, and boxes fit tightly around their contents."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from engine_bodies import box, from_python, pose, rotation, soup, sphere, torus, translation
from engine_oracles import exact_squared_distance, pairwise_distances, root

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base import motion
from proximity_monitor.engine.kernels.base.trees import BoxTree, MeshTree
from proximity_monitor.engine.kernels.bounds import boxes, volumes
from proximity_monitor.engine.models.tree import check_tree

box_bounds, shortest = from_python(boxes.box_bounds), from_python(boxes.shortest)
relative_motions = from_python(motion.relative_motions)
lower_bounds, place = from_python(volumes.lower_bounds), from_python(volumes.place)

KINDS = ("obb", "aabb")
WIDTH, FIELDS = 16, 12
EVERYTHING = np.float32(1e29)
"""A reach that only the bound of an empty lane exceeds."""

SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
SIDES = [
    [i for i in range(8) if SIGNS[i, axis] == sign] for axis in range(3) for sign in (-1.0, 1.0)
]
FACES = np.array([face for a, b, c, d in SIDES for face in ((a, b, d), (a, d, c))])

SHAPES = {
    "cube": (1.0, 1.0, 1.0),
    "brick": (1.3, 0.8, 0.5),
    "plate": (1.0, 0.7, 0.0),
    "rod": (2.0, 0.02, 0.01),
    "splinter": (1.0, 1e-3, 1e-6),
    "segment": (1.5, 0.0, 0.0),
    "point": (0.0, 0.0, 0.0),
}
"""Half extents."""


def of(mesh, kind):
    return engine.TriangleMesh(mesh.vertices, mesh.faces, name=mesh.name, volume=kind)


def corners_of(half, rng=None):
    """Return the corners (8, 3) of a box around the origin, rotated at random if `rng` is given."""
    corners = SIGNS * half
    return corners if rng is None else corners @ rotation(rng).T


def around(corners, kind):
    """Return a model that consists of the corners alone."""
    return of(engine.points(corners), kind)


def stored(mesh):
    """Return centre and half edges (3, 3) of the box stored around a whole model, metres."""
    tree = mesh._hierarchy.tree
    lane = tree.nodes.reshape(-1, FIELDS, WIDTH)[0, :, 0].astype(float)
    u, v = lane[3:6], lane[6:9]
    edges = np.stack((lane[10] * u, lane[11] * v, lane[9] * np.cross(u, v)))
    return (tree.centres[0, :3] + lane[0:3]) * tree.scale[0], edges * tree.scale[0]


def inside(c, edges, other_c, others):
    """Return whether a centre is in the other box. Other boxes that overlap have crossing faces."""
    return any(
        (np.abs(np.linalg.solve(frame.T, point - middle)) <= 1.0).all()
        for middle, frame, point in ((c, edges, other_c), (other_c, others, c))
    )


def between(c, edges, other_c, others):
    """Return the distance of two boxes: 0 if a centre is inside, else that of their triangles."""
    if inside(c, edges, other_c, others):
        return 0.0
    return pairwise_distances((c + SIGNS @ edges)[FACES], (other_c + SIGNS @ others)[FACES]).min()


def bounds(a, pose_a, b, pose_b, reach=EVERYTHING):
    """Return bounds (16,) of all of `a` against the lanes of b's first node, metres.

    The first ones are those of boxes, the second those of swept spheres alone.
    """
    motions, single = np.zeros((2, 12)), np.empty(16, np.float32)
    relative_motions(pose_a, pose_b, *motions)
    assert place(a._hierarchy.tree, 0, (motions[1], motions[0]), b._hierarchy.tree, 0, 0.0, single)
    found = np.empty(WIDTH, np.float32)
    lower_bounds(b._hierarchy.tree.nodes, np.uint64(0), single, found, np.uint64(0))
    spheres = found.copy()
    box_bounds(a._hierarchy.tree, 0, motions[1], b._hierarchy.tree, 0, 0.0, reach, found, 0)
    return found * b._hierarchy.tree.scale[0], spheres * b._hierarchy.tree.scale[0]


def check(a, pose_a, b, pose_b):
    """Check that the bound of the models' boxes is certified, tight, and at least the spheres'."""
    bound, spheres = (found[0] for found in bounds(a, pose_a, b, pose_b))
    (c, edges), (other_c, others) = stored(a), stored(b)
    relative = np.linalg.inv(pose_b) @ pose_a
    turn, shift = relative[:3, :3], relative[:3, 3]
    distance = between(turn @ c + shift, edges @ turn.T, other_c, others)
    size = np.abs(turn @ c + shift - other_c).sum() + np.abs(edges).sum() + np.abs(others).sum()
    assert spheres <= bound <= distance
    # The slack amply covers what the walk may leave and the rounding of float32. For boxes that
    # cross, any bound will do.
    assert bound >= distance * (1.0 - 2e-6) - 16.0 * 2.0**-24 * size or distance == 0.0
    return bound, distance, size


def settings():
    """Return offsets of one box from another, as multiples of the sum of both sizes."""
    rng = np.random.default_rng(1)
    directions = [*np.eye(3), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0), *rng.normal(size=(4, 3))]
    return [factor * np.array(d) for d in directions for factor in (1.2, 0.8, 0.1)]


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "first", "second"),
    [(i, *pair) for i, pair in enumerate(itertools.combinations_with_replacement(SHAPES, 2))],
)
def test_a_bound_is_the_distance_of_the_boxes(number, first, second):
    """Boxes may be flat, lines or points; side by side, edge on, crossed or inside each other.

    The two kinds of boxes take turns: they differ in how they are fitted, not in their bounds.
    """
    kind = KINDS[number % 2]
    rng = np.random.default_rng(2)
    apart = 0
    size = max(SHAPES[first]) + max(SHAPES[second]) + 0.1
    for turned in (None, rng):
        a, b = (
            around(corners_of(SHAPES[first], turned), kind),
            around(corners_of(SHAPES[second]), kind),
        )
        for offset in settings():
            bound, distance, _ = check(a, translation(*(size * offset)), b, np.eye(4))
            apart += bound > 0.0
            assert bound <= 0.0 or distance > 0.0
    assert apart >= 9


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_bound_is_the_distance_of_any_boxes(seed, kind):
    """Extents span four orders of magnitude, gaps two."""
    rng = np.random.default_rng(seed)
    apart = 0
    for _ in range(60):
        a, b = (around(corners_of(10.0 ** rng.uniform(-3.0, 1.0, 3), rng), kind) for _ in "ab")
        bound, distance, size = check(a, pose(rng, 10.0 ** rng.uniform(-1.0, 1.0)), b, pose(rng))
        if distance > 0.2 * size:
            assert bound >= distance * (1.0 - 1e-4)
            apart += 1
    assert apart >= 10


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", SHAPES)
def test_identical_boxes_are_not_apart(shape, kind):
    rng = np.random.default_rng(4)
    mesh = around(corners_of(SHAPES[shape], rng), kind)
    for where in (np.eye(4), pose(rng), pose(rng, 5.0)):
        assert bounds(mesh, where, mesh, where)[0][0] < 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_boxes_that_touch_are_not_apart(kind):
    a, b = around(SIGNS, kind), around(0.5 * SIGNS, kind)
    for direction in ((1, 0, 0), (0, -1, 0), (1, 1, 0), (-1, 0, 1), (1, -1, 1)):
        bound, distance, size = check(a, translation(*(1.5 * np.array(direction))), b, np.eye(4))
        assert distance <= 2.0**-22 * size
        assert -16.0 * 2.0**-24 * size <= bound <= 0.0


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("other", [1e-12, 1e-6, 1.0, 1e6, 1e12])
@pytest.mark.parametrize("factor", [1e-200, 1e-30, 1e-6, 1.0, 1e6, 1e30])
def test_boxes_of_any_size(factor, other, kind):
    """Sizes are metres. Node units scale them away, but not their ratio."""
    rng = np.random.default_rng(5)
    a = around(factor * corners_of((1.0, 0.5, 0.2), rng), kind)
    b = around(factor * other * corners_of((1.0, 0.7, 0.3), rng), kind)
    for direction in rng.normal(size=(4, 3)):
        offset = factor * (1.0 + other) * direction
        where = translation(*offset)
        for bound in (
            bounds(a, where, b, np.eye(4))[0][0],
            bounds(b, np.eye(4), a, where)[0][0],
        ):
            (c, edges), (other_c, others) = stored(a), stored(b)
            frame = factor * (1.0 + other)  # the oracle's own products must not underflow
            distance = frame * between(
                (c + offset) / frame, edges / frame, other_c / frame, others / frame
            )
            assert bound <= distance
            assert bound >= distance * (1.0 - 2e-6) - 64.0 * 2.0**-24 * frame


@pytest.mark.parametrize("threads", [1, 3])
def test_bodies_of_both_kinds_are_asked_about_together(threads):
    """Each pair of kinds has a search of its own. Answers keep the order of the queries."""
    rng = np.random.default_rng(6)
    kinds = ("rss", "obb", "aabb", "rss", "pss")
    bodies = [of(mesh, kind) for mesh, kind in zip((torus(), box()) * 3, kinds, strict=False)]
    poses = np.array([pose(rng, 2.0) for _ in bodies])
    pairs = rng.permutation(list(itertools.combinations(range(len(bodies)), 2)))
    found = engine.Assembly(bodies).distances(poses, pairs, threads=threads)
    for k, (i, j) in enumerate(pairs):
        one = engine.distance(bodies[i], poses[i], bodies[j], poses[j])
        assert (found.lower[k], found.upper[k]) == pytest.approx((one.lower, one.upper), abs=1e-13)


def turned_by(rng, digits):
    """Return a pose rounded to so many digits, as a file may hold it."""
    return np.round(pose(rng, 2.0), digits)


@pytest.mark.parametrize("kind", KINDS)
def test_a_pose_of_few_digits_costs_no_answer(kind):
    """Such a matrix is not quite a rotation, and it moves the box's third side, too."""
    rng = np.random.default_rng(7)
    a, b = torus(), box((0.3, 2.0, 1.5))
    for _ in range(20):
        first, second = turned_by(rng, 7), turned_by(rng, 7)
        expected = engine.distance(a, first, b, second)
        found = engine.distance(of(a, kind), first, of(b, kind), second)
        assert abs(found.upper - expected.upper) <= 1e-13
        assert (found.lower <= expected.upper) and (expected.lower <= found.upper)


def test_a_lane_beyond_reach_is_left_alone():
    """Such a lane is pruned whatever its bound is, and so is an empty lane."""
    rng = np.random.default_rng(8)
    a, b = of(torus(), "obb"), of(sphere(2), "obb")
    found, spheres = bounds(a, translation(4.0), b, pose(rng), np.float32(-2.0))
    assert np.array_equal(found, spheres)
    found, spheres = bounds(a, translation(4.0), b, pose(rng))
    assert found[0] > spheres[0]
    assert (found[1:] >= 1e29).all()


def gap(d, edges, short=0.0, enough=np.inf):
    rows = tuple(map(tuple, edges.tolist()))
    return shortest(tuple(map(float, d)), rows, short, enough)


def test_the_walk_ends_where_it_is_known():
    """The nearest features are sides, edges or corners, or the origin is inside."""
    cubes = np.concatenate((np.eye(3), 0.5 * np.eye(3)))
    assert gap((4.0, 0.0, 0.0), cubes) == 2.5
    assert gap((4.0, 0.1, -1.2), cubes) == pytest.approx(2.5, rel=2e-6)
    assert gap((4.0, 4.0, 0.0), cubes) == pytest.approx(2.5 * np.sqrt(2.0), rel=2e-6)
    assert gap((4.0, -4.0, 4.0), cubes) == pytest.approx(2.5 * np.sqrt(3.0), rel=2e-6)
    for d in ((0.0, 0.0, 0.0), (0.1, 0.2, 0.3), (1.4, 1.4, 1.4), (1.5, 1.5, 1.5)):
        assert gap(d, cubes) <= 0.0
    nothing = np.zeros((6, 3))
    assert gap((0.0, 3.0, 4.0), nothing) == 5.0
    assert gap((0.0, 0.0, 0.0), nothing) <= 0.0


def test_a_walk_finds_the_distance_of_any_boxes():
    """The bound errs above by the rounding of float64 alone. The oracle is exact."""
    rng = np.random.default_rng(13)
    apart = 0
    for _ in range(60):
        edges, others = (rng.uniform(0.1, 1.0, (3, 1)) * rotation(rng) for _ in "ab")
        d, middle = 2.0 * rng.normal(size=3), np.zeros(3)
        if inside(d, edges, middle, others):
            continue
        first, second = (d + SIGNS @ edges)[FACES], (SIGNS @ others)[FACES]
        distances = pairwise_distances(first, second)
        near = np.argwhere(distances <= distances.min() + 1e-12)
        pairs = ((first[i].tolist(), second[j].tolist()) for i, j in near)
        distance = float(root(min(exact_squared_distance(*pair) for pair in pairs)))
        found = gap(d, np.concatenate((edges, others)))
        assert found <= distance + 1e-14
        assert found >= distance * (1.0 - 2.0**-19) or distance == 0.0
        apart += distance > 0.0
    assert apart >= 40


def test_a_walk_may_end_early():
    """A walk that ends early returns a valid bound. It exceeds `enough` if that ended the walk."""
    rng = np.random.default_rng(9)
    for _ in range(100):
        edges, d = rng.normal(size=(6, 3)), 12.0 * rng.normal(size=3)
        full = gap(d, edges)
        if full > 0.0:
            for part in (0.3, 0.9):
                assert part * full < gap(d, edges, enough=part * full) <= full * (1.0 + 2.0**-20)
            assert gap(d, edges, short=2.0 * full) <= full * (1.0 + 2.0**-20)


def lanes_of(mesh):
    """Return the lanes of all used volumes (k, FIELDS)."""
    lanes = mesh._hierarchy.tree.nodes.reshape(-1, FIELDS, WIDTH).swapaxes(1, 2).reshape(-1, FIELDS)
    return lanes[mesh._hierarchy.tree.children != -(2**31)].astype(float)


def test_axis_aligned_boxes_are_aligned_and_no_larger_than_their_points():
    rng = np.random.default_rng(10)
    mesh = of(soup(11, 500), "aabb")
    axes = lanes_of(mesh)[:, 3:9].reshape(-1, 2, 3)
    assert set(np.abs(axes).ravel()) == {0.0, 1.0}
    assert (np.abs(axes).sum(axis=2) == 1.0).all()
    points = rng.normal(size=(100, 3))
    c, edges = stored(around(points, "aabb"))
    low, high = points.min(axis=0), points.max(axis=0)
    assert np.allclose(np.abs(edges).sum(axis=0), 0.5 * (high - low), rtol=1e-6, atol=0.0)
    assert np.allclose(c, 0.5 * (low + high), atol=1e-6)


@pytest.mark.parametrize("shape", [(1.3, 0.8, 0.5), (1.0, 0.7, 0.0), (2.0, 0.02, 0.01)])
def test_an_oriented_box_finds_its_axes(shape):
    rng = np.random.default_rng(12)
    for _ in range(10):
        _, edges = stored(around(corners_of(shape, rng) + rng.normal(size=3), "obb"))
        assert np.allclose(np.linalg.norm(edges, axis=1), shape, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_is_thin_along_its_third_axis(kind):
    """This keeps the swept sphere that stands for the box small."""
    lanes = lanes_of(of(torus(), kind))
    assert (lanes[:, 9] <= 1.000001 * np.minimum(lanes[:, 10], lanes[:, 11])).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("field", [9, 10, 11])
@pytest.mark.parametrize("node", [0, 1, -1])
def test_a_box_that_is_too_small_is_found(node, field, kind):
    mesh = of(torus(), kind)
    nodes = mesh._hierarchy.tree.nodes.copy()
    # The first lane with a positive extent: the box of a triangle may have none.
    lane = int(np.argmax(nodes.reshape(-1, FIELDS, WIDTH)[node, field] > 1e-3))
    nodes.reshape(-1, FIELDS, WIDTH)[node, field, lane] *= np.float32(1.0 - 1e-5)
    with pytest.raises(AssertionError, match=rf"node \d+ lane {lane}: a corner lies .* outside"):
        check_tree(mesh._hierarchy.tree._replace(nodes=nodes), kind)


@pytest.mark.parametrize("kind", ["rss", "obb"])
def test_a_tree_that_is_taken_for_another_is_found(kind):
    """The type of the tree decides which search is compiled for it."""
    tree = of(torus(), kind)._hierarchy.tree
    other = BoxTree if kind == "rss" else MeshTree
    with pytest.raises(AssertionError, match=rf"{other.__name__}: .* to be '{kind}'"):
        check_tree(other(*tree), kind)
