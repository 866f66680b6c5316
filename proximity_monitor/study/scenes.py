"""The scenes of benchmark and study, from fixed seeds (Larsen et al. 1999, sections 7.2 and 7.3).

A scene is a set of models and, step by step, the poses of the pairs to measure.
Lengths are metres, poses (k, 4, 4) from model to world.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine, motion
from proximity_monitor.scene import bundled, load_model, load_scene
from proximity_monitor.scene.poses import rotations

from . import shapes


@dataclass(frozen=True)
class Track:
    """Two models, by name, and their poses, (k, 4, 4) each."""

    a: str
    b: str
    poses_a: NDArray[np.float64]
    poses_b: NDArray[np.float64]


@dataclass(frozen=True)
class StudyScene:
    """Models by name, and the pairs of them to measure at every step.

    Attributes:
        meshes: vertices and faces by name.
        tracks: the pairs; all have the same number of steps.
        block: how many steps in a row one engine answers before the next has its turn.
        quick_blocks: how many blocks, spread evenly over the steps, a quick run takes.
        surfaces: models that are not meshes, by name.
    """

    meshes: dict[str, shapes.Mesh]
    tracks: list[Track]
    block: int = 64
    quick_blocks: int = 3
    surfaces: dict[str, engine.Model] = field(default_factory=dict)


def rotation_poses(axis: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses that turn about unit axes (3,) or (k, 3) by angles (k,)."""
    poses = identities(len(angle))
    poses[:, :3, :3] = rotations(axis, angle)
    return poses


def identities(count: int) -> NDArray[np.float64]:
    """Return (count, 4, 4) identity poses."""
    return np.tile(np.eye(4), (count, 1, 1))


