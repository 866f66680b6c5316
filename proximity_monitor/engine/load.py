"""Files to models: STL, OBJ, PLY, OFF and GLB, read by trimesh; every error names the file.

trimesh takes half a second to import, so it is imported where a file is read: models made from
arrays need not pay for it.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .formats import FormatError, Plain, plain_obj, plain_off, plain_stl
from .glb import plain_glb
from .mesh import ModelError, Solid, TriangleMesh
from .ply import plain_ply

_PLAIN = {
    "stl": plain_stl, "obj": plain_obj, "ply": plain_ply, "off": plain_off, "glb": plain_glb,
}  # fmt: skip
"""What proves a file of each format complete."""

_Geometry = tuple[str, NDArray[np.float64], NDArray[np.int64]]
"""Name, vertices (n, 3) and faces (m, 3)."""


def load(
    path: str | PathLike[str], *, scale: float = 1.0, volume: str = "rss", solid: Solid = None
) -> TriangleMesh:
    """Read a model from a file: .stl, .obj, .ply, .off or .glb, binary or ASCII.

    Several geometries in one file are merged with their transforms; points and curves among them
    are left out. Degenerate triangles are kept. Polygons are cut into fans from their first corner,
    which is right for convex ones. The vertices that STL repeats for each triangle are merged where
    they are exactly equal. A file that is not complete and consistent is refused as a whole.

    Args:
        path: the file; its extension says the format.
        scale: metres in the file's unit of length, 0.001 for millimetres.
        volume: the bounding volumes, as for TriangleMesh.
        solid: whether it has an inside, as for TriangleMesh.

    Returns:
        The model in metres, named after the file without its extension.

    Raises:
        FileNotFoundError: there is no such file.
        IsADirectoryError: it is a directory.
        ModelError: another extension; an empty, truncated or damaged file; a vertex that is not
            finite, a face that names no vertex, no triangles; an unknown volume; no solid though it
            must be one. The message starts with the path.
        ValueError: a scale that is not finite and above 0.
    """
    if not 0.0 < scale < math.inf:
        raise ValueError(f"scale = {scale!r}: must be finite and above 0")
    file = Path(path)
    kind = file.suffix[1:].lower()
    data = _contents(file, kind)
    try:
        plain = _PLAIN[kind](data)
        if plain.triangles == 0:
            raise FormatError("no triangles (points and curves are not a surface)")
        vertices, faces = _read(plain)
        if kind == "stl":
            vertices, faces = _merged(vertices, faces)
    except FormatError as error:
        raise ModelError(f"{file}: {error}") from None
    except Exception as error:  # damaged bytes can make a reader fail in any way
        raise ModelError(
            f"{file}: not a readable {kind.upper()} file: {type(error).__name__}: {error}"
        ) from error
    with np.errstate(over="ignore"):  # what becomes infinite is refused next, with its index
        vertices = vertices * scale
    mesh = TriangleMesh(vertices, faces, name=str(file), volume=volume, solid=solid)
    mesh.name = file.stem
    return mesh


def _contents(file: Path, kind: str) -> bytes:
    """All bytes of a file whose extension is known."""
    try:
        file.stat()
        if file.is_dir():
            raise IsADirectoryError(f"{file}: is a directory, not a model file")
        if kind not in _PLAIN:
            raise ModelError(
                f"{file}: unknown extension {file.suffix!r}; read are "
                f"{', '.join('.' + known for known in _PLAIN)}"
            )
        data = file.read_bytes()
    except FileNotFoundError:
        raise FileNotFoundError(f"{file}: there is no such file") from None
    except (IsADirectoryError, ModelError):
        raise
    except (OSError, ValueError) as error:
        raise ModelError(f"{file}: cannot be read: {error}") from error
    if not data:
        raise ModelError(f"{file}: is empty")
    return data


def _read(plain: Plain) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and faces of a file, in its own unit."""
    vertices, faces, first = [], [], 0
    with np.errstate(all="ignore"):  # garbage is found afterwards
        for name, points, corners in (_scene if plain.kind == "glb" else _single)(plain):
            _check_range(corners, len(points), name)
            vertices.append(points)
            faces.append(corners + first)
            first += len(points)
    found = sum(map(len, faces))
    if found != plain.triangles:
        raise FormatError(f"holds {plain.triangles} triangles, of which {found} could be read")
    return _finite(np.concatenate(vertices)), np.concatenate(faces)


def _single(plain: Plain) -> Iterator[_Geometry]:
    """The one geometry of an STL or PLY file."""
    from trimesh.exchange.load import mesh_loaders

    # The loaders themselves: a trimesh.Trimesh may merge vertices and drop what is not finite.
    loaded = mesh_loaders[plain.kind](io.BytesIO(plain.data), file_type=plain.kind)
    vertices = np.asarray(loaded["vertices"], dtype=np.float64)
    yield "mesh", vertices, np.asarray(loaded["faces"], dtype=np.int64)


def _scene(plain: Plain) -> Iterator[_Geometry]:
    """The geometries of a GLB file in the frame of its scene."""
    import trimesh

    options = {"force": "scene", "process": False, "skip_materials": True}
    scene = trimesh.load(io.BytesIO(plain.data), file_type=plain.kind, **options)
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh):
            # Not by trimesh's own transformation: it leaves out motions below 1e-8.
            vertices = np.asarray(mesh.vertices) @ transform[:3, :3].T + transform[:3, 3]
            mirrored = np.linalg.det(transform[:3, :3]) < 0.0  # which turns the outside in
            yield name, vertices, np.asarray(mesh.faces)[:, :: -1 if mirrored else 1]


def _check_range(faces: NDArray[np.int64], count: int, name: str) -> None:
    """Refuse faces beyond a geometry's own vertices, before they become another geometry's."""
    bad = ((faces < 0) | (faces >= count)).any(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise FormatError(
            f"faces[{first}] = {faces[first].tolist()} of {name!r}: names no vertex; there are "
            f"{count}, numbered from 0"
        )


def _finite(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices, if all are finite; checked before merging, while they have their numbers."""
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise FormatError(
            f"vertices[{first}] = {vertices[first].tolist()}: every coordinate must be finite "
            f"({int(bad.sum())} such vertices)"
        )
    return vertices


def _merged(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Each distinct vertex once, in the order in which they first appear."""
    order = np.lexsort(vertices.T)  # stable: equal ones keep the order in which they appear
    ranked = vertices[order]
    starts = np.concatenate(([True], (ranked[1:] != ranked[:-1]).any(axis=1)))
    firsts = order[starts]
    rank = np.argsort(np.argsort(firsts))
    merged = np.empty(len(vertices), dtype=np.int64)
    merged[order] = rank[np.cumsum(starts) - 1]
    return vertices[np.sort(firsts)], merged[faces]
