"""Coincident triangles: searches for the nearest see one; manifolds and contacts list all."""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import (
    IDENTITY,
    box,
    leaf_triangles,
    of,
    pose,
    soup,
    sphere,
    torus,
    translation,
)
from engine_oracles import pairwise_distances, triangles

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.hashing import EMPTY_HASH, mixed, slot
from proximity_monitor.engine.kernels.tree.layout import EMPTY, EMPTY_RADIUS, FIELDS, WIDTH
from proximity_monitor.engine.models.tree import check_tree, weld


def test_vertices_of_one_place_are_found():
    rng = np.random.default_rng(1)
    for count in (1, 2, 3, 1000):
        vertices = rng.integers(-2, 3, (count, 3)) * 0.5
        vertices[::7] *= -0.0
        expected = [int((vertices == vertex).all(axis=1).argmax()) for vertex in vertices]
        assert weld(vertices).tolist() == expected


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_vertices_on_a_grid_are_spread_over_the_table(axis):
    """Whole numbers differ in the upper bits alone: a weak hash puts them all in one slot."""
    count = 4096
    vertices = np.zeros((count, 3))
    vertices[:, axis] = np.arange(count)
    slots = set()
    with np.errstate(over="ignore"):
        for x, y, z in vertices.view(np.uint64):
            code = EMPTY_HASH
            for value in (x, y, z):
                code = mixed.py_func(code, value)
            slots.add(int(slot.py_func(code, 2 * count)))
    assert len(slots) > 0.6 * count


def again(mesh, times, name="again"):
    """Return the mesh with each face drawn `times` times: turned, flipped, with own corners."""
    faces = np.concatenate([np.roll(mesh.faces, k, axis=1) for k in range(times)])
    faces[len(mesh.faces) :: 3] = faces[len(mesh.faces) :: 3, ::-1]
    corners = mesh.vertices[faces].reshape(-1, 3)
    corners[::5] += -0.0
    return engine.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3), name=name)


def seen(mesh):
    """Return the triangles, in tree order, that a search for the nearest may reach."""
    radii = mesh._hierarchy.distinct.nodes.reshape(-1, FIELDS, WIDTH)[:, 9]
    children = mesh._hierarchy.distinct.children.reshape(-1, WIDTH)
    found, nodes = [], [0]
    while nodes:
        node = nodes.pop()
        for lane in np.flatnonzero(radii[node] > EMPTY_RADIUS):
            child = int(children[node, lane])
            assert child != EMPTY
            if child >= 0:
                nodes.append(child)
            else:
                found += leaf_triangles(child)
    return sorted(found)


def on_places(mesh, which):
    return {
        frozenset(map(tuple, (mesh._hierarchy.tree.triangles[t] + 0.0).reshape(3, 3)))
        for t in which
    }


BODIES = {
    "torus three times": lambda: again(torus(12), 3),
    "soup twice": lambda: again(soup(3, 50), 2),
    "one triangle, 40 times": lambda: again(soup(5, 1), 40),
    "points, 700 at one place": lambda: engine.points(np.full((700, 3), 0.25)),
    "points, by tens": lambda: engine.points(np.random.default_rng(1).integers(0, 3, (270, 3))),
    "a polyline to and fro": lambda: engine.polyline(np.array([[0.0, 0, 0], [1, 2, 3]] * 20)),
    "two triangles": lambda: again(soup(5, 1), 2),
    "one twin of many": lambda: engine.TriangleMesh(
        torus().vertices, np.concatenate((torus().faces, torus().faces[7:8]))
    ),
}


@pytest.mark.parametrize("name", BODIES)
def test_the_nearest_is_looked_for_among_one_of_each(name):
    mesh = BODIES[name]()
    check_tree(mesh._hierarchy.tree)
    which = seen(mesh)
    everywhere = on_places(mesh, range(len(mesh.faces)))
    assert on_places(mesh, which) == everywhere
    assert len(which) == len(everywhere)


def made_for(answer):
    return answer.bound_tests + answer.primitive_tests