def random_rotations(random: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Return poses at the origin with uniformly distributed orientations."""
    w, *axis = (q := random.normal(size=(count, 4))).T / np.linalg.norm(q, axis=1)
    length = np.linalg.norm(axis, axis=0)
    return rotation_poses((axis / length).T, 2.0 * np.arctan2(length, w))


def engine_block(a: str, b: str) -> StudyScene:
    """Return one turn of the bundled engine: its watched pairs of two kinds of bodies."""
    description = load_scene(bundled("engine"))
    moves = motion.from_scene(description)
    steps = 128
    frames = [moves.poses(moves.period_s * i / steps) for i in range(steps)]
    poses = {name: np.array([frame[name] for frame in frames]) for name in frames[0]}
    meshes = {}
    for body in description.bodies:
        meshes[body.name] = load_model(body, description.unit).display_mesh(0.0)[:2]
        if not body.moving:
            poses[body.name] = np.tile(body.pose, (steps, 1, 1))
    tracks = [
        Track(pair.a, pair.b, poses[pair.a], poses[pair.b])
        for pair in description.pairs
        if pair.a.startswith(a) and pair.b.startswith(b)
    ]
    used = {name for track in tracks for name in (track.a, track.b)}
    return StudyScene({name: meshes[name] for name in used}, tracks, block=16, quick_blocks=2)


def corridor(count: int) -> NDArray[np.float64]:
    """Return points (count, 3) of a closed path through the cave, kept free of stalactites."""
    s = np.linspace(0.0, 2.0 * np.pi, count)
    return np.stack((2.4 * np.cos(s), 2.0 * np.sin(2 * s) * 0.6, 0.35 * np.sin(3 * s)), axis=1)


def cave(coherent: bool) -> StudyScene:
    """Return a wrinkled torus in a cave: 2,880 poses, random as a planner's or along one path."""
    meshes = {"torus": shapes.wrinkled_torus(), "cave": shapes.cave(corridor(400), clear=0.25)}
    count = 2880
    random = np.random.default_rng(2880)
    if coherent:
        turn = np.linspace(0.0, 9.0 * np.pi, count)
        poses = rotation_poses(np.array([0.6, 0.0, 0.8]), turn)
        poses[:, :3, 3] = corridor(count)
    else:
        poses = random_rotations(random, count)
        poses[:, :3, 3] = random.uniform((-2.8, -2.8, -1.1), (2.8, 2.8, 1.1), (count, 3))
    return StudyScene(meshes, [Track("torus", "cave", poses, identities(count))], quick_blocks=6)


def chain() -> StudyScene:
    """Return ten interlocked rings, held level and let go: all 45 pairs at each step."""
    links, steps, spacing, step_s = 10, 480, 1.3, 0.01
    joints = np.zeros((links + 1, 3))
    joints[:, 0] = spacing * np.arange(links + 1)
    joints[:, 1] = 0.3 * np.sin(np.arange(links + 1))
    before = joints.copy()
    poses = np.empty((links, steps, 4, 4))
    for step in range(steps):
        joints, before = joints + 0.995 * (joints - before), joints
        joints[:, 2] -= 9.81 * step_s**2
        for _ in range(60):  # restores the links' lengths; a joint between links is a point
            for start in (0, 1):
                link = joints[start + 1 :: 2] - joints[start:-1:2][: len(joints[start + 1 :: 2])]
                length = np.linalg.norm(link, axis=1, keepdims=True)
                correction = 0.5 * (1.0 - spacing / length) * link
                joints[start : start + 2 * len(link) : 2] += correction
                joints[start + 1 :: 2] -= correction
            joints[0] = 0.0
        along = np.diff(joints, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        side = np.cross(along, (0.0, 1.0, 0.0))
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        frames = np.stack((along, side, np.cross(along, side)), axis=2)
        frames[1::2] = frames[1::2][:, :, [0, 2, 1]] * (1.0, 1.0, -1.0)  # a quarter turn
        poses[:, step] = np.eye(4)
        poses[:, step, :3, :3] = frames
        poses[:, step, :3, 3] = 0.5 * (joints[1:] + joints[:-1])
    pairs = [(i, j) for i in range(links) for j in range(i)]
    tracks = [Track("ring", "ring", poses[i], poses[j]) for i, j in pairs]
    return StudyScene({"ring": shapes.ring()}, tracks, block=32, quick_blocks=2)


def tori() -> StudyScene:
    """Return a warped torus that lands aslant on a lumpy one, pivots and falls through its hole."""
    count = 2398
    share = np.linspace(0.0, 1.0, count)
    times = (0.0, 0.25, 0.65, 0.8, 1.0)
    lean = np.interp(share, times, (0.2, 0.5, 0.2, 0.0, 0.3))
    spin = 25.0 * share
    poses = rotation_poses(np.array([0.0, 1.0, 0.0]), lean)
    poses = poses @ rotation_poses(np.array([0.0, 0.0, 1.0]), spin)
    poses[:, 0, 3] = np.interp(share, times, (0.1, 0.25, 0.1, 0.0, 0.0))
    poses[:, 2, 3] = np.interp(share, times, (0.9, 0.62, 0.36, 0.0, -1.2))
    wander = rotation_poses(np.array([0.0, 0.0, 1.0]), 6.0 * share)
    meshes = {"warped": shapes.warped_torus(), "lumpy": shapes.lumpy_torus()}
    return StudyScene(
        meshes, [Track("warped", "lumpy", wander @ poses, identities(count))], quick_blocks=8
    )


def separated_spheres(gap: float) -> StudyScene:
    """Return two unit spheres side by side, in 500 random orientations."""
    random = np.random.default_rng(500)
    poses_a, poses_b = random_rotations(random, 500), random_rotations(random, 500)
    poses_b[:, 0, 3] = 2.0 + gap
    return StudyScene({"sphere": shapes.sphere(1.0)}, [Track("sphere", "sphere", poses_a, poses_b)])


def concentric_spheres(gap: float) -> StudyScene:
    """Return a sphere in the middle of a unit sphere, in 60 random orientations."""
    random = np.random.default_rng(60)
    poses = random_rotations(random, 60), random_rotations(random, 60)
    meshes = {"outer": shapes.sphere(1.0), "inner": shapes.sphere(1.0 - gap)}
    return StudyScene(meshes, [Track("outer", "inner", *poses)], block=2, quick_blocks=1)


def growing_tori() -> StudyScene:
    """Return a lumpy torus that tumbles round another, both of 500, 1,000 … 512,000 triangles.

    The 1997 paper also moves models of growing resolution round a stationary one (section 3.1.1).
    Each size has its own track, and all follow the same path.
    """
    count = 512
    share = np.linspace(0.0, 1.0, count)
    poses = rotation_poses(np.array([0.36, 0.48, 0.8]), 14.0 * np.pi * share)
    away = 2.9 + 0.4 * np.cos(6.0 * np.pi * share)  # they touch below 2.41, the two outer radii
    latitude = 0.9 * np.sin(4.0 * np.pi * share)
    poses[:, 0, 3] = away * np.cos(latitude) * np.cos(2.0 * np.pi * share)
    poses[:, 1, 3] = away * np.cos(latitude) * np.sin(2.0 * np.pi * share)
    poses[:, 2, 3] = away * np.sin(latitude)
    meshes = {}
    for asked in 500 * 2 ** np.arange(11):
        minor = round(np.sqrt(asked / 2 * 30 / 54))
        mesh = shapes.lumpy_torus(round(asked / 2 / minor), minor)
        meshes[str(len(mesh[1]))] = mesh
    tracks = [Track(name, name, poses, identities(count)) for name in meshes]
    return StudyScene(meshes, tracks)


SCENES: dict[str, Callable[[], StudyScene]] = {
    "engine/piston-block": partial(engine_block, "piston", "block"),
    "engine/crankshaft-block": partial(engine_block, "crankshaft", "block"),
    "engine/piston-crankshaft": partial(engine_block, "piston", "crankshaft"),
    "engine/piston-piston": partial(engine_block, "piston", "piston"),
    "cave/random": partial(cave, coherent=False),
    "cave/path": partial(cave, coherent=True),
    "chain": chain,
    "tori": tori,
    **{f"spheres/{gap}": partial(separated_spheres, gap) for gap in (0.01, 0.1, 1.0, 10.0)},
    **{f"concentric/{gap}": partial(concentric_spheres, gap) for gap in (0.1, 0.3, 0.5, 0.7, 0.9)},
}
"""The makers of scenes by name; the word before the slash names a family."""
