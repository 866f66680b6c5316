"""The promise of a volume, and the tests that a search saves if it opens what promises more."""

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.engine.kernels.tree.layout import (
    EMPTY,
    EXTENT,
    FIELDS,
    PROMISE,
    WIDTH,
)
from proximity_monitor.study.scenes import SCENES
from proximity_monitor.study.shapes import sphere, warped_torus

SHARE = 0.04
"""Share of a volume's extent that its promise includes."""

FACES = np.array([[i, j, k] for k in (-1, 1) for i in (-1, 0, 1) for j in (-1, 0, 1)])
"""Nine points of each flat face, as shares of the half lengths and of the radius."""


def outside(points, volumes):
    """Return how far points (n, 3) lie outside the nearest of swept rectangles (m, 12)."""
    found = np.full(len(points), np.inf)
    for volume in volumes:
        c, u, v, (radius, a, b) = volume[:3], volume[3:6], volume[6:9], volume[9:]
        d = points - c
        core = np.outer(np.clip(d @ u, -a, a), u) + np.outer(np.clip(d @ v, -b, b), v)
        found = np.minimum(found, np.linalg.norm(d - core, axis=1) - radius)
    return np.maximum(found, 0.0)


def volumes_of(tree, node):
    """Return the volumes (m, 12) of a node's used lanes, in the frame of the model."""
    used = tree.children[node * WIDTH : (node + 1) * WIDTH] != EMPTY
    lanes = tree.nodes.reshape(-1, FIELDS, WIDTH)[node].astype(float).T[used]
    lanes[:, :3] += tree.centres[node, :3]
    return lanes


@pytest.mark.long
@pytest.mark.parametrize("mesh", [sphere(1.0, 500), warped_torus()], ids=["sphere", "torus"])
def test_a_promise_is_how_far_both_faces_stand_off_the_children(mesh):
    tree = engine.TriangleMesh(*mesh)._hierarchy.tree
    for node in range(len(tree.centres)):
        for lane, volume in enumerate(volumes_of(tree, node)):
            at = node * WIDTH + lane
            extent, promise = tree.sizes[at, [EXTENT, PROMISE]].tolist()
            expected = SHARE * extent
            if tree.children[at] >= 0:
                c, u, v, (radius, a, b) = volume[:3], volume[3:6], volume[6:9], volume[9:]
                points = c + (FACES * (a, b, radius)) @ np.array((u, v, np.cross(u, v)))
                expected += outside(points, volumes_of(tree, tree.children[at])).mean()
            assert promise == pytest.approx(expected, rel=1e-3, abs=1e-5 * extent)


def test_a_ball_promises_less_than_the_parts_of_its_surface():
    tree = engine.TriangleMesh(*sphere(1.0))._hierarchy.tree
    parts = tree.sizes[WIDTH : 2 * WIDTH][tree.children[WIDTH : 2 * WIDTH] != EMPTY]
    assert tree.sizes[0, EXTENT] < parts[:, EXTENT].min()
    assert 2.0 * tree.sizes[0, PROMISE] < parts[:, PROMISE].min()


@pytest.mark.parametrize(
    ("gap", "most"), [(0.1, 5049), (0.3, 176), (0.5, 144)], ids=["near", "farther", "far"]
)
def test_spheres_in_spheres_take_no_more_tests_than_with_leaves_of_one_triangle(gap, most):
    """If size alone decided what to open, the spheres 0.1 apart would take 20,714 tests."""
    scene = SCENES[f"concentric/{gap}"]()
    (track,) = scene.tracks
    pair = engine.Pair(*(engine.TriangleMesh(*scene.meshes[name]) for name in (track.a, track.b)))
    tests = []
    for k in range(5):
        found = pair.within(track.poses_a[k], track.poses_b[k], 0.5 * gap)
        assert found.lower > 0.5 * gap
        tests.append(found.bound_tests)
    assert np.median(tests) <= most
