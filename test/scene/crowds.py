"""A crowd of small bodies that wander about, and the exact distances of its pairs."""

import itertools

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PoseSample

SHAPES = (
    "sphere: {radius: 0.3, subdivisions: 1}",
    "cylinder: {radius: 0.12, height: 0.9, segments: 9}",
    "box: {size: [0.5, 0.3, 0.2]}",
)


def text(count, head="", body="", pairs="all"):
    """A scene file of `count` moving bodies b0, b1, ...; each has the keys `body`."""
    lines = [
        f"  - {{name: b{i}, primitive: {{{SHAPES[i % len(SHAPES)]}}}, moving: true{body}}}"
        for i in range(count)
    ]
    return "\n".join(("version: 1", "unit: m", head, "bodies:", *lines, f"pairs: {pairs}", ""))


def meshes_of(scene):
    """Return the bodies as plain meshes, so that distances are those of the triangles."""
    return {
        name: engine.TriangleMesh(model.vertices, model.faces, name=name, solid=model.solid)
        for name, model in load_models(scene).items()
    }


def walk(count, steps, seed=0, spread=2.0, step=0.05):
    """Yield the poses by name for each step of smooth random walks; some bodies overlap."""
    random = np.random.default_rng(seed)
    rate, phase = random.uniform(0.3, 2.0, (count, 7)), random.uniform(0.0, 6.0, (count, 7))
    for k in range(steps):
        wave = np.sin(rate * k * step + phase)
        yield {f"b{i}": placed(spread * wave[i, :3], wave[i, 3:]) for i in range(count)}


def placed(position, quaternion):
    x, y, z, w = np.asarray(quaternion) / np.linalg.norm(quaternion)
    made = np.eye(4)
    made[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    made[:3, 3] = position
    return made


def samples(poses, stale=()):
    return {name: PoseSample(pose, name in stale) for name, pose in poses.items()}


def exact(models, poses, ask=engine.signed_distance):
    """Return the engine's answer for every pair of bodies, one by one."""
    return {
        (a, b): ask(models[a], poses[a], models[b], poses[b])
        for a, b in itertools.combinations(models, 2)
    }


def assert_certified(tick, true):
    """Check that each listed pair's bounds hold its exact distance; return the listed pairs."""
    for pair in tick.pairs:
        at = true[pair.a, pair.b]
        assert pair.lower <= at.upper, (pair, at)
        assert at.lower <= pair.upper, (pair, at)
    return {(pair.a, pair.b) for pair in tick.pairs}
