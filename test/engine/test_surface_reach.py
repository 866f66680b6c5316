"""How far surfaces reach along a direction, and separating planes found by that."""

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose, translation
from engine_surfaces import bumps
from numba import njit
from test_revolution import ball, torus
from test_rings import patches, wavy

from proximity_monitor import engine
from proximity_monitor.engine import Status
from proximity_monitor.engine.kernels.base.linking import ROOT
from proximity_monitor.engine.kernels.base.tables import tree_at
from proximity_monitor.engine.kernels.base.trees import SurfaceTree
from proximity_monitor.engine.kernels.surface.edges import point_on
from proximity_monitor.engine.kernels.surface.reach import reach_along
from proximity_monitor.study.surfaces import wavy as wavy_patch

EVERYTHING = 1e9


@njit(pipeline_class=ROOT)
def reach(table, n, element, u, v, most):
    tree, _ = tree_at(SurfaceTree, table)
    return reach_along(tree, (n[0], n[1], n[2]), element, u, v, most)


@njit(pipeline_class=ROOT)
def farthest(table, n, steps):
    """Return piece, u, v and reach of the farthest point, by samples ever closer to the best."""
    tree, _ = tree_at(SurfaceTree, table)
    best, piece, u, v = -np.inf, 0, 0.0, 0.0
    for t in range(len(tree.pieces)):
        for i in range(steps):
            for j in range(steps if tree.pieces[t].degree_v > 0 else 1):
                p = point_on(tree, t, i / (steps - 1), j / (steps - 1))
                if p[0] * n[0] + p[1] * n[1] + p[2] * n[2] > best:
                    best = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
                    piece, u, v = t, i / (steps - 1), j / (steps - 1)
    far = 1.0 / (steps - 1)
    while far > 1e-10:
        from_u, from_v = u, v
        for i in range(-4, 5):
            for j in range(-4, 5) if tree.pieces[piece].degree_v > 0 else range(1):
                x = min(max(from_u + 0.25 * far * i, 0.0), 1.0)
                y = min(max(from_v + 0.25 * far * j, 0.0), 1.0)
                p = point_on(tree, piece, x, y)
                if p[0] * n[0] + p[1] * n[1] + p[2] * n[2] > best:
                    best = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
                    u, v = x, y
        far *= 0.5
    return piece, u, v, best


def curve():
    control = np.random.default_rng(1).normal(size=(9, 3))
    return engine.Curve(control, [0] * 4 + [1, 2, 3, 4, 5] + [6] * 4)


SURFACES = {
    "torus": patches(torus(1.0, 0.3)),
    "ball": patches(ball(0.5)),
    "rational": patches(wavy(2, rational=True, seed=1)),
    "bumps": engine.ParametricSurface([bumps(3)]),
    "degree 9": wavy_patch(5, 12, degree=9),
    "curve": curve(),
}


def directions(seed, count):
    made = np.random.default_rng(seed).normal(size=(count, 3))
    return made / (np.linalg.norm(made, axis=1) * (1.0 + 1e-15))[:, None]


@pytest.mark.long
@pytest.mark.parametrize("name", SURFACES)
def test_from_the_point_that_reaches_farthest(name):
    """No sample reaches beyond the bound, and the bound is right to rounding."""
    surface = SURFACES[name]
    table, size = surface._hierarchy.table, surface.radius + np.linalg.norm(surface.centre)
    far = 0
    for n in directions(3, 30):
        piece, u, v, most = farthest(table, n, 9)
        end = reach(table, n, piece, u, v, 1e-9 * size)
        assert end >= most - 1e-15 * size
        far += not end <= most + 2e-12 * size
        elsewhere = reach(table, n, 0, 0.5, 0.5, EVERYTHING)
        assert elsewhere >= most - 1e-15 * size
    assert far <= 10  # `farthest` may stop at the end of a piece, and another piece reaches farther


@pytest.mark.parametrize(("name", "large", "small"), [("torus", 1.0, 0.3), ("ball", 0.0, 0.5)])
def test_what_formulas_say(name, large, small):
    """Along an axis, the farthest point is a corner of four pieces, or there is a whole circle."""
    table = SURFACES[name]._hierarchy.table
    for n in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.8, 0.0), (0.0, 0.6, 0.8), (0.0, 0.0, 1.0)):
        n = np.array(n)
        expected = large * np.hypot(n[0], n[1]) + small
        piece, u, v, _ = farthest(table, n, 9)
        assert expected - 1e-14 <= reach(table, n, piece, u, v, 1e-9) <= expected + 1e-12


def test_what_reaches_farther_than_is_allowed_ends_the_search():
    table = SURFACES["torus"]._hierarchy.table
    assert reach(table, np.array([1.0, 0.0, 0.0]), 5, 0.5, 0.5, 1e-3) == np.inf


MESH = engine.shapes.box((0.5, 0.7, 1.1))


def test_a_plane_ends_the_search():
    """A surface beside a mesh, apart: one plane proves many of the answers, and all are right."""
    a, b = SURFACES["torus"], MESH
    known = torus(1.0, 0.3)
    held = apart = 0
    rng = np.random.default_rng(6)
    for _ in range(40):
        way = rng.normal(size=3)
        at = translation(*(2.2 * way / np.linalg.norm(way))) @ pose(rng)
        found, turned = engine.distance(a, IDENTITY, b, at), engine.distance(b, at, a, IDENTITY)
        expected = engine.distance(known, IDENTITY, b, at)
        for each in (found, turned):
            assert each.lower <= expected.upper + 1e-12 and expected.lower <= each.upper + 1e-12
            assert each.status in (Status.EXACT, Status.INTERSECTING)
            apart += each.status is Status.EXACT
            held += each.status is Status.EXACT and each.bound_tests == 0
    assert held > 0.2 * apart
