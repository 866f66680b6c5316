"""Balls that contain no point of a surface, and the triangles that they dismiss."""

import numpy as np
import pytest
from engine_bodies import IDENTITY, from_python
from engine_surfaces import bumps, sphere_patches, torus_patches
from test_outliers import apart
from test_trimmed import PLATE

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.state import PROGRESS
from proximity_monitor.engine.kernels.pairs import mesh_in_ball
from proximity_monitor.engine.kernels.surface import edges, empty_ball, evaluate, reach
from proximity_monitor.study import shapes

ball_of, support_of = from_python(empty_ball.empty_ball), from_python(reach.support_of)
bend_towards = from_python(empty_ball._bend_towards)
point_on, jet_at = from_python(edges.point_on), from_python(evaluate.jet_at)
is_in_ball = from_python(mesh_in_ball._has_in_ball)
RING = engine.ParametricSurface(torus_patches())
SURFACES = {"ring": RING, "bumps": engine.ParametricSurface([bumps(2)])}
BALL = engine.TriangleMesh(*shapes.sphere(1.0))
GRID = np.linspace(0.0, 1.0, 9)


def sample(tree, piece):
    """Return points (81, 3) of a piece."""
    return np.array([point_on(tree, piece, u, v) for u in GRID for v in GRID])


def places(tree, count):
    """Yield points of pieces with normals: element, u, v, point, normal."""
    rng = np.random.default_rng(5)
    for element in rng.integers(len(tree.pieces), size=count):
        u, v = rng.choice([0.0, 0.4, 0.6, 1.0], 2)
        jet = jet_at(tree.pieces[element], tree.nets, u, v)
        n = np.cross(jet[1], jet[2])
        yield int(element), u, v, np.array(jet[0]), n / np.linalg.norm(n)


@pytest.mark.long
@pytest.mark.parametrize("name", SURFACES)
def test_no_point_of_the_surface_is_nearer_than_is_said(name):
    tree, tight = SURFACES[name]._hierarchy.tree, 0
    for element, u, v, p, n in places(tree, 40):
        for side in (1.0, -1.0):
            far = (9.0, 9.0, 9.0)
            c, own, others, _ = ball_of(tree, element, u, v, tuple(side * n), 20.0, 1e-3, far, 0.0)
            near = np.linalg.norm(sample(tree, element) - c, axis=1).min()
            assert own <= near + 1e-12
            found = engine.closest_points(SURFACES[name], IDENTITY, np.array([c]))
            assert min(own, others) <= found.upper[0]
            tight += min(own, others) >= np.linalg.norm(np.array(c) - p) - 1e-9
    assert tight >= 30  # of 80: such a ball touches the surface where it was asked to


@pytest.mark.parametrize(("wanted", "share", "most_of"), [(0.0, 0.9, 1.0), (0.96, 0.98, 0.7)])
def test_inside_a_ring_a_ball_is_as_large_as_its_bend_allows(wanted, share, most_of):
    """The ball is nine tenths of that size, or larger if the caller wants it.

    Near the limit, 11 of 39 balls are not proven with the looks there are, and become smaller.
    """
    tree, far, tried, large = RING._hierarchy.tree, (9.0, 9.0, 9.0), 0, 0
    for element, u, v, p, n in places(tree, 120):
        out = np.hypot(p[0], p[1])
        if 0.72 < out < 0.92:
            outward = np.sign(n @ [p[0] * (out - 1.0), p[1] * (out - 1.0), p[2]]) * n
            most = 0.3 * out / (1.0 - out)
            asked = tuple(outward), 4.0, 1e-3, far, wanted * most
            large += min(ball_of(tree, element, u, v, *asked)[1:3]) >= share * most - 1e-9
            tried += 1
    assert tried > 20 and large >= most_of * tried


@pytest.mark.parametrize("name", SURFACES)
def test_an_element_reaches_no_farther_than_its_support(name):
    tree, tight = SURFACES[name]._hierarchy.tree, 0
    for element, u, v, p, n in places(tree, 40):
        points = sample(tree, element)
        for side in (1.0, -1.0):
            found = support_of(tree, element, u, v, tuple(side * n))
            assert (points @ (side * n)).max() <= found + 1e-12
            tight += found <= side * (n @ p) + 1e-11
    assert tight >= 2  # if the piece bends away in both directions, and does not end there


