"""Newton's method on two elements, with steps across the edges of triangles."""

import numpy as np
import pytest
from engine_bodies import IDENTITY, from_python, pose
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.kernels.pairs import surface_mesh, triangle_newton
from proximity_monitor.engine.kernels.surface import newton
from proximity_monitor.study import shapes

RING = engine.ParametricSurface(torus_patches())


def test_a_step_over_two_parameters_is_that_of_numpy():
    """Parameters may be at an end, pressed outwards or not, and damped; indefinite is refused."""
    solve, rng, refused = from_python(triangle_newton._solve), np.random.default_rng(3), 0
    trees, factor = (0, 0), np.empty((4, 4))  # neither is read
    for _ in range(400):
        x, gradient, hessian = rng.choice([0.0, 0.5, 1.0], 4), rng.normal(size=4), np.zeros((4, 4))
        half = rng.normal(size=(2, 2))
        hessian[:2, :2] = half @ half.T + rng.choice([0.0, -0.5]) * np.eye(2)
        damping, step = rng.choice([0.0, 0.1]), np.full(4, 9.0)
        held = ((x <= 0.0) & (gradient >= 0.0)) | ((x >= 1.0) & (gradient <= 0.0))
        free = [i for i in range(2) if not held[i]]
        matrix = hessian[np.ix_(free, free)]
        if free:
            most = np.abs(np.diag(matrix)).max()
            matrix = matrix + np.diag(damping * (np.abs(np.diag(matrix)) + 1e-3 * most))
        positive = len(free) == 0 or np.linalg.eigvalsh(matrix).min() > 0.0
        lower = np.tril(hessian)
        assert solve(*trees, x, gradient, lower, damping, factor, step) == positive
        refused += not positive
        if positive:
            expected = np.zeros(4)
            if free:
                expected[free] = -np.linalg.solve(matrix, gradient[free])
            assert step == pytest.approx(expected, rel=1e-8, abs=1e-10)
    assert 20 < refused < 200


def test_points_that_are_near_enough_are_not_moved():
    """If models meet, a search for a local minimum ends within the error allowed of a distance."""
    assert surface_mesh.search  # importing it registers the triangle kernels of Newton's method
    nearest = from_python(newton.nearest_near)
    ball = engine.TriangleMesh(*shapes.sphere(0.2, around=16, bands=10))
    trees, motion = (RING._hierarchy.tree, ball._hierarchy.tree), np.append(np.eye(3), [2.0, 0, 0])
    given = (*trees, 0, 0, (0.3, 0.4, 0.0), (1.0 / 3.0,) * 3, motion, newton.MOST)
    near, at, _, _ = nearest(*given, 0.0)
    first, still, _, _ = nearest(*given, 10.0)
    assert still == (0.3, 0.4, 0.0)
    assert at != still
    assert near < first < 10.0
    between = 0.5 * (near + first)
    assert nearest(*given, between)[0] <= between


@pytest.mark.parametrize("turned", [False, True])
def test_searches_end_where_a_surface_crosses_a_mesh(turned):
    """Formerly, points of both came within 1e-13 to 1e-8 of each other and zigzagged along an edge.

    At six of these poses the search went on until its room was full.
    """
    ring, ball = RING, engine.TriangleMesh(*shapes.sphere(0.2, around=16, bands=10))
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
