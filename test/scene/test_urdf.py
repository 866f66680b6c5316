"""Robot descriptions: what is read of them, and what is wrong with them."""

import math
import random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from proximity_monitor.engine.poses import check_pose
from proximity_monitor.scene.description import Box, Cylinder, Sphere
from proximity_monitor.scene.poses import pose_matrix
from proximity_monitor.scene.urdf import Shape, UrdfError, read_urdf

ROBOT = """<?xml version="1.0"?>
<robot name="lift">
  <!-- Other programs' elements, and things without a shape or a motion, are passed over. -->
  <material name="grey"/>
  <transmission name="t"><joint name="unheard_of"/></transmission>
  <gazebo reference="base"><mu1>0.2</mu1></gazebo>
  <link name="base">
    <inertial><mass value="no number"/></inertial>
    <collision name="first"><geometry><box size="0.4 0.3 0.1"/></geometry></collision>
    <collision>
      <origin xyz="0 0 0.25" rpy="0 0 1.5"/>
      <geometry><mesh filename="package://lift/column.stl" scale="1 -1 2"/></geometry>
    </collision>
    <visual><geometry><sphere radius="0.2"/></geometry></visual>
  </link>
  <link name="fork">
    <collision><geometry><cylinder radius="0.02" length="0.5"/></geometry></collision>
  </link>
  <link name="frame"/>
  <joint name="raise" type="prismatic">
    <parent link="base"/><child link="fork"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>
    <axis xyz="0 0 2"/>
    <limit lower="-0.1" upper="0.9" effort="100" velocity="1"/>
  </joint>
  <joint name="hold" type="fixed"><parent link="fork"/><child link="frame"/></joint>
</robot>
"""


@pytest.fixture
def read(tmp_path):
    def write_and_read(text):
        path = tmp_path / "lift.urdf"
        path.write_text(text)
        return read_urdf(path)

    return write_and_read


def test_links_and_their_shapes(read):
    base, fork, frame = read(ROBOT).links
    assert (base.name, fork.name, frame.name) == ("base", "fork", "frame")
    none = (0.0, 0.0, 0.0)
    assert base.collision == (
        Shape(Box((0.4, 0.3, 0.1)), (1.0, 1.0, 1.0), none, none),
        Shape("package://lift/column.stl", (1.0, -1.0, 2.0), (0.0, 0.0, 0.25), (0.0, 0.0, 1.5)),
    )
    assert [shape.geometry for shape in base.visual] == [Sphere(0.2)]
    assert [shape.geometry for shape in fork.collision] == [Cylinder(0.02, 0.5)]
    assert (frame.collision, frame.visual) == ((), ())


def test_joints(read):
    kinematics = read(ROBOT).kinematics
    assert kinematics.links == ("base", "fork", "frame")
    raised, held = kinematics.joints
    assert (raised.name, raised.kind, raised.lower, raised.upper) == (
        "raise",
        "prismatic",
        -0.1,
        0.9,
    )
    assert (held.kind, held.lower, held.upper) == ("fixed", -math.inf, math.inf)
    assert kinematics.free == (raised,)


def test_an_origin_turns_about_fixed_x_then_y_then_z(read):
    roll, pitch, yaw = 0.4, 0.5, 0.6

    def about(axis, angle):
        c, s = math.cos(angle), math.sin(angle)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        made = np.eye(3)
        made[i, i], made[i, j], made[j, i], made[j, j] = c, -s, s, c
        return made

    origin = read(ROBOT).kinematics.free[0].origin
    expected = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    np.testing.assert_allclose(origin[:3, :3], expected, atol=1e-15)
    np.testing.assert_array_equal(origin[:3, 3], [0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    "quaternion",
    [
        "0.1 0.5 -0.5 0.7",
        "0 0.70710678118654757 0 0.70710678118654757",
        "0.5 0.5 -0.5 0.5",
        "0 0 1 0",
        "0 0 0.71 0.71",  # parsers of robots normalise it
        "0 0 1 -1",
    ],
)
def test_an_origin_may_turn_by_a_quaternion(read, quaternion):
    text = ROBOT.replace('rpy="0.4 0.5 0.6"', f'quat_xyzw="{quaternion}"')
    origin = read(text.replace("<robot ", '<robot version="1.1" ')).kinematics.free[0].origin
    parts = np.array([float(each) for each in quaternion.split()])
    expected = pose_matrix((0.1, 0.2, 0.3), parts / np.linalg.norm(parts))
    np.testing.assert_allclose(origin, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<robot ", '<robot xmlns="http://example.org/robots" '),
        ("<material", "<sensor:camera/><material"),
        ("<?xml", "\n\n<?xml"),
        ("<material", "<my_xacro_note/><material"),
        ('version="1.0"', 'version="1.0" encoding="gb2312"'),
    ],
)
def test_markup_that_parsers_of_robots_pass_over(tmp_path, old, new):
    path = tmp_path / "lift.urdf"
    path.write_bytes(ROBOT.replace(old, new).replace("fork", "\u53c9").encode("gb2312"))
    if "gb2312" not in new:
        path.write_text(ROBOT.replace(old, new).replace("fork", "\u53c9"), encoding="utf-8")
    assert [link.name for link in read_urdf(path).links] == ["base", "\u53c9", "frame"]


