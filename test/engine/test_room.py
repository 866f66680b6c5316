"""Searches that run out of room for parts of surfaces."""

import numpy as np
from engine_bodies import IDENTITY
from test_revolution import torus

from proximity_monitor import engine
from proximity_monitor.engine.questions.search_memory import CellRoom


def test_an_assembly_of_a_surface_and_a_mesh(monkeypatch):
    """Triangles stay what they are where parts of the surface are given up, in either order."""
    inner = torus(1.0, 0.3)
    shown = torus(1.0, 0.7).display_mesh(1e-2)  # around it: all of it is about equally near
    mesh = engine.TriangleMesh(shown.vertices, shown.faces, solid=False)
    alone = engine.distance(inner, IDENTITY, mesh, IDENTITY)
    # Room for few parts is full soon.
    monkeypatch.setattr(CellRoom.of.__func__, "__defaults__", (256,))
    bodies = engine.Assembly([inner, mesh])
    for pair in ((0, 1), (1, 0)):
        together = bodies.distances(np.stack([IDENTITY, IDENTITY]), [pair])
        assert together.lower[0] <= alone.upper + 1e-12
        assert together.upper[0] >= alone.lower - 1e-12
        assert 0.39 <= together.upper[0] <= 0.4 + 1e-9
