"""Make the STEP assembly of the gearbox scene: `python tools/make_gearbox_step.py [FOLDER]`.

It is a pair of spur gears on two shafts with bearings, in a housing with a bolted cover, and a knob
on the driving shaft. It has planes, cylinders, cones, spheres, tori, extruded and free splines,
faces with holes, and products that are placed several times: 544 faces in 19 parts. The script
needs the extra `cad`. OpenCASCADE writes the colours in a different order each time.
"""

from __future__ import annotations

import math
import re
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeRevol,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.Geom import Geom_BezierCurve
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_StepModelType
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

try:  # 8.0
    from OCP.collections import Array1_gp_Pnt as Points
except ImportError:  # 7.9
    from OCP.TColgp import TColgp_Array1OfPnt as Points

HERE = Path(__file__).parents[1] / "proximity_monitor/scene/bundled/gearbox/models/gearbox.step"
MODULE = 1.3  # millimetres of pitch diameter a tooth
TEETH = 20, 34
WIDTH = 10.0
BACKLASH = 0.15  # millimetres between flanks
APART = 0.5 * MODULE * sum(TEETH) + 0.1
BOLTS = [
    (-25.0, -30.0), (66.0, -30.0), (66.0, 30.0), (-25.0, 30.0),
    (-25.0, -10.0), (66.0, -10.0), (66.0, 10.0), (-25.0, 10.0),
]  # fmt: skip


def edges(shape: Any) -> list[Any]:
    """Return all edges of a shape; an edge comes once for each of its faces."""
    found, explorer = [], TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_EDGE)
    cast = getattr(TopoDS, "Edge", None) or TopoDS.Edge_s
    while explorer.More():
        found.append(cast(explorer.Current()))
        explorer.Next()
    return found


def up(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> gp_Ax2:
    """Return axes at a point, z up."""
    return gp_Ax2(gp_Pnt(x, y, z), gp_Dir(0, 0, 1))


def cylinder(radius: float, low: float, high: float, x: float = 0.0, y: float = 0.0) -> Any:
    """Return a cylinder along z."""
    return BRepPrimAPI_MakeCylinder(up(x, y, low), radius, high - low).Shape()


def cut(shape: Any, *tools: Any) -> Any:
    """Return a shape less the tools."""
    for tool in tools:
        shape = BRepAlgoAPI_Cut(shape, tool).Shape()
    return shape


def turned(points: list[tuple[float, float]]) -> Any:
    """Return a closed polygon of (radius, z) turned about z."""
    polygon = BRepBuilderAPI_MakePolygon()
    for radius, z in points:
        polygon.Add(gp_Pnt(radius, 0, z))
    polygon.Close()
    face = BRepBuilderAPI_MakeFace(polygon.Wire()).Face()
    return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))).Shape()


def block(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float, radius: float) -> Any:
    """Return a box with rounded edges."""
    box = BRepPrimAPI_MakeBox(gp_Pnt(x0, y0, z0), gp_Pnt(x1, y1, z1)).Shape()
    rounding = BRepFilletAPI_MakeFillet(box)
    for edge in edges(box):
        rounding.Add(radius, edge)
    return rounding.Shape()


def bezier(points: list[tuple[float, float, float]]) -> Any:
    """Return an edge along a Bezier curve."""
    poles = Points(1, len(points))
    for i, point in enumerate(points, 1):
        poles.SetValue(i, gp_Pnt(*point))
    return BRepBuilderAPI_MakeEdge(Geom_BezierCurve(poles)).Edge()


def involute(base: float, radius: float) -> float:
    """Return the angle at which an involute reaches a radius."""
    ratio = math.sqrt((radius / base) ** 2 - 1.0)
    return ratio - math.atan(ratio)


def flank(base: float, low: float, high: float, begin: float, sign: float) -> list[tuple]:
    """Return the control points of a cubic near an involute: same ends and end directions."""
    ends = []
    for radius in (low, high):
        angle = begin + sign * involute(base, radius)
        roll = sign * math.sqrt(max((radius / base) ** 2 - 1.0, 0.0))
        direction = begin + roll  # an involute runs along the normal of its base circle
        ends.append(((radius * math.cos(angle), radius * math.sin(angle)),
                     (math.cos(direction), math.sin(direction))))  # fmt: skip
    (p, d), (q, e) = ends
    reach = math.dist(p, q) / 3.0
    return [
        (*p, 0.0),
        (p[0] + reach * d[0], p[1] + reach * d[1], 0.0),
        (q[0] - reach * e[0], q[1] - reach * e[1], 0.0),
        (*q, 0.0),
    ]


