"""What is straight one way, as the wall of a cylinder, against what is flat, faceted or curved.

Its parts are long strips. A bound along a direction that is tilted along one of them is worse by
the tilt times its length, so the way between near points has to be normal to it.
"""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose
from engine_surfaces import bumps

from proximity_monitor import engine


def cube():
    """Six flat patches."""
    corners = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]]).reshape(2, 2, 2)
    made = []
    for axis in range(3):
        for side in (-0.5, 0.5):
            control = np.insert(corners, axis, side, axis=2)
            made.append(engine.Patch(control))
    return engine.ParametricSurface(made)


CYLINDER = engine.shapes.cylinder(0.5, 1.5)
OTHERS = {
    "mesh": engine.shapes.box((1.0, 1.0, 1.0)),
    "patches": cube(),
    "bumps": engine.ParametricSurface([bumps(1)]),
    "cylinder": CYLINDER,
}


def apart(a, b, seed, count):
    """Random poses of b beside a, some of which cross it."""
    rng = np.random.default_rng(seed)
    made = np.stack([pose(rng) for _ in range(count)])
    way = rng.normal(size=(count, 3))
    way *= rng.uniform(0.7, 1.1, (count, 1)) / np.linalg.norm(way, axis=1)[:, None]
    made[:, :3, 3] = a.centre + (a.radius + b.radius) * way
    made[:, :3, 3] -= np.einsum("kij,j->ki", made[:, :3, :3], b.centre)
    return made


@pytest.mark.parametrize("order", ["first", "second"])
@pytest.mark.parametrize("name", OTHERS)
def test_exact_answers_end_soon(name, order):
    other = OTHERS[name]
    for at in apart(CYLINDER, other, 4, 60):
        models = (CYLINDER, IDENTITY, other, at)
        found = engine.distance(*(models if order == "first" else models[2:] + models[:2]))
        assert found.status in (engine.Status.EXACT, engine.Status.INTERSECTING)
        assert found.bound_tests < 6000
