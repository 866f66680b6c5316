"""Files to models, by the readers in `files`; every error names the file."""

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
    """Read a model from a file: .stl, .obj, .ply, .off, .glb, .gltf, .dae, .3mf or .json.

    Other packages may read other extensions (see `files.readers`).

    A .json file is one of geomdl (NURBS-Python): a `Patch` or a `Curve`, or several as a
    `ParametricSurface`; or it holds a `SolidOfRevolution` (see docs/models.md). All others hold
    triangles. Several geometries in one of those are merged with their transforms; points and
    curves among them are left out. Degenerate triangles are kept, but for those that join strips.
    Polygons are cut into fans from their first corner, or otherwise where a fan would fold, as seen
    along their normal. Those that cross themselves, seen so, are refused, and those whose corners
    rise along it by more than half of their size: what they mean is unclear. The vertices that
    STL repeats for each triangle are merged where they are exactly equal. The `up_axis` of COLLADA
    does not count, as in RViz. A file that is not complete and consistent is refused as a whole,
    and so is one whose scene is not what stands in it (animations, skins, morph targets).

    Args:
        path: the file; its extension says the format.
        unit: metres in the file's unit of length, 0.001 for millimetres, where the file does not
            state it; .dae and .3mf files do.
        scale: how much larger the model is than the file says.
        deviation: metres; how far its surface may be from that of the thing, as for TriangleMesh.
        volume: the bounding volumes, as for TriangleMesh; a surface takes the default alone.
        solid: whether it has an inside, as for TriangleMesh or ParametricSurface.
        part: of a STEP assembly, the name of one part, which comes in its own frame (see
            `load_placements`); None: all parts, where they are placed, as one model.

    Returns:
        The model in metres, named after the file without its extension, or after the part.

    Raises:
        FileNotFoundError: there is no such file.
        IsADirectoryError: it is a directory.
        ModelError: another extension that no package reads; an empty, truncated or damaged file; a
            vertex that is not finite, a face that names no vertex, no triangles; an unknown volume;
            no solid though it must be one; no such part; a face of a STEP file that cannot be
            honoured, or no OpenCASCADE to read it with. The message starts with the path.
        ValueError: a unit or a scale that is not finite and above 0.
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
        raise ModelError(f"{file}: its reader returned no model but {type(model).__name__}")
    model.name = part or file.stem
    return model


def load_placements(path: str | PathLike[str], *, scale: float = 1.0) -> list[Placement]:
    """What stands where in a STEP assembly: its parts, in the file's order.

    A part's model is ``load(path, scale=scale, part=placement.model)``.

    Args:
        path: the file.
        scale: how much larger the assembly is than the file says.

    Returns:
        Its parts; none of a file whose format knows no parts.

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
    """What a reader raised, which damaged bytes can make fail in any way, with the file's name."""
    if isinstance(error, FormatError | ModelError):
        named = str(error) if str(error).startswith(str(file)) else f"{file}: {error}"
        return ModelError(named)
    kind = file.suffix[1:].upper()
    return ModelError(f"{file}: not a readable {kind} file: {type(error).__name__}: {error}")


def _contents(file: Path, kind: str) -> tuple[bytes, Reader]:
    """All bytes of a file, and the reader of its extension."""
    try:
        file.stat()
        if file.is_dir():
            raise IsADirectoryError(f"{file}: is a directory, not a model file")
        read = reader_of(kind)
        if read is None:
            raise ModelError(
                f"{file}: unknown extension {file.suffix!r}; read are {', '.join(extensions())}"
            )
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
