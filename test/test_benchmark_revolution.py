"""The meshes of the benchmark of solids of revolution are within their precision."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from proximity_monitor import engine

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmark"))

from revolution_mesh import tessellated


def test_a_mesh_is_within_its_precision_also_where_a_chord_meets_the_curve_at_its_middle():
    """The profile is an S whose chord goes through its middle, from (1, 0) to (1, 3)."""
    control = np.array([[1.0, 0.0], [2.0, 1.0], [0.0, 2.0], [1.0, 3.0]])
    rims = [[[0.0, 0.0], [1.0, 0.0]], [[1.0, 3.0], [0.0, 3.0]]]
    curves = [engine.Curve(each) for each in (rims[0], control, rims[1])]
    vertices, faces, reached = tessellated(engine.SolidOfRevolution(curves), 0.05, 10**6)
    assert reached == 0.05
    t = np.linspace(0.0, 1.0, 501)[:, None]
    shares = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3
    rho, z = sum(share * point for share, point in zip(shares, control, strict=True)).T
    around = np.stack((rho, np.zeros_like(rho), z), axis=1)
    mesh = engine.TriangleMesh(vertices, faces)
    off = engine.closest_points(mesh, np.eye(4), around).upper
    assert off.max() <= reached
