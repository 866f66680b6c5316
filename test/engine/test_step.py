"""STEP files against OpenCASCADE itself: faces, trims, names, places, colours, refusals."""

import math
from pathlib import Path

import numpy as np
import pytest
from ball_oracle import winding_numbers

from proximity_monitor import engine
from proximity_monitor.engine.kernels.surface.trim import INSIDE
from proximity_monitor.engine.kernels.surface.trim_entries import (
    classify_points,
    nearest_trim_points,
)
from proximity_monitor.engine.models.patch import Patch
from proximity_monitor.engine.models.trim import joined

pytest.importorskip("OCP", reason="needs OpenCASCADE: pip install cadquery-ocp")

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepClass import BRepClass_FaceClassifier
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.Geom import Geom_OffsetSurface, Geom_SphericalSurface
from OCP.gp import gp_Ax3, gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TopAbs import TopAbs_State
from OCP.TopoDS import TopoDS_Compound

from proximity_monitor.engine.files import step_parts
from proximity_monitor.engine.files.step_faces import cast, read_face, shapes_in

GEARBOX = Path(engine.__file__).parents[1] / "scene/bundled/gearbox/models/gearbox.step"
GRID = 60


@pytest.fixture(scope="module")
def faces():
    """Return each face of the gearbox's parts: OpenCASCADE's and ours."""
    found = []

    def keep(shape, name):
        for face in shapes_in(shape, "Face"):
            found.append((face, read_face(face)))
        return whole(shape, name)

    whole = step_parts.read_shape
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(step_parts, "read_shape", keep)
        step_parts.read_parts(GEARBOX)
    return found


def patch_of(face):
    net = face.net
    return Patch(net.control, net.knots_u, net.knots_v, net.weights, trim=face.trim)


def sides(patch, parameters):
    """Return for each point whether the trim leaves it: INSIDE and so on."""
    made = np.full(len(parameters), INSIDE, np.int8)
    if patch.trim is not None:
        classify_points(joined([patch.trim]), 0, parameters, made)
    return made


