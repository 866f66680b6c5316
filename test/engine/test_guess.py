"""Where a search of a surface and a mesh begins if there was no earlier one."""

import numpy as np
from engine_bodies import IDENTITY, pose
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.study import shapes


def test_a_search_begins_beside_the_mesh_in_either_order():
    """A ring's middle is a hole. From there, crossings take 60,500 bound tests, not 40,200."""
    ring = engine.ParametricSurface(torus_patches())
    ball = engine.TriangleMesh(*shapes.sphere(1.0))
    rng, tests, crossing = np.random.default_rng(7), 0, 0
    for _ in range(100):
        at, way = pose(rng), rng.normal(size=3)
        way *= rng.uniform(0.1, 1.0) * (ring.radius + ball.radius) / np.linalg.norm(way)
        at[:3, 3] = ring.centre + way - at[:3, :3] @ ball.centre
        first = engine.distance(ring, IDENTITY, ball, at)
        second = engine.distance(ball, at, ring, IDENTITY)
        assert first.status is second.status
        if first.status is engine.Status.INTERSECTING:
            crossing += 1
            tests += second.bound_tests
    assert crossing > 50
    assert tests < 50_000
