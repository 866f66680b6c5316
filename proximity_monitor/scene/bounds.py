"""Certified bounds for pairs of bodies that have moved since they were last searched.

A search answers for the poses that it was given. When the bodies move on, that answer is still
worth something: no point of B comes nearer to A than it moved relative to A, and the two closest
points of then, carried along by their bodies, are still two points of the models. So every pair has
a certified interval at every moment, at the cost of a few array operations for all pairs together.

Everything here is an array with one row a pair: lengths in metres, poses (k, 4, 4) model to world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

#: Rounding allowance of a bound: (``ROUNDING`` eps + ``NON_RIGID`` d) * s, where eps is the
#: spacing of float64 at 1, d is how far the rotation matrices are from orthogonal (Frobenius norm
#: of R'R - I), and s adds up, for both bodies, the distance of the origin from the model's frame
#: and the reach of the model from that frame's origin. Worst case, with u = eps / 2 and both
#: moments counted: the relative pose and the image of a centre under it 32 u + 4 d, their
#: difference and norm 8 u, the rotation's difference 33 u + 5 d, replacing both matrices by exact
#: rotations 2 d, the subtractions 4 u; and measuring d is itself wrong by up to 9 u. That is 88
#: eps + 11 d: both constants are above it. The upper bound's chain (a witness point to its body's
#: frame and back to the world) is shorter. Smaller ones could certify a bound that is wrong by
#: rounding; larger ones only blur it.
ROUNDING = 128.0
NON_RIGID = 16.0

_EPS = float(np.finfo(np.float64).eps)


class Extents(NamedTuple):
    """Bounding spheres of the two models of each pair, in the models' own frames."""

    centre_a: np.ndarray
    """(k, 3) metres."""
    centre_b: np.ndarray
    radius_a: np.ndarray
    """(k,) metres; every vertex lies within the radius of the centre."""
    radius_b: np.ndarray


class Placement(NamedTuple):
    """Where the bodies of each pair are at one moment, and how exactly that can be computed."""

    pose_a: np.ndarray
    pose_b: np.ndarray
    relative: np.ndarray
    """(k, 4, 4) B's frame to A's frame."""
    size: np.ndarray
    """(k,) metres: the magnitude of the coordinates (see `ROUNDING`)."""
    defect: np.ndarray
    """(k,) how far the less orthogonal of the two rotations is from orthogonal."""


@dataclass
class Answers:
    """The last answer of each pair, kept in frames that move with the bodies."""

    lower: np.ndarray
    """(k,) metres: certified at `relative`."""
    witness_a: np.ndarray
    """(k, 3) a point of model A, in A's frame."""
    witness_b: np.ndarray
    relative: np.ndarray
    size: np.ndarray
    defect: np.ndarray


class Bounds(NamedTuple):
    """Certified intervals: ``lower <= true distance <= upper`` for each pair."""

    lower: np.ndarray
    upper: np.ndarray
    point_a: np.ndarray
    """(k, 3) world: the carried witness points; `upper` is their distance plus rounding."""
    point_b: np.ndarray
    still: np.ndarray
    """(k,) bool: the bodies did not move relative to each other by more than rounding."""


def extents(models: list[tuple]) -> Extents:
    """Return the spheres of pairs of models (anything with ``centre`` (3,) and ``radius``)."""
    return Extents(
        np.array([a.centre for a, _ in models], dtype=np.float64).reshape(-1, 3),
        np.array([b.centre for _, b in models], dtype=np.float64).reshape(-1, 3),
        np.array([a.radius for a, _ in models], dtype=np.float64),
        np.array([b.radius for _, b in models], dtype=np.float64),
    )


def unanswered(first_a: np.ndarray, first_b: np.ndarray) -> Answers:
    """Return the answers of pairs that were never searched.

    Args:
        first_a: (k, 3) any vertex of each model A, in its frame.
        first_b: (k, 3) the same for B.

    Returns:
        Answers that know nothing from below and one pair of points from above.
    """
    count = len(first_a)
    return Answers(
        lower=np.zeros(count),
        witness_a=np.array(first_a, dtype=np.float64).reshape(-1, 3),
        witness_b=np.array(first_b, dtype=np.float64).reshape(-1, 3),
        relative=np.tile(np.eye(4), (count, 1, 1)),
        size=np.zeros(count),
        defect=np.zeros(count),
    )


