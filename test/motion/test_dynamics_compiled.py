"""Compiled functions of dynamics: where they are kept, and bounds against exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from dynamics_bodies import at

from proximity_monitor.engine.kernels.base.jit import CACHE_DIRECTORY
from proximity_monitor.motion.dynamics import candidates, solver


@pytest.mark.parametrize("module", [candidates, solver])
def test_it_is_kept_with_the_kernels(module):
    compiled = [each for each in vars(module).values() if hasattr(each, "py_func")]
    kept = {each.stats.cache_path for each in compiled} - {None}
    assert kept and all(path.startswith(str(CACHE_DIRECTORY)) for path in kept)


def exact(pose, point):
    """Return the point that a pose moves a point to, in rational numbers."""
    return [
        sum(Fraction(pose[i, k]) * Fraction(point[k]) for k in range(3)) + Fraction(pose[i, 3])
        for i in range(3)
    ]


@pytest.mark.parametrize("away", [1.0, 1e4, 1e8])
def test_bounds_are_below_the_exact_distance_wherever_models_are_drawn(away):
    random = np.random.default_rng(8)
    for _ in range(100):
        # Two points, far from their models' origins and a metre or two apart in the world.
        points = away * random.uniform(-1.0, 1.0, (2, 3))
        poses = np.array([at((0, 0, 0), random.normal(size=3), random.normal()) for _ in points])
        poses[:, :3, 3] -= np.einsum("nij,nj->ni", poses[:, :3, :3], points)
        poses[0, :3, 3] += random.uniform(1.0, 2.0, 3)
        spheres = candidates.spheres_at(poses, np.arange(2), np.pad(points, ((0, 0), (0, 1))))
        boxes, pairs, rows = np.hstack((points, points)), np.array([[0, 1]]), np.empty((1, 3), int)
        lower = np.zeros(1)
        assert not candidates.near_pieces(
            poses, pairs, np.zeros(1), lower, np.arange(3), spheres, boxes, rows
        )
        first, second = map(exact, poses, points)
        square = sum((p - q) ** 2 for p, q in zip(first, second, strict=True))
        assert Fraction(lower[0]) ** 2 <= square
        assert lower[0] == pytest.approx(float(square) ** 0.5, rel=1e-12 * max(away, 1.0))
