"""Boxes, cylinders, cones and rings as surfaces, at poses that are typical of assemblies.

They are parallel along lines, arcs and faces, or nearest at their rims and apexes.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from proximity_monitor import engine

HERE = np.eye(4)
EXACT = engine.Status.EXACT


def box(x, y, z):
    """Return a box of flat patches."""
    patches = []
    for axis, side in itertools.product(range(3), (-1.0, 1.0)):
        grid = np.zeros((2, 2, 3))
        grid[..., axis] = side
        u, v = (axis + 1) % 3, (axis + 2) % 3
        grid[1, :, u] = grid[:, 1, v] = 1.0
        grid[0, :, u] = grid[:, 0, v] = -1.0
        patches.append(engine.Patch((grid if side > 0.0 else grid.swapaxes(0, 1)) * (x, y, z)))
    return engine.ParametricSurface(patches, solid=True)


SOLIDS = {
    "cylinder": engine.shapes.cylinder(0.06, 0.2),
    "cone": engine.shapes.cone(0.06, 0.0, 0.2),
    "bevel": engine.shapes.cone(0.08, 0.04, 0.1),
    "ring": engine.shapes.torus(0.1, 0.02),
}
SURFACES = {
    "box": box(0.05, 0.05, 0.2),
    "cylinder": engine.shapes.cylinder(0.06, 0.2, solid=False),
    "cone": engine.shapes.cone(0.06, 0.0, 0.2, solid=False),
    "bevel": engine.shapes.cone(0.08, 0.04, 0.1, solid=False),
    "ring": engine.shapes.torus(0.1, 0.02, solid=False),
}


def poses(count, turns, near, far):
    """Return poses from the given turns, with origins `near` to `far` metres away."""
    rng = np.random.default_rng(7)
    made = np.tile(HERE, (count, 1, 1))
    made[:, :3, :3] = turns[rng.integers(len(turns), size=count)]
    way = rng.normal(size=(count, 3))
    way *= rng.uniform(near, far, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    made[:, :3, 3] = way
    return made


QUARTERS = Rotation.create_group("O").as_matrix()
ANY = Rotation.random(200, random_state=7).as_matrix()
ALIGNED, RANDOM = poses(40, QUARTERS, 0.2, 0.6), poses(40, ANY, 0.4, 0.8)


PAIRS = list(itertools.combinations_with_replacement(SURFACES, 2))


@pytest.mark.parametrize("pair", PAIRS, ids=" ".join)
def test_parallel_shapes_close_their_gap(pair):
    """Formerly, along equally near lines and faces, cells were divided until the room was full."""
    a, b = pair
    for pose in ALIGNED:
        found = engine.distance(SURFACES[a], HERE, SURFACES[b], pose)
        assert found.status is EXACT or found.upper < 1e-12
        if "box" in pair:
            continue
        other = engine.distance(SOLIDS[a], HERE, SOLIDS[b], pose)  # searches the profiles
        assert found.lower <= other.upper + 1e-14
        assert other.lower <= found.upper + 1e-14


def test_the_corners_of_a_box_know_that_it_is_parallel():
    for pose in ALIGNED:
        found = engine.distance(SURFACES["box"], HERE, SURFACES["box"], pose)
        size = np.array([0.05, 0.05, 0.2])
        apart = np.abs(pose[:3, 3]) - size - np.abs(pose[:3, :3]) @ size
        truth = np.linalg.norm(np.maximum(apart, 0.0))
        assert found.lower <= truth + 1e-15
        assert truth <= found.upper + 1e-15


def total_tests(a, b):
    """Return the bound tests of all random poses. Check answers against the solids' profiles."""
    total = 0
    for pose in RANDOM:
        found = engine.distance(SURFACES[a], HERE, SURFACES[b], pose)
        other = engine.distance(SOLIDS[a], HERE, SOLIDS[b], pose)
        assert found.status is EXACT
        assert found.lower <= other.upper + 1e-14
        assert other.lower <= found.upper + 1e-14
        total += found.bound_tests
    return total


def test_the_cell_that_weakens_the_bound_is_divided():
    """Formerly, if two rims were nearest, only the cell at a long straight side was divided."""
    assert total_tests("cylinder", "cylinder") < 100_000


def test_at_an_apex_all_pieces_have_one_point():
    """Formerly, of the pieces that meet at the nearest apex, only one was proven done."""
    assert total_tests("cylinder", "cone") < 150_000
    assert total_tests("cone", "cone") < 130_000
