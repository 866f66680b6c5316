"""The effects `script` and `bag` of the motion section: SI units, and faults with their lines."""

import math

import numpy as np
import pytest

TEXT = """\
version: 1
unit: mm
bodies:
  - {name: block, primitive: {box: {size: [1, 1, 1]}}, pose: {position: [0, 0, 0]}}
  - {name: cart, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: door, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: hand, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: tool, primitive: {box: {size: [1, 1, 1]}}, topic: /tool}
motion:
  script:
    bodies:
      cart:
        keys:
          - {t: 0, position: [1000, 0, 0], quaternion: [0, 0, 0.6, 0.8001]}
          - {t: 2, position: [0, 1000, 0], rotation: {axis: [0, 0, 5], angle_deg: 90}}
      door:
        hinge:
          origin: [100, 0, 0]
          axis: [0, 0, 2]
          angles_deg: [[0, 0], [1, 180]]
      hand: {csv: hand.csv}
  bag:
    path: part.stl
    topics:
      /tool: tool
"""
HEAD = "t,x,y,z,qx,qy,qz,qw\n"
ROW = "0,1000,0,0,0,0,0,1\n"
URDF = """
<robot name="swing">
  <link name="post"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <link name="arm"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <link name="tip"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <joint name="pivot" type="continuous">
    <parent link="post"/><child link="arm"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="rail" type="prismatic">
    <parent link="arm"/><child link="tip"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"""


@pytest.fixture(autouse=True)
def table(tmp_path):
    path = tmp_path / "hand.csv"
    path.write_text(HEAD + ROW + "1.5,0,0,-500,0.6,0,0,0.8\n")
    return path


def test_several_effects_stand_in_the_order_of_the_file(load):
    assert list(load(TEXT).motion) == ["script", "bag"]


