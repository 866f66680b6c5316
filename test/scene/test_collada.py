"""COLLADA files, as the visual meshes of robots come in."""

import sys

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene.collada import read_collada

COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><created>2020-01-01</created><modified>2020-01-01</modified>
    <unit meter="0.001" name="millimetre"/><up_axis>Y_UP</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array>
      <technique_common><accessor source="#a" count="4" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="1" material="missing"><input semantic="VERTEX" source="#v" offset="0"/>
      <p>0 2 1</p></triangles>
    <polylist count="2"><input semantic="VERTEX" source="#v" offset="0"/>
      <vcount>3 3</vcount><p>0 1 3 1 2 3</p></polylist>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node>
    <translate>0 0 10</translate><instance_geometry url="#g"/></node></visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""


@pytest.fixture
def read(tmp_path):
    def write_and_read(text):
        path = tmp_path / "base.dae"
        path.write_text(text)
        return read_collada(path)

    return write_and_read


def test_the_unit_and_the_nodes_count_but_not_the_up_axis(read):
    pytest.importorskip("collada", reason="needs pycollada")
    vertices, faces = read(COLLADA)
    corners = np.array([[0, 0, 10], [1, 0, 10], [0, 2, 10], [0, 0, 13]])  # lifted by its node
    expected = corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3]]]
    np.testing.assert_allclose(vertices[faces], 0.001 * expected, atol=1e-9)


@pytest.mark.parametrize(
    "text", ["", "<COLLADA/>", COLLADA.replace("polylist", "p").replace("triangles", "t")]
)
def test_damaged_files_name_themselves(read, text):
    pytest.importorskip("collada", reason="needs pycollada")
    with pytest.raises(engine.ModelError, match=r"base\.dae: "):
        read(text)


def test_without_pycollada_the_error_says_how_to_get_it(read, monkeypatch):
    monkeypatch.setitem(sys.modules, "collada", None)
    with pytest.raises(engine.ModelError, match=r"base\.dae: .* pip install '\.\[robots\]'"):
        read(COLLADA)
