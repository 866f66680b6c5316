"""Reads the triangles of COLLADA files (.dae), in which many robots' visual meshes come.

`pycollada` parses them, an extra that a scene without such files can do without.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.paths import WITH_ROBOTS


def read_collada(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of a file's scene, placed by its nodes.

    The file's unit counts. Its `up_axis` does not, as in RViz and Gazebo: robot descriptions are
    written for these.

    Returns:
        (n, 3) vertices in metres and (m, 3) faces.

    Raises:
        engine.ModelError: pycollada is not installed; the file is damaged or holds no triangles.
    """
    try:
        import collada
    except ImportError:
        raise engine.ModelError(
            f"{path}: reading COLLADA needs pycollada; install it, {WITH_ROBOTS} "
            "(or let the robot have 'meshes: collision')"
        ) from None
    vertices, faces, first = [], [], 0
    try:
        # What a material or an effect refers to does not matter here, and is often missing.
        broken = [collada.common.DaeUnsupportedError, collada.common.DaeBrokenRefError]
        document = collada.Collada(str(path), ignore=broken)
        for geometry in document.scene.objects("geometry") if document.scene else ():
            for part in geometry.primitives():
                if hasattr(part, "triangleset"):  # polygons
                    part = part.triangleset()
                if not isinstance(part, collada.triangleset.BoundTriangleSet) or not len(part):
                    continue  # lines
                vertices.append(part.vertex)
                faces.append(part.vertex_index + first)
                first += len(part.vertex)
        metres = float(document.assetInfo.unitmeter or 1.0)
    except Exception as error:  # damaged bytes can make a reader fail in any way
        raise engine.ModelError(
            f"{path}: not a readable COLLADA file: {type(error).__name__}: {error}"
        ) from error
    if not faces:
        raise engine.ModelError(f"{path}: no triangles (points and curves are not a surface)")
    return metres * np.concatenate(vertices).astype(np.float64), np.concatenate(faces)
