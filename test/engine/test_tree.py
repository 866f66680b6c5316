"""The hierarchy is right for every model, and its validator finds every kind of damage."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from engine_bodies import box, from_trimesh, soup, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine.models.tree import check_tree

WIDTH, FIELDS = 16, 12
"""Lanes of a node, and numbers of a lane. Field f of lane k is at f * WIDTH + k."""
RADIUS = 9
EMPTY = -(2**31)


def grown(count, base):
    """Return triangles at ever larger distances: a splitter that halves space makes a deep tree."""
    centres = base ** np.arange(count, dtype=float)
    shape = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]])
    corners = centres[:, None, None] * (shape + np.array([1.0, 0.0, 0.0]))
    return engine.TriangleMesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def repeated(count):
    mesh = engine.TriangleMesh(np.eye(3), [[0, 1, 2]] * count)
    assert len(mesh.faces) == count
    return mesh


def resized(mesh, factor, shift=0.0):
    return engine.TriangleMesh(mesh.vertices * factor + shift, mesh.faces)


def line_of_points(count):
    return engine.points(np.linspace(0.0, 1.0, count)[:, None] * [1.0, 2.0, 3.0])


MODELS = {
    "one triangle": lambda: soup(1, 1),
    "one point": lambda: engine.points([[1.0, 2.0, 3.0]]),
    "the origin": lambda: engine.points([[0.0, 0.0, 0.0]]),
    "box": box,
    "torus": lambda: torus(32),
    "sphere of 40k triangles": lambda: from_trimesh(_sphere_40k(), "sphere"),
    "soup": lambda: soup(2, 1000),
    "splinters": lambda: soup(3, 500, 1e-6),
    "identical triangles": lambda: repeated(1000),
    "identical points": lambda: engine.points(np.ones((300, 3))),
    "points on a line": lambda: line_of_points(777),
    "points": lambda: engine.points(np.random.default_rng(4).normal(size=(500, 3))),
    "flat": lambda: engine.TriangleMesh(soup(5).vertices * (1.0, 1.0, 0.0), soup(5).faces),
    "growing by 2": lambda: grown(140, 2.0),
    "growing by 100": lambda: grown(22, 100.0),
    "huge": lambda: resized(torus(16), 5e44),
    "tiny": lambda: resized(torus(16), 1e-40),
    "vanishing": lambda: resized(torus(16), 1e-300),
    "far from the origin": lambda: resized(torus(16), 1e-3, 1e6),
    "very far from the origin": lambda: resized(torus(16), 1e-3, 1e12),
}
MODELS |= {
    f"{count} triangles": lambda count=count: soup(count, count)
    for count in (2, 3, 15, 16, 17, 18, 31, 32, 33, 47, 48, 49, 255, 256, 257, 273, 4097)
}


def _sphere_40k():
    import trimesh

    mesh = trimesh.creation.uv_sphere(count=[101, 100])
    assert len(mesh.faces) == 40_000
    return mesh


@pytest.mark.long
@pytest.mark.parametrize("kind", ["rss", "obb", "aabb"])
@pytest.mark.parametrize("name", MODELS)
def test_every_volume_holds_its_triangles(name, kind):
    model = MODELS[name]()
    mesh = engine.TriangleMesh(model.vertices, model.faces, volume=kind)
    check_tree(mesh._hierarchy.tree, kind)
    assert sorted(mesh._hierarchy.numbers) == list(range(len(mesh.faces)))
    in_order = mesh.vertices[mesh.faces[mesh._hierarchy.numbers]].reshape(-1, 9)
    assert np.array_equal(mesh._hierarchy.tree.triangles, in_order)


@pytest.mark.parametrize("power", [-9, 0, 10, 100])
def test_a_unit_is_no_smaller_than_the_largest_coordinate(power):
    """The float after a power of two is a hard case: its computed logarithm is a whole number."""
    for largest in (2.0**power, np.nextafter(2.0**power, np.inf)):
        mesh = engine.TriangleMesh(np.eye(3) * largest, [[0, 1, 2]])
        check_tree(mesh._hierarchy.tree)


def test_the_hierarchy_is_frozen():
    for array in sphere(1)._hierarchy.tree:
        with pytest.raises(ValueError, match="read-only"):
            array.reshape(-1)[0] = 1


@pytest.mark.parametrize("volume", ["rss", "obb"])
def test_volumes_begin_at_cache_lines_and_are_held_once(volume):
    body = torus(24)
    doubled = np.vstack((body.faces, body.faces[:9]))  # twins: searches have a tree without them
    model = engine.TriangleMesh(body.vertices, doubled, volume=volume)
    other = pickle.loads(pickle.dumps(model))
    moved = engine.TriangleMesh(body.vertices, doubled, volume=volume)
    moved.deform(1.1 * body.vertices)
    for each in (model, other, moved):
        tree, distinct = each._hierarchy.tree, each._hierarchy.distinct
        for name in ("nodes", "centres", "children", "sizes"):
            array = getattr(distinct, name)
            assert array.ctypes.data % 64 == 0
            assert not array.flags.writeable
            assert array is getattr(tree, name) or name == "nodes"


def test_the_hierarchy_is_wide_and_shallow():
    mesh = MODELS["sphere of 40k triangles"]()
    assert mesh.depth <= 8
    nodes = len(mesh._hierarchy.tree.nodes) // (WIDTH * FIELDS)
    assert nodes <= 2 * 40_000 / WIDTH


def damaged(field, change, model=None):
    """Return a copy of a hierarchy with one of its arrays changed."""
    tree = (model or torus(24))._hierarchy.tree
    array = getattr(tree, field).copy()
    change(array)
    return tree._replace(**{field: array})


def used_lanes(tree):
    """Return node and lane of every volume."""
    return [divmod(at, WIDTH) for at in np.flatnonzero(tree.children != EMPTY)]


TORUS = torus(24)
LANES = used_lanes(TORUS._hierarchy.tree)
LEAVES = [at for at in LANES if TORUS._hierarchy.tree.children[at[0] * WIDTH + at[1]] < 0]
INNER = [at for at in LANES if at not in LEAVES]


def at(place, field):
    node, lane = place
    return (node * FIELDS + field) * WIDTH + lane


@pytest.mark.parametrize("place", [LANES[0], INNER[1], INNER[-1], LEAVES[0], LEAVES[-1]])
@pytest.mark.parametrize("field", range(3))
def test_a_volume_that_moved_is_found(place, field):
    def move(nodes):
        nodes[at(place, field)] += 0.2

    with pytest.raises(AssertionError, match=f"node {place[0]} lane {place[1]}"):
        check_tree(damaged("nodes", move))


@pytest.mark.parametrize("place", [LANES[0], INNER[1], INNER[-1], LEAVES[0], LEAVES[-1]])
@pytest.mark.parametrize("length", [10, 11])
def test_a_side_that_shrank_is_found(place, length):
    def shrink(nodes):
        nodes[at(place, length)] *= 0.9

    with pytest.raises(AssertionError, match=f"node {place[0]} lane {place[1]}"):
        check_tree(damaged("nodes", shrink))


@pytest.mark.parametrize("place", [LANES[0], INNER[1], INNER[-1]])
@pytest.mark.parametrize("axis", [3, 6])
def test_an_axis_that_turned_is_found(place, axis):
    def turn(nodes):
        one, other, third = (at(place, axis + k) for k in range(3))
        nodes[one], nodes[other], nodes[third] = nodes[other], nodes[third], nodes[one]

    with pytest.raises(AssertionError, match=f"node {place[0]} lane {place[1]}"):
        check_tree(damaged("nodes", turn))


@pytest.mark.parametrize("place", LANES[::37])
@pytest.mark.parametrize("factor", [0.0, 0.99, 1.0 - 1e-5, -1.0, np.nan])
def test_a_radius_that_is_too_small_is_found(place, factor):
    """The radius is rounded up by only a few units in the last place of float32."""

    def shrink(nodes):
        nodes[at(place, RADIUS)] *= np.float32(factor)

    with pytest.raises(AssertionError, match=f"node {place[0]} lane {place[1]}"):
        check_tree(damaged("nodes", shrink))


@pytest.mark.parametrize("node", [0, 1, 2, -1])
@pytest.mark.parametrize("column", range(3))
def test_a_centre_that_moved_is_found(node, column):
    def move(centres):
        centres[node, column] += 0.1

    with pytest.raises(AssertionError, match="node"):
        check_tree(damaged("centres", move))


@pytest.mark.parametrize("node", [0, 1, 2, -1])
@pytest.mark.parametrize("factor", [0.5, 0.0, -1.0, np.nan])
def test_a_reach_that_is_too_short_is_found(node, factor):
    def shrink(centres):
        centres[node, 3] *= factor

    with pytest.raises(AssertionError, match=r"node .* lane"):
        check_tree(damaged("centres", shrink))


def test_a_triangle_in_two_leaves_is_found():
    (first, second) = (node * WIDTH + lane for node, lane in LEAVES[:2])

    def repeat(children):
        children[first] = children[second]

    with pytest.raises(AssertionError):
        check_tree(damaged("children", repeat))


def test_a_triangle_in_no_leaf_is_found():
    node, lane = LEAVES[-1]

    def forget(children):
        children[node * WIDTH + lane] = EMPTY

    with pytest.raises(AssertionError, match=r"triangle \d+ stands in 0 leaves"):
        check_tree(damaged("children", forget))


def test_swapped_children_are_found():
    (first, second) = (node * WIDTH + lane for node, lane in INNER[1:3])

    def swap(children):
        children[first], children[second] = children[second], children[first]

    with pytest.raises(AssertionError):
        check_tree(damaged("children", swap))


def test_a_branch_that_is_left_out_is_found():
    node, lane = INNER[2]

    def forget(children):
        children[node * WIDTH + lane] = EMPTY

    with pytest.raises(AssertionError, match="stands in 0 leaves"):
        check_tree(damaged("children", forget))


@pytest.mark.parametrize("column", range(9))
def test_a_corner_that_moved_is_found(column):
    def move(triangles):
        triangles[11, column] += 0.05

    with pytest.raises(AssertionError, match="node"):
        check_tree(damaged("triangles", move))


def test_an_unused_lane_that_can_be_reached_is_found():
    """The lane's child is no triangle: a search that reached it would read beyond the arrays."""
    tree = TORUS._hierarchy.tree
    unused = np.flatnonzero(tree.children == EMPTY)
    node, lane = divmod(int(unused[-1]), WIDTH)

    def open_it(nodes):
        nodes[at((node, lane), RADIUS)] = 1.0

    with pytest.raises(AssertionError, match=f"node {node} lane {lane}"):
        check_tree(damaged("nodes", open_it))


@pytest.mark.parametrize("entry", [0, 2])
def test_a_scale_that_is_wrong_is_found(entry):
    """Entry 0: metres in a node unit. Entry 2: the largest norm of a vertex, for all margins."""

    def shrink(scale):
        scale[entry] *= 0.5

    with pytest.raises(AssertionError):
        check_tree(damaged("scale", shrink))
