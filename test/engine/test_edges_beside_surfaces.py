"""Triangles whose nearest point to a surface lies at a corner or on an edge, or nearly so."""

import numpy as np
import pytest
from engine_bodies import IDENTITY
from engine_surfaces import patch, torus_patches

from proximity_monitor import engine

MAJOR, MINOR = 1.0, 0.3
RING = engine.ParametricSurface(torus_patches(MAJOR, MINOR))


def inside_the_ring(rng, height):
    """Return a point `height` above the saddle inside the ring, the normal, and a tangent.

    The tangent runs along the ring. The last value is how much the surface of equal height
    bends towards the ring's middle, 1/metres.
    """
    angle, side = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(2.4, 3.8)
    middle = np.array([np.cos(angle), np.sin(angle), 0.0])
    n = np.cos(side) * middle + np.sin(side) * np.array([0.0, 0.0, 1.0])
    along = np.cross(middle, (0.0, 0.0, 1.0))
    centre = (MAJOR + MINOR * np.cos(side)) / -np.cos(side)
    return MAJOR * middle + (MINOR + height) * n, n, along, 1.0 / (centre - height)


def tip(rng, height, size, share):
    point, n, along, bend = inside_the_ring(rng, height)
    across, rise = np.cross(n, along), 0.5 * share * bend * size**2
    turns = np.arange(6) * np.pi / 3.0 + rng.uniform(0.0, 1.0)
    rim = [point + size * (np.cos(t) * along + np.sin(t) * across) + rise * n for t in turns]
    return [point, *rim], [[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)]


def ridge(rng, height, size, share):
    """Return two triangles with an edge across the ring. Its nearest point is not at an end.

    The surface bends away there.
    """
    point, n, along, bend = inside_the_ring(rng, height)
    across, rise = np.cross(n, along), 0.5 * share * bend * size**2
    sides = [point + rise * n + size * along, point + rise * n - size * along]
    return [point - 0.6 * size * across, point + size * across, *sides], [[0, 1, 2], [1, 0, 3]]


@pytest.mark.parametrize(
    "made, height, most", [(tip, 0.45, 1100), (ridge, 0.15, 300)], ids=["tip", "ridge"]
)
def test_a_tip_and_a_ridge_above_a_saddle_end_soon(made, height, most):
    """The other corners rise only 1.2 times as much as would make them equally near.

    If both points move along the saddle, the distance falls, but for the triangle's slope.
    Without a proof that knows the slope, a search takes 1,500 and 400 bounds.
    """
    rng = np.random.default_rng(7)
    bounds = []
    for _ in range(12):
        mesh = engine.TriangleMesh(*made(rng, height, 0.02, 1.2))
        found = engine.distance(RING, IDENTITY, mesh, IDENTITY)
        assert found.status == engine.Status.EXACT
        assert found.upper == pytest.approx(height, abs=1e-12)
        assert found.lower >= found.upper - 1e-11
        bounds.append(found.bound_tests)
    assert np.median(bounds) <= most


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_nothing_of_a_triangle_that_is_about_as_near_all_over_is_nearer_than_the_bound(seed):
    """Its corners are about equally high above a wavy surface, so perhaps none is the nearest."""
    rng = np.random.default_rng(seed)
    surface = patch(seed, shape=(6, 6), degrees=(3, 3))
    model = engine.ParametricSurface([surface])
    shares = np.vstack((np.eye(3), rng.dirichlet((0.6, 0.6, 0.6), size=400)))
    for _ in range(60):
        size, height = 10.0 ** rng.uniform(-3.0, -1.0), 10.0 ** rng.uniform(-3.0, -0.5)
        u, v = np.clip(rng.uniform(0.1, 0.9, (2, 1)) + size * rng.normal(size=(2, 3)), 0.0, 1.0)
        rise = height * (1.0 + 10.0 ** rng.uniform(-9.0, -2.0) * rng.normal(size=3))
        corners = surface.evaluate(u, v) + rise[:, None] * surface.normal(u, v)
        triangle = engine.TriangleMesh(corners, [[0, 1, 2]])
        found = engine.distance(model, IDENTITY, triangle, IDENTITY)
        assert found.status in (engine.Status.EXACT, engine.Status.INTERSECTING)
        near = engine.closest_points(model, IDENTITY, shares @ corners)
        assert near.lower.min() >= found.lower - 1e-13
