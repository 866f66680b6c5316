"""Which triangles share a leaf: neighbours that are nearly coplanar. Each triangle has one leaf."""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import SMALL, box, leaf_triangles, soup, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine.kernels.tree.layout import EMPTY, FIELDS, WIDTH
from proximity_monitor.engine.models.tree import check_tree

BODIES = SMALL | {"ball": lambda: sphere(3), "ring": lambda: torus(40)}


def leaves(mesh):
    """Return the faces of each leaf, by the caller's numbers."""
    children = mesh._hierarchy.tree.children
    codes = children[(children < 0) & (children != EMPTY)].tolist()
    return [[int(mesh._hierarchy.numbers[t]) for t in leaf_triangles(code)] for code in codes]


def shared(mesh):
    return [leaf for leaf in leaves(mesh) if len(leaf) == 2]


def normal(mesh, face):
    a, b, c = mesh.vertices[mesh.faces[face]]
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n)


def body(name):
    found = BODIES[name]
    return found() if callable(found) else found


@pytest.mark.parametrize("name", BODIES)
def test_each_face_stands_in_one_leaf(name):
    mesh = body(name)
    assert sorted(face for leaf in leaves(mesh) for face in leaf) == list(range(len(mesh.faces)))


@pytest.mark.parametrize("name", BODIES)
def test_those_that_share_a_leaf_share_an_edge_and_are_flat_together(name):
    mesh = body(name)
    for first, second in shared(mesh):
        assert len(set(mesh.faces[first]) & set(mesh.faces[second])) >= 2
        assert abs(normal(mesh, first) @ normal(mesh, second)) > 0.9 - 1e-12


def test_a_box_is_its_six_sides():
    mesh = box((3.0, 2.0, 1.0))
    assert len(shared(mesh)) == 6
    for first, second in shared(mesh):
        assert abs(normal(mesh, first) @ normal(mesh, second)) == pytest.approx(1.0)


def grid(n, m, turn=0.0):
    """Return n by m squares in one plane, each of two triangles."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(m + 1.0), indexing="ij")
    c, s = np.cos(turn), np.sin(turn)
    points = np.stack((c * x - s * y, s * x + c * y, 0.3 * x + 0.0 * y), axis=2).reshape(-1, 3)
    corner = (np.arange(n)[:, None] * (m + 1) + np.arange(m)).reshape(-1, 1)
    first = corner + np.array([0, m + 1, m + 2])
    second = corner + np.array([0, m + 2, 1])
    return engine.TriangleMesh(points, np.concatenate((first, second)))


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_grid_of_squares_is_taken_apart_into_squares(turn):
    mesh = grid(9, 7, turn)
    found = shared(mesh)
    assert len(found) == 63
    assert {second - first for first, second in (sorted(pair) for pair in found)} == {63}


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_the_volume_of_a_square_is_hardly_larger(turn):
    mesh = grid(4, 4, turn)
    lanes = mesh._hierarchy.tree.nodes.reshape(-1, FIELDS, WIDTH)
    children = mesh._hierarchy.tree.children.reshape(-1, WIDTH)
    used = (children < 0) & (children != EMPTY)
    sides = (
        np.stack((lanes[:, 10][used], lanes[:, 11][used]), axis=1)
        * 2.0
        * mesh._hierarchy.tree.scale[0]
    )
    slanted = np.hypot(1.0, 0.3)
    assert np.allclose(np.sort(sides, axis=1), [1.0, slanted], rtol=1e-6)
    assert lanes[:, 9][used].max() < 1e-6


def test_where_all_edges_are_as_long_none_stays_alone_beside_another():
    n = 30
    x, y = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    points = np.stack((x + 0.5 * y, np.sqrt(0.75) * y, 0.0 * x), axis=2).reshape(-1, 3)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1, 1)
    faces = np.concatenate((corner + np.array([0, n + 1, 1]), corner + np.array([1, n + 1, n + 2])))
    mesh = engine.TriangleMesh(points, faces)
    assert 2 * len(shared(mesh)) > 0.75 * len(faces)
    alone = [set(faces[leaf[0]]) for leaf in leaves(mesh) if len(leaf) == 1]
    for k, first in enumerate(alone):
        assert all(len(first & second) < 2 for second in alone[:k])


def test_a_fan_is_taken_apart_by_twos():
    """Each triangle's longest edge is longer than the previous one's: choices run along the fan."""
    count = 200
    angle = np.linspace(0.0, 3.0, count + 1)
    reach = np.linspace(1.0, 2.0, count + 1)
    rim = np.stack((reach * np.cos(angle), reach * np.sin(angle), 0.0 * angle), axis=1)
    faces = [[0, i, i + 1] for i in range(1, count + 1)]
    mesh = engine.TriangleMesh(np.concatenate((np.zeros((1, 3)), rim)), faces)
    assert len(shared(mesh)) > 10
    assert all(abs(first - second) == 1 for first, second in shared(mesh))


def test_triangles_without_common_vertices_stand_alone():
    assert shared(soup(3, 300)) == []


def test_a_sharp_edge_parts_leaves():
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert shared(engine.TriangleMesh(points, [[0, 1, 2], [1, 0, 3]])) == []
    points[3] = [1, -1, 0.01]
    assert len(shared(engine.TriangleMesh(points, [[0, 1, 2], [1, 0, 3]]))) == 1


@pytest.mark.parametrize("faces", [[[0, 1, 2]] * 5, [[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1]]])
def test_a_triangle_that_is_drawn_again_stands_alone(faces):
    """If it shared a leaf with its neighbour, it would be bounded twice: see test_welding."""
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    mesh = engine.TriangleMesh(points, [*faces, [1, 3, 2]])
    assert len(shared(mesh)) == 1
    check_tree(mesh._hierarchy.tree)


def unwelded(mesh):
    """Return the same triangles, each with its own vertices."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    return engine.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))


