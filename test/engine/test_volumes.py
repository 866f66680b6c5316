"""Every kind of bounding volume holds its triangles, and none changes an answer."""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import Fcl, box, pose, soup, sphere, torus, translation

from proximity_monitor import engine, scene
from proximity_monitor.engine.kernels.tree.layout import RADIUS
from proximity_monitor.engine.models.tree import check_tree

KINDS = ("rss", "lss", "pss", "hybrid", "obb", "aabb")
WIDTH, FIELDS = 16, 12
"""Lanes of a node, and numbers of a lane. Field f of lane k is at f * WIDTH + k."""
EMPTY = -(2**31)


def of(mesh, kind):
    return engine.TriangleMesh(mesh.vertices, mesh.faces, name=mesh.name, volume=kind)


def scaled(mesh, factor, shift=0.0):
    return engine.TriangleMesh(mesh.vertices * factor + shift, mesh.faces)


def needles(count):
    """Return triangles with an aspect ratio of a million, some of them without area."""
    rng = np.random.default_rng(5)
    start = rng.normal(size=(count, 3))
    along = rng.normal(size=(count, 3))
    across = 1e-6 * rng.normal(size=(count, 3)) * (np.arange(count) % 3 > 0)[:, None]
    corners = np.stack((start, start + along, start + 0.3 * along + across), axis=1)
    return engine.TriangleMesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def rod(seed):
    """Return points in a box of 20 × 1 × 1, the case for which line swept spheres are made."""
    mesh = soup(seed, 300, 0.1)
    return engine.TriangleMesh(mesh.vertices * (20.0, 1.0, 1.0), mesh.faces)


def spiral(count=200):
    t = np.linspace(0.0, 12.0, count)
    return engine.polyline(np.stack((np.cos(t), np.sin(t), 0.1 * t), axis=1))


def cloud(count=300):
    return engine.points(np.random.default_rng(4).normal(size=(count, 3)))


BODIES = {
    "one triangle": lambda: soup(1, 1),
    "one point": lambda: engine.points([[1.0, 2.0, 3.0]]),
    "the origin": lambda: engine.points([[0.0, 0.0, 0.0]]),
    "one segment": lambda: engine.polyline([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]),
    "box": box,
    "plate": lambda: box((3.0, 2.0, 0.01)),
    "torus": torus,
    "sphere": lambda: sphere(3),
    "soup": lambda: soup(2, 700),
    "needles": lambda: needles(200),
    "rod": lambda: rod(3),
    "points": cloud,
    "points on a line": lambda: engine.points(np.linspace(0.0, 1.0, 77)[:, None] * [1.0, 2.0, 3.0]),
    "points on a circle": lambda: engine.points(spiral().vertices * (1.0, 1.0, 0.0)),
    "polyline": spiral,
    "identical points": lambda: engine.points(np.ones((300, 3))),
    "flat": lambda: scaled(soup(5), (1.0, 1.0, 0.0)),
    "huge": lambda: scaled(torus(16), 5e44),
    "tiny": lambda: scaled(torus(16), 1e-40),
    "vanishing": lambda: scaled(torus(16), 1e-300),
    "far from the origin": lambda: scaled(torus(16), 1e-3, 1e6),
}
FEW = ("box", "plate", "torus", "sphere", "soup", "needles", "rod", "points", "polyline")


def parts_of_the_engine():
    described = scene.load_scene(scene.bundled("engine"))
    return {part.name: scene.load_model(part, described.unit) for part in described.bodies}


@pytest.fixture(scope="module")
def engine_parts():
    return parts_of_the_engine()


def same(first, second, size):
    """Check that two exact answers about models of that size agree but for rounding."""
    # Three times the error of a distance (POINT_MARGIN): for each answer and for the search path.
    assert abs(first.upper - second.upper) <= 100.0 * 2.0**-53 * size
    assert (first.upper == 0.0) == (second.upper == 0.0)
    assert first.lower <= second.upper
    assert second.lower <= first.upper


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", BODIES)
def test_every_volume_holds_its_triangles(name, kind):
    mesh = of(BODIES[name](), kind)
    assert mesh.volume == kind
    check_tree(mesh._hierarchy.tree, kind)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_every_volume_holds_the_parts_of_the_engine(engine_parts, kind):
    for part in engine_parts.values():
        check_tree(of(part, kind)._hierarchy.tree, kind)


def test_rectangles_are_the_default():
    mesh, named = torus(), of(torus(), "rss")
    assert mesh.volume == "rss"
    for array, other in zip(mesh._hierarchy.tree, named._hierarchy.tree, strict=True):
        assert np.array_equal(array, other)


def cores(mesh):
    """Return how many sides each volume's core has: the number of nonzero half lengths."""
    lanes = mesh._hierarchy.tree.nodes.reshape(-1, FIELDS, WIDTH)
    used = mesh._hierarchy.tree.children.reshape(-1, WIDTH) != EMPTY
    return (lanes[:, 10:] > 0.0).sum(axis=1)[used]