def test_defaults_of_the_format(read):
    text = ROBOT.replace('<axis xyz="0 0 2"/>', "").replace("prismatic", "continuous")
    turning = read(text).kinematics.free[0]
    assert turning.axis == (1.0, 0.0, 0.0)
    assert (turning.lower, turning.upper) == (-math.inf, math.inf)  # whatever <limit> says
    follow = '<mimic joint="raise"/></joint>'
    held = read(ROBOT.replace('type="fixed"', 'type="revolute"').replace(
        '<child link="frame"/></joint>', f'<child link="frame"/>{follow}'
    )).kinematics.joints[1]  # fmt: skip
    assert (held.mimic.joint, held.mimic.multiplier, held.mimic.offset) == ("raise", 1.0, 0.0)


BROKEN = {
    "another version": ("<robot ", '<robot version="2.0" ', "<robot>: version '2.0' is not"),
    "a turn twice": (
        'rpy="0.4 0.5 0.6"', 'rpy="0 0 1" quat_xyzw="0 0 0 1"',
        "joint 'raise', <origin>: can have only one of rpy, quat_xyzw",
    ),
    "no quaternion": (
        'rpy="0.4 0.5 0.6"', 'quat_xyzw="0 0 0 0"', "<origin>: quat_xyzw must not be 0",
    ),
    "an unknown attribute": (
        'rpy="0 0 1.5"', 'rpz="0 0 1.5"',
        "link 'base', <collision>, <mesh>, <origin>: unknown attribute 'rpz'; did you mean 'rpy'?",
    ),
    "not XML": ("</robot>", "", "the file: cannot be read as XML: no element found"),
    "not XML after an empty line": ("<?xml", "\n<?xml version='1.0'?><?xml", "line 2, column"),
    "another root": ('<robot name="lift">', "<model>", "mismatched tag"),
    "a document type": (
        '<?xml version="1.0"?>',
        '<!DOCTYPE robot [<!ENTITY e SYSTEM "file:///etc/passwd">]>',
        "has a document type declaration",
    ),
    "macros": (
        '<material name="grey"/>', '<x:y xmlns:x="http://www.ros.org/wiki/xacro"/>',
        "contains xacro macros; rename it to end in .xacro, or expand them first: xacro IN.xacro",
    ),
    "no name": ('<link name="frame"/>', "<link/>", "a link: needs the attribute 'name'"),
    "a bad size": (
        'size="0.4 0.3 0.1"', 'size="0.4 0.3"',
        r"link 'base', <collision>, <box>: size must be 3 numbers of at most 1e\+09 \(got '0.4 ",
    ),
    "not a number": (
        'radius="0.02"', 'radius="thick"',
        r"link 'fork', <collision>, <cylinder>: radius must be a number of at most 1e\+09",
    ),
    "not finite": ('radius="0.2"', 'radius="inf"', r"radius must be a number of at most 1e\+09"),
    "far": ('xyz="0 0 0.25"', 'xyz="0 0 1e200"', "xyz must be 3 numbers of at most"),
    "a limit that is none": ('lower="-0.1"', 'lower="nan"', "lower must be a number"),
    "negative": ('radius="0.02"', 'radius="-1"', "sizes must be greater than 0"),
    "flat": ('scale="1 -1 2"', 'scale="1 0 2"', "scale must not be 0"),
    "no shape": (
        '<geometry><sphere radius="0.2"/></geometry>', "<geometry/>",
        r"link 'base', <visual>: <geometry> must hold one shape \(got 0\)",
    ),
    "another shape": (
        '<sphere radius="0.2"/>', '<cone radius="1"/>',
        "<cone>: unknown shape; known: mesh, box, cylinder, sphere, capsule",
    ),
    "a joint of six": (
        'type="prismatic"', 'type="floating"',
        r"joint 'raise': type must be fixed, revolute, continuous or prismatic \(got 'floating'\)",
    ),
    "no child": ('<child link="fork"/>', "", "joint 'raise': needs <child>"),
    "no axis": ('xyz="0 0 2"', 'xyz="0 0 0"', "joint 'raise', <axis>: must be a direction"),
    "limits crossed": ('lower="-0.1"', 'lower="1"', "lower must not exceed upper"),
    "a bad tree": ('<child link="fork"/>', '<child link="base"/>', "links base form a cycle"),
}  # fmt: skip


