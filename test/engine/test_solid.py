"""Which meshes are solids, and why the others are not."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import trimesh
from engine_bodies import IDENTITY, box, pose, sphere

from proximity_monitor import engine
from proximity_monitor.engine.kernels.inside.solids import unpaired_edges
from proximity_monitor.engine.models.solid import sides_of


def test_a_solid_is_checked_once():
    model = box()
    assert sides_of(model) is sides_of(model)


def as_soup(mesh, solid=None):
    """Return the same triangles, with no vertex in common."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return engine.TriangleMesh(corners, faces, name="soup", solid=solid)


def test_a_refit_keeps_what_was_found_of_the_edges():
    for model in (box(), as_soup(box())):
        before = sides_of(model).region
        model.deform(2.0 * model.vertices + 1.0)
        after = sides_of(model).region
        assert after.samples is before.samples
        assert after.ball == pytest.approx([1.0, 1.0, 1.0, 2.0 * before.ball[3]])


def test_a_refit_that_tears_vertices_apart_is_noticed():
    model, must_be = as_soup(CUBE), as_soup(CUBE, solid=True)
    torn = model.vertices.copy()
    torn[0] += 0.1
    assert model.is_solid
    model.deform(torn)
    assert model.not_solid.startswith("not watertight: 4 open edges")
    with pytest.raises(engine.ModelError, match="soup: not a solid: not watertight: 4 open edges"):
        must_be.deform(torn)
    assert np.array_equal(must_be.vertices, as_soup(CUBE).vertices)
    assert must_be.is_solid
    model.deform(as_soup(CUBE).vertices)
    assert len(sides_of(model).region.samples) == 1
    assert model.is_solid


def test_a_refit_that_tears_parts_apart_leaves_a_solid():
    """Two boxes have a vertex in common. They are one part before the refit and two after it."""
    corner = CUBE.vertices[0]
    vertices = np.concatenate((CUBE.vertices, 2.0 * corner - CUBE.vertices))
    faces = np.concatenate((CUBE.faces, CUBE.faces[:, ::-1] + 8))
    model = engine.TriangleMesh(vertices, faces)
    assert len(sides_of(model).region.samples) == 1
    model.deform(np.concatenate((CUBE.vertices, 3.0 * corner - CUBE.vertices)))
    assert len(sides_of(model).region.samples) == 2


def test_unpaired_edges_against_a_count_of_all():
    rng = np.random.default_rng(2)
    for count, m in ((3, 1), (4, 10), (6, 200), (40, 60), (500, 40)):
        faces = rng.integers(0, count, (m, 3)).astype(np.int32)
        proper = [face for face in faces.tolist() if len(set(face)) == 3]
        passed = [(face[i], face[(i + 1) % 3]) for face in proper for i in range(3)]
        uses = {}
        for i, j in passed:
            uses.setdefault((min(i, j), max(i, j)), []).append(i < j)
        odd = sorted(edge for edge, ways in uses.items() if len(ways) % 2)
        unlike = sorted(
            edge for edge, ways in uses.items() if len(ways) % 2 == 0 and 2 * sum(ways) != len(ways)
        )
        vertices = rng.normal(size=(count, 3))
        found = unpaired_edges(faces, vertices)
        rim = sum(
            abs(2 * sum(ways) - len(ways)) * np.linalg.norm(vertices[i] - vertices[j])
            for (i, j), ways in uses.items()
        )
        assert found[4] == pytest.approx(rim)
        assert found[:3] == (len(proper), len(odd), len(unlike))
        for edges, first in zip((odd, unlike), found[3].tolist(), strict=True):
            assert not edges or tuple(first) == edges[0]


def test_a_curved_sheet_of_two_sides_encloses_nothing():
    """Half a sphere and the same half inside out: a long sum's rounding must not matter."""
    ball = sphere(5)
    half = ball.faces[(ball.vertices[ball.faces][:, :, 2] > 0.0).all(axis=1)]
    vertices = ball.vertices + np.array((1.0 / 3.0, 0.1, 1e3))
    sheet = engine.TriangleMesh(vertices, np.concatenate((half, half[::-1, ::-1])), name="sheet")
    assert sheet.not_solid == "it encloses no volume"


