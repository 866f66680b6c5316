"""The parts of a STEP file: their names, placements, colours and faces, by OpenCASCADE's XCAF.

Deviation of the model: the faces of a file meet along edges. Each edge has a curve in space and a
tolerance. The trimming curves of both faces give the edge too, and lie within the tolerance of the
curve in space. The faces of the intended part meet along the curves in space. So its surface is
nowhere farther from the faces as read than the largest tolerance of its edges and vertices. This
tolerance is the model's deviation.
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
"""Names that programs generate for labels without a name."""
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
"""OpenCASCADE's settings are global to the process, so other code may have changed them."""
_COLOURS = (
    XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen,
    XCAFDoc_ColorType.XCAFDoc_ColorCurv,
)  # fmt: skip


class PartShape(NamedTuple):
    """A shape that may be placed several times."""

    faces: list[Face]
    revolution: Revolution | None
    """The solid that the faces bound, if it is a solid of revolution."""


class Part(NamedTuple):
    """One placed part."""

    name: str
    pose: Reals
    """(4, 4) millimetres, from the part's frame to the assembly's."""
    colour: Colour | None
    """Red, green, blue, opacity, each 0 to 1 (sRGB)."""
    shape: PartShape


def read_parts(file: Path) -> list[Part]:
    """Return all parts of a STEP file that have faces, in the file's order.

    Raises:
        FormatError: the file is unreadable, damaged, only partly read or without faces, or a face
            cannot be represented.
    """
    checks = StepChecks(StepText(file.read_bytes(), file.name))
    with _settings():
        return _transferred(file, checks)


def _transferred(file: Path, checks: StepChecks) -> list[Part]:
    """Return all parts of a file; refuse it if some that it states are missing."""
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
            f"has {checks.faces} faces, but OpenCASCADE read only {brought}: some are damaged "
            "or belong to no part"
        )
    if len(parts) < checks.placed:
        raise FormatError(f"places {checks.placed} parts, but OpenCASCADE read only {len(parts)}")
    return parts


@contextmanager
def _settings() -> Iterator[None]:
    """Set OpenCASCADE's settings as this reader needs them, and restore them at the end."""
    STEPCAFControl_Reader()  # creates the settings
    known = [key for key in _SETTINGS if Interface_Static.IsPresent_s(key)]
    before = {key: Interface_Static.CVal_s(key) for key in known}
    try:
        for key in known:
            if not Interface_Static.SetCVal_s(key, _SETTINGS[key]):
                raise FormatError(f"OpenCASCADE refuses the setting {key} = {_SETTINGS[key]}")
        yield
    finally:
        for key, value in before.items():
            Interface_Static.SetCVal_s(key, value)


def _check_loaded(reader: Any, checks: StepChecks) -> None:
    """Refuse statements of a shape, a placement or a unit that OpenCASCADE has only partly read."""
    failed = reader.ChangeReader().WS().ModelCheckList()
    failed.Start()
    while failed.More():
        check = failed.Value()
        for i in range(1, check.NbFails() + 1):
            why, number = check.CFail(i), checks.statement(failed.Number())
            if number is None:  # the message of an error of the whole file may name a statement
                named = _NAMED.search(why)
                number = int(named[1]) if named else None
            if number is None or number in checks.relevant:
                raise FormatError(f"#{number or '?'} is damaged: {why}")
        failed.Next()


def _faces_made(reader: Any) -> int:
    """Return for how many faces of the file OpenCASCADE has made a shape."""
    process = reader.ChangeReader().WS().TransferReader().TransientProcess()
    return sum(
        isinstance(process.Mapped(i), StepShape_FaceSurface) and process.MapItem(i).HasResult()
        for i in range(1, process.NbMapped() + 1)
    )


def _quiet() -> None:
    """Let OpenCASCADE print only failures on the console."""
    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)


def _distinct(parts: list[Part]) -> list[Part]:
    """Return the parts with unique names: the second part called NAME becomes NAME 2."""
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
    """The content of an XCAF document. A shape that is placed several times is read once."""

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
        """Yield the parts under a label, which may be an assembly, a placed shape or a shape."""
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
        """Return the colour of the first solid that has one, else of a shell, else of a face."""
        colour = Quantity_ColorRGBA()
        for sort in ("Solid", "Shell", "Face"):
            for each in shapes_in(shape, sort):
                for kind in _COLOURS:
                    if self._colours.GetColor(each, kind, colour):
                        return _srgb(colour)
        return None


def read_shape(shape: Any, name: str) -> PartShape:
    """Read all faces of a shape.

    Raises:
        FormatError: some faces cannot be represented. The message names the part and up to three
            faces with their types.
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
    """Return the entry of a label, which identifies it in its document."""
    text = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, text)
    return text.ToCString()


def _name(label: Any) -> str:
    """Return the name of a label; empty if it has none, or only a generated one.

    Programs number the occurrences of a part, so a number is no name of an occurrence. It may be
    the name of a part.
    """
    name = TDataStd_Name()
    if not label.FindAttribute(TDataStd_Name.GetID_s(), name):
        return ""
    text = name.Get().ToExtString().strip()
    numbered = text.isdigit() and XCAFDoc_ShapeTool.IsReference_s(label)
    return "" if numbered or _GIVEN_BY_NOBODY.fullmatch(text) else text


def _matrix(location: Any) -> Reals:
    """Return the matrix (4, 4) of a placement.

    Raises:
        FormatError: the placement is no rigid motion.
    """
    motion = location.Transformation()
    matrix = np.eye(4)
    for i in range(3):
        matrix[i] = [motion.Value(i + 1, j + 1) for j in range(4)]
    turn = matrix[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-9 or np.linalg.det(turn) < 0.0:
        raise FormatError("the placement of a part is not a rigid motion")
    return matrix


def _srgb(colour: Any) -> Colour:
    red, green, blue = colour.GetRGB().Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
    return tuple(round(each, 6) for each in (red, green, blue, colour.Alpha()))
