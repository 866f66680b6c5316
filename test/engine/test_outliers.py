"""Poses of curved parts at which searches once took long, or did not finish.

A surface that is straight in one direction, such as the wall of a cylinder, is divided into long
strips. If the search direction is tilted along a strip, the bound is worse by the tilt times the
strip's length. So the line between the near points must be normal to the strip.
"""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose
from engine_surfaces import bumps
from test_revolution import vase
from test_rings import patches

from proximity_monitor import engine
from proximity_monitor.engine.models.parts import even_parts
from proximity_monitor.engine.models.surface_hierarchy import SurfaceHierarchy
from proximity_monitor.study import shapes


def cube():
    """Return a cube of six flat patches."""
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
    """Return random poses of b beside a; at some of them b crosses a."""
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


def test_a_crossing_that_is_come_upon_slowly(monkeypatch):
    """Newton's method leaps to the crossing only in its last iterations, so it may go on.

    This is so if all pieces are cut evenly in their parameters.
    """
    monkeypatch.setattr(SurfaceHierarchy, "parts_of", staticmethod(even_parts))
    vase_at = np.array([
        [0.9177479610525869, -0.31945153960445094, 0.23598600345818294, 0.10701492452381386],
        [-0.3903726744331293, -0.8349589740232916, 0.3878823104420951, 0.39762330341264784],
        [0.07312903007524249, -0.4481006868353558, -0.8909870478396061, 0.7258137919978522],
        [0.0, 0.0, 0.0, 1.0],
    ])  # fmt: skip
    ball = engine.TriangleMesh(*shapes.sphere(1.0))
    found = engine.distance(patches(vase()), IDENTITY, ball, vase_at)
    assert found.status is engine.Status.INTERSECTING
    assert found.bound_tests < 2000
