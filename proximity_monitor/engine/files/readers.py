"""The registry of readers by file extension, of this package and of other packages.

A reader takes a file's bytes, its path and a `Reading`, and returns a `Model`. Whatever it raises
becomes a ModelError that names the file. Other packages register readers as entry points of GROUP.
An entry point is named after the extension without its dot:
``ball = "round_things.files:read_ball"``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..models.hierarchy import Solid
from ..models.mesh import TriangleMesh
from ..models.model import Model
from .dae import read_dae
from .geomdl import read_geomdl
from .gltf import read_glb, read_gltf
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .step import read_step
from .stl import read_stl
from .threemf import read_3mf
from .triangles import FormatError, Triangles, check_finite

GROUP = "proximity_monitor.models"
"""The entry-point group of readers."""


class Reading(NamedTuple):
    """The options for reading a file; see `load`."""

    unit: float
    """Metres per unit of length of the file, if the file does not state its unit."""
    scale: float
    deviation: float
    volume: str
    solid: Solid
    part: str | None = None
    """The name of one part of an assembly; None: everything in the file."""


Reader = Callable[[bytes, Path, Reading], Model]


def mesh_reader(read: Callable[[bytes, Path], Triangles]) -> Reader:
    """Return the reader of a triangle format, from a function of a file's bytes and folder."""

    def reader(data: bytes, file: Path, how: Reading) -> Model:
        found = read(data, file.parent)
        check_finite(found.vertices)
        if not len(found.faces):
            raise FormatError("no triangles (points and curves are not a surface)")
        metres = how.unit if found.unit is None else found.unit
        with np.errstate(over="ignore"):  # the model refuses infinite values, with their index
            vertices = found.vertices * (metres * how.scale)
        return TriangleMesh(
            vertices, found.faces, name=str(file), deviation=how.deviation, volume=how.volume,
            solid=how.solid,
        )  # fmt: skip

    return reader


_TRIANGLES = {
    ".stl": read_stl, ".obj": read_obj, ".ply": read_ply, ".off": read_off, ".glb": read_glb,
    ".gltf": read_gltf, ".dae": read_dae, ".3mf": read_3mf,
}  # fmt: skip
_OWN = {suffix: mesh_reader(read) for suffix, read in _TRIANGLES.items()}
_OWN |= {".json": read_geomdl, ".step": read_step, ".stp": read_step}
ASSEMBLIES = {".step", ".stp"}
"""Extensions of files whose parts can be loaded one by one."""
_READERS: dict[str, Reader] = dict(_OWN)


def reader_of(suffix: str) -> Reader | None:
    """Return the reader for an extension such as ".stl", in lower case; None if there is none.

    Raises:
        FormatError: another package's reader cannot be imported, or several packages have one.
    """
    if suffix in _READERS:
        return _READERS[suffix]
    found = metadata.entry_points(group=GROUP, name=suffix.removeprefix("."))
    if len({entry.value for entry in found}) > 1:
        several = ", ".join(_origin(each) for each in found)
        raise FormatError(f"several installed packages read this extension: {several}")
    for entry in found:
        try:
            _READERS[suffix] = entry.load()
        except Exception as error:
            raise FormatError(
                f"its reader {_origin(entry)} cannot be loaded: {type(error).__name__}: {error}"
            ) from error
    return _READERS.get(suffix)


def extensions() -> list[str]:
    """Return the extensions that have a reader, such as ".stl"."""
    others = {f".{name}" for name in metadata.entry_points(group=GROUP).names}
    return [*_OWN, *sorted(others - _OWN.keys())]


def _origin(entry: metadata.EntryPoint) -> str:
    package = "" if entry.dist is None else f" of {entry.dist.name}"
    return f"{entry.value}{package}"
