"""Depths of solids that hardly reach into a surface: on a point, along a line, and over an area.

Where a solid is about tangent to a surface, the surface's depth changes little over large parts of
it. A search that bounds depths by the size of a part alone would divide it very often.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from engine_bodies import IDENTITY, box, from_trimesh, pose
from engine_surfaces import QUARTER, QUARTER_WEIGHTS, sphere_patches, torus_patches
from scipy.optimize import linprog

from proximity_monitor import engine
from proximity_monitor.engine import Status

DEPTHS = (1e-2, 1e-4, 1e-6, 1e-8)
SQUARE = engine.Patch(np.array([[[-1.0, -1, 0], [-1, 1, 0]], [[1, -1, 0], [1, 1, 0]]]))
TRIANGLES = engine.TriangleMesh(
    [[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]], solid=False
)


def hill():
    """Return a paraboloid whose highest point is the origin."""
    x, square = np.array([-0.5, 0.0, 0.5]), np.array([0.25, -0.25, 0.25])
    heights = -0.25 * (square[:, None] + square[None, :])
    grid = np.meshgrid(x, x, indexing="ij")
    return engine.Patch(np.stack((*grid, heights), axis=-1))


def ball_of_revolution():
    return engine.SolidOfRevolution([
        engine.Curve(part, weights=QUARTER_WEIGHTS)
        for part in (QUARTER[::-1] * (1.0, -1.0), QUARTER)
    ])  # fmt: skip


def rotation(axis, angle):
    """Return the rotation (3, 3) about a coordinate axis."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    made = np.eye(3)
    made[i, i] = made[j, j] = c
    made[i, j], made[j, i] = -s, s
    return made


def turn(seed):
    return pose(np.random.default_rng(seed))[:3, :3]


ASIDE = rotation(2, 0.7)
LYING = ASIDE @ rotation(1, np.pi / 2)
ON_AN_EDGE = ASIDE @ rotation(0, np.pi / 4)
ON_A_CORNER = ASIDE @ rotation(0, np.arctan(np.sqrt(0.5))) @ rotation(1, np.pi / 4)
ROUNDED = engine.TriangleMesh(box((0.4, 0.3, 0.2)).vertices, box().faces, radius=0.1)

CASES = {
    "sphere on a point": (
        engine.ParametricSurface(sphere_patches(), solid=True), SQUARE, turn(1), 1.0, 1.0, 150
    ),
    "sphere of revolution on a point": (ball_of_revolution(), SQUARE, turn(2), 1.0, 1.0, 150),
    "sphere on its pole": (
        engine.ParametricSurface(sphere_patches(), solid=True), SQUARE, ASIDE, 1.0, 1.0, 150
    ),
    "cylinder on a line": (engine.shapes.cylinder(0.3, 1.0), SQUARE, LYING, 0.3, 1.0, 600),
    "cylinder on a line over triangles": (
        engine.shapes.cylinder(0.3, 1.0), TRIANGLES, LYING, 0.3, 1.0, 600
    ),
    "torus on a circle": (
        engine.ParametricSurface(torus_patches(0.5, 0.2), solid=True), SQUARE, ASIDE, 0.2, 1.0, 600
    ),
    "box on a face": (box((0.6, 0.5, 0.4)), SQUARE, ASIDE, 0.2, 1.0, 100),
    "box on an edge": (
        box((0.4, 0.4, 0.4)), SQUARE, ON_AN_EDGE, 0.2 * np.sqrt(2.0), np.sqrt(0.5), 600
    ),
    "box on a corner": (
        box((0.4, 0.4, 0.4)), SQUARE, ON_A_CORNER, 0.2 * np.sqrt(3.0), np.sqrt(1 / 3), 200
    ),
    "rounded box on an edge": (
        ROUNDED, SQUARE, ASIDE @ rotation(0, 0.5),
        0.1 + 0.1 * np.cos(0.5) + 0.15 * np.sin(0.5), 1.0, 400,
    ),
    "box on a hill": (box((0.6, 0.5, 0.4)), hill(), ASIDE, 0.2, 1.0, 100),
}  # fmt: skip
"""Solid; surface; the solid's rotation; how far it then reaches below its origin; the depth as a
share of how far it reaches below the surface's origin; and the most points that may be tested."""