def gear(teeth: int, bore: float) -> Any:
    """Return a spur gear about z, from z = 0 to WIDTH; one tooth points along x."""
    pitch = 0.5 * MODULE * teeth
    base, tip = pitch * math.cos(math.radians(20.0)), pitch + MODULE
    root = pitch - 1.25 * MODULE
    low = max(base * 1.0005, root)
    half = 0.25 * math.pi / (0.5 * teeth) - 0.5 * BACKLASH / pitch + involute(base, pitch)
    wire = BRepBuilderAPI_MakeWire()
    for tooth in range(teeth):
        middle = 2.0 * math.pi * tooth / teeth
        following = middle + 2.0 * math.pi / teeth
        rise = flank(base, low, tip, middle - half, 1.0)
        fall = flank(base, low, tip, middle + half, -1.0)[::-1]
        after = flank(base, low, tip, following - half, 1.0)
        left = math.atan2(fall[-1][1], fall[-1][0])
        right = math.atan2(after[0][1], after[0][0])
        foot = [(root * math.cos(a), root * math.sin(a), 0.0) for a in (left, right)]
        wire.Add(bezier(rise))
        wire.Add(bezier([rise[-1], fall[0]]))
        wire.Add(bezier(fall))
        wire.Add(bezier([fall[-1], foot[0], foot[1], after[0]]))
    body = BRepPrimAPI_MakePrism(
        BRepBuilderAPI_MakeFace(wire.Wire()).Face(), gp_Vec(0, 0, WIDTH)
    ).Shape()
    holes = [cylinder(bore, -1, WIDTH + 1)]
    if root > 15.5:  # otherwise they would cut into the teeth
        holes += [
            cylinder(2.5, -1, WIDTH + 1, 12 * math.cos(a), 12 * math.sin(a))
            for a in (2.0 * math.pi * i / 5 for i in range(5))
        ]
    return cut(body, *holes)


def shaft(length: float) -> Any:
    """Return a stepped shaft with chamfered ends and a keyway with round ends."""
    body = turned([(0, -24), (4, -24), (5, -23), (5, -13), (6, -12.5), (6, 12.5), (5, 13),
                   (5, length - 1), (4, length), (0, length)])  # fmt: skip
    slot = BRepPrimAPI_MakeBox(gp_Pnt(4.5, -1.5, -4), gp_Pnt(8, 1.5, 4)).Shape()
    along_x = [gp_Ax2(gp_Pnt(4.5, 0, z), gp_Dir(1, 0, 0)) for z in (-4.0, 4.0)]
    ends = [BRepPrimAPI_MakeCylinder(axes, 1.5, 3.5).Shape() for axes in along_x]
    return cut(body, slot, *ends)


def bearing() -> Any:
    """Return a ring with rounded edges and a groove for its seal."""
    ring = cut(cylinder(11.0, 0.0, 8.0), cylinder(5.05, -1.0, 9.0))
    rounding = BRepFilletAPI_MakeFillet(ring)
    for edge in edges(ring):
        rounding.Add(0.6, edge)
    groove = BRepPrimAPI_MakeTorus(up(0, 0, 8.0), 8.0, 1.2).Shape()
    return cut(rounding.Shape(), groove)


def bolt() -> Any:
    """Return a hexagon head bolt with a dome on its head and a cone at its end."""
    polygon = BRepBuilderAPI_MakePolygon()
    for i in range(6):
        angle = math.pi * i / 3
        polygon.Add(gp_Pnt(4.6 * math.cos(angle), 4.6 * math.sin(angle), 0))
    polygon.Close()
    head = BRepPrimAPI_MakePrism(
        BRepBuilderAPI_MakeFace(polygon.Wire()).Face(), gp_Vec(0, 0, 3.5)
    ).Shape()
    ball = BRepPrimAPI_MakeSphere(gp_Pnt(0, 0, -5.0), 9.4).Shape()
    head = BRepAlgoAPI_Common(head, ball).Shape()
    stem = turned([(0, -20), (1.6, -20), (2.4, -19), (2.4, 0.5), (0, 0.5)])
    return BRepAlgoAPI_Fuse(head, stem).Shape()


def knob() -> Any:
    """Return a knob with five lobes: a loft through closed splines, with a bore."""
    loft = BRepOffsetAPI_ThruSections(True, False, 1e-6)
    for z, size in ((0.0, 9.0), (6.0, 13.0), (12.0, 12.0), (15.0, 8.0)):
        loft.AddWire(lobes(z, size))
    loft.Build()
    return cut(loft.Shape(), cylinder(5.1, -1.0, 9.0))


def lobes(z: float, size: float) -> Any:
    """Return a closed curve with five lobes, of ten cubic pieces that meet smoothly."""
    wire = BRepBuilderAPI_MakeWire()
    count, reach = 10, 4.0 / 3.0 * math.tan(math.pi / 20.0)
    points = []
    for i in range(count + 1):
        angle = 2.0 * math.pi * i / count
        radius = size * (1.0 if i % 2 == 0 else 0.82)
        points.append((radius, angle % (2.0 * math.pi)))
    for (r, a), (s, b) in pairwise(points):
        p = (r * math.cos(a), r * math.sin(a), z)
        q = (s * math.cos(b), s * math.sin(b), z)
        wire.Add(bezier([
            p,
            (p[0] - reach * r * math.sin(a), p[1] + reach * r * math.cos(a), z),
            (q[0] + reach * s * math.sin(b), q[1] - reach * s * math.cos(b), z),
            q,
        ]))  # fmt: skip
    return wire.Wire()


