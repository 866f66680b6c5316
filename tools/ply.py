"""Write the meshes of bundled scenes as binary PLY files, the same ones on every machine."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike

_TYPES = {"float": "<f4", "double": "<f8", "ushort": "<u2", "int": "<i4"}


def write(
    path: str | os.PathLike[str],
    vertices: ArrayLike,
    faces: ArrayLike,
    comment: str,
    *,
    real: str = "double",
    index: str = "int",
) -> None:
    """Write vertices (n, 3) and triangles (m, 3) with shared vertices, little-endian.

    Args:
        path: the file.
        vertices: in the unit that the comment names.
        faces: indices of vertices.
        comment: one line of ASCII.
        real: PLY type of coordinates: `double`, or `float` if its rounding does not matter.
        index: PLY type of indices: `int`, or `ushort` for up to 65,536 vertices.
    """
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    records = np.empty(len(faces), dtype=[("n", "u1"), ("v", _TYPES[index], 3)])
    records["n"], records["v"] = 3, faces
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment {comment}\n"
        f"element vertex {len(vertices)}\n"
        f"property {real} x\nproperty {real} y\nproperty {real} z\n"
        f"element face {len(faces)}\nproperty list uchar {index} vertex_indices\nend_header\n"
    )
    with open(path, "wb") as file:
        file.write(header.encode("ascii"))
        file.write(vertices.astype(_TYPES[real]).tobytes())
        file.write(records.tobytes())
