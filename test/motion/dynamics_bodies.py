"""Shapes and worlds of the dynamics tests."""

from itertools import combinations

import numpy as np

from proximity_monitor.engine import TriangleMesh, distance
from proximity_monitor.motion.dynamics import ContactLaw, Forces, RigidBody, World

G = 9.81
DOWN = np.array([0.0, 0.0, -G])
STEP_S = 0.0025
IMPULSE = ContactLaw("impulse", 2e-4)


def box_arrays(x, y, z):
    """Vertices and outward faces of a box around the origin."""
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return 0.5 * corners * (x, y, z), np.array(faces)


def box(x, y, z):
    return TriangleMesh(*box_arrays(x, y, z), name="box")


def ball(radius, bands=12):
    """Return a closed mesh of meridians and parallels, with its vertices on the sphere."""
    polar = np.linspace(0.0, np.pi, bands + 1)[1:-1]
    around = 2 * bands
    azimuth = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rings = [
        (np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)) for p in polar for a in azimuth
    ]
    vertices = radius * np.array([(0.0, 0.0, 1.0), *rings, (0.0, 0.0, -1.0)])
    faces = []
    for j in range(around):
        k = (j + 1) % around
        faces.append((0, 1 + j, 1 + k))
        for i in range(bands - 2):
            a, b = 1 + i * around, 1 + (i + 1) * around
            faces += [(a + j, b + j, b + k), (a + j, b + k, a + k)]
        last = 1 + (bands - 2) * around
        faces.append((last + j, len(vertices) - 1, last + k))
    return TriangleMesh(vertices, faces, name="ball")


def at(position, axis=(0.0, 0.0, 1.0), angle=0.0):
    """A pose: turned about an axis, then moved."""
    x, y, z = np.array(axis, dtype=float) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    pose[:3, 3] = position
    return pose


def moving(mesh, pose, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), name="body"):
    return RigidBody(name, mesh, pose, 1000.0, np.array(velocity), np.array(spin))


def floor():
    """A plate whose upper side is z = 0."""
    return RigidBody("floor", box(4.0, 4.0, 0.2), at((0.0, 0.0, -0.1)))


def on_floor(bodies, step_s=STEP_S, **forces):
    return World(
        [*bodies, floor()], Forces(**{"gravity": DOWN, "contacts": IMPULSE} | forces), step_s
    )


def nearest(world):
    """Return the least distance of two bodies, at least one of them moving, by their whole models.

    Check that the world's own lower bound is not above it.
    """
    poses = world.poses()
    least = min(
        distance(a.model, poses[i], b.model, poses[j]).upper
        for (i, a), (j, b) in combinations(enumerate(world.bodies), 2)
        if a.density is not None or b.density is not None
    )
    assert world.clearance() <= least
    return least


def run(world, seconds):
    """Run the world; return the energies and the least distance over all steps."""
    energies, least = [world.energy()], nearest(world)
    for _ in range(round(seconds / world.step_s)):
        world.step()
        energies.append(world.energy())
        least = min(least, nearest(world))
    return np.array(energies), least
