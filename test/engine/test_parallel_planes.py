"""Flat patches above flat patches and triangles, so near that rounding tilts the way between them.

All points of the faces are nearest points. Bounds are exact along the normal only.
"""

import numpy as np
import pytest
from engine_surfaces import clamped

from proximity_monitor import engine

ACROSS = np.linspace(-2.0, 2.0, 6)
KNOTS = clamped(np.random.default_rng(2), 6, 3)
FLAT = np.stack((*np.meshgrid(ACROSS, ACROSS, indexing="ij"), np.zeros((6, 6))), axis=-1)
CORNERS = np.array([[-3.0, -3.0, 0.0], [3.0, -3.0, 0.0], [3.0, 3.0, 0.0], [-3.0, 3.0, 0.0]])

MODELS = {
    "patch": engine.Patch(CORNERS[[0, 3, 1, 2]].reshape(2, 2, 3)),
    "net": engine.Patch(FLAT, KNOTS, KNOTS),
    "triangles": engine.TriangleMesh(CORNERS, [[0, 1, 2], [0, 2, 3]]),
}


@pytest.mark.parametrize("gap", [1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize(
    "names",
    [("patch", "patch"), ("patch", "triangles"), ("net", "triangles"), ("net", "net")],
    ids=" above ".join,
)
def test_parallel_faces_have_an_exact_distance_however_near(names, gap):
    a, b = (MODELS[name] for name in names)
    q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    for turn in (np.eye(3), q * np.linalg.det(q)):
        here, above = np.eye(4), np.eye(4)
        here[:3, :3] = above[:3, :3] = turn
        above[:3, 3] = turn @ [0.3, 0.1, gap]
        found = engine.distance(a, here, b, above)
        assert found.status is engine.Status.EXACT
        assert found.lower <= gap + 1e-15
        assert found.upper >= gap - 1e-15
