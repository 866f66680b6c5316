"""Models of a scene that come from files, in metres."""

import zipfile

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene import UNITS, Body, load_model

MM = UNITS["mm"]


def body_of(path, scale):
    return Body("thing", path, None, scale, None, "thing", (1.0, 1.0, 1.0, 1.0))


def test_model_file_in_the_scenes_unit_times_scale(tmp_path):
    path = tmp_path / "part.obj"
    path.write_text("v 0 0 0\nv 10 0 0\nv 0 20 0\nf 1 2 3\n")
    body = body_of(path, 2.0)
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
    body = body_of(path, 2.0)
    found = load_model(body, MM)
    np.testing.assert_allclose(found.vertices.max(axis=0), [0.2, 0.4, 0.0])


def test_bad_model_files(tmp_path):
    body = body_of(tmp_path / "part.stl", 1.0)
    with pytest.raises(FileNotFoundError, match=r"part\.stl"):
        load_model(body, MM)
    body.model.write_bytes(b"\x00garbage")
    with pytest.raises(engine.ModelError, match=r"part\.stl"):
        load_model(body, MM)
