"""The parts of a STEP file: their names, placements, colours and faces, by OpenCASCADE's XCAF.

What a file means. Its faces meet along edges; each edge has a curve in space, and a tolerance
within which the edges of both faces, which their trimming curves give them, lie around that curve.
The thing that is meant has faces that meet along these curves. Its surface is nowhere farther from
the faces as they stand here than the largest tolerance of its edges and vertices, which is the
model's deviation.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Interface import Interface_Static
from OCP.Message import Message, Message_Gravity
from OCP.Quantity import Quantity_ColorRGBA, Quantity_TypeOfColor
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.StepShape import StepShape_FaceSurface
from OCP.TCollection import TCollection_AsciiString, TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label, TDF_Tool
from OCP.TDocStd import TDocStd_Document
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

try:  # 8.0
    from OCP.collections import Sequence_TDF_Label as Labels
except ImportError:  # 7.9
    from OCP.TDF import TDF_LabelSequence as Labels

from .step_checks import StepChecks
from .step_faces import Face, read_face, shapes_in
from .step_revolution import Revolution, find_revolution
from .step_text import StepText
from .triangles import FormatError

Reals = NDArray[np.float64]
Colour = tuple[float, float, float, float]

_GIVEN_BY_NOBODY = re.compile(r"(NAUO ?\d*|=>\[[\d:]*\]||NONE|COMPOUND|SOLID)", re.IGNORECASE)
"""Names that programs give to what has none."""
_NAMED = re.compile(r"Ent\.Id\.#(\d+)")
_SETTINGS = {
    "xstep.cascade.unit": "MM",
    "read.precision.mode": "File",
    "read.maxprecision.mode": "Preferred",
    "read.maxprecision.val": "1.",
    "read.stdsameparameter.mode": "Off",
    "read.surfacecurve.mode": "Default",
    "read.step.product.mode": "ON",
    "read.step.product.context": "all",
    "read.step.shape.repr": "All",
    "read.step.assembly.level": "all",
    "read.step.shape.relationship": "ON",
    "read.step.shape.aspect": "ON",
    "read.step.constructivegeom.relationship": "OFF",
    "read.step.nonmanifold": "Off",
    "read.step.ideas": "Off",
    "read.step.all.shapes": "Off",
    "read.step.tessellated": "Off",
    "step.angleunit.mode": "File",
    "read.step.root.transformation": "ON",
}
"""OpenCASCADE's settings are the process's: others in it may have changed them."""
_COLOURS = (
    XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen,
    XCAFDoc_ColorType.XCAFDoc_ColorCurv,
)  # fmt: skip


class PartShape(NamedTuple):
    """A shape that may be placed several times."""

    faces: list[Face]
    revolution: Revolution | None
    """What they bound together, where that is a solid of revolution."""


class Part(NamedTuple):
    """One placed part."""

    name: str
    pose: Reals
    """(4, 4), millimetres."""
    colour: Colour | None
    """Red, green, blue, opacity, each 0 to 1 (sRGB)."""
    shape: PartShape


def read_parts(file: Path) -> list[Part]:
    """All parts of a STEP file that have faces, in its order.

    Raises:
        FormatError: not readable, damaged, not all of it is read, no faces, a face that cannot be
            honoured.
    """
    checks = StepChecks(StepText(file.read_bytes(), file.name))
    with _settings():
        return _transferred(file, checks)


def _transferred(file: Path, checks: StepChecks) -> list[Part]:
    """All parts of a file, which are those that it states."""
    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    _quiet()
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    if reader.ReadFile(str(file)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise FormatError("OpenCASCADE cannot read it")
    _check_loaded(reader, checks)
    if not reader.Transfer(document):
        raise FormatError("OpenCASCADE finds no shapes in it")
    parts = _Document(document).parts()
    shapes = {id(part.shape): len(part.shape.faces) for part in parts}
    brought = min(_faces_made(reader), sum(shapes.values()))
    if brought < checks.faces:
        raise FormatError(
            f"has {checks.faces} faces, of which OpenCASCADE brought {brought}: some of it is "
            "damaged, or belongs to no part"
        )
    if len(parts) < checks.placed:
        raise FormatError(
            f"places {checks.placed} parts, of which OpenCASCADE brought {len(parts)}"
        )
    return parts


@contextmanager
def _settings() -> Iterator[None]:
    """OpenCASCADE's settings as this reader needs them, for as long as it reads."""
    STEPCAFControl_Reader()  # makes them known
    known = [key for key in _SETTINGS if Interface_Static.IsPresent_s(key)]
    before = {key: Interface_Static.CVal_s(key) for key in known}
    try:
        for key in known:
            if not Interface_Static.SetCVal_s(key, _SETTINGS[key]):
                raise FormatError(f"OpenCASCADE knows no {key} = {_SETTINGS[key]}")
        yield
    finally:
        for key, value in before.items():
            Interface_Static.SetCVal_s(key, value)


def _check_loaded(reader: Any, checks: StepChecks) -> None:
    """Refuse statements of a shape, a place or a unit that OpenCASCADE has read in part alone."""
    failed = reader.ChangeReader().WS().ModelCheckList()
    failed.Start()
    while failed.More():
        check = failed.Value()
        for i in range(1, check.NbFails() + 1):
            why, number = check.CFail(i), checks.statement(failed.Number())
            if number is None:  # what is wrong with the file as a whole may name a statement
                named = _NAMED.search(why)
                number = int(named[1]) if named else None
            if number is None or number in checks.relevant:
                raise FormatError(f"#{number or '?'}: {why}: it is damaged")
        failed.Next()


