"""Pairs of parametric surfaces, and of a surface and a mesh, for benchmarks."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.study import shapes
from proximity_monitor.study.surfaces import wavy

_QUARTER = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
_WEIGHTS = np.array([1.0, np.sqrt(0.5), 1.0])
_OFF = 2e-4
"""How far a torus as a mesh may be off the torus, m."""

Poses = NDArray[np.float64]


@dataclass
class Scene:
    """Two models, the second one at poses (k, 4, 4).

    OCCT is asked only about every `every`-th pose. `coherent` says that each pose is near the one
    before, as in a motion. We are asked to `abs_err`, the peer always for its exact answer.
    """

    a: engine.Model
    b: engine.Model
    poses: Poses
    every: int = 1
    coherent: bool = False
    peer: tuple[engine.Model, engine.Model] | None = None  # meshes instead of OCCT
    abs_err: float = 0.0


def torus(major: float = 1.0, minor: float = 0.3) -> engine.ParametricSurface:
    """Return a torus about z of 8 rational biquadratic patches: quarter turns of half the tube."""
    knots = [0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0]
    half = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0]])
    weights = np.array([1.0, _WEIGHTS[1], 1.0, _WEIGHTS[1], 1.0])
    made = []
    for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        around = _QUARTER @ np.array([[c, s], [-s, c]])
        for sign in (1.0, -1.0):
            control = np.empty((3, 5, 3))
            control[..., :2] = around[:, None] * (major + minor * sign * half[:, :1])
            control[..., 2] = minor * sign * half[:, 1]
            made.append(engine.Patch(control, None, knots, np.outer(_WEIGHTS, weights)))
    return engine.ParametricSurface(made, name="torus")


def teapot() -> engine.ParametricSurface:
    """Return Newell's teapot of 32 bicubic patches; edges collapse in its knob and its bottom.

    It does not close: the lid is smaller than the rim, and the spout is open at its tip.
    """
    data = json.loads((Path(__file__).parent / "teapot.json").read_text(encoding="utf-8"))
    ways = {"quarters": [(1, 1), (-1, 1), (-1, -1), (1, -1)], "halves": [(1, 1), (1, -1)]}
    made = [
        # A patch that is mirrored once is reversed along v, so that all normals point to one side.
        engine.Patch((np.array(control, float) * (*way, 1))[:, :: way[0] * way[1]])
        for which, signs in ways.items()
        for control in data[which].values()
        for way in signs
    ]
    return engine.ParametricSurface(made, name="teapot")


def fitting() -> engine.Model:
    """Return a plate with a boss, cones and a ring on it: planes and solids of revolution."""
    flat = {"solid": False}
    low, high = np.array([-0.2, -0.1, -0.02]), np.array([0.2, 0.1, 0.02])
    sides = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end in (low, high):
            grid = np.tile(end, (2, 2, 1))
            grid[0, :, u], grid[1, :, u] = low[u], high[u]
            grid[:, 0, v], grid[:, 1, v] = low[v], high[v]
            sides.append(engine.Patch(grid))
    round_ones = [
        (engine.shapes.cylinder(0.05, 0.12, **flat), (-0.1, 0.0, 0.08)),
        (engine.shapes.cone(0.06, 0.0, 0.16, **flat), (0.1, 0.0, 0.1)),
        (engine.shapes.cone(0.04, 0.02, 0.06, **flat), (0.0, 0.0, -0.05)),
        (engine.shapes.torus(0.05, 0.015, **flat), (-0.1, 0.0, 0.14)),
    ]
    parts = [engine.shapes.Part(engine.ParametricSurface(sides), np.eye(4))]
    parts += [
        engine.shapes.Part(model, at(np.eye(3), np.array(place))) for model, place in round_ones
    ]
    return engine.shapes.compound(parts, name="fitting", solid=False)


def turned(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a random rotation (3, 3)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def at(rotation: NDArray[np.float64], offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a rotation and an offset."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, offset
    return pose


def _small(rng: np.random.Generator, angle: float) -> NDArray[np.float64]:
    """Return a rotation (3, 3) about x, y and z by random angles with this standard deviation."""
    x, y, z = angle * rng.normal(size=3)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    q, r = np.linalg.qr(np.eye(3) + skew)
    return q * np.sign(np.diag(r))


def _random(a: engine.Model, b: engine.Model, count: int, most: float) -> Poses:
    """Return random poses of b, centres 0.1 to `most` times the sum of both radii apart."""
    rng, made = np.random.default_rng(7), []
    for _ in range(count):
        rotation, way = turned(rng), rng.normal(size=3)
        way *= rng.uniform(0.1, most) * (a.radius + b.radius) / np.linalg.norm(way)
        made.append(at(rotation, a.centre + way - rotation @ b.centre))
    return np.array(made)


def _wavy(count: int) -> Scene:
    a, b = wavy(1, 10), wavy(2, 10)
    return Scene(a, b, _random(a, b, count, 1.6))


def _parallel(count: int) -> Scene:
    a, b, rng = wavy(3, 30, 0.02), wavy(4, 30, 0.02), np.random.default_rng(4)
    gaps = np.linspace(0.06, 0.2, count)
    return Scene(a, b, np.array([at(_small(rng, 0.02), np.array([0, 0, g])) for g in gaps]))


def _offset(count: int) -> Scene:
    a, rng = wavy(3, 30, 0.02), np.random.default_rng(4)
    b = engine.Patch(a.control + 1e-4 * rng.normal(size=a.control.shape), a.knots_u, a.knots_v)
    gaps = np.geomspace(1e-2, 5e-4, count)
    return Scene(a, b, np.array([at(_small(rng, 1e-4), np.array([0, 0, g])) for g in gaps]))


def _motion(count: int) -> Scene:
    a, b = wavy(1, 10), wavy(2, 10)
    t = np.linspace(0.0, 2.0 * np.pi, 30 * count)
    base = turned(np.random.default_rng(5))
    poses = []
    for angle in t:
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        offset = np.array([0.5 + 0.4 * c, 0.5 + 0.3 * s, 0.9 + 0.2 * np.sin(3 * angle)])
        poses.append(at(turn @ base, offset - turn @ base @ b.centre))
    return Scene(a, b, np.array(poses), every=30, coherent=True)


def _tori(count: int) -> Scene:
    a = torus()
    return Scene(a, a, _random(a, a, count, 1.2))


def _interlocked(count: int) -> Scene:
    a, rng = torus(), np.random.default_rng(6)
    upright = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    way = 0.1 * rng.normal(size=(count, 3))
    made = [at(_small(rng, 0.2) @ upright, np.array([1.0, 0, 0]) + each) for each in way]
    return Scene(a, a, np.array(made))


def _coaxial(count: int) -> Scene:
    a, b, rng = torus(), torus(0.8, 0.15), np.random.default_rng(8)
    made = []
    for height in np.linspace(0.5, 1.5, max(count // 4, 1)):
        angle = rng.uniform(0, np.pi)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        made.append(at(turn, np.array([0, 0, height])))
    return Scene(a, b, np.array(made))


def _teapot(count: int) -> Scene:
    a = teapot()
    return Scene(a, a, _random(a, a, count, 1.2), every=4)


def _fitting(count: int) -> Scene:
    a = fitting()
    return Scene(a, a, _random(a, a, count, 1.2), every=4)


def _aligned(count: int) -> Scene:
    scene, rng = _fitting(count), np.random.default_rng(9)
    for pose in scene.poses:
        turn = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)
        pose[:3, :3] = turn * np.linalg.det(turn)
    return scene


def _mesh(count: int, radius: float = 1.0, abs_err: float = 0.0) -> Scene:
    ring, ball = torus(), engine.TriangleMesh(*shapes.sphere(radius), name="sphere")
    shown = ring.display_mesh(_OFF)
    mesh = engine.TriangleMesh(shown.vertices, shown.faces, name="torus as a mesh")
    poses = _random(ring, ball, 4 * count, 1.2)
    return Scene(ring, ball, poses, peer=(mesh, ball), abs_err=abs_err)


SCENES: dict[str, Callable[[int], Scene]] = {
    "wavy": _wavy,
    "parallel": _parallel,
    "offset": _offset,
    "motion": _motion,
    "tori": _tori,
    "interlocked": _interlocked,
    "coaxial": _coaxial,
    "teapot": _teapot,
    "fitting": _fitting,
    "aligned": _aligned,
    "mesh": _mesh,
    "hole": partial(_mesh, radius=0.5),
    "mesh_2e-4": partial(_mesh, abs_err=_OFF),
    "hole_2e-4": partial(_mesh, radius=0.5, abs_err=_OFF),
}
WITHOUT_OCCT = ("mesh", "hole", "mesh_2e-4", "hole_2e-4", "deform")
