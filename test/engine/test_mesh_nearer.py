"""The place from which to look for nearer points of a surface beside a mesh; see mesh_nearer.py."""

import numpy as np
import pytest
from engine_bodies import IDENTITY, from_python, pose
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.kernels.pairs import mesh_nearer
from proximity_monitor.study import shapes

aim = from_python(mesh_nearer._aim)
RING = engine.ParametricSurface(torus_patches())
BALL = engine.TriangleMesh(*shapes.sphere(1.0))


def unit(rng):
    """Return a random unit vector."""
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


@pytest.mark.parametrize("seed", range(20))
def test_where_planes_meet_near_by_is_looked(seed):
    rng = np.random.default_rng(seed)
    p, n, m = rng.normal(size=3), unit(rng), unit(rng)
    q = p + 0.01 * rng.normal(size=3)
    place, away = aim(tuple(p), tuple(n), tuple(q), tuple(m), 1.0, 10.0)
    way = np.array(place) - p
    assert away == pytest.approx(np.linalg.norm(way))
    assert abs(way @ n) < 1e-12
    assert abs((place - q) @ m) < 1e-12
    assert abs(way @ np.cross(n, m)) < 1e-12  # the place is the point of the line nearest to p


def test_what_faces_is_looked_for_from_behind():
    """If the mesh faces p, the place is behind the mesh's point; if not, on the way to a crossing.

    A crossing farther away than the limit shortens the way to the limit. If the crossing is of no
    use, the place is the mesh's own point.
    """
    up, down = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
    p, q = (0.0, 0.0, 0.0), (0.0, 0.0, 0.5)
    place, away = aim(p, up, q, down, 2.0, 0.25)
    assert place == (0.0, 0.0, 2.5)
    assert away == np.inf
    assert aim(p, up, q, up, 2.0, 0.25)[0] == q  # parallel, and the mesh faces away from p
    tilted = (0.6, 0.0, 0.8)
    place, away = aim(p, up, q, tilted, 2.0, 0.6)
    assert away == 0.6
    assert place == pytest.approx((0.6, 0.0, 0.0))  # on the way to the crossing at x = 2 / 3
    assert aim(p, up, q, tilted, 2.0, 0.4)[0] == q  # the limit is below the distance to q: no step


def test_models_that_cross_are_found_to_do_so_before_any_volume_is_opened():
    crossing = at_once = 0
    for seed in range(60):
        there = pose(np.random.default_rng(seed), 0.8)
        answer = engine.Pair(RING, BALL).distance(IDENTITY, there)
        if answer.status == engine.Status.INTERSECTING:
            crossing += 1
            at_once += answer.bound_tests == 0
    assert crossing >= 50
    assert at_once >= 0.85 * crossing  # projections alone found 39 of 56