def test_key_poses_are_in_si_units_and_exactly_unit(load):
    cart = load(TEXT).motion["script"]["bodies"]["cart"]
    np.testing.assert_array_equal(cart["times"], [0.0, 2.0])
    np.testing.assert_allclose(cart["positions"], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(np.linalg.norm(cart["quaternions"], axis=1), 1.0, rtol=1e-15)
    root = math.sqrt(0.5)
    np.testing.assert_allclose(cart["quaternions"][1], [0.0, 0.0, root, root])


def test_a_hinge_is_in_radians_and_has_a_unit_axis(load):
    door = load(TEXT).motion["script"]["bodies"]["door"]
    np.testing.assert_allclose(door["values"], [0.0, math.pi])
    np.testing.assert_array_equal(door["hinge"]["axis"], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(door["hinge"]["origin"], [0.1, 0.0, 0.0])
    np.testing.assert_array_equal(door["hinge"]["pose"], np.eye(4))


@pytest.mark.parametrize("length", [1e-323, 1e-200, 1e200, 1e308])
def test_a_direction_of_any_length_becomes_a_unit_vector(load, length):
    text = TEXT.replace("axis: [0, 0, 2]", f"axis: [0, {length!r}, {length!r}]")
    axis = load(text).motion["script"]["bodies"]["door"]["hinge"]["axis"]
    np.testing.assert_allclose(axis, [0.0, math.sqrt(0.5), math.sqrt(0.5)], rtol=1e-15)


def test_a_table_is_in_the_scenes_unit(load):
    hand = load(TEXT).motion["script"]["bodies"]["hand"]
    np.testing.assert_allclose(hand["times"], [0.0, 1.5])
    np.testing.assert_allclose(hand["positions"], [[1.0, 0.0, 0.0], [0.0, 0.0, -0.5]])
    np.testing.assert_allclose(hand["quaternions"], [[0, 0, 0, 1], [0.6, 0, 0, 0.8]])


def test_a_table_of_a_spreadsheet_is_read_too(load, table):
    table.write_bytes(b"\xef\xbb\xbf" + (HEAD + ROW).replace("\n", "\r\n").encode())
    assert load(TEXT).motion["script"]["bodies"]["hand"]["times"].tolist() == [0.0]


def test_joints_are_in_radians_and_metres(load, tmp_path):
    (tmp_path / "swing.urdf").write_text(URDF)
    joints = """
    joints:
      pivot: {angles_deg: [[0, 0], [1, 90]]}
      rail: {offsets: [[0.5, 250]]}
"""
    robot = "robots: [{name: swing, urdf: swing.urdf}]\n"
    text = TEXT.replace("motion:", robot + "motion:").replace("  bag:", joints + "  bag:")
    found = load(text).motion["script"]["joints"]
    assert list(found) == ["pivot", "rail"]
    np.testing.assert_allclose(found["pivot"]["values"], [0.0, math.pi / 2.0])
    np.testing.assert_array_equal(found["rail"]["times"], [0.5])
    np.testing.assert_allclose(found["rail"]["values"], [0.25])
    assert [joint["kind"] for joint in found.values()] == ["angles_deg", "offsets"]


def test_settings_cannot_be_changed(load):
    script = load(TEXT).motion["script"]
    with pytest.raises(TypeError):
        script["bodies"]["cart"]["times"] = None
    for body in script["bodies"].values():
        for each in body.values():
            for array in each.values() if not isinstance(each, np.ndarray) else (each,):
                with pytest.raises(ValueError, match="read-only"):
                    array[0] = 7.0


def test_defaults(load, tmp_path):
    motion = load(TEXT).motion
    assert motion["script"]["loop"] is True
    assert motion["bag"] == {
        "path": tmp_path / "part.stl",
        "topics": {"/tool": "tool"},
        "rate": 1.0,
        "seek_s": 0.0,
        "loop": True,
    }


def test_a_bag_may_be_a_folder(load, tmp_path):
    (tmp_path / "taken").mkdir()
    text = TEXT.replace(
        "path: part.stl", "path: taken\n    rate: 2\n    seek_s: 1.5\n    loop: false"
    )
    bag = load(text).motion["bag"]
    assert bag["path"] == tmp_path / "taken"
    assert (bag["rate"], bag["seek_s"], bag["loop"]) == (2.0, 1.5, False)


FAULTS = {
    "neither bodies nor joints": (
        TEXT[TEXT.index("    bodies:\n") : TEXT.index("  bag:")],
        "    loop: true\n",
        "10: motion.script: needs the key 'bodies' or the key 'joints'",
    ),
    "two spellings of a path": (
        "hand: {csv: hand.csv}",
        "hand: {csv: hand.csv, slide: {axis: [1, 0, 0], offsets: [[0, 0]]}}",
        "21: motion.script.bodies.hand: needs exactly one of 'keys', 'csv', 'hinge', 'slide' (got "
        "'csv' and 'slide')",
    ),
    "no spelling of a path": (
        "hand: {csv: hand.csv}",
        "hand: {}",
        "21: motion.script.bodies.hand: needs exactly one of 'keys', 'csv', 'hinge', 'slide' (got "
        "none)",
    ),
    "two spellings of an orientation": (
        "quaternion: [0, 0, 0.6, 0.8001]",
        "quaternion: [0, 0, 0, 1], rotation: {axis: [0, 0, 1], angle_deg: 1}",
        "14: motion.script.bodies.cart.keys[0]: can have only one of 'quaternion', 'rotation'",
    ),
    "no quaternion": (
        "[0, 0, 0.6, 0.8001]",
        "[0, 0, 1, 1]",
        "14: motion.script.bodies.cart.keys[0].quaternion: must have length 1 (got 1.41421)",
    ),
    "rotation about nothing": (
        "axis: [0, 0, 5]",
        "axis: [0, 0, 0]",
        "15: motion.script.bodies.cart.keys[1].rotation.axis: must be a direction",
    ),
    "times do not increase": (
        "{t: 2, ",
        "{t: 0, ",
        "15: motion.script.bodies.cart.keys[1].t: must be later than the previous key, 0 s (got 0)",
    ),
    "before the start": ("{t: 0, ", "{t: -1, ", "14: motion.script.bodies.cart.keys[0].t: must be"),
    "a key without a time": (
        "{t: 0, ",
        "{",
        "14: motion.script.bodies.cart.keys[0]: needs the key 't'",
    ),
    "a key that is a number": (
        "- {t: 0, position: [1000, 0, 0], quaternion: [0, 0, 0.6, 0.8001]}",
        "- 3",
        "14: motion.script.bodies.cart.keys[0]: must be a mapping (got 3)",
    ),
    "beyond any world": (
        "[1000, 0, 0]",
        "[1e300, 0, 0]",
        "14: motion.script.bodies.cart.keys[0].position[0]: must be at most 1e+09 m",
    ),
    "angles do not increase": (
        "[1, 180]",
        "[0, 180]",
        "20: motion.script.bodies.door.hinge.angles_deg[1]: must be later than the previous key",
    ),
    "an angle without a time": (
        "[1, 180]",
        "[180]",
        "20: motion.script.bodies.door.hinge.angles_deg[1]: must have exactly 2 entries (got 1)",
    ),
    "no axis": (
        "axis: [0, 0, 2]",
        "axis: [0, 0, 0]",
        "19: motion.script.bodies.door.hinge.axis: must be a direction",
    ),
    "unknown body": (
        "      door:",
        "      dor:",
        "16: motion.script.bodies.dor: no body is named 'dor'; did you mean 'door'?",
    ),
    "fixed body": (
        "      door:",
        "      block:",
        "16: motion.script.bodies.block: 'block' is fixed; to move it, give it 'moving: true'",
    ),
    "driven by two effects": (
        "/tool: tool",
        "/tool: door",
        "25: motion.bag.topics./tool: 'door' is already driven by motion.script.bodies.door "
        "(line 16); only one effect can drive a body",
    ),
    "driven by two topics": (
        "/tool: tool",
        "/tool: tool\n      /tools: [tool]",
        "26: motion.bag.topics./tools[0]: 'tool' is already driven by motion.bag.topics./tool",
    ),
    "a joint of two kinds": (
        "    bodies:\n",
        "    joints: {elbow: {angles_deg: [[0, 0]], offsets: [[0, 0]]}}\n    bodies:\n",
        "11: motion.script.joints.elbow: needs exactly one of 'angles_deg', 'offsets'",
    ),
    "no such table": ("hand.csv", "arm.csv", "21: motion.script.bodies.hand.csv: no such file: /"),
    "no such bag": ("part.stl", "gone", "23: motion.bag.path: no such file: /"),
    "no topic": ("\n      /tool: tool", " {}", "24: motion.bag.topics: must have at least 1 key"),
    "no rate": ("path: part.stl", "path: part.stl\n    rate: 0", "24: motion.bag.rate: must be at"),
}


@pytest.mark.parametrize("old, new, expected", FAULTS.values(), ids=FAULTS)
def test_faults(problems, old, new, expected):
    assert old in TEXT
    found = problems(TEXT.replace(old, new, 1))
    assert any(line.startswith(expected) for line in found), found


TABLES = {
    "empty": ("", ":1: the first line must name the columns t, x, y, z, qx, qy, qz, qw; t, x"),
    "no header": (ROW, ":1: the first line must name the columns"),
    "a header too long": (HEAD[:-1] + ",more" * 999 + "\n" + ROW, ":1: a line has more than 4096"),
    "a column missing": ("t,x,y,qx,qy,qz,qw\n", ":1: the first line must name the columns t, x, y"),
    "a column twice": (HEAD.replace("x", "x,x", 1), ":1: the column x appears twice"),
    "no pose": (HEAD, ": has a header but no poses"),
    "a row too short": (HEAD + ROW + "1,2,3\n", ":3: has 3 columns, but the header has 8"),
    "a word": (HEAD + ROW.replace("1000", "far"), ":2: x must be a number (got 'far')"),
    "not finite": (HEAD + ROW.replace("1000", "nan"), ":2: x must be finite (got nan)"),
    "too far": (HEAD + ROW.replace("1000", "1e13"), ":2: x must be within 1e+09 m of 0"),
    "no quaternion": (HEAD + ROW.replace(",1\n", ",2\n"), ":2: the quaternion must have length 1"),
    "time stands still": (
        HEAD + ROW + ROW,
        ":3: t must be later than in the previous row, 0 (got 0)",
    ),
    "before the start": (HEAD + "-" + ROW.replace("0", "1", 1), ":2: t must be 0 to 1e+06 s after"),
    "a clock's stamp": (HEAD + "17" + "0" * 8 + ROW[1:], ":2: t must be 0 to 1e+06 s after"),
    "an open quote": (HEAD + ROW + '"1,', ":3: unexpected end of data"),
}


@pytest.mark.parametrize("text, expected", TABLES.values(), ids=TABLES)
def test_a_fault_in_a_table_is_told_with_its_file_and_line(problems, table, text, expected):
    table.write_text(text)
    (found,) = problems(TEXT)
    assert found.startswith(f"21: motion.script.bodies.hand.csv: {table}{expected}"), found


@pytest.mark.parametrize("content", [b"\xff\xfe\x00t", b"\0" * 9000, b"," * 9000])
def test_what_is_no_table_is_told(problems, table, content):
    table.write_bytes(content)
    (found,) = problems(TEXT)
    assert found.startswith(f"21: motion.script.bodies.hand.csv: {table}:"), found


def test_what_cannot_be_read_is_told(problems, tmp_path):
    found = problems(TEXT.replace("hand.csv", str(tmp_path)))
    assert any("no such file" in line for line in found)