def place(pose_a: np.ndarray, pose_b: np.ndarray, spheres: Extents) -> Placement:
    """Return the placement of k pairs from their bodies' poses, each (k, 4, 4)."""
    rotation_a, rotation_b = pose_a[:, :3, :3], pose_b[:, :3, :3]
    to_a = rotation_a.transpose(0, 2, 1)
    relative = np.zeros_like(pose_a)
    relative[:, :3, :3] = to_a @ rotation_b
    between = pose_b[:, :3, 3] - pose_a[:, :3, 3]
    relative[:, :3, 3] = (to_a @ between[:, :, None])[:, :, 0]
    relative[:, 3, 3] = 1.0
    size = (
        _norm(pose_a[:, :3, 3])
        + _norm(pose_b[:, :3, 3])
        + _norm(spheres.centre_a)
        + _norm(spheres.centre_b)
        + spheres.radius_a
        + spheres.radius_b
    )
    defect = np.maximum(_defect(to_a @ rotation_a), _defect(_transposed_product(rotation_b)))
    return Placement(pose_a, pose_b, relative, size, defect)


def widen(answers: Answers, now: Placement, spheres: Extents) -> Bounds:
    """Return bounds for the bodies' present placement from the answers of another one.

    A point of B at y in B's frame moves relative to A by at most ``|T1 c - T0 c| + 2 sin(angle /
    2) |y - c|``, where T0 and T1 are the relative poses, c is B's centre and the angle is that of
    the rotation between them. ``2 sin(angle / 2)`` is the Frobenius norm of R1 - R0 over sqrt 2,
    which unlike an arc cosine loses no digits for small angles. The same holds with A and B
    exchanged; the smaller of the two counts. The bounding spheres give a second lower bound that
    does not need an earlier answer.
    """
    slack = _slack(np.maximum(now.size, answers.size), np.maximum(now.defect, answers.defect))
    before, after = answers.relative, now.relative
    turn = np.sqrt(((after[:, :3, :3] - before[:, :3, :3]) ** 2).sum(axis=(1, 2)) / 2.0)
    move_b = _norm(_apply(after, spheres.centre_b) - _apply(before, spheres.centre_b))
    move_a = _norm(
        _apply_inverse(after, spheres.centre_a) - _apply_inverse(before, spheres.centre_a)
    )
    moved = np.minimum(move_b + turn * spheres.radius_b, move_a + turn * spheres.radius_a)

    between = _apply(now.pose_b, spheres.centre_b) - _apply(now.pose_a, spheres.centre_a)
    apart = _norm(between) - spheres.radius_a - spheres.radius_b
    lower = np.fmax(answers.lower - moved, apart) - slack
    point_a = _apply(now.pose_a, answers.witness_a)
    point_b = _apply(now.pose_b, answers.witness_b)
    upper = _norm(point_b - point_a) + slack
    # Coordinates too large to be squared give inf or NaN: then nothing is known.
    return Bounds(
        lower=np.where(np.isfinite(lower), np.maximum(lower, 0.0), 0.0),
        upper=np.fmin(upper, np.inf),
        point_a=point_a,
        point_b=point_b,
        still=moved <= slack,
    )


def carry_back(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return a world point (3,) in the frame of the body at `pose` (4, 4)."""
    return pose[:3, :3].T @ (point - pose[:3, 3])


def _slack(size: np.ndarray, defect: np.ndarray) -> np.ndarray:
    return (ROUNDING * _EPS + NON_RIGID * defect) * size


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(axis=1))


def _apply(poses: np.ndarray, points: np.ndarray) -> np.ndarray:
    return (poses[:, :3, :3] @ points[:, :, None])[:, :, 0] + poses[:, :3, 3]


def _apply_inverse(poses: np.ndarray, points: np.ndarray) -> np.ndarray:
    back = poses[:, :3, :3].transpose(0, 2, 1)
    return (back @ (points - poses[:, :3, 3])[:, :, None])[:, :, 0]


def _transposed_product(rotations: np.ndarray) -> np.ndarray:
    return rotations.transpose(0, 2, 1) @ rotations


def _defect(grams: np.ndarray) -> np.ndarray:
    return np.sqrt(((grams - np.eye(3)) ** 2).sum(axis=(1, 2)))
