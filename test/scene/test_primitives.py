"""Meshes of primitives and model files, in metres."""

import dataclasses
import math
import zipfile
from pathlib import Path

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene import UNITS, Body, Box, Cylinder, Point, Sphere, load_model

MM = UNITS["mm"]
BODY = Body(
    name="thing",
    model=None,
    primitive=Box((0.1, 0.2, 0.3)),
    scale=1.0,
    pose=None,
    topic="thing",
    colour=(1.0, 1.0, 1.0, 1.0),
)


def with_shape(primitive, scale=1.0):
    return dataclasses.replace(BODY, primitive=primitive, scale=scale)


def volume(mesh):
    """Signed volume; positive where the faces are closed and look outward."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def edges_match(mesh):
    """Whether each edge is used once in each direction, as in a closed surface."""
    edges = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    forward = sorted(map(tuple, edges.tolist()))
    return forward == sorted(map(tuple, edges[:, ::-1].tolist())) and len(set(forward)) == len(
        forward
    )


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_box(scale):
    mesh = load_model(with_shape(Box((0.1, 0.2, 0.3)), scale), MM)
    assert mesh.name == "thing"
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.05 * scale, 0.1 * scale, 0.15 * scale])
    np.testing.assert_allclose(mesh.vertices.min(axis=0), -mesh.vertices.max(axis=0))
    assert volume(mesh) == pytest.approx(0.006 * scale**3)
    assert edges_match(mesh)


@pytest.mark.parametrize("segments", [3, 64])
def test_cylinder(segments):
    mesh = load_model(with_shape(Cylinder(0.5, 2.0, segments)), MM)
    across = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    assert across.max() == pytest.approx(0.5)
    assert sorted(set(np.round(mesh.vertices[:, 2], 12))) == [-1.0, 1.0]
    polygon = 0.5 * segments * 0.25 * math.sin(math.tau / segments)
    assert volume(mesh) == pytest.approx(2.0 * polygon)
    assert edges_match(mesh)


@pytest.mark.parametrize("subdivisions", [0, 3])
def test_sphere(subdivisions):
    mesh = load_model(with_shape(Sphere(0.25, subdivisions)), MM)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.25)
    assert len(mesh.faces) == 20 * 4**subdivisions
    assert volume(mesh) > 0.0
    assert edges_match(mesh)


def test_point():
    mesh = load_model(with_shape(Point(), 3.0), MM)
    assert (len(mesh.vertices), len(mesh.faces), mesh.radius) == (1, 1, 0.0)
    found = engine.distance(mesh, np.eye(4), load_model(with_shape(Box((2.0, 2.0, 2.0))), MM),
                            np.eye(4))  # fmt: skip
    assert found.upper == pytest.approx(1.0)


def test_model_file_in_the_scenes_unit_times_scale(tmp_path):
    path = tmp_path / "part.obj"
    path.write_text("v 0 0 0\nv 10 0 0\nv 0 20 0\nf 1 2 3\n")
    body = dataclasses.replace(BODY, primitive=None, model=path, scale=2.0)
    mesh = load_model(body, MM)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.02, 0.04, 0.0])


def test_a_model_file_that_states_its_unit_is_not_in_the_scenes(tmp_path):
    path = tmp_path / "part.3mf"
    mesh = (
        '<vertices><vertex x="0" y="0" z="0"/><vertex x="10" y="0" z="0"/>'
        '<vertex x="0" y="20" z="0"/></vertices><triangles>'
        '<triangle v1="0" v2="1" v3="2"/></triangles>'
    )
    model = (
        '<model unit="centimeter"><resources><object id="1"><mesh>'
        f"{mesh}</mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    )
    with zipfile.ZipFile(path, "w") as archive:
        link = '<Relationship Target="m" Type="x/3dmodel"/>'
        archive.writestr("_rels/.rels", f"<Relationships>{link}</Relationships>")
        archive.writestr("m", model)
    body = dataclasses.replace(BODY, primitive=None, model=path, scale=2.0)
    found = load_model(body, MM)
    np.testing.assert_allclose(found.vertices.max(axis=0), [0.2, 0.4, 0.0])


def test_bad_model_files(tmp_path):
    body = dataclasses.replace(BODY, primitive=None, model=Path(tmp_path / "part.stl"))
    with pytest.raises(FileNotFoundError, match=r"part\.stl"):
        load_model(body, MM)
    body.model.write_bytes(b"\x00garbage")
    with pytest.raises(engine.ModelError, match=r"part\.stl"):
        load_model(body, MM)


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_scale_must_be_positive(scale):
    with pytest.raises(ValueError, match="body 'thing': scale must be greater than 0"):
        load_model(with_shape(BODY.primitive, scale), MM)
