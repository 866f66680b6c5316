"""Reader for STEP files: surfaces, read by OpenCASCADE, which the extra `cad` installs."""

from __future__ import annotations

import importlib.util
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..models.checks import ModelError
from ..models.patch import Curve, Patch
from ..models.revolution import SolidOfRevolution
from ..models.surface import ParametricSurface, Surface
from .triangles import FormatError

if TYPE_CHECKING:
    from .readers import Reading
    from .step_faces import Face
    from .step_parts import Part

_BEGIN, _END = b"ISO-10303-21", b"END-ISO-10303-21;"
_MILLIMETRE = 1e-3


class Placement(NamedTuple):
    """A placed part of an assembly: its pose, colour and model."""

    name: str
    """The part's name, unique in the file."""
    pose: NDArray[np.float64]
    """(4, 4) metres, from the part's frame to the assembly's."""
    colour: tuple[float, float, float, float] | None
    """Red, green, blue, opacity, each 0 to 1; None if the file gives no colour."""
    model: str
    """The name of the first part with the same shape: parts of one shape can share its model."""


def read_step(data: bytes, file: Path, how: Reading) -> Surface:
    """Read one part of a STEP file in its own frame, or all parts as one surface.

    The file states its own unit. A single part that is a solid of revolution becomes a
    `SolidOfRevolution`, unless `solid` is False.
    """
    if how.volume != "rss":
        raise FormatError(f"volume = {how.volume!r}: must be 'rss' for parametric surfaces")
    if how.solid == "robust":
        raise FormatError("solid = 'robust': only for meshes; use True, False or None")
    parts = _parts(data, file)
    if how.part is not None:
        own = [part for part in parts if part.name == how.part]
        if not own:
            known = ", ".join(repr(part.name) for part in parts)
            raise FormatError(f"part = {how.part!r}: no such part; the file has {known}")
        parts = [own[0]._replace(pose=np.eye(4))]
    metres = _MILLIMETRE * how.scale
    if len(parts) == 1 and how.solid is not False:
        made = _revolution(parts[0], metres, str(file), how.deviation)
        if made is not None:
            return made
    patches = [
        _patch(face, part.pose, metres, f"{part.name}, face {i}", how.deviation)
        for part in parts
        for i, face in enumerate(part.shape.faces, 1)
    ]
    return ParametricSurface(patches, name=str(file), solid=how.solid)


def _revolution(part: Part, metres: float, name: str, deviation: float) -> SolidOfRevolution | None:
    """Return a part as a solid of revolution; None if it is none, or its profile crosses itself."""
    found = part.shape.revolution
    if found is None:
        return None
    turn, shift = part.pose[:3, :3], part.pose[:3, 3]
    aside = max(face.tolerance for face in part.shape.faces) + found.deviation
    try:
        return SolidOfRevolution(
            [Curve(points * metres, knots, weights) for points, weights, knots in found.curves],
            (turn @ found.origin + shift) * metres,
            turn @ found.axis,
            name=name,
            deviation=deviation + aside * metres,
        )
    except ModelError:
        return None


def step_placements(data: bytes, file: Path, scale: float) -> list[Placement]:
    """Return the placements of the parts of a STEP file; see `load_placements`."""
    made, first = [], {}
    for part in _parts(data, file):
        pose = part.pose.copy()
        pose[:3, 3] *= _MILLIMETRE * scale
        pose.setflags(write=False)
        model = first.setdefault(id(part.shape), part.name)
        made.append(Placement(part.name, pose, part.colour, model))
    return made


def _patch(
    face: Face, pose: NDArray[np.float64], metres: float, name: str, deviation: float
) -> Patch:
    control = (face.net.control @ pose[:3, :3].T + pose[:3, 3]) * metres
    return Patch(
        control, face.net.knots_u, face.net.knots_v, face.net.weights, name=name,
        deviation=deviation + face.tolerance * metres, trim=face.trim,
    )  # fmt: skip


def _parts(data: bytes, file: Path) -> list[Part]:
    """Return the parts of a file; refuse it if its bytes are not a complete STEP file."""
    if not data.lstrip().startswith(_BEGIN):
        raise FormatError(f"not a STEP file: it does not begin with {_BEGIN.decode()}")
    if not data.rstrip(b"\0 \t\r\n").endswith(_END):
        raise FormatError(f"is truncated: it does not end with {_END.decode()}")
    if importlib.util.find_spec("OCP") is None:
        raise FormatError("STEP files need OpenCASCADE: pip install '.[cad]' in the checkout")
    stat = file.stat()
    return _read(file.resolve(), stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=4)
def _read(file: Path, _time: int, _size: int) -> list[Part]:
    """Read the parts of a file, cached, so that loading them one by one reads the file once."""
    from .step_parts import read_parts

    return read_parts(file)