def test_an_edge_is_no_farther_than_the_piece_it_lies_on():
    """If a ball leans on an edge, nothing is known of the edge's piece: it may enter the ball."""
    tree, mesh = engine.ParametricSurface([PLATE])._hierarchy.tree, BALL._hierarchy.tree
    edges_of = tree.pieces["edge"] >= 0
    assert edges_of.any() and not edges_of.all()
    progress = np.zeros(1, PROGRESS)[0]
    progress["ball"] = 0.0, 0.0, 0.0, 2.0, 0.5, 1.0  # triangles are as far as 1
    for element in (int(np.argmax(edges_of)), int(np.argmin(edges_of))):
        progress["leaning"] = element
        assert is_in_ball(mesh, 0, tree, element, progress) == (not edges_of[element])


def test_triangles_in_a_ball_are_dismissed_together():
    """This takes 8,000 bounds. One for each pair of a piece and a triangle would make 15,000."""
    poses, tests = apart(RING, BALL, 4, 30), []
    for order in ("first", "second"):
        for at in poses[[13, 16, 28]]:
            models = (RING, IDENTITY, BALL, at)
            found = engine.distance(*(models if order == "first" else models[2:] + models[:2]))
            assert found.status is engine.Status.EXACT
            tests.append(found.bound_tests)
    assert sum(tests[:3]) < 10_000
    assert sum(tests[3:]) < 10_000


@pytest.mark.parametrize("order", ["first", "second"])
def test_volumes_in_a_ball_are_not_opened(order):
    """36,132 and 36,609 bound tests; with a ball only after all volumes, 62,670 and 64,212."""
    tests = 0
    for i, at in enumerate(apart(RING, BALL, 4, 30)):
        models = (RING, IDENTITY, BALL, at)
        if i != 6:  # here the search finds a nearer point at last, beyond the ball
            found = engine.distance(*(models if order == "first" else models[2:] + models[:2]))
            tests += found.bound_tests if found.status is engine.Status.EXACT else 0
    assert 0 < tests < 45_000


def test_how_a_torus_bends_towards_its_normal():
    """The oracle is the larger of two curvatures: that of the tube and that around the axis."""
    tree, seen = RING._hierarchy.tree, set()
    for element, u, v, p, n in places(tree, 40):
        out = np.hypot(p[0], p[1])
        tube = np.array([p[0] / out * (out - 1.0), p[1] / out * (out - 1.0), p[2]]) / 0.3
        around = (out - 1.0) / 0.3 / out
        for side in (1.0, -1.0):
            outward = side * np.sign(n @ tube)
            expected = max(-outward / 0.3, -outward * around)
            found = bend_towards(tree, element, u, v, tuple(side * n))
            assert found == pytest.approx(expected, abs=1e-9)
            seen.add((outward > 0.0, expected > 0.0))
    assert seen == {(True, True), (True, False), (False, True)}


@pytest.mark.parametrize(("offset", "most"), [(0.0, 60_000), (1e-5, 100_000), (1e-2, 30_000)])
def test_a_mesh_around_the_centre_of_a_sphere(offset, most):
    """One ball holds the whole mesh: 45,000, 76,000 and 24,000 bound tests.

    Without it there are 437,000, 169,000 and 54,000, and a finer mesh exceeds the room for pairs.
    """
    mesh = engine.TriangleMesh(*shapes.sphere(0.5, around=24, bands=12))
    at = np.eye(4)
    at[:3, 3] = offset * np.array([0.0, 0.6, 0.8])
    hollow = engine.ParametricSurface(sphere_patches())
    least = 1.0 - np.linalg.norm(mesh.vertices + at[:3, 3], axis=1).max()
    for turned in (False, True):
        models = (hollow, IDENTITY, mesh, at)
        found = engine.distance(*(models[2:] + models[:2] if turned else models))
        assert found.status is engine.Status.EXACT
        assert found.lower - 1e-13 <= least <= found.upper + 1e-13
        assert found.bound_tests < most


@pytest.mark.parametrize("offset", [0.05, 0.3])
def test_a_mesh_inside_a_sphere(offset):
    """All of the sphere is about equally near to a ball's centre; looking for a ball gives up."""
    vertices, faces = shapes.sphere(0.5)
    mesh = engine.TriangleMesh(vertices * [1.0, 0.9, 1.1], faces)
    at = np.eye(4)
    at[:3, 3] = offset * np.array([0.6, 0.0, 0.8])
    hollow = engine.ParametricSurface(sphere_patches())
    found = engine.distance(hollow, IDENTITY, mesh, at)
    least = 1.0 - np.linalg.norm(mesh.vertices + at[:3, 3], axis=1).max()
    assert found.lower - 1e-12 <= least <= found.upper + 1e-12
    assert found.status is engine.Status.EXACT
    assert found.bound_tests < 100_000