CUBE = box((1.0, 1.0, 1.0))
REFUSED = {
    "open": (CUBE.vertices, CUBE.faces[1:], r"not watertight: 3 open edges .* between"),
    "one face turned": (
        CUBE.vertices,
        np.concatenate((CUBE.faces[:1, ::-1], CUBE.faces[1:])),
        r"opposite orientations at 3 edges, the first between",
    ),
    "flat": (CUBE.vertices, [CUBE.faces[0], CUBE.faces[0][::-1]], r"encloses no volume"),
    "points": (CUBE.vertices, [[0, 0, 0]], r"none of its faces has an area"),
    "a fin": (CUBE.vertices, np.concatenate((CUBE.faces, [[0, 1, 7]])), r"open edges"),
}


@pytest.mark.parametrize("vertices, faces, message", REFUSED.values(), ids=REFUSED)
def test_what_is_no_solid_is_a_surface_and_says_why(vertices, faces, message):
    surface = engine.TriangleMesh(vertices, faces, name="bracket")
    assert not surface.is_solid
    assert re.search(message, surface.not_solid)
    with pytest.raises(engine.ModelError, match=f"^bracket: not a solid: .*{message}.*'robust'"):
        engine.TriangleMesh(vertices, faces, name="bracket", solid=True)


def test_a_surface_is_one_because_it_is_told_so():
    told = engine.TriangleMesh(CUBE.vertices, CUBE.faces, solid=False)
    assert not told.is_solid
    assert told.not_solid == "it is declared a surface (solid=False)"
    assert CUBE.is_solid
    assert CUBE.not_solid == ""


@pytest.mark.parametrize("solid", ["yes", 1, "Robust", 0.5])
def test_what_solid_may_not_be(solid):
    with pytest.raises(
        engine.ModelError, match=r"solid = .*: must be True, False, 'robust' or None"
    ):
        engine.TriangleMesh(CUBE.vertices, CUBE.faces, solid=solid)


def test_a_file_says_the_same(tmp_path):
    path = tmp_path / "open.stl"
    trimesh.Trimesh(CUBE.vertices, CUBE.faces[1:]).export(path)
    assert not engine.load(path).is_solid
    assert engine.load(path, solid="robust").is_solid
    with pytest.raises(
        engine.ModelError, match=r"open.stl: not a solid: not watertight: 3 open edges"
    ):
        engine.load(path, solid=True)


def test_robust_makes_no_difference_to_what_is_watertight():
    robust = engine.TriangleMesh(CUBE.vertices, CUBE.faces, solid="robust")
    assert sides_of(robust).region.inside == sides_of(CUBE).region.inside
    points = engine.TriangleMesh(CUBE.vertices, [[0, 0, 0]], solid="robust")
    assert points.not_solid == "none of its faces has an area"


def test_a_rotated_flat_sheet_is_no_solid():
    matrix = pose(np.random.default_rng(6), 100.0)
    corners = box((1.0, 1.0, 0.3)).vertices[:3] @ matrix[:3, :3].T + matrix[:3, 3]
    sheet = engine.TriangleMesh(corners, [[0, 1, 2], [2, 1, 0]], name="sheet")
    assert sheet.not_solid == "it encloses no volume"


@pytest.mark.parametrize(
    "options, name",
    [({"rel_err": -1.0}, "rel_err"), ({"abs_err": math.nan}, "abs_err"), ({"budget_s": -1.0}, "b")],
)
def test_bad_arguments_are_refused(options, name):
    with pytest.raises(ValueError, match=name):
        engine.signed_distance(CUBE, IDENTITY, CUBE, IDENTITY, **options)


def test_bad_poses_are_refused():
    with pytest.raises(ValueError, match="pose_b"):
        engine.signed_distance(CUBE, IDENTITY, CUBE, 2.0 * IDENTITY)