@pytest.mark.parametrize("name", BODIES)
def test_triangles_that_share_no_vertices_have_the_same_hierarchy(name):
    mesh = body(name)
    other = unwelded(mesh)
    assert np.array_equal(mesh._hierarchy.numbers, other._hierarchy.numbers)
    for first, second in zip(mesh._hierarchy.tree, other._hierarchy.tree, strict=True):
        assert np.array_equal(first, second)


def test_zeros_of_either_sign_are_one_place():
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 1, -0.0], [1, -0.0, 0], [1, 1, 0]]
    assert len(shared(engine.TriangleMesh(points, [[0, 1, 2], [3, 4, 5]]))) == 1


def test_an_edge_of_many_triangles_parts_them_by_twos():
    """The faces are pages of a book, nearly flat on each other. No three of them share a leaf."""
    pages = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    pages += [[0.5, np.cos(0.001 * k), np.sin(0.001 * k)] for k in range(7)]
    mesh = engine.TriangleMesh(pages, [[0, 1, 2 + k] for k in range(7)])
    assert len(shared(mesh)) == 3
    check_tree(mesh._hierarchy.tree)


def test_needles_and_points_stand_alone():
    points = [[0, 0, 0], [1, 0, 0], [0.5, 1e-200, 0], [0.5, -1, 0]]
    faces = [[0, 1, 2], [1, 0, 3], [2, 2, 2], [0, 0, 1]]
    mesh = engine.TriangleMesh(points, faces)
    assert shared(mesh) == []
    check_tree(mesh._hierarchy.tree)


def test_the_size_of_the_model_does_not_matter():
    mesh = torus(24)
    expected = sorted(map(sorted, shared(mesh)))
    for size in (1e-30, 1e30):
        other = engine.TriangleMesh(mesh.vertices * size, mesh.faces)
        assert len(shared(other)) >= 0.9 * len(expected)
        check_tree(other._hierarchy.tree)


@pytest.mark.parametrize("volume", ["rss", "lss", "pss", "hybrid", "obb", "aabb"])
def test_a_leaf_that_is_folded_later_still_holds_both(volume):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = engine.TriangleMesh(points, [[0, 1, 2], [0, 2, 3]], volume=volume)
    assert len(shared(mesh)) == 1
    rng = np.random.default_rng(7)
    for height in (0.5, 1.0, 1e3, 1e-12, 0.0):
        for _ in range(5):
            folded = points.copy()
            folded[3] = [1.0 - height * rng.uniform(), rng.uniform(), height]  # over the first
            mesh.deform(folded)
            check_tree(mesh._hierarchy.tree, volume)
    for folded in (0.0 * points, points[:, [0, 0, 0]], points * [1.0, 1e-200, 1.0]):
        mesh.deform(folded)
        check_tree(mesh._hierarchy.tree, volume)


@pytest.mark.parametrize("volume", ["rss", "lss", "obb"])
@pytest.mark.parametrize("size", [1e-79, 1e-80, 1e-82, 1e-101, 1e-150, 1e-158, 1e-160, 1e-162])
def test_leaves_whose_products_underflow_have_perpendicular_unit_axes(size, volume):
    """A float64 square below 1e-308 has lost digits, and so has a direction normalised by it."""
    rng = np.random.default_rng(11)
    tiny = size * rng.normal(size=(40, 3, 3))
    thin = rng.normal(size=(40, 3, 3))
    thin[:, 1] = thin[:, 0] * (1.0, 0.0, 0.0)
    thin[:, 0] = thin[:, 1] + size * rng.normal(size=(40, 3)) * (0.0, 1.0, 1.0)
    corners = np.concatenate((tiny, thin)).reshape(-1, 3)
    mesh = engine.TriangleMesh(corners, np.arange(240).reshape(-1, 3), volume=volume)
    check_tree(mesh._hierarchy.tree, volume)
