"""A refitted mesh answers as well as a new one, and the pairs that hold it see its new shape."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import Fcl, covering, pose, soup, sphere, torus, translation

from proximity_monitor import engine
from proximity_monitor.engine.models.tree import check_tree

KINDS = ("rss", "lss", "pss", "hybrid", "obb", "aabb")


def of(mesh, kind):
    return engine.TriangleMesh(mesh.vertices, mesh.faces, name=mesh.name, volume=kind)


def points():
    return engine.points(np.random.default_rng(1).normal(size=(100, 3)))


def polyline():
    return engine.polyline(np.random.default_rng(2).normal(size=(100, 3)).cumsum(axis=0))


def torus_and_unused_vertices():
    mesh = torus()
    vertices = np.concatenate([mesh.vertices, [[50.0, 0.0, 0.0], [0.0, 70.0, 0.0]]])
    return engine.TriangleMesh(vertices, mesh.faces)


def unwelded():
    """Return a torus of triangles that share no vertices: edges common by place alone may tear."""
    corners = torus(9).vertices[torus(9).faces].reshape(-1, 3)
    return engine.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))


BODIES = {
    "torus": torus,
    "unwelded torus": unwelded,
    "sphere": lambda: sphere(3),
    "soup": lambda: soup(3, 300),
    "17 triangles": lambda: soup(4, 17),
    "one triangle": lambda: soup(5, 1),
    "points": points,
    "polyline": polyline,
    "unused vertices": torus_and_unused_vertices,
}


def bent(vertices, rng):
    return vertices + 0.2 * np.sin(2.0 * vertices[:, [1, 2, 0]])


def jittered(vertices, rng):
    return vertices + rng.normal(0.0, 0.02, vertices.shape)


def scattered(vertices, rng):
    return rng.normal(size=vertices.shape)


def grown(vertices, rng):
    return vertices * 37.0


def shrunk(vertices, rng):
    return vertices * 1e-9


def far_away(vertices, rng):
    return vertices + 1e5


def collapsed(vertices, rng):
    return np.ones(vertices.shape)


def flattened(vertices, rng):
    return vertices * (1.0, 1.0, 0.0)


MOVES = (bent, jittered, scattered, grown, shrunk, far_away, collapsed, flattened)


@pytest.mark.parametrize(("name", "move", "kind"), covering(BODIES, MOVES, KINDS))
def test_a_refitted_mesh_holds_its_triangles(name, move, kind):
    mesh, rng = of(BODIES[name](), kind), np.random.default_rng(6)
    moved = move(mesh.vertices, rng)
    mesh.deform(moved)
    check_tree(mesh._hierarchy.tree, kind)
    fresh = engine.TriangleMesh(moved, mesh.faces)
    assert np.array_equal(mesh.vertices, moved)
    assert np.array_equal(mesh.centre, fresh.centre)
    assert mesh.radius == fresh.radius
    in_order = mesh.vertices[mesh.faces[mesh._hierarchy.numbers]].reshape(-1, 9)
    assert np.array_equal(mesh._hierarchy.tree.triangles, in_order)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("move", MOVES)
def test_a_refitted_mesh_answers_as_a_new_one(move, kind):
    rng = np.random.default_rng(7)
    mesh, other = of(torus(), kind), sphere(2)
    mesh.deform(move(mesh.vertices, rng))
    fresh = engine.TriangleMesh(mesh.vertices, mesh.faces)
    for spread in (0.5, 2.0, 2.0, 40.0):
        first, second = pose(rng), pose(rng, spread)
        answer = engine.distance(mesh, first, other, second)
        expected = engine.distance(fresh, first, other, second)
        size = 10.0 + 3.0 * spread + np.abs(mesh.vertices).max()
        assert abs(answer.upper - expected.upper) <= 100.0 * 2.0**-53 * size
        assert answer.lower <= expected.upper
        assert expected.lower <= answer.upper


def test_a_refitted_mesh_agrees_with_fcl():
    rng = np.random.default_rng(8)
    mesh, other = torus(), sphere(2)
    for _ in range(5):
        mesh.deform(bent(jittered(mesh.vertices, rng), rng))
        first, second = pose(rng), pose(rng, 2.0)
        expected = Fcl(mesh, other).distance(first, second)
        answer = engine.distance(mesh, first, other, second)
        assert answer.upper == pytest.approx(expected, abs=1e-7)


def test_refitting_back_gives_the_first_answers():
    rng = np.random.default_rng(9)
    mesh, other = torus(), sphere(2)
    first, second = pose(rng), translation(2.5, 0.3, 0.4)
    before, vertices = engine.distance(mesh, first, other, second), mesh.vertices
    mesh.deform(scattered(vertices, rng))
    mesh.deform(vertices)
    after = engine.distance(mesh, first, other, second)
    assert after.upper == pytest.approx(before.upper, rel=1e-14)


def test_pairs_see_the_new_shape():
    """One pair remembers triangles of the old shape; the other is of the mesh with itself."""
    rng = np.random.default_rng(10)
    mesh, other = torus(), sphere(2)
    pair, itself = engine.Pair(mesh, other), engine.Pair(mesh, mesh)
    first, second = pose(rng), translation(3.0, 0.2, 0.1)
    for _ in range(6):
        mesh.deform(bent(jittered(mesh.vertices, rng), rng))
        fresh = engine.TriangleMesh(mesh.vertices, mesh.faces)
        answer = pair.distance(first, second)
        expected = engine.distance(fresh, first, other, second)
        assert answer.upper == pytest.approx(expected.upper, rel=1e-14)
        triangle = mesh.vertices[mesh.faces[answer.feature_a.index]]
        nearest = first[:3, :3] @ (answer.feature_a.parameters @ triangle) + first[:3, 3]
        assert np.allclose(nearest, answer.point_a, atol=1e-12)
        answer = itself.distance(first, second @ translation(1.0))
        expected = engine.distance(fresh, first, fresh, second @ translation(1.0))
        assert answer.upper == pytest.approx(expected.upper, rel=1e-14)


def test_a_refitted_mesh_counts_its_revisions():
    mesh = torus()
    assert mesh.revision == 0
    mesh.deform(mesh.vertices)
    mesh.deform(mesh.vertices)
    assert mesh.revision == 2


def test_the_given_array_stays_the_callers():
    mesh = torus()
    given = mesh.vertices + 1.0
    mesh.deform(given)
    given[:] = 0.0
    assert mesh.vertices.min() > -1.0
    for array in (mesh.vertices, mesh.centre, *mesh._hierarchy.tree):
        assert not array.flags.writeable


def holed(vertices):
    vertices[7] = np.nan
    return vertices


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: v[:-1], r"torus: vertices: 287 given, expected 288"),
        (lambda v: v[:, :2], r"torus: vertices: shape \(288, 2\), expected \(n, 3\)"),
        (holed, r"torus: vertices\[7\] = \["),
        (lambda v: v * 1e46, r"torus: vertices\[\d+\] = .* at most 1e\+45 m"),
        (lambda v: "round", r"torus: vertices: not an array of numbers"),
    ],
)
def test_bad_vertices_leave_the_mesh_as_it_was(change, message):
    mesh = torus()
    before = (mesh.vertices, mesh.centre, mesh.radius, mesh._hierarchy.tree)
    with pytest.raises(engine.ModelError, match=message):
        mesh.deform(change(mesh.vertices.copy()))
    after = (mesh.vertices, mesh.centre, mesh.radius, mesh._hierarchy.tree)
    assert all(x is y for x, y in zip(before, after, strict=True))
    assert mesh.revision == 0


@pytest.mark.parametrize("size", [1.0, 1e45, 1e-160, 1e-200, 5e-324, 0.0])
def test_no_vertex_moves_farther_than_is_told(size):
    """Squares of the smallest sizes vanish, and squares of 1e-160 lose most of their digits."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        before, after = rng.uniform(-1.0, 1.0, (2, 4, 3)) * size
        mesh = engine.TriangleMesh(before, [[0, 1, 2], [0, 2, 3]])
        told = Fraction(mesh.deform(after))
        exact = max(
            sum((Fraction(x) - Fraction(y)) ** 2 for x, y in zip(p, q, strict=True))
            for p, q in zip(before.tolist(), after.tolist(), strict=True)
        )
        assert told**2 >= exact
        assert told**2 <= exact * (1 + Fraction(1, 10**14)) or told <= Fraction(2e-323)


def test_a_search_that_was_cut_off_starts_anew_after_a_refit():
    """The rest of that search is about the old shape."""
    ball, other = sphere(2), sphere(2)
    pair = engine.Pair(ball, other)
    here, there = np.eye(4), translation(5.0, 0.0, 0.0)
    for shift in (0.0, 1.0, -3.0):
        pair.distance(here, there, budget_s=0.0)
        ball.deform(ball.vertices + np.array([shift, 0.0, 0.0]))
        found = pair.distance(here, there, budget_s=60.0)
        fresh = engine.distance(ball, here, other, there)
        assert (found.lower, found.upper) == (fresh.lower, fresh.upper)
