"""Searches that run out of room for cells of surfaces."""

import numpy as np
from engine_bodies import IDENTITY
from engine_surfaces import bumps, sphere_patches, torus_patches
from test_revolution import torus

from proximity_monitor import engine
from proximity_monitor.engine.questions.search_memory import CellRoom
from proximity_monitor.study import shapes


def test_an_assembly_of_a_surface_and_a_mesh(monkeypatch):
    """If a search gives up cells of the surface, its triangles stay valid, in either order."""
    inner = torus(1.0, 0.3)
    shown = torus(1.0, 0.7).display_mesh(1e-2)  # around it: all of it is about equally near
    mesh = engine.TriangleMesh(shown.vertices, shown.faces, solid=False)
    alone = engine.distance(inner, IDENTITY, mesh, IDENTITY)
    # A small room is soon full.
    monkeypatch.setattr(CellRoom.of.__func__, "__defaults__", (256,))
    bodies = engine.Assembly([inner, mesh])
    for pair in ((0, 1), (1, 0)):
        together = bodies.distances(np.stack([IDENTITY, IDENTITY]), [pair])
        assert together.lower[0] <= alone.upper + 1e-12
        assert together.upper[0] >= alone.lower - 1e-12
        assert 0.39 <= together.upper[0] <= 0.4 + 1e-9


def test_very_many_pairs_that_are_about_as_near_end_one_by_one():
    """Formerly, all pairs were divided in turns until the room for their cells was full."""
    shape = np.array([1.0, 1.0, 1.0001])  # not a sphere, so no empty ball holds the mesh
    patches = [
        engine.Patch(each.control * shape, weights=each.weights) for each in sphere_patches()
    ]
    vertices, faces = shapes.sphere(0.9, around=40, bands=20)
    mesh = engine.TriangleMesh(vertices * shape, faces)
    answer = engine.distance(engine.ParametricSurface(patches), IDENTITY, mesh, IDENTITY)
    assert answer.status is engine.Status.EXACT
    assert answer.lower <= 0.1 + 1e-13
    assert answer.upper >= 0.1 - 1e-13
    assert answer.upper - answer.lower < 1e-11


def test_a_continuum_ends_soon():
    """No pair can be finished in any time. The search notices this and returns its bounds."""
    one, other = (engine.ParametricSurface(torus_patches(1.0, minor)) for minor in (0.3, 0.2))
    answer = engine.distance(one, IDENTITY, other, IDENTITY)
    assert answer.status is engine.Status.OUT_OF_TIME
    assert answer.lower > 0.09
    assert answer.lower <= 0.1 <= answer.upper + 1e-13
    assert answer.bound_tests < 1_000_000


def test_what_is_nearer_than_bounds_can_tell_is_exact():
    """A copy of a surface at rounding distance: the bounds are 0 and that, and no budget ended."""
    sheet = engine.ParametricSurface([bumps(1)])
    above = IDENTITY.copy()
    above[2, 3] = 1e-12
    answer = engine.distance(sheet, IDENTITY, sheet, above)
    assert answer.status in (engine.Status.EXACT, engine.Status.INTERSECTING)
    assert answer.lower == 0.0
    assert answer.upper < 2e-12
