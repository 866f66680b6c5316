"""Newton's method on two elements, where it leads across the edges of triangles."""

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.study import shapes


@pytest.mark.parametrize("turned", [False, True])
def test_searches_end_where_a_surface_crosses_a_mesh(turned):
    """Points of both came within 1e-13 to 1e-8 of each other, and zigzagged along an edge there.

    At six of these poses the search went on until there was no room for more.
    """
    ring = engine.ParametricSurface(torus_patches())
    ball = engine.TriangleMesh(*shapes.sphere(0.2, around=16, bands=10))
    rng, count = np.random.default_rng(4), 4000
    poses = np.stack([pose(rng) for _ in range(count)])
    around, about = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    tube = rng.uniform(0.1, 0.5, count)
    out = 1.0 + tube * np.cos(about)
    poses[:, 0, 3], poses[:, 1, 3] = out * np.cos(around), out * np.sin(around)
    poses[:, 2, 3] = tube * np.sin(about)
    models = (ring, np.broadcast_to(IDENTITY, poses.shape), ball, poses)
    found = engine.distances(*(models[2:] + models[:2] if turned else models))
    statuses = tuple(engine.Status)
    assert statuses.index(engine.Status.OUT_OF_TIME) not in found.status
    crossing = found.status == statuses.index(engine.Status.INTERSECTING)
    assert crossing.sum() > 3900
    assert (found.lower[crossing] == 0.0).all()
