"""The falling tori of the 1999 paper, if their data is available."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .scenes import StudyScene, Track, identities
from .shapes import Mesh

VARIABLE = "PROXIMITY_MONITOR_DATA"
"""The environment variable that names the folder of recorded data."""


class RecordedDataError(ValueError):
    """Recorded data that cannot be read."""


def find_falling_tori(data: Path | None, usual: Path) -> Path | None:
    """Return the folder `falling_tori`, or None if it is missing and was not asked for.

    Args:
        data: the folder that holds it; None: the one that VARIABLE names, else `usual`.
        usual: where the folder may lie, but need not.

    Raises:
        FileNotFoundError: `data`, or the folder that VARIABLE names, holds no `falling_tori`.
    """
    given = data or os.environ.get(VARIABLE)
    folder = Path(given or usual) / "falling_tori"
    if folder.is_dir():
        return folder
    if given:
        raise FileNotFoundError(f"{given}: has no folder 'falling_tori'")
    return None


def falling_tori(folder: Path) -> StudyScene:
    """Return the scene in that folder: 2,398 steps along the recorded path.

    Raises:
        RecordedDataError: a file is missing or damaged; the message names it.
    """
    meshes, poses = {}, {}
    for name in ("torus1", "torus2"):
        meshes[name] = _welded(_triples(folder / f"{name}.tris", 3))
        rows = _triples(folder / f"{name}.path", 4)
        poses[name] = identities(len(rows))
        poses[name][:, :3, :3] = _orthonormal(rows[:, :3])
        poses[name][:, :3, 3] = rows[:, 3]
    track = Track("torus1", "torus2", poses["torus1"], poses["torus2"])
    return StudyScene(meshes, [track], quick_blocks=8)


def _triples(file: Path, many: int) -> NDArray[np.float64]:
    """Return the rows (k, many, 3) of a file that begins with their number."""
    try:
        return np.array(file.read_text().split()[1:], float).reshape(-1, many, 3)
    except (OSError, ValueError) as error:
        raise RecordedDataError(f"{file}: cannot be read as rows of numbers: {error}") from error


def _welded(corners: NDArray[np.float64]) -> Mesh:
    """Merge equal corners into one vertex, as in every other scene."""
    vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, faces.reshape(-1, 3).astype(np.int32)


def _orthonormal(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations nearest to matrices (k, 3, 3) that were written with six digits."""
    u, _, v = np.linalg.svd(matrices)
    return u @ v
