"""What `signed_distance` refuses, and how it says so."""

from __future__ import annotations

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose

from proximity_monitor import engine
from proximity_monitor.engine.solid import as_solid


def test_a_solid_is_checked_once():
    model = box()
    assert as_solid(model) is as_solid(model)


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
