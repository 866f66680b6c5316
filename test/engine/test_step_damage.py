"""STEP files with something lost, unclear or in another file are refused. The error names it."""

import re

import numpy as np
import pytest

from proximity_monitor import engine

pytest.importorskip("OCP", reason="needs OpenCASCADE: pip install cadquery-ocp")

from OCP.BRep import BRep_Builder
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_DocumentTool

AXES = """#9005 = CARTESIAN_POINT('',(100.,0.,0.));
#9006 = DIRECTION('',(1.,0.,0.));
#9007 = DIRECTION('',(0.,1.,0.));
#9008 = DIRECTION('',(0.,0.,-1.));
"""


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    """Return the text of an assembly: a box, a cylinder and the box again, at 0, 100, 200 mm."""
    box = BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape()
    parts = [box, BRepPrimAPI_MakeCylinder(5.0, 40.0).Shape(), box]
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    for i, part in enumerate(parts):
        shift = gp_Trsf()
        shift.SetTranslation(gp_Vec(100.0 * i, 0.0, 0.0))
        builder.Add(whole, part.Moved(TopLoc_Location(shift)))
    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).AddShape(whole, True)
    file = tmp_path_factory.mktemp("assembly") / "whole.step"
    writer = STEPCAFControl_Writer()
    writer.Transfer(document)
    writer.Write(str(file))
    return re.sub(r"\s*\n\s*(?!#|ENDSEC|DATA|HEADER|FILE|END)", "", file.read_text())


def changed(text, *pairs):
    for old, new in pairs:
        assert re.search(old, text), old
        text = re.sub(old, new, text, count=1)
    return text


def load(tmp_path, text):
    file = tmp_path / "a.step"
    file.write_text(text)
    return engine.load(file)


def added(text, statements):
    return text.replace("ENDSEC;\nEND-ISO", f"{statements}ENDSEC;\nEND-ISO")


def test_the_whole_is_read(tmp_path, text):
    points = load(tmp_path, text).control_points
    assert np.ptp(points[:, 0]) == pytest.approx(0.21)
    assert [each.pose[0, 3] for each in engine.load_placements(tmp_path / "a.step")] == [
        0.0, 0.1, 0.2,
    ]  # fmt: skip


