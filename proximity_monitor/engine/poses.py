"""Poses: 4×4 matrices that map a model into the world."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arguments import as_reals
from .kernels.base.motion import pose_deviation
from .kernels.base.rounding import LARGEST_COORDINATE, RIGID_TOLERANCE

_FLOAT64 = np.dtype(np.float64)
_SHAPE = (4, 4)
_Array = np.ndarray


def as_pose(pose: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return the pose as the kernels take it, (4, 4) float64 and C-contiguous.

    Only the shape and the dtype are checked, not that it is a rigid motion.

    Raises:
        ValueError: the elements are no real numbers, or the shape is another one.
    """
    if (
        type(pose) is _Array
        and pose.dtype is _FLOAT64
        and pose.shape == _SHAPE
        and pose.flags.carray
    ):
        return pose
    array = as_reals(pose, name, "a matrix of numbers")
    if array.shape != _SHAPE:
        raise ValueError(f"{name}: shape {array.shape}, expected a (4, 4) homogeneous matrix")
    return array


def check_pose(pose: ArrayLike, name: str = "pose") -> NDArray[np.float64]:
    """Return the pose as a (4, 4) float64 array after checking that it is a rigid motion.

    Args:
        pose: 4×4 homogeneous matrix, model to world; translation in metres.
        name: what errors call it.

    Raises:
        ValueError: the shape is another one; an element is not finite; the last row is not
            (0, 0, 0, 1), to 2e-6; the translation is beyond 1e45 m; the rotation changes lengths by
            more than a share of 1e-6, or mirrors. The message says which.
    """
    array = as_pose(pose, name)
    if pose_deviation(array) <= 2.0 * RIGID_TOLERANCE:
        return array
    if not np.isfinite(array).all():
        row, column = np.argwhere(~np.isfinite(array))[0].tolist()
        raise ValueError(f"{name}[{row}, {column}] = {array[row, column]}: must be finite")
    if np.abs(array[3] - (0.0, 0.0, 0.0, 1.0)).max() > 2.0 * RIGID_TOLERANCE:
        raise ValueError(
            f"{name}: last row {array[3].tolist()}, expected [0, 0, 0, 1] (is it transposed?)"
        )
    if np.abs(array[:3, 3]).max() > LARGEST_COORDINATE:
        raise ValueError(
            f"{name}: translation {array[:3, 3].tolist()} m is beyond {LARGEST_COORDINATE:g} m"
        )
    rotation = array[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.abs(rotation.T @ rotation - np.eye(3)).max()) / 2.0
    if not error <= RIGID_TOLERANCE:
        raise ValueError(
            f"{name}: not a rigid motion: its rotation changes lengths by {error:.3g} "
            f"(up to {RIGID_TOLERANCE:g} is allowed); scale the model, not the pose"
        )
    raise ValueError(f"{name}: not a rigid motion: its rotation mirrors (determinant below 0)")


def as_poses(poses: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return poses as the kernels take them, (k, 4, 4) float64 and C-contiguous.

    Only the shape and the dtype are checked, not that they are rigid motions.

    Raises:
        ValueError: the elements are no real numbers, or the shape is another one.
    """
    if type(poses) is np.ndarray and poses.dtype is _FLOAT64 and poses.flags.carray:
        array = poses
    else:
        array = as_reals(poses, name)
    if array.ndim != 3 or array.shape[1:] != (4, 4):
        raise ValueError(f"{name}: shape {array.shape}, expected (k, 4, 4)")
    return array
