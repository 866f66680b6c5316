"""Solids with holes: a point is inside if the winding number around it is more than a half."""

from __future__ import annotations

import numpy as np
import pytest
from ball_oracle import point_distances, winding_numbers
from engine_bodies import IDENTITY, box, rotation
from scipy.spatial.transform import Rotation

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.jit import entry
from proximity_monitor.engine.kernels.base.trees import MeshTree
from proximity_monitor.engine.kernels.inside.angles import _from_rim
from proximity_monitor.engine.kernels.inside.solid_table import solid_at
from proximity_monitor.engine.models.solid import sides_of

BOX_FACES = (
    (0, 1, 3), (0, 3, 2), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
    (1, 5, 7), (1, 7, 3),
)  # fmt: skip
"""All faces but those of the end x = 1, for the corners that `box_corners` makes."""


def box_corners(width):
    """Return the corners (8, 3) of a box 2 long, `width` wide and 1 high."""
    return np.array([(x, y, z) for x in (-1.0, 1.0) for y in (0.0, width) for z in (-1.0, 0.0)])


@entry
def _rim_distance(solid, p):
    _, _, region = solid_at(MeshTree, solid)
    return _from_rim(region, (p[0], p[1], p[2]))[0]


@pytest.mark.parametrize("seed", range(4))
def test_no_open_edge_is_nearer_than_is_said(seed):
    rng = np.random.default_rng(seed)
    solid = box((2.0, 2.0, 2.0))
    # Small triangles with three open edges each, far away and next to each other.
    places = rng.normal(size=(40, 3)) * 10.0 ** rng.uniform(-4.0, 1.0, (40, 1))
    loose = places[:, None] + rng.normal(size=(40, 3, 3)) * 1e-6
    vertices = np.concatenate((solid.vertices, loose.reshape(-1, 3)))
    faces = np.concatenate((solid.faces, 8 + np.arange(120).reshape(40, 3)))
    mesh = engine.TriangleMesh(vertices, faces, solid="robust")
    table = sides_of(mesh).table
    points = places[rng.integers(40, size=200)]
    points = points + rng.normal(size=(200, 3)) * 10.0 ** rng.uniform(-4.0, 0.0, (200, 1))
    edges = loose[:, [[0, 1, 1], [1, 2, 2], [2, 0, 0]]].reshape(-1, 3, 3)  # edges as flat triangles
    true = point_distances(points, edges)
    found = np.array([_rim_distance(table, p) for p in points])
    assert (found <= true).all()
    assert (found >= 0.98 * true).all()


@pytest.mark.parametrize("width", [1e-5, 1e-6])
def test_the_side_of_a_long_thin_triangle_is_right_close_to_it(width):
    rng = np.random.default_rng(3)
    turn, shift = rotation(rng), rng.normal(size=3)
    vertices = box_corners(width) @ turn.T + shift
    mesh = engine.TriangleMesh(vertices, np.array(BOX_FACES), solid="robust")
    assert mesh.is_solid
    count = 400
    x, y = rng.uniform(-0.8, 0.8, count), width * rng.uniform(0.3, 0.7, count)
    z = 10.0 ** rng.uniform(-12.0, np.log10(width) - 2.0, count)
    for sign in (-1.0, 1.0):  # inside, outside
        points = np.stack((x, y, sign * z), axis=1) @ turn.T + shift
        found = engine.closest_points(mesh, IDENTITY, points, signed=True)
        wrong = found.lower > 0.0 if sign < 0.0 else found.upper < 0.0
        assert not wrong.any()
        known = found.upper < 0.0 if sign < 0.0 else found.lower > 0.0
        assert known.mean() > 0.9


def layers(turn):
    """Return three sheets that face the same way. They wind about once around near points."""
    sheet = np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)])
    vertices = np.concatenate([sheet + np.array((0.0, 0.0, 1e-3 * k)) for k in range(3)])
    faces = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * k for k in range(3)])
    return engine.TriangleMesh(vertices @ turn.T, faces, solid="robust")


@pytest.mark.parametrize(("slope", "expected"), [(0.25 * np.pi, -0.2), (0.0, 0.298)])
def test_an_inside_beyond_the_elements_ends_at_their_box(slope, expected):
    turn = Rotation.from_euler("x", slope).as_matrix()
    solid, cube, at = layers(turn), box((0.2, 0.2, 0.2)), np.eye(4)
    at[:3, :3], at[:3, 3] = turn, 0.4 * turn[:, 2]
    corners = cube.vertices @ turn.T + at[:3, 3]
    assert (np.abs(winding_numbers(corners, solid.vertices[solid.faces])) > 0.8).all()
    for found in (
        engine.signed_distance(solid, IDENTITY, cube, at),
        engine.signed_distance(cube, at, solid, IDENTITY),
    ):
        assert found.lower <= expected <= found.upper + 1e-12
        assert found.upper - found.lower < 1e-3
    middle = engine.closest_points(solid, IDENTITY, at[None, :3, 3], signed=True)
    sign = -1.0 if expected < 0.0 else 1.0
    assert middle.lower == pytest.approx(sign * 0.398)
    assert middle.upper == pytest.approx(sign * 0.398)