DAMAGED = {
    "a placement": ((r"(ITEM_DEFINED_TRANSFORMATION\('','',#\d+,#)", r"\g<1>9"), "is missing"),
    "a unit": ((r"UNIT_ASSIGNED_CONTEXT\(\(#", "UNIT_ASSIGNED_CONTEXT((#99"), "is missing"),
    "a loop": ((r"FACE_BOUND\('',#", "FACE_BOUND('',#99"), "is missing"),
    "no unit": ((r"UNIT_ASSIGNED_CONTEXT\(\(#\d+,", "UNIT_ASSIGNED_CONTEXT(("), "no units of len"),
    "no angle": (
        (r"(ADVANCED_BREP[\s\S]*?UNIT_ASSIGNED_CONTEXT\(\(#\d+),#\d+", r"\1"),
        "no units of angle",
    ),
    "twice": ((r"#2 = ", "#1 = "), "#1 is defined twice"),
    "parameters": ((r"(#\d+) = PLANE\('',", r"\1 = PLANE("), r"#\d+ is damaged: "),
    "another type": (
        (r"ITEM_DEFINED_TRANSFORMATION\('','',#\d+", "ITEM_DEFINED_TRANSFORMATION('','',#2"),
        r"#\d+ is damaged: .*type",
    ),
    "an occurrence": (
        (r"= CONTEXT_DEPENDENT_SHAPE_REPRESENTATION\([^;]*", "= CARTESIAN_POINT('',(0.,0.,0.))"),
        r"part '.*': its occurrence .* has no placement",
    ),
    "a face of another kind": (
        (r"ADVANCED_FACE\('',\(#\d+\),#\d+", "FACE_SURFACE('',(#11),#11"), "is damaged",
    ),
    "a solid": (
        (r"= MANIFOLD_SOLID_BREP\('',#\d+\)", "= BLOCK('',#11,1.,1.,1.)"),
        r"part '.*': BLOCK \(#\d+\) has no faces",
    ),
    "a shell": (
        (r"= MANIFOLD_SOLID_BREP\('',#\d+\)", "= CARTESIAN_POINT('',(0.,0.,0.))"),
        "9 faces, but OpenCASCADE read only",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_what_is_lost_is_refused(tmp_path, text, name):
    pair, why = DAMAGED[name]
    with pytest.raises(engine.ModelError, match=why):
        load(tmp_path, changed(text, pair))
    with pytest.raises(engine.ModelError, match=why):
        engine.load_placements(tmp_path / "a.step")


def test_two_units_of_length_are_refused(tmp_path, text):
    metre = "#9000 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.) );\n"
    two = (r"UNIT_ASSIGNED_CONTEXT\(\(#", "UNIT_ASSIGNED_CONTEXT((#9000,#")
    with pytest.raises(engine.ModelError, match="2 units of length"):
        load(tmp_path, added(changed(text, two), metre))


def test_a_unit_that_names_itself_is_refused(tmp_path, text):
    ring = "#9000 = ( CONVERSION_BASED_UNIT('RING',#9000) LENGTH_UNIT() NAMED_UNIT(*) );\n"
    two = (r"UNIT_ASSIGNED_CONTEXT\(\(#", "UNIT_ASSIGNED_CONTEXT((#9000,#")
    with pytest.raises(engine.ModelError, match="2 units of length"):
        load(tmp_path, added(changed(text, two), ring))


def test_parts_in_other_files_are_refused(tmp_path, text):
    other = "#9000 = DOCUMENT_FILE('wheel.stp','',$,#9001,'',$);\n#9001 = DOCUMENT_TYPE('');\n"
    with pytest.raises(engine.ModelError, match=r"another file, 'wheel\.stp'.*one file"):
        load(tmp_path, added(text, other))
    assert (
        load(tmp_path, added(text, other.replace("stp", "pdf"))).is_solid
        == load(tmp_path, text).is_solid
    )
    anchors = "REFERENCE;\n#9000=<wheel.stp#1>;\nENDSEC;\nDATA;"
    with pytest.raises(engine.ModelError, match="other files: save it as one file"):
        load(tmp_path, text.replace("DATA;", anchors, 1))


@pytest.mark.parametrize("documented", [False, True])
def test_a_part_that_has_a_document_in_place_of_a_shape_is_refused(tmp_path, text, documented):
    """The document's file name may tell nothing. A part with neither shape nor document is valid.

    Such a part is empty, as planners leave some.
    """
    whole = re.search(
        r"#\d+ = NEXT_ASSEMBLY_USAGE_OCCURRENCE\('[^']*','[^']*','[^']*',(#\d+)", text
    )[1]
    definition = re.search(r"= PRODUCT_DEFINITION\('design','',(#\d+),(#\d+)\)", text)
    wheel = (
        "#9000 = PRODUCT('wheel','wheel','',());\n"
        "#9001 = PRODUCT_DEFINITION_FORMATION('','',#9000);\n"
        f"#9002 = PRODUCT_DEFINITION('design','',#9001,{definition[2]});\n"
        f"#9003 = NEXT_ASSEMBLY_USAGE_OCCURRENCE('9','wheel','',{whole},#9002,$);\n"
        "#9004 = DOCUMENT_FILE('WHEEL-7','',$,#9005,'',$);\n#9005 = DOCUMENT_TYPE('');\n"
    )
    if documented:
        file = added(text, wheel + "#9006 = APPLIED_DOCUMENT_REFERENCE(#9004,'',(#9002));\n")
        with pytest.raises(engine.ModelError, match="part 'wheel' has a document instead of a"):
            load(tmp_path, file)
    else:
        assert len(load(tmp_path, added(text, wheel)).nets) == 15


HARMLESS = {
    "a document's number": "#9000 = DOCUMENT_FILE('DOC-00123','',$,#9001,'',$);\n"
    "#9001 = DOCUMENT_TYPE('');\n",
    "a standard": "#9000 = DOCUMENT_FILE('MIL-STD-171','finish',$,#9001,'',$);\n"
    "#9001 = DOCUMENT_TYPE('specification');\n",
    "its own name": "#9000 = DOCUMENT_FILE('C:\\\\parts\\\\A.step','',$,#9001,'',$);\n"
    "#9001 = DOCUMENT_TYPE('');\n",
    "a property": "#9000 = PROPERTY_DEFINITION('pmi','',#9999);\n",
}


@pytest.mark.parametrize("name", HARMLESS)
def test_what_belongs_to_no_shape_is_not_checked(tmp_path, text, name):
    assert len(load(tmp_path, added(text, HARMLESS[name])).nets) == 15


def test_a_plane_beside_a_solid_is_left_out(tmp_path, text):
    beside = (r"(ADVANCED_BREP_SHAPE_REPRESENTATION\('',\()(#\d+)", r"\1\2,#9000")
    where = re.search(beside[0], text)[2]
    changed_text = added(changed(text, beside), f"#9000 = PLANE('',{where});\n")
    assert len(load(tmp_path, changed_text).nets) == 15


def test_only_what_bounds_something_needs_units(tmp_path, text):
    length = re.search(r"UNIT_ASSIGNED_CONTEXT\(\((#\d+)", text)[1]
    solid, place = re.search(
        r"(#\d+) = ADVANCED_BREP_SHAPE_REPRESENTATION\('',\((#\d+)", text
    ).groups()
    wires = (
        f"#9000 = GEOMETRICALLY_BOUNDED_WIREFRAME_SHAPE_REPRESENTATION('',({place}),#9001);\n"
        "#9001 = ( GEOMETRIC_REPRESENTATION_CONTEXT(3) "
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length})) REPRESENTATION_CONTEXT('','') );\n"
        f"#9002 = SHAPE_REPRESENTATION_RELATIONSHIP('','',{solid},#9000);\n"
    )
    assert len(load(tmp_path, added(text, wires)).nets) == 15


