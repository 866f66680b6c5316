"""What `signed_distance` refuses, and how it says so."""

from __future__ import annotations

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, sphere

from proximity_monitor import engine
from proximity_monitor.engine.kernels.solids import unpaired_edges
from proximity_monitor.engine.solid import as_solid


def test_a_solid_is_checked_once():
    model = box()
    assert as_solid(model) is as_solid(model)


def as_soup(mesh):
    """The same triangles, none of which share a vertex."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    return engine.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3), name="soup")


def test_a_refit_keeps_what_was_found_of_the_edges():
    for model in (box(), as_soup(box())):
        before = as_solid(model)
        model.refit(2.0 * model.vertices + 1.0)
        after = as_solid(model)
        assert after.owned is before.owned
        assert after.samples is before.samples
        assert after.ball == pytest.approx([1.0, 1.0, 1.0, 2.0 * before.ball[3]])


def test_a_refit_that_tears_vertices_apart_is_noticed():
    model = as_soup(CUBE)
    as_solid(model)
    torn = model.vertices.copy()
    torn[0] += 0.1
    model.refit(torn)
    with pytest.raises(engine.ModelError, match="soup: no solid: not watertight: 4 open edges"):
        as_solid(model)
    model.refit(as_soup(CUBE).vertices)
    assert len(as_solid(model).samples) == 1


def test_a_refit_that_tears_parts_apart_leaves_a_solid():
    """Two boxes that had a vertex in common: one part before, two after."""
    corner = CUBE.vertices[0]
    vertices = np.concatenate((CUBE.vertices, 2.0 * corner - CUBE.vertices))
    faces = np.concatenate((CUBE.faces, CUBE.faces[:, ::-1] + 8))
    model = engine.TriangleMesh(vertices, faces)
    assert len(as_solid(model).samples) == 1
    model.refit(np.concatenate((CUBE.vertices, 3.0 * corner - CUBE.vertices)))
    assert len(as_solid(model).samples) == 2


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
        found = unpaired_edges(faces, count)
        assert found[:3] == (len(proper), len(odd), len(unlike))
        for edges, first in zip((odd, unlike), found[3].tolist(), strict=True):
            assert not edges or tuple(first) == edges[0]


def test_a_curved_sheet_of_two_sides_encloses_nothing():
    """Whatever the rounding of a long sum: half a sphere, and the same half turned inside out."""
    ball = sphere(5)
    half = ball.faces[(ball.vertices[ball.faces][:, :, 2] > 0.0).all(axis=1)]
    vertices = ball.vertices + np.array((1.0 / 3.0, 0.1, 1e3))
    sheet = engine.TriangleMesh(vertices, np.concatenate((half, half[::-1, ::-1])), name="sheet")
    with pytest.raises(engine.ModelError, match="sheet: no solid: it encloses no volume"):
        as_solid(sheet)


CUBE = box((1.0, 1.0, 1.0))
REFUSED = {
    "open": (CUBE.vertices, CUBE.faces[1:], r"not watertight: 3 open edges .* between"),
    "one face turned": (
        CUBE.vertices,
        np.concatenate((CUBE.faces[:1, ::-1], CUBE.faces[1:])),
        r"unlike orientation at 3 edges, the first between",
    ),
    "flat": (CUBE.vertices, [CUBE.faces[0], CUBE.faces[0][::-1]], r"encloses no volume"),
    "points": (CUBE.vertices, [[0, 0, 0]], r"none of its faces has an area"),
    "a fin": (CUBE.vertices, np.concatenate((CUBE.faces, [[0, 1, 7]])), r"open edges"),
}


@pytest.mark.parametrize("vertices, faces, message", REFUSED.values(), ids=REFUSED)
def test_what_is_no_solid_is_refused_by_name(vertices, faces, message):
    surface = engine.TriangleMesh(vertices, faces, name="bracket")
    for first, second in ((surface, CUBE), (CUBE, surface)):
        with pytest.raises(engine.ModelError, match=f"^bracket: no solid: .*{message}"):
            engine.signed_distance(first, IDENTITY, second, IDENTITY)
    with pytest.raises(engine.ModelError, match=r"`distance`, which takes any surface$"):
        engine.signed_distance(surface, IDENTITY, CUBE, IDENTITY)


def test_a_rotated_flat_sheet_is_refused():
    matrix = pose(np.random.default_rng(6), 100.0)
    corners = box((1.0, 1.0, 0.3)).vertices[:3] @ matrix[:3, :3].T + matrix[:3, 3]
    sheet = engine.TriangleMesh(corners, [[0, 1, 2], [2, 1, 0]], name="sheet")
    with pytest.raises(engine.ModelError, match="no volume"):
        engine.signed_distance(sheet, IDENTITY, CUBE, IDENTITY)


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
