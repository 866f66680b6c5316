"""Files to models, by the readers in `files`; every error names the file."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

import numpy as np

from ..models.mesh import ModelError, Solid, TriangleMesh
from .dae import read_dae
from .gltf import read_glb, read_gltf
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .stl import read_stl
from .threemf import read_3mf
from .triangles import FormatError, Triangles, check_finite

_READERS = {
    ".stl": read_stl, ".obj": read_obj, ".ply": read_ply, ".off": read_off, ".glb": read_glb,
    ".gltf": read_gltf, ".dae": read_dae, ".3mf": read_3mf,
}  # fmt: skip


def load(
    path: str | PathLike[str],
    *,
    unit: float = 1.0,
    scale: float = 1.0,
    deviation: float = 0.0,
    volume: str = "rss",
    solid: Solid = None,
) -> TriangleMesh:
    """Read a model from a file: .stl, .obj, .ply, .off, .glb, .gltf, .dae or .3mf.

    Several geometries in one file are merged with their transforms; points and curves among them
    are left out. Degenerate triangles are kept, but for those that join strips. Polygons are cut
    into fans from their first corner, which is right for convex ones. The vertices that STL repeats
    for each triangle are merged where they are exactly equal. The `up_axis` of COLLADA does not
    count, as in RViz. A file that is not complete and consistent is refused as a whole, and so is
    one whose scene is not what stands in it (animations, skins, morph targets).

    Args:
        path: the file; its extension says the format.
        unit: metres in the file's unit of length, 0.001 for millimetres, where the file does not
            state it; .dae and .3mf files do.
        scale: how much larger the model is than the file says.
        deviation: metres; how far its surface may be from that of the thing, as for TriangleMesh.
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
        ValueError: a unit or a scale that is not finite and above 0.
    """
    for key, value in (("unit", unit), ("scale", scale)):
        if not 0.0 < value < math.inf:
            raise ValueError(f"{key} = {value!r}: must be finite and above 0")
    file = Path(path)
    found = _read(file)
    with np.errstate(over="ignore"):  # what becomes infinite is refused next, with its index
        vertices = found.vertices * ((unit if found.unit is None else found.unit) * scale)
    mesh = TriangleMesh(
        vertices, found.faces, name=str(file), deviation=deviation, volume=volume, solid=solid
    )
    mesh.name = file.stem
    return mesh


def _read(file: Path) -> Triangles:
    """The content of a file, which has triangles and finite vertices."""
    kind = file.suffix.lower()
    data = _contents(file, kind)
    try:
        found = _READERS[kind](data, file.parent)
        check_finite(found.vertices)
        if not len(found.faces):
            raise FormatError("no triangles (points and curves are not a surface)")
    except FormatError as error:
        raise ModelError(f"{file}: {error}") from None
    except Exception as error:  # damaged bytes can make a reader fail in any way
        raise ModelError(
            f"{file}: not a readable {kind[1:].upper()} file: {type(error).__name__}: {error}"
        ) from error
    return found


def _contents(file: Path, kind: str) -> bytes:
    """All bytes of a file whose extension is known."""
    try:
        file.stat()
        if file.is_dir():
            raise IsADirectoryError(f"{file}: is a directory, not a model file")
        if kind not in _READERS:
            raise ModelError(
                f"{file}: unknown extension {file.suffix!r}; read are {', '.join(_READERS)}"
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