def test_the_same_unit_may_be_stated_twice(tmp_path, text):
    again = "#9000 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );\n"
    two = (r"UNIT_ASSIGNED_CONTEXT\(\(#", "UNIT_ASSIGNED_CONTEXT((#9000,#")
    assert np.ptp(load(tmp_path, added(changed(text, two), again)).control_points[:, 0]) == (
        pytest.approx(0.21)
    )


def test_a_bare_surface_is_named(tmp_path, text):
    surface = (
        "#9000 = GEOMETRIC_SET('',(#9001));\n"
        "#9001 = B_SPLINE_SURFACE_WITH_KNOTS('',1,1,((#9005,#9006),(#9007,#9008)),.UNSPECIFIED.,"
        ".F.,.F.,.F.,(2,2),(2,2),(0.,1.),(0.,1.),.UNSPECIFIED.);\n"
        + "".join(
            f"#{9005 + i} = CARTESIAN_POINT('',({10 * (i // 2)}.,{10 * (i % 2)}.,0.));\n"
            for i in range(4)
        )
    )
    beside = (r"(ADVANCED_BREP_SHAPE_REPRESENTATION\('',\(#\d+)", r"\1,#9000")
    with pytest.raises(engine.ModelError, match=r"GEOMETRIC_SET \(#9000\) has no faces with edges"):
        load(tmp_path, added(changed(text, beside), surface))


def test_a_mirrored_part_is_refused(tmp_path, text):
    """OpenCASCADE would turn the mirroring into a rotation."""
    operator = "#9001 = CARTESIAN_TRANSFORMATION_OPERATOR_3D('','','',{},#9005,1.,{});\n" + AXES
    place = r"ITEM_DEFINED_TRANSFORMATION\([^;]*;"
    replaced = changed(text, (rf"(#\d+) = {place}", r"\1 = DIRECTION('',(0.,0.,1.));"))
    where = re.search(rf"(#\d+) = {place}", text)[1]
    replaced = replaced.replace(f"TRANSFORMATION({where})", "TRANSFORMATION(#9001)")
    with pytest.raises(engine.ModelError, match=r"#9001 mirrors a part"):
        load(tmp_path, added(replaced, operator.format("#9006,#9007", "#9008")))
    with pytest.raises(engine.ModelError, match=r"#9001: this form"):
        load(tmp_path, added(replaced, operator.replace("'','','',", "'',").format("$,$", "$")))
    points = load(tmp_path, added(replaced, operator.format("#9006,#9007", "$"))).control_points
    assert np.ptp(points[:, 0]) == pytest.approx(0.115)


def test_tessellated_faces_are_named(tmp_path, text):
    shell = (
        "#9000 = TESSELLATED_SHELL('',(#9001),$);\n"
        "#9001 = TRIANGULATED_FACE('',#9002,3,((0.,0.,1.)),$,(1,2,3),((1,2,3)));\n"
        "#9002 = COORDINATES_LIST('',3,((0.,0.,0.),(10.,0.,0.),(10.,10.,0.)));\n"
    )
    beside = (r"(ADVANCED_BREP_SHAPE_REPRESENTATION\('',\(#\d+)", r"\1,#9000")
    with pytest.raises(engine.ModelError, match=r"TESSELLATED_SHELL \(#9000\) has no faces"):
        load(tmp_path, added(changed(text, beside), shell))


def test_strings_and_comments_are_no_statements(tmp_path, text):
    words = (
        r"PRODUCT\('[^']*'",
        "/* #9999; ADVANCED_FACE( */ PRODUCT('#9999; it''s ADVANCED_FACE('",
    )
    assert len(load(tmp_path, changed(text, words)).nets) == 15


def test_a_part_may_have_a_number_for_its_name(tmp_path, text):
    names = [(r"PRODUCT\('[^']*','[^'\d][^']*'", f"PRODUCT('{n}','{n}'") for n in (1, 2, 3)]
    load(tmp_path, changed(text, *names))
    placed = engine.load_placements(tmp_path / "a.step")
    assert {each.name for each in placed} <= {"1", "2", "3", "2 2", "3 2"}


def test_settings_of_others_neither_count_nor_change(tmp_path, text):
    others = {"xstep.cascade.unit": "M", "read.step.assembly.level": "assembly"}
    before = {key: Interface_Static.CVal_s(key) for key in others}
    try:
        for key, value in others.items():
            assert Interface_Static.SetCVal_s(key, value)
        points = load(tmp_path, text).control_points
        assert np.ptp(points[:, 0]) == pytest.approx(0.21)
        assert {key: Interface_Static.CVal_s(key) for key in others} == others
    finally:
        for key, value in before.items():
            Interface_Static.SetCVal_s(key, value)