def test_each_kind_has_the_core_of_its_name():
    assert set(cores(of(soup(2, 500), "pss"))) == {0}
    assert set(cores(of(soup(2, 500), "lss"))) == {1}
    assert set(cores(of(soup(2, 500), "rss"))) == {2}
    assert set(cores(of(soup(2, 500), "hybrid"))) == {0, 1, 2}


@pytest.mark.parametrize(
    ("size", "edges"),
    [
        ((1.0, 1.0, 1.0), 0),
        ((1.7, 1.0, 0.9), 0),
        ((2.1, 1.0, 0.9), 1),
        ((9.0, 1.5, 1.0), 1),
        ((9.0, 4.0, 1.0), 2),
        ((2.1, 2.0, 1.0), 2),
        ((2.1, 2.0, 0.0), 2),
    ],
)
def test_hybrids_choose_by_a_factor_of_two(size, edges):
    """See section 4.2 of the paper. The first volume is the one around the whole model."""
    rng = np.random.default_rng(7)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = 0.5 * corners * size @ pose(rng)[:3, :3].T
    assert cores(of(engine.points(corners), "hybrid"))[0] == edges


def root_radius(mesh):
    return float(mesh._hierarchy.tree.nodes[9 * WIDTH]) * mesh._hierarchy.tree.scale[0]


def test_a_point_swept_sphere_is_the_smallest_one():
    """The points: a regular tetrahedron, a cube, a long and an obtuse triangle, a ball."""
    tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    shapes = [
        (tetrahedron, np.sqrt(3.0)),
        (box((2.0, 2.0, 2.0)).vertices, np.sqrt(3.0)),
        (np.array([[0, 0, 0], [10, 0, 0], [4, 1, 0]], dtype=float), 5.0),
        (np.array([[0, 0, 0], [2, 0, 0], [1, np.sqrt(3.0), 0]]), 2.0 / np.sqrt(3.0)),
        (sphere(4).vertices * 0.7 + 3.0, 0.7),
    ]
    for vertices, radius in shapes:
        mesh = of(engine.points(vertices), "pss")
        assert root_radius(mesh) == pytest.approx(radius, rel=1e-6)


def test_no_ball_of_other_centre_is_smaller():
    """The smallest ball is unique: from any other centre some point is farther away."""
    rng = np.random.default_rng(8)
    for size in (2, 3, 4, 5, 10, 100):
        points = rng.normal(size=(size, 3))
        radius = root_radius(of(engine.points(points), "pss"))
        centre = points.mean(axis=0)
        for step in np.geomspace(1.0, 1e-5, 4000):  # a slow descent, independent of the engine
            away = np.linalg.norm(points - centre, axis=1)
            centre += step * 0.1 * (points[away.argmax()] - centre)
        assert radius <= np.linalg.norm(points - centre, axis=1).max() * (1.0 + 1e-5)


def test_a_line_swept_sphere_fits_a_capsule():
    """Points on a capsule of radius 0.5 around a segment of length 4."""
    rng = np.random.default_rng(9)
    ball = 0.5 * sphere(3).vertices
    ends = np.array([[[2.0, 0.0, 0.0]], [[-2.0, 0.0, 0.0]]])
    shape = (ball + ends).reshape(-1, 3) @ pose(rng)[:3, :3].T
    mesh = of(engine.points(shape), "lss")
    nodes = mesh._hierarchy.tree.nodes.reshape(-1, FIELDS, WIDTH)
    half = nodes[0, 10, 0] * mesh._hierarchy.tree.scale[0]
    assert root_radius(mesh) == pytest.approx(0.5, rel=0.02)
    assert half == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("kind", KINDS[1:])
@pytest.mark.parametrize("name", FEW)
def test_distances_do_not_depend_on_the_volumes(name, kind):
    rng = np.random.default_rng(10)
    plain, other, fixed = BODIES[name](), of(BODIES[name](), kind), torus()
    size = 10.0 + plain.radius + fixed.radius
    for spread in (0.0, 1.0, 2.0, 2.0, 2.0, 30.0):
        first, second = pose(rng, spread), pose(rng)
        expected = engine.distance(plain, first, fixed, second)
        same(engine.distance(other, first, fixed, second), expected, size + 3.0 * spread)
        same(engine.distance(other, first, of(fixed, kind), second), expected, size + 3.0 * spread)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["torus", "sphere", "box", "soup"])
def test_distances_agree_with_fcl(name, kind):
    rng = np.random.default_rng(11)
    a, b = of(BODIES[name](), kind), of(torus(), kind)
    peer = Fcl(a, b)
    for spread in (0.5, 2.0, 2.0, 3.0, 3.0):
        first, second = pose(rng, spread), pose(rng)
        answer = engine.distance(a, first, b, second)
        assert answer.upper == pytest.approx(peer.distance(first, second), abs=1e-7)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_the_engine_has_the_same_clearances(engine_parts, kind):
    plain = list(engine_parts.values())
    others = [of(part, kind) for part in plain]
    rng = np.random.default_rng(12)
    where = [pose(rng, 0.05) for _ in plain]
    for i in range(len(plain)):
        for j in range(i):
            expected = engine.distance(plain[i], where[i], plain[j], where[j])
            same(engine.distance(others[i], where[i], others[j], where[j]), expected, 1.0)


