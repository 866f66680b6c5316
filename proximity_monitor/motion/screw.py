"""Paths of constant twist: between two keys, a body makes one screw motion at constant speed.

From pose A the body moves as ``A exp(s xi)``, 0 <= s <= 1, with the twist xi = (theta k, u) in the
body frame: it turns by ``s theta`` about the unit vector k, and its origin starts with the velocity
u. Let h = s theta / 2, and split u into its part `along` k and its part `across`:

    rotation     I + sin(2 h) [k] + 2 sin(h)^2 [k]^2                  (Rodrigues)
    translation  s (along + sinc(h) (cos(h) across + sin(h) k x across))

These are the closed forms of the exponential of SE(3): the chord of an arc is sinc(h) times as long
as the arc, and its direction is turned by half of the arc's angle. For small theta, nothing in them
cancels or is divided by a small number. At s = 0 they are exactly the identity.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proximity_monitor.scene.poses import pose_matrices, rotations


@dataclass(frozen=True, eq=False)
class Path:
    """The path of one body: n keys, and the twists from each to the next."""

    times: np.ndarray
    """(n,) seconds, increasing."""
    poses: np.ndarray
    """(n, 4, 4) model to world at the keys, metres."""
    axes: np.ndarray
    """(n - 1, 3) k: unit vectors in the body's frame, or 0 for no rotation."""
    angles: np.ndarray
    """(n - 1,) theta: radians, of any size and sign."""
    velocities: np.ndarray
    """(n - 1, 3) u: metres for the whole piece, in the body's frame."""


def through(times: np.ndarray, positions: np.ndarray, quaternions: np.ndarray) -> Path:
    """Return the path through key poses that turns the shorter way between them.

    If two orientations are half a turn apart, both ways are equally long. The path then takes the
    right-handed turn about the axis of the relative quaternion.

    Args:
        times: (n,) seconds, increasing.
        positions: (n, 3) metres.
        quaternions: (n, 4) x, y, z, w of length 1, to rounding.
    """
    poses = pose_matrices(positions, quaternions)
    axes, angles = _turns(quaternions[:-1], quaternions[1:])
    ways = np.einsum("nji,nj->ni", poses[:-1, :3, :3], positions[1:] - positions[:-1])
    along = _dot(axes, ways) * axes
    across = ways - along
    # The module's formula for s = 1, solved for u; sinc(h) >= 2 / pi because theta <= pi.
    h = 0.5 * angles[:, None]
    back = (np.cos(h) * across - np.sin(h) * np.cross(axes, across)) / _sinc(h)
    return Path(times, poses, axes, angles, along + back)


def hinged(
    times: np.ndarray, angles: np.ndarray, origin: np.ndarray, axis: np.ndarray, pose: np.ndarray
) -> Path:
    """Return the path of a body on a hinge.

    Args:
        times: (n,) seconds, increasing.
        angles: (n,) radians at these times, right-handed about the axis, of any size.
        origin: (3,) a point on the axis in the world, metres.
        axis: (3,) the axis direction in the world, a unit vector.
        pose: (4, 4) of the body at angle 0.
    """
    turned = rotations(axis, angles)
    poses = np.tile(np.eye(4), (len(angles), 1, 1))
    poses[:, :3, :3] = turned @ pose[:3, :3]
    poses[:, :3, 3] = origin + turned @ (pose[:3, 3] - origin)
    own = pose[:3, :3].T @ axis
    own /= np.linalg.norm(own)
    arm = pose[:3, :3].T @ (pose[:3, 3] - origin)
    steps = np.diff(angles)
    velocities = steps[:, None] * np.cross(own, arm)
    return Path(times, poses, np.tile(own, (len(steps), 1)), steps, velocities)


