"""Parts of STEP files that are solids of revolution, against OpenCASCADE's own distances."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from engine_bodies import IDENTITY

from proximity_monitor import engine
from proximity_monitor.engine import SolidOfRevolution

pytest.importorskip("OCP", reason="needs OpenCASCADE: pip install cadquery-ocp")

from OCP import BRepBuilderAPI, BRepPrimAPI
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.Geom import Geom_BezierCurve
from OCP.gp import gp_Ax1, gp_Ax2, gp_Circ, gp_Dir, gp_Elips, gp_Pnt, gp_Trsf, gp_Vec
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TopAbs import TopAbs_State
from OCP.TopLoc import TopLoc_Location

try:  # OpenCASCADE 8.0
    from OCP.collections import Array1_gp_Pnt as Points
except ImportError:  # OpenCASCADE 7.9
    from OCP.TColgp import TColgp_Array1OfPnt as Points

from proximity_monitor.engine.files.step_parts import read_shape
from proximity_monitor.engine.files.step_revolution import find_revolution

GEARBOX = Path(engine.__file__).parents[1] / "scene/bundled/gearbox/models/gearbox.step"
UP = gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))
SLANTED = gp_Ax2(gp_Pnt(3, -4, 5), gp_Dir(1, 2, 3))


def outline(points, bend=None):
    """Return a face in the xz plane with straight edges, or with a last Bezier edge by poles."""
    if bend is None:
        polygon = BRepBuilderAPI.BRepBuilderAPI_MakePolygon()
        for rho, z in points:
            polygon.Add(gp_Pnt(rho, 0, z))
        polygon.Close()
        return BRepBuilderAPI.BRepBuilderAPI_MakeFace(polygon.Wire()).Face()
    wire = BRepBuilderAPI.BRepBuilderAPI_MakeWire()
    for (a, b), (c, d) in itertools.pairwise(points):
        wire.Add(BRepBuilderAPI.BRepBuilderAPI_MakeEdge(gp_Pnt(a, 0, b), gp_Pnt(c, 0, d)).Edge())
    poles = Points(1, len(bend) + 2)
    for i, (rho, z) in enumerate([points[-1], *bend, points[0]], 1):
        poles.SetValue(i, gp_Pnt(rho, 0, z))
    wire.Add(BRepBuilderAPI.BRepBuilderAPI_MakeEdge(Geom_BezierCurve(poles)).Edge())
    return BRepBuilderAPI.BRepBuilderAPI_MakeFace(wire.Wire()).Face()


def revolved(points, angle=2.0 * math.pi, bend=None):
    """Return the solid of a polygon of (rho, z) turned about z."""
    return BRepPrimAPI.BRepPrimAPI_MakeRevol(outline(points, bend), UP, angle).Shape()


def cylinder(radius, height, axes=None):
    axes = axes or gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))
    return BRepPrimAPI.BRepPrimAPI_MakeCylinder(axes, radius, height).Shape()


def sphere(radius, *where):
    return BRepPrimAPI.BRepPrimAPI_MakeSphere(gp_Pnt(*where), radius).Shape()


def filled(rim):
    """Return a plane face inside a closed curve."""
    edge = BRepBuilderAPI.BRepBuilderAPI_MakeEdge(rim).Edge()
    wire = BRepBuilderAPI.BRepBuilderAPI_MakeWire(edge).Wire()
    return BRepBuilderAPI.BRepBuilderAPI_MakeFace(wire).Face()


def cut(one, other):
    return BRepAlgoAPI_Cut(one, other).Shape()


def capsule():
    made = cylinder(2.0, 6.0)
    for z in (0.0, 6.0):
        made = BRepAlgoAPI_Fuse(made, sphere(2.0, 0, 0, z)).Shape()
    return made


def two_halves():
    """Return a torus of two faces, half a turn each."""
    halves = []
    for sign in (1.0, -1.0):
        rim = gp_Circ(gp_Ax2(gp_Pnt(5, 0, 0), gp_Dir(0, 1, 0)), 2.0)
        halves.append(BRepPrimAPI.BRepPrimAPI_MakeRevol(filled(rim), UP, sign * math.pi).Shape())
    return BRepAlgoAPI_Fuse(*halves).Shape()


def extruded():
    """Return a round bar whose surface is an extruded circle, with a plain cylindrical bore."""
    face = filled(gp_Circ(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 3.0))
    return cut(BRepPrimAPI.BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, 4)).Shape(), cylinder(1.0, 9.0))


SHAFT = [(0, -24), (4, -24), (5, -23), (5, -13), (6, -12.5), (6, 12.5), (5, 13), (5, 20), (0, 20)]
TURNED = {
    "shaft": lambda: revolved(SHAFT),
    "bore": lambda: cut(revolved(SHAFT), cylinder(1.5, 99.0)),
    "cone": lambda: BRepPrimAPI.BRepPrimAPI_MakeCone(SLANTED, 4.0, 0.0, 7.0).Shape(),
    "ball": lambda: sphere(4.0, 1, 2, 3),
    "dome": lambda: BRepPrimAPI.BRepPrimAPI_MakeSphere(SLANTED, 4.0, -0.5, 1.2).Shape(),
    "torus": lambda: BRepPrimAPI.BRepPrimAPI_MakeTorus(SLANTED, 7.0, 2.0).Shape(),
    "two halves": two_halves,
    "capsule": capsule,
    "bar": extruded,
    "vase": lambda: revolved([(0, 9), (0, 0), (3, 0)], bend=[(6, 3), (-2, 5), (2, 9)]),
    "bush": lambda: revolved([(4, 0), (2, 0), (2, 6)], bend=[(3, 9), (7, 2)]),
    "slanted": lambda: cut(cylinder(4.0, 5.0, SLANTED), cylinder(2.0, 5.0, SLANTED)),
}


def written(shape, path):
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
    return path


@pytest.mark.parametrize("name", TURNED)
def test_a_part_that_turns_about_an_axis(name, tmp_path):
    """The oracle of signed distances is OpenCASCADE, which measures to its own faces."""
    shape = TURNED[name]()
    made = engine.load(written(shape, tmp_path / "part.step"))
    assert isinstance(made, SolidOfRevolution)
    assert made.is_solid
    assert 1e-10 <= made.deviation < 1.1e-10  # 1e-7 mm, the tolerance of its edges
    shown = made.display_mesh(1e-4)
    low, high = 1e3 * shown.vertices.min(axis=0), 1e3 * shown.vertices.max(axis=0)
    points = np.random.default_rng(1).uniform(low - 1.0, high + 1.0, (16, 3))
    found = engine.closest_points(made, IDENTITY, 1e-3 * points, signed=True)
    for point, lower, upper in zip(points, 1e3 * found.lower, 1e3 * found.upper, strict=True):
        vertex = BRepBuilderAPI.BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
        away = BRepExtrema_DistShapeShape(vertex, shape).Value()
        side = BRepClass3d_SolidClassifier(shape, gp_Pnt(*point), 1e-9).State()
        if side == TopAbs_State.TopAbs_IN:  # OpenCASCADE measures 0 inside
            assert upper < 0.0
            away = min(BRepExtrema_DistShapeShape(vertex, face).Value() for face in faces_of(shape))
            lower, upper = -upper, -lower
        assert lower - 1e-7 <= away <= upper + 1e-7
        assert upper - lower < 1e-6


def faces_of(shape):
    from proximity_monitor.engine.files.step_faces import shapes_in

    return list(shapes_in(shape, "Face"))


def keyway():
    slot = BRepPrimAPI.BRepPrimAPI_MakeBox(gp_Pnt(4.5, -1.5, -4), gp_Pnt(8, 1.5, 4)).Shape()
    return cut(revolved(SHAFT), slot)


def elliptic():
    rim = gp_Elips(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 3.001, 3.0)
    return BRepPrimAPI.BRepPrimAPI_MakePrism(filled(rim), gp_Vec(0, 0, 4)).Shape()


def beside(x):
    return gp_Ax2(gp_Pnt(x, 0, -1), gp_Dir(0, 0, 1))


OTHERS = {
    "keyway": keyway,
    "half a turn": lambda: revolved(SHAFT, math.pi),
    "box": lambda: BRepPrimAPI.BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Shape(),
    "eccentric bore": lambda: cut(cylinder(4.0, 5.0), cylinder(2.0, 9.0, beside(1e-3))),
    "slanted bore": lambda: cut(
        cylinder(4.0, 5.0),
        cylinder(2.0, 9.0, gp_Ax2(gp_Pnt(0, 0, -1), gp_Dir(1e-4, 0, 1))),
    ),
    "two bores": lambda: cut(
        cut(cylinder(4.0, 5.0), cylinder(1.0, 9.0)), cylinder(0.5, 9.0, beside(2.5))
    ),
    "hollow": lambda: cut(sphere(4.0, 0, 0, 0), sphere(3.0, 0, 0, 0)),
    "slanted end": lambda: cut(
        cylinder(2.0, 9.0), cylinder(9.0, 9.0, gp_Ax2(gp_Pnt(0, 0, 5), gp_Dir(1e-4, 0, 1)))
    ),
    "elliptic": elliptic,
}


@pytest.mark.long
@pytest.mark.parametrize("name", OTHERS)
def test_any_other_part_stays_a_surface_of_patches(name, tmp_path):
    made = engine.load(written(OTHERS[name](), tmp_path / "part.step"))
    assert isinstance(made, engine.ParametricSurface)
    assert made.is_solid


def test_what_is_off_by_less_than_the_tolerance_counts():
    """One face is moved: the deviation tells by how much. A part off by more is refused as such."""
    faces = read_shape(revolved(SHAFT), "shaft").faces
    assert find_revolution(faces).deviation < 1e-12
    for i, face in enumerate(faces):
        for direction in np.eye(3):
            for off in (0.3e-7, 4e-7):
                control = face.net.control + off * direction
                moved = [*faces]
                moved[i] = face._replace(net=face.net._replace(control=control))
                found = find_revolution(moved)
                if off > face.tolerance:
                    assert found is None
                else:
                    assert 0.49 * off <= found.deviation <= 2.5 * off


def test_faces_that_look_to_unlike_sides_bound_nothing():
    faces = read_shape(revolved(SHAFT), "shaft").faces
    for i, face in enumerate(faces):
        net = face.net
        turned = net._replace(control=net.control[:, ::-1], weights=net.weights[:, ::-1])
        assert find_revolution([*faces[:i], face._replace(net=turned), *faces[i + 1 :]]) is None
    assert find_revolution(faces[1:]) is None
    assert find_revolution([*faces, faces[0]]) is None


@pytest.mark.long
def test_parts_of_an_assembly():
    """Parts come in their own frames, with names, places and colours as of any other part."""
    kinds = {}
    for placed in engine.load_placements(GEARBOX):
        model = engine.load(GEARBOX, part=placed.model)
        kinds[placed.name] = model.kind
        assert model.name == placed.model
    turned = {name for name, kind in kinds.items() if kind == "solid of revolution"}
    assert turned == {"bearing 1", "bearing 2", "seal 1", "seal 2"}
    bearing = engine.load(GEARBOX, part="bearing 1")
    # The bearing has a bore of 10.1 mm, is 22 mm wide and 8 mm high, rounded, with a groove.
    points = 1e-3 * np.array([[0, 0, 0], [12, 0, 4], [0, 8, 4], [8, 0, 8]])
    found = engine.closest_points(bearing, IDENTITY, points, signed=True)
    expected = [math.hypot(5.65, 0.6) - 0.6, 1.0, 0.8 - 3.6, 1.2]
    assert found.upper == pytest.approx([1e-3 * each for each in expected], abs=1e-9)


def test_how_a_single_part_is_read(tmp_path):
    """It is read where it is placed, to scale, and as a surface if it must not be a solid."""
    shift = gp_Trsf()
    shift.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 1, 0)), 0.5 * math.pi)
    shift.SetTranslationPart(gp_Vec(1, 2, 3))
    file = written(revolved(SHAFT).Moved(TopLoc_Location(shift)), tmp_path / "part.step")
    made = engine.load(file, scale=2.0, deviation=1e-3)
    assert isinstance(made, SolidOfRevolution)
    assert made.deviation == pytest.approx(1e-3 + 2e-10)
    found = engine.closest_points(made, IDENTITY, [[0.002 * (1 + 30), 0.004, 0.006]])
    assert found.upper[0] == pytest.approx(0.02 + 1e-3, abs=1e-9)
    flat = engine.load(file, solid=False)
    assert isinstance(flat, engine.ParametricSurface)
    assert not flat.is_solid
    assert engine.load(file, solid=True).is_solid
