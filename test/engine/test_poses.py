"""Poses: which matrices are rigid motions, and what the error says about each other matrix."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, sphere

from proximity_monitor import engine
from proximity_monitor.engine.poses import check_pose

A, B = box(), sphere(1)


def changed(row, column, value):
    matrix = pose(np.random.default_rng(1), 1.0)
    matrix[row, column] = value
    return matrix


def scaled(factor):
    return np.diag([factor, factor, factor, 1.0])


def sheared(share):
    matrix = np.eye(4)
    matrix[0, 1] = share
    return matrix


def turned(factor):
    matrix = pose(np.random.default_rng(2))
    matrix[:3, :3] *= factor
    return matrix


BAD = {
    "nan in the rotation": (changed(1, 2, math.nan), r"pose_a\[1, 2\] = nan: must be finite"),
    "nan in the translation": (changed(2, 3, math.nan), r"pose_a\[2, 3\] = nan: must be finite"),
    "infinite translation": (changed(0, 3, -math.inf), r"pose_a\[0, 3\] = -inf: must be finite"),
    "infinite rotation": (changed(2, 0, math.inf), r"pose_a\[2, 0\] = inf: must be finite"),
    "nan in the last row": (changed(3, 1, math.nan), r"pose_a\[3, 1\] = nan: must be finite"),
    "transposed": (changed(0, 3, 5.0).T, r"last row .*transposed"),
    "last row": (changed(3, 3, 2.0), "last row"),
    "beyond any world": (changed(0, 3, 1.1e45), r"translation .* beyond 1e\+45 m"),
    "doubled": (scaled(2.0), "not a rigid motion: .*changes lengths by 1.5"),
    "a little larger": (scaled(1.00001), "not a rigid motion: .*changes lengths by 1e-05"),
    "huge": (scaled(1e200), "not a rigid motion: .*changes lengths"),
    "huge and turned": (turned(1e200), "not a rigid motion: .*changes lengths"),
    "sheared": (sheared(0.001), "not a rigid motion: .*changes lengths"),
    "flat": (np.diag([1.0, 1.0, 0.0, 1.0]), "not a rigid motion: .*changes lengths"),
    "zero": (np.zeros((4, 4)), "last row"),
    "zero rotation": (scaled(0.0), "not a rigid motion"),
    "mirrored": (np.diag([1.0, 1.0, -1.0, 1.0]), "not a rigid motion: .*mirrors"),
    "3x3": (np.eye(3), r"shape \(3, 3\), expected a \(4, 4\)"),
    "3x4": (np.eye(4)[:3], r"shape \(3, 4\), expected a \(4, 4\)"),
    "many": (np.eye(4)[None], r"shape \(1, 4, 4\), expected a \(4, 4\)"),
    "a position": ([0.0, 0.0, 0.0], r"shape \(3,\), expected a \(4, 4\)"),
    "words": ([["a"] * 4] * 4, "not a matrix of numbers"),
    "ragged": ([[1.0, 0.0], [0.0]], "not a matrix of numbers"),
    "nothing": (None, "pose_a"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", BAD)
def test_what_is_no_rigid_motion_is_told_why(kind):
    matrix, message = BAD[kind]
    with pytest.raises(ValueError, match=message) as caught:
        check_pose(matrix, "pose_a")
    assert str(caught.value).startswith("pose_a")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", BAD)
def test_every_question_refuses_it(kind):
    matrix, message = BAD[kind]
    with pytest.raises(ValueError, match=message):
        engine.distance(A, matrix, B, IDENTITY)
    with pytest.raises(ValueError, match=message.replace("pose_a", "pose_b")):
        engine.distance(A, IDENTITY, B, matrix)
    with pytest.raises(ValueError, match=message):
        engine.distance(A, matrix, B, IDENTITY, budget_s=0.0)


@pytest.mark.parametrize(
    "kind", [kind for kind in BAD if getattr(BAD[kind][0], "shape", 0) == (4, 4)]
)
def test_many_poses_name_the_one_that_is_bad(kind):
    matrix, message = BAD[kind]
    poses = np.tile(np.eye(4), (300, 1, 1))
    poses[270] = matrix
    message = message.replace("pose_a", r"poses_a\[270\]")
    with pytest.raises(ValueError, match=message) as caught:
        engine.distances(A, poses, B, np.tile(np.eye(4), (300, 1, 1)))
    assert str(caught.value).startswith("poses_a[270]")
    with pytest.raises(ValueError, match=r"poses_b\[270\]"):
        engine.distances(A, np.tile(np.eye(4), (300, 1, 1)), B, poses)


def test_a_rigid_motion_comes_back_as_it_is():
    rng = np.random.default_rng(2)
    for _ in range(100):
        matrix = pose(rng, 100.0)
        assert check_pose(matrix) is matrix
        assert check_pose(matrix.tolist()).tolist() == matrix.tolist()


def test_every_coordinate_may_be_as_large_as_is_promised():
    """The points are at opposite corners of the allowed space, 4e45 m apart in each direction."""
    far = np.full(3, 1e45)
    here, there = np.eye(4), np.eye(4)
    here[:3, 3], there[:3, 3] = -far, far
    point, corner = engine.points([-far]), engine.points([far])
    unit = box((1.0, 1.0, 1.0))
    half, whole = (engine.TriangleMesh(k * far * unit.vertices, unit.faces) for k in (1, 2))
    for found, each in (
        (engine.distance(point, here, corner, there), 4),
        (engine.distance(point, here, whole, there), 2),
        (engine.signed_distance(half, here, half, there), 1),
    ):
        square = 3 * (each * Fraction(1e45)) ** 2
        assert Fraction(found.lower) ** 2 <= square <= Fraction(found.upper) ** 2
        assert found.upper - found.lower <= 1e-13 * found.upper


@pytest.mark.parametrize("digits", [6, 7, 9, 12])
def test_rotations_of_six_digits_are_accepted(digits):
    rng = np.random.default_rng(digits)
    for _ in range(300):
        matrix = np.round(pose(rng, 10.0), digits)
        assert np.array_equal(check_pose(matrix), matrix)


def test_rotations_of_float32_are_accepted():
    rng = np.random.default_rng(3)
    for _ in range(300):
        checked = check_pose(pose(rng, 10.0).astype(np.float32))
        assert checked.dtype == np.float64


def test_rotations_of_four_digits_are_not():
    rng = np.random.default_rng(4)
    refused = 0
    for _ in range(100):
        try:
            check_pose(np.round(pose(rng), 4))
        except ValueError:
            refused += 1
    assert refused > 90


@pytest.mark.parametrize("share", [0.5e-6, 0.99e-6])
def test_the_tolerance_is_a_millionth(share):
    check_pose(scaled(1.0 + share))
    check_pose(scaled(1.0 - share))
    with pytest.raises(ValueError, match="not a rigid motion"):
        check_pose(scaled(1.0 + 3.0 * share + 1e-6))


@pytest.mark.parametrize("layout", [np.asfortranarray, np.ascontiguousarray, list])
def test_layouts_of_a_pose(layout):
    matrix = pose(np.random.default_rng(5), 3.0)
    expected = engine.distance(A, matrix, B, IDENTITY)
    assert engine.distance(A, layout(matrix), B, IDENTITY).upper == expected.upper
    strided = np.zeros((8, 8))
    strided[::2, ::2] = matrix
    assert engine.distance(A, strided[::2, ::2], B, IDENTITY).upper == expected.upper


def test_distances_refuses_other_shapes():
    poses = np.tile(np.eye(4), (3, 1, 1))
    with pytest.raises(ValueError, match=r"poses_a: shape \(4, 4\), expected \(k, 4, 4\)"):
        engine.distances(A, np.eye(4), B, poses)
    with pytest.raises(ValueError, match=r"poses_b: shape \(3, 4\)"):
        engine.distances(A, poses, B, np.zeros((3, 4)))
    with pytest.raises(ValueError, match="poses_a has 3 poses, but poses_b has 2"):
        engine.distances(A, poses, B, poses[:2])