def sliding(times: np.ndarray, offsets: np.ndarray, axis: np.ndarray, pose: np.ndarray) -> Path:
    """Return the path of a body on a slide.

    Args:
        times: (n,) seconds, increasing.
        offsets: (n,) metres along the axis at these times.
        axis: (3,) direction in the world, a unit vector.
        pose: (4, 4) of the body at offset 0.
    """
    poses = np.tile(pose, (len(offsets), 1, 1))
    poses[:, :3, 3] += offsets[:, None] * axis
    steps = np.diff(offsets)
    velocities = steps[:, None] * (pose[:3, :3].T @ axis)
    return Path(times, poses, np.zeros((len(steps), 3)), np.zeros(len(steps)), velocities)


class Paths:
    """Several paths, evaluated together, so that a hundred bodies cost little more than one."""

    def __init__(self, paths: Sequence[Path]) -> None:
        """Concatenate the paths' pieces, and end each path with a piece at rest of any length."""
        self._times = [path.times.tolist() for path in paths]
        self._firsts = np.cumsum([0, *map(len, self._times)])[:-1]
        self._begins = _stacked([path.times for path in paths])
        self._spans = _stacked([np.append(np.diff(path.times), np.inf) for path in paths])
        self._poses = _stacked([path.poses for path in paths], 4, 4)
        self._angles = _stacked([np.append(path.angles, 0.0) for path in paths])
        rest = np.zeros((1, 3))
        self._axes = _stacked([each for path in paths for each in (path.axes, rest)], 3)
        velocities = _stacked([each for path in paths for each in (path.velocities, rest)], 3)
        self._along = _dot(self._axes, velocities) * self._axes
        self._across = velocities - self._along
        self._aside = np.cross(self._axes, self._across)

    def at(self, t: float) -> np.ndarray:
        """Return the pose of each body at t seconds, (n, 4, 4), model to world in metres.

        A body rests at its first key before that key's time, and at its last key after it.
        """
        pieces = [max(bisect_right(times, t) - 1, 0) for times in self._times]
        i = self._firsts + np.array(pieces, dtype=np.intp)
        s = np.minimum(np.maximum((t - self._begins[i]) / self._spans[i], 0.0), 1.0)
        angles = s * self._angles[i]
        h = 0.5 * angles[:, None]
        chords = _sinc(h) * (np.cos(h) * self._across[i] + np.sin(h) * self._aside[i])
        steps = s[:, None] * (self._along[i] + chords)
        poses = self._poses[i]
        turned = poses[:, :3, :3]
        poses[:, :3, 3] += (turned @ steps[:, :, None])[:, :, 0]
        poses[:, :3, :3] = turned @ rotations(self._axes[i], angles)
        return poses


def _turns(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return axes (n, 3) and angles (n,), 0 to pi, of the rotations from `before` to `after`.

    They are those of the quaternions conj(before) * after, in the frame of `before`.
    """
    v, w = -before[:, :3], before[:, 3:]
    to, tw = after[:, :3], after[:, 3:]
    vectors = w * to + tw * v + np.cross(v, to)
    scalars = w[:, 0] * tw[:, 0] - (v * to).sum(axis=1)
    vectors = np.where(scalars[:, None] < 0.0, -vectors, vectors)
    # Divide by the largest component first: the square of a tiny component would underflow to 0.
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    axes = vectors / np.where(largest > 0.0, largest, 1.0)[:, None]
    lengths = np.linalg.norm(axes, axis=1)
    axes /= np.where(lengths > 0.0, lengths, 1.0)[:, None]
    return axes, 2.0 * np.arctan2(largest * lengths, np.abs(scalars))


def _stacked(parts: Sequence[np.ndarray], *shape: int) -> np.ndarray:
    """Return the rows of all parts, which have the given shape; no rows if there are no parts."""
    return np.concatenate([np.empty((0, *shape)), *parts])


def _sinc(x: np.ndarray) -> np.ndarray:
    return np.divide(np.sin(x), x, out=np.ones_like(x), where=x != 0.0)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=1, keepdims=True)