@pytest.mark.parametrize("old, new, message", BROKEN.values(), ids=BROKEN)
def test_what_is_wrong_is_said_with_the_file_and_the_element(read, tmp_path, old, new, message):
    assert old in ROBOT
    with pytest.raises(UrdfError, match=message) as caught:
        read(ROBOT.replace(old, new))
    assert str(caught.value).startswith(f"{tmp_path / 'lift.urdf'}: ")


def test_another_xml_file_is_refused(read):
    with pytest.raises(UrdfError, match="<sdf>: a robot description begins with <robot>"):
        read("<sdf/>")
    with pytest.raises(UrdfError, match="<robot>: has no link"):
        read("<robot/>")


def test_a_file_that_is_gone_or_no_text(tmp_path):
    with pytest.raises(UrdfError, match=r"gone\.urdf: the file: cannot be read: No such file"):
        read_urdf(tmp_path / "gone.urdf")
    path = tmp_path / "noise.urdf"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(UrdfError, match="cannot be read as XML"):
        read_urdf(path)


def test_entities_do_not_grow(read):
    """A few bytes that would expand to a gigabyte are refused where they are declared."""
    levels = "".join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 10}">' for i in range(9))
    bomb = f'<!DOCTYPE robot [<!ENTITY e0 "{"x" * 10}">{levels}]><robot>&e9;</robot>'
    with pytest.raises(UrdfError, match="has a document type declaration"):
        read(bomb)


WORDS = """
<link/> </link> <joint> <!-- <![CDATA[ &amp; &lt; &x; " ' = > 0 -1 1e999 nan inf 1e308 1e-320 1e9
base fork frame raise hold fixed revolute continuous name= <mimic joint="raise"/> <origin/> <limit/>
"""
relaxed = settings(
    max_examples=200,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


def holds(path, data):
    """Check that any data in the file give a robot whose links have poses, or an error."""
    path.write_bytes(data)
    try:
        kinematics = read_urdf(path).kinematics
    except UrdfError as error:
        assert str(error).startswith(f"{path}: ")
        return
    for pose in kinematics.poses(np.full(len(kinematics.free), 0.7)):
        check_pose(pose)


@relaxed
@given(
    start=st.integers(0, len(ROBOT)),
    length=st.integers(0, 40),
    insert=st.sampled_from(WORDS.split()) | st.text(max_size=6),
)
def test_any_text_in_any_place(tmp_path, start, length, insert):
    text = ROBOT[:start] + insert + ROBOT[start + length :]
    holds(tmp_path / "any.urdf", text.encode("utf-8", "surrogatepass"))


@relaxed
@given(choices=st.randoms(use_true_random=False), word=st.sampled_from(WORDS.split()))
def test_any_value_of_any_attribute(tmp_path, choices: random.Random, word):
    values = ROBOT.split('"')
    values[2 * choices.randrange(len(values) // 2) + 1] = word
    holds(tmp_path / "any.urdf", '"'.join(values).encode())


@relaxed
@given(st.binary(max_size=200))
def test_any_bytes(tmp_path, data):
    holds(tmp_path / "any.urdf", data)


def test_an_axis_of_any_length_is_a_direction(read):
    """Squares of the small components would underflow, and the rotation would not be rigid."""
    for axis in ("1e-320 1e-320 0", "1e-200 0 1e-200", "1e9 1e9 1e9"):
        kinematics = read(
            ROBOT.replace("prismatic", "revolute").replace('xyz="0 0 2"', f'xyz="{axis}"')
        ).kinematics
        turn = kinematics.poses([0.7])[1][:3, :3]
        np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-15)
