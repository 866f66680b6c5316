"""Solids for tests of depth, and checks that every answer must pass."""

from __future__ import annotations

import itertools

import numpy as np
import trimesh
from ball_oracle import depth_of_solids
from engine_bodies import (
    box,
    from_trimesh,
    sphere,
    torus,
)
from engine_oracles import pairwise_distances, triangles

from proximity_monitor import engine

TIGHT = 1e-12
PERCENT = 1.01 + 1e-9


def together(*parts: trimesh.Trimesh, name: str = "assembly") -> engine.TriangleMesh:
    """Return several meshes as one model."""
    return from_trimesh(trimesh.util.concatenate(parts), name)


def turned(mesh: engine.TriangleMesh) -> engine.TriangleMesh:
    """Return the same mesh inside out."""
    return engine.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1], name=mesh.name)


def as_soup(mesh: engine.TriangleMesh) -> engine.TriangleMesh:
    """Return the same triangles as a mesh in which none share a vertex."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    return engine.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3), name="soup")


def icosphere(subdivisions: int, radius: float, x: float = 0.0) -> trimesh.Trimesh:
    made = trimesh.creation.icosphere(subdivisions, radius)
    made.apply_translation((x, 0.0, 0.0))
    return made


def cylinder(radius: float, height: float) -> engine.TriangleMesh:
    return from_trimesh(trimesh.creation.cylinder(radius, height, sections=24), "cylinder")


def ball(radius: float = 0.5) -> engine.TriangleMesh:
    return engine.points([[0.0, 0.0, 0.0]], radius=radius)


def ask(a, pose_a, b, pose_b, **options) -> engine.Distance:
    """Query both orders of the models, check that the answers agree, and return the first."""
    found = engine.signed_distance(a, pose_a, b, pose_b, **options)
    other = engine.signed_distance(b, pose_b, a, pose_a, **options)
    assert max(found.lower, other.lower) <= min(found.upper, other.upper) + TIGHT
    assert (found.upper < 0.0) == (other.upper < 0.0)
    assert (found.lower > 0.0) == (other.lower > 0.0)
    return found


def check(found: engine.Distance, expected: float, slack: float = TIGHT) -> None:
    """Check that the bounds contain the value and are as tight as promised."""
    assert found.lower - slack <= expected <= found.upper + slack
    if found.upper < 0.0:
        assert found.lower >= PERCENT * found.upper - slack
    elif found.lower > 0.0:
        assert found.upper - found.lower <= slack


def check_brute(a, pose_a, b, pose_b, found: engine.Distance) -> None:
    """Check that the bounds agree with the wider ones of a search on a grid."""
    shallow, deep = depth_of_solids(a, pose_a, b, pose_b)
    assert max(-found.lower, 0.0) >= shallow - TIGHT
    assert -found.upper <= deep + TIGHT
    if shallow > 0.0:
        assert found.lower < 0.0
        check(found, found.upper)
    if found.lower > 0.0:
        nearest = float(pairwise_distances(triangles(a, pose_a), triangles(b, pose_b)).min())
        check(found, nearest)


SOLIDS = {
    "box": box(),
    "sphere": sphere(1),
    "torus": torus(8),
    "cylinder": from_trimesh(trimesh.creation.cylinder(0.4, 2.0, sections=12), "cylinder"),
    "plate": box((2.0, 2.0, 0.05)),
    "two spheres": together(icosphere(1, 0.6, -1.0), icosphere(1, 0.5, 1.0)),
    "overlapping boxes": together(
        trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.5, 2.0, 0.5))
    ),
    "hollow": together(icosphere(1, 1.5), trimesh.Trimesh(
        (inner := icosphere(1, 1.1)).vertices, inner.faces[:, ::-1]
    )),
}  # fmt: skip

PAIRS = list(itertools.combinations_with_replacement(SOLIDS, 2))