@pytest.mark.parametrize("volume", ["rss", "obb"])
def test_coincident_points_are_compared_once(volume):
    """Eight thousand points against as many: all pairs are equally near."""
    a = engine.points(np.zeros((8000, 3)), volume=volume)
    b = engine.points(np.tile([0.3, 0.4, 0.0], (8000, 1)), volume=volume)
    found = engine.distance(a, IDENTITY, b, translation(2.7, 3.6, 0.0))
    assert found.lower <= 5.0 <= found.upper
    assert made_for(found) < 200


def test_a_mesh_that_is_drawn_ten_times_takes_as_long_as_one():
    rng = np.random.default_rng(2)
    once, ten = torus(16), again(torus(16), 10)
    ball = sphere(3)
    expected, found = 0, 0
    for _ in range(30):
        first, second = pose(rng), pose(rng, 2.5)
        one, other = (engine.distance(mesh, first, ball, second) for mesh in (once, ten))
        assert other.upper == pytest.approx(one.upper, rel=1e-14)
        expected, found = expected + made_for(one), found + made_for(other)
    assert found < 1.1 * expected


@pytest.mark.parametrize("order", ["depth_first", "priority", "breadth_first"])
def test_a_manifold_lists_all_of_them(order):
    """A Pair lists all of them, too, even if it has just searched one of each."""
    rng = np.random.default_rng(3)
    a, b = again(sphere(0), 3), again(box(), 2)
    pair = engine.Pair(a, b)
    for _ in range(5):
        first, second = pose(rng), pose(rng, 3.0)
        pair.distance(first, second)
        found = pair.distance(first, second, manifold=True, order=order)
        distances = pairwise_distances(triangles(a, first), triangles(b, second))
        held = np.zeros(distances.shape, bool)
        for k in range(len(found.manifold)):
            held[np.ix_(*found.manifold.faces(k))] = True
        assert held[distances <= found.upper - 1e-14].all()
        assert held.sum() % 6 == 0


def test_contacts_are_all_of_them():
    a, b = again(sphere(1), 3), again(box(), 2)
    once = engine.collide(sphere(1), IDENTITY, box(), translation(0.9), all_contacts=True)
    found = engine.collide(a, IDENTITY, b, translation(0.9), all_contacts=True)
    assert len(once.contacts) > 0
    assert len(found.contacts) == 6 * len(once.contacts)


@pytest.mark.parametrize("volume", ["rss", "obb"])
def test_what_comes_apart_is_looked_at_again(volume):
    """Coincident triangles part, all or one, and meet again. Edges common by place alone tear."""
    rng = np.random.default_rng(4)
    mesh, ball = of(again(torus(12), 3), volume), sphere(2)
    whole = mesh.vertices
    one = whole.copy()
    one[-1] += 0.3
    pair = engine.Pair(mesh, ball)
    for vertices in (whole + rng.normal(0.0, 0.1, whole.shape), whole, one, 2.0 * whole, whole):
        mesh.deform(vertices)
        check_tree(mesh._hierarchy.tree, volume)
        fresh = engine.TriangleMesh(vertices, mesh.faces)
        assert on_places(mesh, seen(mesh)) == on_places(fresh, range(len(fresh.faces)))
        for _ in range(3):
            first, second = pose(rng), pose(rng, 2.5)
            found = pair.distance(first, second)
            expected = engine.distance(fresh, first, ball, second)
            assert found.upper == pytest.approx(expected.upper, rel=1e-13)
    assert len(seen(mesh)) == len(mesh.faces) // 3


def test_a_wall_between_two_solids_counts_from_either_side():
    """Two boxes share a wall, drawn in both directions. Together they are one solid."""
    cube = box((1.0, 1.0, 1.0))
    reach = cube.vertices.max(axis=0)[0]
    mirrored = cube.vertices * (-3.0, 1.0, 1.0)
    mirrored[:, 0] += 4.0 * reach
    vertices = np.concatenate((cube.vertices, mirrored))
    both = engine.TriangleMesh(vertices, np.concatenate((cube.faces, cube.faces[:, ::-1] + 8)))
    assert len(seen(both)) == len(both.faces) - 2
    y, z = vertices.mean(axis=0)[1:]
    for x, outside in ((-0.5, False), (0.5, False), (2.5, False), (-1.5, True), (3.5, True)):
        pose_b = translation(reach + x, y, z)
        found = engine.signed_distance(both, IDENTITY, sphere(0, 0.01), pose_b)
        assert (found.lower > 0.0) if outside else (found.upper < 0.0)
