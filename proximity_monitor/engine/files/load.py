"""Load models from files with the readers in `files`; every error names the file."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

from ..models.checks import ModelError
from ..models.hierarchy import Solid
from ..models.model import Model
from .readers import ASSEMBLIES, Reader, Reading, extensions, reader_of
from .step import Placement, step_placements
from .triangles import FormatError


def load(
    path: str | PathLike[str],
    *,
    unit: float = 1.0,
    scale: float = 1.0,
    deviation: float = 0.0,
    volume: str = "rss",
    solid: Solid = None,
    part: str | None = None,
) -> Model:
    """Read a model: .stl, .obj, .ply, .off, .glb, .gltf, .dae, .3mf, .json, .step or .stp.

    Other packages may register readers for other extensions (see `files.readers`).

    A .json file is geomdl JSON (NURBS-Python): it holds a `Patch`, a `Curve`, several of them as a
    `ParametricSurface`, or a `SolidOfRevolution` (see docs/models.md). A STEP file holds surfaces.
    All other formats hold triangles. Several geometries in one of those files are placed by their
    transforms and merged; points and curves are skipped. Degenerate triangles are kept, except
    those that join strips. A polygon is cut into a fan from its first corner. If the fan would
    fold, as seen along the polygon's normal, it is cut otherwise. A polygon is refused as unclear
    if it crosses itself, seen this way, or if its corners rise along the normal by more than half
    of its size. The vertices that STL repeats for each triangle are merged if exactly equal. The
    `up_axis` of COLLADA is ignored, as in RViz. A file that is incomplete or inconsistent is
    refused as a whole, and so is one whose scene changes (animations, skins, morph targets).

    Args:
        path: the file; its extension determines the format.
        unit: metres per unit of length of the file, such as 0.001 for millimetres. Ignored if the
            file states its unit, as .dae, .3mf and STEP files do.
        scale: factor by which the model is larger than the file says.
        deviation: metres; how far its surface may be from the real part's, as for TriangleMesh.
        volume: the bounding volumes, as for TriangleMesh; a surface takes only the default.
        solid: whether the model has an inside, as for TriangleMesh or ParametricSurface.
        part: the name of one part of a STEP assembly, which is read in its own frame (see
            `load_placements`). None: all parts, at their placements, as one model.

    Returns:
        The model in metres, named after the file without its extension, or after the part.

    Raises:
        FileNotFoundError: there is no such file.
        IsADirectoryError: the path is a directory.
        ModelError: an extension that no package reads; an empty, truncated or damaged file; a
            vertex that is not finite, a face that names no vertex, no triangles; an unknown volume;
            a model that must be a solid and is none; no such part; a face of a STEP file that
            cannot be represented; no OpenCASCADE for a STEP file. The message starts with the path.
        ValueError: `unit` or `scale` is not finite and above 0.
    """
    for key, value in (("unit", unit), ("scale", scale)):
        if not 0.0 < value < math.inf:
            raise ValueError(f"{key} = {value!r}: must be finite and above 0")
    file = Path(path)
    kind = file.suffix.lower()
    data, read = _contents(file, kind)
    try:
        if part is not None and kind not in ASSEMBLIES:
            raise ModelError(f"part = {part!r}: {kind} files have no parts")
        model = read(data, file, Reading(unit, scale, deviation, volume, solid, part))
    except Exception as error:
        raise _refused(file, error) from error
    if not isinstance(model, Model):
        raise ModelError(f"{file}: its reader returned {type(model).__name__}, not a Model")
    model.name = part or file.stem
    return model


def load_placements(path: str | PathLike[str], *, scale: float = 1.0) -> list[Placement]:
    """Return the placed parts of a STEP assembly, in the file's order.

    To load a part's model, call ``load(path, scale=scale, part=placement.model)``.

    Args:
        path: the file.
        scale: factor by which the assembly is larger than the file says.

    Returns:
        The placements of the parts; an empty list if the file's format has no parts.

    Raises:
        FileNotFoundError, IsADirectoryError, ModelError, ValueError: as `load`.
    """
    if not 0.0 < scale < math.inf:
        raise ValueError(f"scale = {scale!r}: must be finite and above 0")
    file = Path(path)
    if file.suffix.lower() not in ASSEMBLIES:
        return []
    data, _ = _contents(file, file.suffix.lower())
    try:
        return step_placements(data, file, scale)
    except Exception as error:
        raise _refused(file, error) from error


def _refused(file: Path, error: Exception) -> ModelError:
    """Return a reader's error as a ModelError that names the file.

    Damaged bytes can make a reader raise any exception.
    """
    if isinstance(error, FormatError | ModelError):
        named = str(error) if str(error).startswith(str(file)) else f"{file}: {error}"
        return ModelError(named)
    kind = file.suffix[1:].upper()
    return ModelError(f"{file}: not a readable {kind} file: {type(error).__name__}: {error}")


def _contents(file: Path, kind: str) -> tuple[bytes, Reader]:
    """Return all bytes of a file, and the reader for its extension."""
    try:
        file.stat()
        if file.is_dir():
            raise IsADirectoryError(f"{file}: is a directory, not a model file")
        read = reader_of(kind)
        if read is None:
            known = ", ".join(extensions())
            raise ModelError(f"{file}: unknown extension {file.suffix!r}; supported are {known}")
        data = file.read_bytes()
    except FileNotFoundError:
        raise FileNotFoundError(f"{file}: there is no such file") from None
    except FormatError as error:
        raise ModelError(f"{file}: {error}") from None
    except (IsADirectoryError, ModelError):
        raise
    except (OSError, ValueError) as error:
        raise ModelError(f"{file}: cannot be read: {error}") from error
    if not data:
        raise ModelError(f"{file}: is empty")
    return data, read