def housing() -> Any:
    """Return a rounded box, open at the top, with two bearing seats and holes for bolts."""
    body = block(-35, 76, -40, 40, -26, 9, 4.0)
    inside = block(-20, 61, -32, 32, -15, 20, 3.0)
    seats = [cylinder(11.1, -30, 0, x) for x in (0.0, APART)]
    holes = [cylinder(2.6, -16, 12, x, y) for x, y in BOLTS]
    flat = BRepPrimAPI_MakeBox(gp_Pnt(-50, -50, 6.0), gp_Pnt(90, 50, 30)).Shape()
    return cut(body, flat, inside, *seats, *holes)


def cover() -> Any:
    """Return a rounded plate with holes for bolts and shafts, one of them counterbored."""
    plate = block(-35, 76, -40, 40, 0, 6, 2.5)
    sunk = BRepPrimAPI_MakeCylinder(up(0, 0, 4.0), 9.0, 4.0).Shape()
    holes = [cylinder(2.6, -1, 7, x, y) for x, y in BOLTS]
    shafts = [cylinder(5.4, -1, 7, x) for x in (0.0, APART)]
    return cut(plate, *holes, *shafts, sunk)


def seal() -> Any:
    """Return a ring around a shaft."""
    return BRepPrimAPI_MakeTorus(up(), 7.2, 1.4).Shape()


PRODUCTS = {
    "housing": (housing, (0.35, 0.42, 0.50)),
    "cover": (cover, (0.55, 0.62, 0.70)),
    "pinion": (lambda: gear(TEETH[0], 6.1), (0.85, 0.65, 0.20)),
    "wheel": (lambda: gear(TEETH[1], 6.1), (0.80, 0.45, 0.15)),
    "input shaft": (lambda: shaft(40.0), (0.75, 0.75, 0.78)),
    "output shaft": (lambda: shaft(22.0), (0.75, 0.75, 0.78)),
    "bearing": (bearing, (0.30, 0.55, 0.35)),
    "bolt": (bolt, (0.20, 0.20, 0.22)),
    "knob": (knob, (0.75, 0.15, 0.15)),
    "seal": (seal, (0.10, 0.10, 0.10)),
}
PLACES = [
    ("housing", "housing", (0, 0, 0), 0.0),
    ("cover", "cover", (0, 0, 14.1), 0.0),
    ("pinion", "pinion", (0, 0, -5), 0.0),
    ("wheel", "wheel", (APART, 0, -5), 180.0 / TEETH[1]),
    ("input shaft", "input shaft", (0, 0, 0), 0.0),
    ("output shaft", "output shaft", (APART, 0, 0), 30.0),
    *(("bearing", f"bearing {i}", (x, 0, -25), 0.0) for i, x in enumerate((0.0, APART), 1)),
    *(("seal", f"seal {i}", (x, 0, 20.0), 0.0) for i, x in enumerate((0.0, APART), 1)),
    ("knob", "knob", (0, 0, 31.5), 0.0),
    *(("bolt", f"bolt {i}", (x, y, 20.3), 15.0 * i) for i, (x, y) in enumerate(BOLTS, 1)),
]


def placed(where: tuple[float, float, float], degrees: float) -> TopLoc_Location:
    """Return a location: a turn about z, then a shift."""
    turn, shift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), math.radians(degrees))
    shift.SetTranslation(gp_Vec(*where))
    return TopLoc_Location(shift.Multiplied(turn))


def named(label: Any, name: str) -> None:
    """Name a product or a component."""
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))


def write(path: Path) -> None:
    """Write the assembly."""
    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    labels = {}
    for name, (make, colour) in PRODUCTS.items():
        labels[name] = shapes.AddShape(make(), False)
        named(labels[name], name)
        sort = Quantity_TypeOfColor.Quantity_TOC_sRGB
        kind = XCAFDoc_ColorType.XCAFDoc_ColorSurf
        colours.SetColor(labels[name], Quantity_Color(*colour, sort), kind)
    whole = shapes.NewShape()
    named(whole, "gearbox")
    for product, name, where, degrees in PLACES:
        named(shapes.AddComponent(whole, labels[product], placed(where, degrees)), name)
    shapes.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    # Leave out the edges' curves in the faces' parameters: the file is half as long, and a reader
    # computes them.
    Interface_Static.SetIVal_s("write.surfacecurve.mode", 0)
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    writer.Transfer(document, STEPControl_StepModelType.STEPControl_AsIs)
    path.parent.mkdir(parents=True, exist_ok=True)
    writer.Write(str(path))
    text = path.read_text(encoding="utf-8")  # fix the date: only the order of the colours varies
    text = re.sub(r"FILE_NAME\('[^']*','[^']*'", "FILE_NAME('gearbox','2026-01-01T00:00:00'", text)
    path.write_text(text, encoding="utf-8")
    print(f"{path}: {len(text) / 1024:.0f} KiB")


if __name__ == "__main__":
    write(Path(sys.argv[1]) / HERE.name if len(sys.argv) > 1 else HERE)