@pytest.mark.parametrize("factor", [1e-6, 1e6, 1e-30, 1e30])
@pytest.mark.parametrize("kind", KINDS[1:])
def test_distances_of_large_and_small_models(factor, kind):
    """A power of ten is not exact, so both kinds get the very same vertices."""
    a, b = scaled(torus(16), factor), scaled(sphere(2), factor)
    first, second = np.eye(4), translation(1.7 * factor, 1.1 * factor, 0.6 * factor)
    expected = engine.distance(a, first, b, second)
    same(engine.distance(of(a, kind), first, of(b, kind), second), expected, 10.0 * factor)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_the_other_questions_do_not_depend_on_the_volumes(kind):
    rng = np.random.default_rng(13)
    a, b = torus(), soup(14)
    points = rng.normal(size=(50, 3))
    nearest = engine.closest_points(a, np.eye(4), points)
    others = engine.closest_points(of(a, kind), np.eye(4), points)
    assert np.allclose(nearest.upper, others.upper, rtol=0.0, atol=1e-13)
    for _ in range(5):
        first, second = pose(rng, 1.0), pose(rng)
        expected = engine.collide(a, first, b, second, all_contacts=True)
        answer = engine.collide(of(a, kind), first, of(b, kind), second, all_contacts=True)
        assert set(map(tuple, answer.contacts)) == set(map(tuple, expected.contacts))
        gap = engine.distance(a, first, b, second).upper
        for clearance in (0.5 * gap, 1.5 * gap):
            assert (
                engine.within(of(a, kind), first, of(b, kind), second, clearance).within
                == engine.within(a, first, b, second, clearance).within
            )


@pytest.mark.parametrize("volume", ["RSS", "sphere", "", None, 0])
def test_an_unknown_volume_is_refused(volume):
    with pytest.raises(engine.ModelError, match=r"ball: volume = .* rss, lss, pss, hybrid"):
        engine.TriangleMesh(np.eye(3), [[0, 1, 2]], name="ball", volume=volume)


def changed(mesh, change):
    nodes = mesh._hierarchy.tree.nodes.copy()
    change(nodes.reshape(-1, FIELDS, WIDTH))
    return mesh._hierarchy.tree._replace(nodes=nodes)


@pytest.mark.parametrize(("kind", "field"), [("pss", 10), ("pss", 11), ("lss", 11)])
def test_a_core_of_another_kind_is_found(kind, field):
    def stretch(lanes):
        lanes[2, field, 1] = 0.01

    with pytest.raises(AssertionError, match="node 2 lane 1"):
        check_tree(changed(of(torus(), kind), stretch), kind)


@pytest.mark.parametrize("kind", ["rss", "obb"])
@pytest.mark.parametrize("factor", [1.0 + 1e-5, 1.0 - 1e-5, 2.0, 0.0, np.nan])
@pytest.mark.parametrize("axis", [3, 6])
def test_an_axis_that_is_no_unit_vector_is_found(axis, factor, kind):
    """Half lengths suppose that projections onto an axis keep their length."""

    def change(lanes):
        lanes[1, axis : axis + 3, 1] *= np.float32(factor)

    with pytest.raises(AssertionError, match="node 1 lane 1"):
        check_tree(changed(of(torus(), kind), change), kind)


@pytest.mark.parametrize("kind", ["rss", "obb"])
def test_axes_that_are_not_perpendicular_are_found(kind):
    def change(lanes):
        lanes[1, 6:9, 1] = lanes[1, 3:6, 1]

    with pytest.raises(AssertionError, match="node 1 lane 1: its axes"):
        check_tree(changed(of(torus(), kind), change), kind)


def test_a_size_that_is_too_small_is_found():
    tree = torus()._hierarchy.tree
    sizes = tree.sizes.copy()
    sizes[WIDTH + 1] *= 0.5
    with pytest.raises(AssertionError, match="node 1 lane 1"):
        check_tree(tree._replace(sizes=sizes))


SEVEN = [[2, 3, 2], [3, 3, 2], [3, 2, 3], [3, 2, 2], [1, 3, 1], [1, 1, 1], [3, 1, 3]]
EIGHT = [
    [3, 3, 2], [0, 0, 2], [3, 3, 3], [1, 0, 3], [3, 0, 0], [0, 3, 0], [1, 1, 0], [2, 0, 3],
]  # fmt: skip


@pytest.mark.parametrize(("points", "least"), [(SEVEN, 3.0**0.5), (EIGHT, 2.503996805109784)])
def test_a_sphere_around_points_is_hardly_larger_than_need_be(points, least):
    """Four of the points lie in one plane; only by chance is there a sphere through them."""
    tree = engine.points(np.array(points, float), volume="pss")._hierarchy.tree
    assert least <= tree.nodes[int(RADIUS)] * tree.scale[0] <= 1.002 * least