def lowered(turned, low, depth):
    """Return the pose of a solid that reaches `depth` below the plane z = 0."""
    made = np.eye(4)
    made[:3, :3] = turned
    made[:3, 3] = 0.123, 0.077, low - depth
    return made


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("depth", DEPTHS)
def test_a_solid_that_hardly_reaches_in(case, depth):
    solid, surface, turned, low, share, most = CASES[case]
    there = lowered(turned, low, depth)
    if case == "box on a hill":
        there[:2, 3] = 0.05, 0.04
    whole = pose(np.random.default_rng(len(case)), 2.0) if depth > 1e-7 else IDENTITY
    found = engine.signed_distance(solid, whole @ there, surface, whole)
    noise = 1e-13
    assert found.lower <= -share * depth + noise
    assert found.upper >= -share * depth - noise
    assert found.status in (Status.WITHIN_TOLERANCE, Status.EXACT)
    assert found.upper - found.lower <= -0.01 * found.upper + noise
    apart = engine.distance(solid, whole @ there, surface, whole)
    assert found.primitive_tests - apart.primitive_tests < most


def planes_of(mesh):
    """Return normals and offsets of the faces of a convex mesh."""
    corners = mesh.vertices[mesh.faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1)[:, None]
    return n, np.einsum("ij,ij->i", n, corners[:, 0])


def deepest_in(mesh, there):
    """Return how deep the plane z = 0 reaches into a convex mesh: a linear programme."""
    n, offset = planes_of(mesh)
    n = n @ there[:3, :3].T
    offset = offset + n @ there[:3, 3]
    rows = np.column_stack((n[:, :2], np.ones(len(n))))
    within = [(-1.0, 1.0), (-1.0, 1.0), (None, None)]
    return linprog([0.0, 0.0, -1.0], rows, offset, bounds=within).x[2]


@pytest.mark.parametrize("surface", [SQUARE, TRIANGLES], ids=["patch", "triangles"])
@pytest.mark.parametrize("name", ["box", "sphere"])
def test_convex_meshes_turned_by_any_angle(name, surface):
    mesh = {
        "box": box((0.5, 0.4, 0.3)), "sphere": from_trimesh(trimesh.creation.icosphere(4), "ball")
    }[name]  # fmt: skip
    rng = np.random.default_rng(len(name))
    for depth in 10.0 ** rng.uniform(-7.0, -2.0, 12):
        turned = pose(rng)[:3, :3]
        there = lowered(turned, -(mesh.vertices @ turned.T)[:, 2].min(), depth)
        expected = deepest_in(mesh, there)
        found = engine.signed_distance(mesh, there, surface, IDENTITY)
        assert found.lower <= -expected + 1e-10
        assert found.upper >= -expected - 1e-10
        assert found.upper - found.lower <= -0.01 * found.upper
        apart = engine.distance(mesh, there, surface, IDENTITY)
        assert found.primitive_tests - apart.primitive_tests < 500


@pytest.mark.parametrize("depth", DEPTHS)
def test_a_ball_in_the_hole_of_a_torus(depth):
    """No plane has all of the torus on one side there, not even nearby."""
    ring = engine.ParametricSurface(torus_patches(1.0, 0.3), solid=True)
    ball = engine.ParametricSurface(sphere_patches(), solid=False)
    ball.deform(0.5 * ball.control_points)
    turned = pose(np.random.default_rng(3), 1.0)
    aside = IDENTITY.copy()
    aside[:3, :3] = rotation(2, 0.3)
    aside[:3, 3] = (0.2 + depth) * aside[:3, 0]
    found = engine.signed_distance(ring, turned, ball, turned @ aside)
    assert found.lower <= -depth + 1e-12
    assert found.upper >= -depth - 1e-12
    assert found.upper - found.lower <= -0.01 * found.upper + 1e-12
    apart = engine.distance(ring, turned, ball, turned @ aside)
    assert found.primitive_tests - apart.primitive_tests < 600