def cells(patch):
    """Return a point (n, 2) of each cell of a grid on each span, and the area of each cell.

    It is the cell's middle. On a trimmed patch it is random, because a straight loop along a row of
    middles would count the whole row wrongly.
    """
    middles, widths = [], []
    for along in patch.nets[0].spans:
        steps = max(8, GRID // len(along.low))
        share = (np.arange(steps) + 0.5) / steps
        middles.append((along.low[:, None] + (along.high - along.low)[:, None] * share).ravel())
        widths.append(np.repeat((along.high - along.low) / steps, steps))
    u, v = (each.ravel() for each in np.meshgrid(*middles, indexing="ij"))
    if patch.trim is not None:
        aside = np.random.default_rng(7).uniform(-0.5, 0.5, (2, len(u)))
        u = u + np.repeat(widths[0], len(widths[1])) * aside[0]
        v = v + np.tile(widths[1], len(widths[0])) * aside[1]
    first = patch.derivatives(u, v, 1)
    lengths = np.linalg.norm(np.cross(first[:, 1, 0], first[:, 0, 1]), axis=1)
    return np.column_stack([u, v]), lengths * np.outer(*widths).ravel()


@pytest.mark.long
def test_each_face_has_the_area_that_opencascade_measures(faces):
    trimmed = 0
    for theirs, ours in faces:
        patch = patch_of(ours)
        parameters, areas = cells(patch)
        measured = GProp_GProps()
        BRepGProp.SurfaceProperties_s(theirs, measured, 1e-6)
        left = areas[sides(patch, parameters) == INSIDE].sum()
        # A cell that a loop passes through counts as a whole or not at all, at random.
        slack = 4e-4 if ours.trim is None else 0.5 / GRID
        assert left == pytest.approx(measured.Mass(), abs=slack * areas.sum())
        trimmed += ours.trim is not None
    assert trimmed > 50


@pytest.mark.long
def test_points_lie_on_the_face_where_its_classifier_says(faces):
    random = np.random.default_rng(5)
    kinds = set()
    for theirs, ours in faces:
        patch = patch_of(ours)
        (low_u, high_u), (low_v, high_v) = patch.domain
        parameters = random.uniform((low_u, low_v), (high_u, high_v), (12, 2))
        found = sides(patch, parameters)
        surface = BRep_Tool.Surface_s(cast(theirs, "Face"))
        kinds.add(type(surface).__name__)
        for place, side, point in zip(
            parameters, found, patch.evaluate(*parameters.T), strict=True
        ):
            judge = BRepClass_FaceClassifier(cast(theirs, "Face"), gp_Pnt(*point), 1e-6)
            if judge.State() != TopAbs_State.TopAbs_ON:
                assert (judge.State() == TopAbs_State.TopAbs_IN) == (side == INSIDE), place
    assert len(kinds) >= 7, kinds


def test_points_of_loops_lie_on_edges(faces):
    random = np.random.default_rng(6)
    for theirs, ours in faces:
        if ours.trim is None:
            continue
        patch = patch_of(ours)
        (low_u, high_u), (low_v, high_v) = patch.domain
        parameters = random.uniform((low_u, low_v), (high_u, high_v), (5, 2))
        nearest = np.empty_like(parameters)
        assert nearest_trim_points(joined([patch.trim]), 0, parameters, 1.0, 1.0, nearest)
        for point in patch.evaluate(*nearest.T):
            judge = BRepClass_FaceClassifier(cast(theirs, "Face"), gp_Pnt(*point), 1e-5)
            assert judge.State() == TopAbs_State.TopAbs_ON


def test_normals_of_solids_point_outward(faces):
    """The flux of x through a closed surface is its volume, positive if normals point outward."""
    volume = 0.0
    for _, ours in faces[:53]:  # the housing
        patch = patch_of(ours)
        parameters, _ = cells(patch)
        left = parameters[sides(patch, parameters) == INSIDE]
        first = patch.derivatives(*left.T, 1)
        flux = first[:, 0, 0] * np.cross(first[:, 1, 0], first[:, 0, 1])
        volume += flux.sum() / len(parameters) * math.prod(h - low for low, h in patch.domain)
    assert volume > 0.0


@pytest.mark.long
def test_parts_have_names_places_and_colours():
    placed = {each.name: each for each in engine.load_placements(GEARBOX)}
    assert list(placed) == [
        "housing", "cover", "pinion", "wheel", "input shaft", "output shaft", "bearing 1",
        "bearing 2", "seal 1", "seal 2", "knob", "bolt 1", "bolt 2", "bolt 3", "bolt 4",
        "bolt 5", "bolt 6", "bolt 7", "bolt 8",
    ]  # fmt: skip
    assert placed["pinion"].colour == pytest.approx((0.85, 0.65, 0.20, 1.0), abs=1e-6)
    assert placed["bolt 3"].model == "bolt 1"
    assert placed["bolt 3"].pose[:3, 3] == pytest.approx([0.066, 0.03, 0.0203])
    turn = placed["bolt 3"].pose[:3, :3]
    assert turn[0] == pytest.approx([math.cos(math.pi / 4), -math.sin(math.pi / 4), 0.0])


def test_a_part_comes_in_its_own_frame_and_the_whole_as_placed():
    ring = engine.load(GEARBOX, part="seal 1")
    assert ring.name == "seal 1"
    assert ring.centre == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    # A torus of radii 7.2 and 1.4 mm: its box is 17.2 mm wide and 2.8 mm high.
    points = ring.display_mesh(1e-6).vertices
    assert np.ptp(points, axis=0) == pytest.approx([0.0172, 0.0172, 0.0028], rel=1e-3)
    assert 1e-10 <= ring.deviation < 1.1e-10  # 1e-7 mm, the tolerance of its edges
    whole = engine.load(GEARBOX)
    count = len(engine.load(GEARBOX, part="bolt 1").nets)
    assert len(whole.nets) == 544
    bolt = whole.nets[-count:]
    assert np.vstack([net.points for net in bolt])[:, :2].mean(axis=0) == pytest.approx(
        [-0.025, 0.010], abs=1e-3
    )


def written(shape, path):
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
    return path


def test_what_cannot_be_honoured_is_refused_by_name(tmp_path):
    ball = Geom_SphericalSurface(gp_Ax3(), 10.0)
    face = BRepBuilderAPI_MakeFace(Geom_OffsetSurface(ball, 1.0), 0.1, 1.0, 0.1, 1.0, 1e-6).Face()
    shape, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(shape)
    builder.Add(shape, BRepPrimAPI_MakeBox(1.0, 1.0, 1.0).Shape())
    builder.Add(shape, face)
    with pytest.raises(engine.ModelError, match=r"part .*: face \d+, offset: this type"):
        step_error(shape)


def step_error(shape):
    try:
        step_parts.read_shape(shape, "cap")
    except step_parts.FormatError as error:
        raise engine.ModelError(str(error)) from None


def test_units_are_those_of_the_file(tmp_path):
    before = Interface_Static.CVal_s("write.step.unit")
    try:
        for unit in ("MM", "INCH", "M"):
            Interface_Static.SetCVal_s("write.step.unit", unit)
            file = written(BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape(), tmp_path / f"{unit}.stp")
            points = engine.load(file, scale=2.0).control_points
            assert np.ptp(points, axis=0) == pytest.approx([0.02, 0.04, 0.06], rel=1e-12)
    finally:
        Interface_Static.SetCVal_s("write.step.unit", before)


def test_damaged_files_are_refused(tmp_path):
    text = GEARBOX.read_bytes()
    for name, data, why in (
        ("cut.step", text[: len(text) // 2], "truncated"),
        ("other.step", b"solid x\nendsolid x\n", "not a STEP file"),
        ("lost.step", text.replace(b"PLANE('',#", b"PLANE('',#9999", 3), "which is missing"),
        ("none.step", b"ISO-10303-21;\nEND-ISO-10303-21;\n", "cannot read"),
    ):
        file = tmp_path / name
        file.write_bytes(data)
        with pytest.raises(engine.ModelError, match=why) as caught:
            engine.load(file)
        assert str(file) in str(caught.value)


def test_other_files_have_no_parts(tmp_path):
    file = tmp_path / "a.stl"
    file.write_bytes(b"solid a\nendsolid a\n")
    with pytest.raises(engine.ModelError, match="no parts"):
        engine.load(file, part="a")
    assert engine.load_placements(file) == []
    with pytest.raises(engine.ModelError, match="no such part; the file has 'housing'"):
        engine.load(GEARBOX, part="lid")


@pytest.mark.long
def test_parts_that_close_up_are_solids():
    random = np.random.default_rng(2)
    shapes = {each.model for each in engine.load_placements(GEARBOX)}
    assert len(shapes) == 10
    for name in sorted(shapes):
        part = engine.load(GEARBOX, part=name)
        assert part.is_solid, part.not_solid
        assert part._hierarchy.joints.gap < 1e-6
        corners = part.display_mesh(3e-4).corners()
        near = corners[random.integers(len(corners), size=20)].mean(axis=1)
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        points = np.concatenate(
            (random.uniform(low, high, (40, 3)), near + 2e-3 * random.normal(size=(20, 3)))
        )
        found = engine.closest_points(part, np.eye(4), points, signed=True)
        far = engine.closest_points(part, np.eye(4), points).lower > 5e-4
        inside = np.abs(winding_numbers(points[far], corners)) > 0.5
        assert far.sum() > 25
        assert (found.upper[far][inside] < 0.0).all()
        assert (found.lower[far][~inside] > 0.0).all()


@pytest.mark.long
def test_how_deep_parts_are_pushed_into_each_other_is_that_of_their_meshes():
    error = 3e-4
    parts = {
        name: engine.load(GEARBOX, part=name)
        for name in ("bolt 1", "input shaft", "bearing 1", "seal 1", "wheel")
    }
    meshes = {}
    for name, part in parts.items():
        shown = part.display_mesh(error)
        meshes[name] = engine.TriangleMesh(
            shown.vertices, shown.welded(), deviation=error, solid="robust"
        )
    deep = 0
    for a, b, place in (
        ("bolt 1", "bolt 1", (0.004, 0.002, 0.003)),
        ("input shaft", "bearing 1", (0.006, 0.0, 0.01)),
        ("wheel", "seal 1", (0.03, 0.0, 0.0)),
        ("input shaft", "bolt 1", (0.03, 0.0, 0.0)),
    ):
        at = np.eye(4)
        at[:3, 3] = place
        found = engine.signed_distance(parts[a], np.eye(4), parts[b], at, depth_err=0.05)
        other = engine.signed_distance(
            meshes[a], np.eye(4), meshes[b], at, depth_err=0.1, budget_s=0.5
        )
        assert found.lower <= other.upper + 1e-12
        assert other.lower <= found.upper + 1e-12
        deep += found.upper < 0.0
    assert deep >= 3


def test_a_part_that_is_open_stays_a_surface_and_says_why(tmp_path):
    box = BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape()
    lid, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(lid)
    for face in list(shapes_in(box, "Face"))[1:]:
        builder.Add(lid, face)
    assert engine.load(written(box, tmp_path / "box.step")).is_solid
    part = engine.load(written(lid, tmp_path / "open.step"))
    assert not part.is_solid
    assert "4 open edges" in part.not_solid
    with pytest.raises(engine.ModelError, match=r"open\.step: not a solid: .* 4 open edges"):
        engine.load(tmp_path / "open.step", solid=True)


def test_flat_sides_in_one_plane_are_divided_in_turns():
    """Formerly, one of two flat cells was divided without end, chosen by rounding in its bend."""
    poses = []
    for at, angle in ((0.0, 1.1309733552923258), (0.0352, -0.5728786603615185)):
        pose = np.eye(4)
        c, s = np.cos(angle), np.sin(angle)
        pose[:2, :2], pose[[0, 2], 3] = [[c, -s], [s, c]], (at, -0.005)
        poses.append(pose)
    pinion, wheel = (engine.load(GEARBOX, part=part) for part in ("pinion", "wheel"))
    found = engine.distance(pinion, poses[0], wheel, poses[1], rel_err=0.1, budget_s=20.0)
    assert found.status is engine.Status.WITHIN_TOLERANCE
    assert found.bound_tests < 60_000