def _faces_made(reader: Any) -> int:
    """Of how many faces of the file OpenCASCADE has made any."""
    process = reader.ChangeReader().WS().TransferReader().TransientProcess()
    return sum(
        isinstance(process.Mapped(i), StepShape_FaceSurface) and process.MapItem(i).HasResult()
        for i in range(1, process.NbMapped() + 1)
    )


def _quiet() -> None:
    """Let OpenCASCADE say on the console what fails, and nothing else."""
    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)


def _distinct(parts: list[Part]) -> list[Part]:
    """The same parts, of which no two have the same name: the second is NAME 2."""
    taken = {part.name for part in parts}
    seen: set[str] = set()
    made = []
    for part in parts:
        name, number = part.name, 2
        while name in seen or (name != part.name and name in taken):
            name, number = f"{part.name} {number}", number + 1
        seen.add(name)
        made.append(part._replace(name=name))
    return made


class _Document:
    """What a document holds; shapes that are placed several times are read once."""

    def __init__(self, document: Any) -> None:
        self._shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
        self._colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
        self._read: dict[str, PartShape] = {}

    def parts(self) -> list[Part]:
        found = Labels()
        self._shapes.GetFreeShapes(found)
        parts = [part for label in _each(found) for part in self._below(label, np.eye(4), "", None)]
        parts = [part for part in parts if part.shape.faces]
        if not parts:
            raise FormatError("has no faces")
        return _distinct(parts)

    def _below(self, label: Any, pose: Reals, name: str, colour: Colour | None) -> Iterator[Part]:
        """The parts under a label, which may be an assembly, a placed shape or a shape."""
        colour = self._colour(label) or colour
        own = _name(label)
        if XCAFDoc_ShapeTool.IsReference_s(label):
            shape = TDF_Label()
            XCAFDoc_ShapeTool.GetReferredShape_s(label, shape)
            location = XCAFDoc_ShapeTool.GetLocation_s(label)
            yield from self._below(shape, pose @ _matrix(location), own, colour)
        elif XCAFDoc_ShapeTool.IsAssembly_s(label):
            found = Labels()
            XCAFDoc_ShapeTool.GetComponents_s(label, found)
            for each in _each(found):
                yield from self._below(each, pose, "", colour)
        else:
            shape = XCAFDoc_ShapeTool.GetShape_s(label)
            pose = pose @ _matrix(shape.Location())
            yield Part(name or own or "part", pose, colour or self._of_faces(shape),
                       self._shape(label, shape, name or own or "part"))  # fmt: skip

    def _shape(self, label: Any, shape: Any, name: str) -> PartShape:
        key = _entry(label)
        if key not in self._read:
            self._read[key] = read_shape(shape.Located(type(shape.Location())()), name)
        return self._read[key]

    def _colour(self, label: Any) -> Colour | None:
        colour = Quantity_ColorRGBA()
        for kind in _COLOURS:
            if self._colours.GetColor_s(label, kind, colour):
                return _srgb(colour)
        return None

    def _of_faces(self, shape: Any) -> Colour | None:
        """The colour of a shape's own solids or of its first face that has one."""
        colour = Quantity_ColorRGBA()
        for sort in ("Solid", "Shell", "Face"):
            for each in shapes_in(shape, sort):
                for kind in _COLOURS:
                    if self._colours.GetColor(each, kind, colour):
                        return _srgb(colour)
        return None


def read_shape(shape: Any, name: str) -> PartShape:
    """All faces of a shape.

    Raises:
        FormatError: faces that cannot be honoured; it names each, its type and the part.
    """
    faces, refused = [], []
    for number, face in enumerate(shapes_in(shape, "Face"), 1):
        try:
            faces.append(read_face(face))
        except FormatError as error:
            refused.append(f"part {name!r}: face {number}, {error}")
    if refused:
        more = f"; and {len(refused) - 3} more" if len(refused) > 3 else ""
        raise FormatError("; ".join(refused[:3]) + more)
    return PartShape(faces, find_revolution(faces))


def _each(labels: Any) -> Iterator[Any]:
    return (labels.Value(i) for i in range(1, labels.Length() + 1))


def _entry(label: Any) -> str:
    """What a label is called in its document."""
    text = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, text)
    return text.ToCString()


def _name(label: Any) -> str:
    """The name somebody gave to a label; empty: nobody did.

    Programs number the occurrences of a part; a part may have a number for its name.
    """
    name = TDataStd_Name()
    if not label.FindAttribute(TDataStd_Name.GetID_s(), name):
        return ""
    text = name.Get().ToExtString().strip()
    numbered = text.isdigit() and XCAFDoc_ShapeTool.IsReference_s(label)
    return "" if numbered or _GIVEN_BY_NOBODY.fullmatch(text) else text


def _matrix(location: Any) -> Reals:
    """(4, 4) of a placement.

    Raises:
        FormatError: it is no rigid motion.
    """
    motion = location.Transformation()
    matrix = np.eye(4)
    for i in range(3):
        matrix[i] = [motion.Value(i + 1, j + 1) for j in range(4)]
    turn = matrix[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-9 or np.linalg.det(turn) < 0.0:
        raise FormatError("a part is placed by what is no rigid motion")
    return matrix


def _srgb(colour: Any) -> Colour:
    red, green, blue = colour.GetRGB().Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
    return tuple(round(each, 6) for each in (red, green, blue, colour.Alpha()))
