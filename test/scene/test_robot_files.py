"""The sources of a robot's description (files, xacro files, a topic), and what follows from it."""

import importlib.util
import itertools
import math
import sys

import numpy as np
import pytest

from proximity_monitor.scene import SceneError, load_scene

needs_xacro = pytest.mark.skipif(
    importlib.util.find_spec("xacro") is None, reason="needs xacro: pip install '.[robots]'"
)
BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def chain(*links, shape=BOX):
    """Return the URDF of a chain of links, each turning on the one before."""
    text = "".join(f'<link name="{link}">{shape}</link>\n' for link in links)
    for i, (above, link) in enumerate(itertools.pairwise(links), 1):
        text += (
            f'<joint name="turn{i}" type="continuous"><parent link="{above}"/>'
            f'<child link="{link}"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/></joint>\n'
        )
    return f'<robot name="chain">\n{text}</robot>\n'


CHAIN = chain("a", "b", "c", "d")
SCENE = """version: 1
unit: mm
robots:
  - name: arm
    urdf: arm.urdf
"""
SRDF = """<?xml version="1.0"?>
<robot name="chain">
  <group name="all"><chain base_link="a" tip_link="d"/></group>
  <disable_collisions link1="a" link2="c" reason="Never"/>
  <disable_collisions link1="d" link2="a" reason="Never"/>
</robot>
"""
XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="long" default="false"/>
  <xacro:arg name="side" default="0.1"/>
  <xacro:property name="size" value="${2 * $(arg side)}"/>
  <xacro:macro name="part" params="name">
    <link name="${name}"><collision><geometry><box size="${size} 0.1 0.1"/></geometry></collision>
    </link>
  </xacro:macro>
  <xacro:part name="a"/>
  <xacro:part name="b"/>
  <joint name="turn" type="continuous"><parent link="a"/><child link="b"/></joint>
  <xacro:if value="$(arg long)">
    <xacro:part name="c"/>
    <joint name="more" type="continuous"><parent link="b"/><child link="c"/></joint>
  </xacro:if>
</robot>
"""


@pytest.fixture
def load(tmp_path):
    """Return a function that writes files and a scene beside them, and loads the scene."""

    def write_and_load(more="", describe=None, scene=SCENE, **files):
        files = {"arm.urdf": CHAIN, **{name.replace("__", "."): t for name, t in files.items()}}
        for name, text in files.items():
            (tmp_path / name).write_text(text)
        path = tmp_path / "scene.yaml"
        path.write_text(scene + more)
        return load_scene(path, describe)

    return write_and_load


@pytest.fixture
def problems(load):
    def lines(*arguments, **files):
        with pytest.raises(SceneError) as caught:
            load(*arguments, **files)
        return [line.partition("scene.yaml:")[2] for line in str(caught.value).splitlines()]

    return lines


def watched(scene):
    return {f"{pair.a} {pair.b}".replace("arm_", "") for pair in scene.pairs}


# SRDF


def test_pairs_that_an_srdf_disables_are_not_watched(load):
    assert watched(load()) == {"a c", "a d", "b d"}
    assert watched(load("    srdf: arm.srdf\n", arm__srdf=SRDF)) == {"b d"}


def test_all_pairs_of_a_link_may_be_disabled_but_for_some(load):
    rules = '<disable_default_collisions link="a"/><enable_collisions link1="d" link2="a"/>'
    scene = load("    srdf: arm.srdf\n", arm__srdf=f"<robot>{rules}</robot>")
    assert watched(scene) == {"a d", "b d"}


def test_an_srdf_is_found_like_a_model_file(load, tmp_path, monkeypatch):
    share = tmp_path / "ws" / "share" / "arm_config"
    share.mkdir(parents=True)
    (share / "arm.srdf").write_text(SRDF)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ws"))
    assert watched(load("    srdf: package://arm_config/arm.srdf\n")) == {"b d"}


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('link1="a" ', "", "arm.srdf:4: <disable_collisions>: needs 'link1' and 'link2'"),
        ("robot", "model", "arm.srdf: <model>: a semantic robot description begins with <robot>"),
        ("</robot>", "", "arm.srdf: cannot be read as XML: no element found: line 7"),
        ("<robot", "<!DOCTYPE robot []><robot", "arm.srdf: cannot be read as XML: it has a"),
    ],
)
def test_what_is_wrong_with_an_srdf_is_told_by_its_line(problems, old, new, told):
    found = problems("    srdf: arm.srdf\n", arm__srdf=SRDF.replace(old, new))
    assert len(found) == 1
    assert found[0].startswith("6: robots[0].srdf: ")
    assert told in found[0]


def test_an_unknown_link_is_told_once_and_one_without_shape_is_none(load):
    twice = SRDF.replace('"c"', '"elbow"').replace('"d"', '"elbow"')
    (told,) = load("    srdf: arm.srdf\n", arm__srdf=twice).warnings
    assert "yaml:6: robots[0].srdf: " in told
    assert told.endswith("arm.srdf:4: the robot has no link 'elbow'")
    tool = CHAIN.replace(f'<link name="d">{BOX}</link>', '<link name="d"/>')
    assert watched(load("    srdf: arm.srdf\n", arm__srdf=SRDF.replace('"c"', '"d"'),
                        arm__urdf=tool)) == {"a c"}  # fmt: skip


# xacro

OF_XACRO = SCENE.replace("arm.urdf", "arm.urdf.xacro\n    exclude_adjacent: false")


@needs_xacro
def test_a_xacro_file_is_expanded_with_its_arguments(load):
    scene = load(scene=OF_XACRO, arm__urdf__xacro=XACRO)
    assert [body.name for body in scene.bodies] == ["arm_a", "arm_b"]
    more = "    xacro_args: {long: true, side: 0.5}\n"
    scene = load(more, scene=OF_XACRO, arm__urdf__xacro=XACRO)
    assert [body.name for body in scene.bodies] == ["arm_a", "arm_b", "arm_c"]
    assert scene.bodies[0].primitive.parts[0].shape.size == (1.0, 0.1, 0.1)


@needs_xacro
def test_an_srdf_may_be_a_xacro_file(load):
    macro = (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="tip" default="d"/>'
        '<disable_collisions link1="a" link2="$(arg tip)"/></robot>'
    )
    more = "    srdf: arm.srdf.xacro\n"
    assert watched(load(more, arm__srdf__xacro=macro)) == {"a c", "b d"}
    more += "    xacro_args: {tip: c}\n"
    assert watched(load(more, arm__srdf__xacro=macro)) == {"a d", "b d"}


@needs_xacro
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("${2 *", "${2 * lenght *", "cannot be expanded by xacro: name 'lenght' is not defined"),
        ("$(arg side)", "$(arg sise)", "cannot be expanded by xacro: Undefined substitution"),
        ("</robot>", "", "cannot be expanded by xacro: no element found"),
        ("xacro:part name=", "part name=", "<robot>: has no link"),
    ],
)
def test_what_is_wrong_with_a_xacro_file_is_told(problems, old, new, told):
    (found,) = problems(scene=OF_XACRO, arm__urdf__xacro=XACRO.replace(old, new))
    assert found.startswith("5: robots[0].urdf: ")
    assert "arm.urdf.xacro: " in found
    assert told in found


def test_without_xacro_the_extra_is_named(problems, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)  # as if it were not installed
    (found,) = problems(scene=OF_XACRO, arm__urdf__xacro=XACRO)
    assert "pip install xacro (it is part of the extra 'robots')" in found


def test_arguments_that_no_xacro_file_takes_are_refused(problems):
    (found,) = problems("    xacro_args: {long: true}\n")
    assert found.startswith("6: robots[0].xacro_args: apply only to xacro files")


@needs_xacro
@pytest.mark.parametrize("value", ["true", "on", "1.10", "1e-3", "0x10", "'010'"])
def test_arguments_of_xacro_are_the_text_of_the_file(load, value):
    macro = XACRO.replace('xacro:part name="b"', 'xacro:part name="b_$(arg note)"')
    macro = macro.replace('link="b"', 'link="b_$(arg note)"')
    more = f"    xacro_args: {{note: {value}}}\n"
    scene = load(more, scene=OF_XACRO, arm__urdf__xacro=macro)
    (joint,) = scene.robots[0].kinematics.joints
    assert joint.child == f"b_{value.strip(chr(39))}"
    assert scene.warnings == ()


@needs_xacro
def test_arguments_that_no_file_asks_for_are_warned_of(load):
    scene = load("    xacro_args: {lon: 1, side: 2}\n", scene=OF_XACRO, arm__urdf__xacro=XACRO)
    (told,) = scene.warnings
    at = "robots[0].xacro_args.lon: "
    assert told.endswith(f"yaml:7: {at}no xacro file has the argument 'lon'; did you mean 'long'?")


# A topic

OF_TOPIC = SCENE.replace("arm.urdf", "{topic: /robot_description}")


def test_a_description_is_taken_from_a_topic(load):
    asked = []

    def describe(topic):
        asked.append(topic)
        return CHAIN

    assert watched(load("", describe, OF_TOPIC)) == {"a c", "a d", "b d"}
    assert asked == ["/robot_description"]


def test_meshes_of_a_description_from_a_topic_are_found_from_the_scenes_folder(load, problems):
    mesh = '<collision><geometry><mesh filename="part.obj"/></geometry></collision>'
    text = chain("a", "b", "c", shape=mesh)
    scene = load("", lambda topic: text, OF_TOPIC, part__obj="v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert {part.shape.name for body in scene.bodies for part in body.primitive.parts} == {
        "part.obj"
    }
    found = problems("", lambda topic: text.replace("part", "gone"), OF_TOPIC)
    assert "robots[0].urdf: link 'a': no such file: " in found[0]


@pytest.mark.parametrize(
    ("describe", "told"),
    [
        (None, "the description comes from the topic /robot_description, so only the nodes can"),
        (lambda topic: "", "topic /robot_description: the text: cannot be read as XML"),
        (lambda topic: "<robot/>", "topic /robot_description: <robot>: has no link"),
    ],
)
def test_what_is_wrong_with_a_topics_description_is_told(problems, describe, told):
    (found,) = problems("", describe, OF_TOPIC)
    assert found.startswith("5: robots[0].urdf: ")
    assert told in found


def test_a_bad_topic_of_a_description_is_told(problems):
    (found,) = problems("", None, SCENE.replace("arm.urdf", "{topic: no topic}"))
    assert found.startswith("5: robots[0].urdf.topic: must be a topic name")
    (found,) = problems("", None, SCENE.replace("arm.urdf", "{}"))
    assert found.startswith("5: robots[0].urdf: needs the key 'topic'")


# Which links are watched


def test_links_without_the_shapes_that_are_asked_for_name_the_others(problems, load):
    visual = CHAIN.replace("collision", "visual")
    (found,) = problems(arm__urdf=visual)
    assert found.startswith("4: robots[0].meshes: no link of arm has a collision shape, but some ")
    assert found.endswith("set 'meshes: visual'")
    assert watched(load("    meshes: visual\n", arm__urdf=visual)) == {"a c", "a d", "b d"}
    (found,) = problems("    meshes: visual\n")
    assert found.endswith("no link of arm has a visual shape, but some have a collision shape: "
                          "set 'meshes: collision'")  # fmt: skip
    (found,) = problems(arm__urdf=CHAIN.replace(BOX, ""))
    assert found.endswith("no link of arm has a collision shape; remove the robot")


def test_links_that_have_the_other_shape_alone_are_warned_of(load):
    bare = CHAIN.replace(BOX, BOX.replace("collision", "visual"), 1)
    (told,) = load(arm__urdf=bare).warnings
    assert (
        "yaml:4: robots[0].meshes: not watched, because they have only a visual shape: a; " in told
    )


# A root that moves


def test_all_links_of_a_robot_whose_root_moves_are_moving_bodies(load):
    (robot,) = load().robots
    assert robot.root is None
    assert list(robot.links) == ["arm_b", "arm_c", "arm_d"]
    scene = load("    root: {}\n")
    (robot,) = scene.robots
    assert (robot.root.topic, robot.root.frame) == ("bodies/arm/pose", "arm")
    assert list(robot.links) == ["arm_a", "arm_b", "arm_c", "arm_d"]
    assert all(body.moving and body.topic is None for body in scene.bodies)
    assert watched(scene) == {"a c", "a d", "b d"}


def test_the_links_are_placed_from_the_pose_of_the_root(load):
    (robot,) = load("    root: {topic: /odom, frame: base_link}\n").robots
    assert (robot.root.topic, robot.root.frame) == ("/odom", "base_link")
    base = np.eye(4)
    base[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    base[:3, 3] = 1.0, 2.0, 3.0
    poses = robot.poses({"turn1": math.pi / 2}, base)
    np.testing.assert_allclose(poses["arm_a"], base)
    # Bent by the first joint, link b points along the root's x axis, the scene's y axis.
    np.testing.assert_allclose(poses["arm_c"][:3, 3], [1.0, 2.3, 3.3])


def test_a_robot_alone_on_wheels_is_watched_against_what_stands(load):
    wall = "{name: wall, primitive: {box: {size: [9, 9, 9]}}, pose: {position: [0, 0, 0]}}"
    scene = load(f"    root: {{}}\nbodies: [{wall}]\n", arm__urdf=chain("a"))
    assert watched(scene) == {"wall a"}


def test_a_root_stands_or_moves(problems):
    (found,) = problems("    root: {}\n    pose: {position: [0, 0, 0]}\n")
    assert found == "4: robots[0]: can have only one of 'pose', 'root'"
    (found,) = problems("    root: {topic: no topic}\n")
    assert found.startswith("6: robots[0].root.topic: must be a topic name")


PATH = "keys: [{t: 0, position: [0, 0, 0]}, {t: 2, position: [4000, 0, 0]}]"


def test_a_script_moves_a_root(load):
    from proximity_monitor import motion

    scene = load(f"    root: {{}}\nmotion: {{script: {{bodies: {{arm: {{{PATH}}}}}}}}}\n")
    moves = motion.from_scene(scene)
    assert moves.bodies == ("arm",)
    np.testing.assert_allclose(moves.poses(1.0)["arm"][:3, 3], [2.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (
            "motion: {script: {bodies: {arm: {PATH}}}}",
            "'arm' is a robot with a fixed root; to move it",
        ),
        (
            "    root: {}\nmotion: {script: {bodies: {arm_a: {PATH}}}}",
            "'arm_a' is a robot link",
        ),
        (
            "    root: {}\nmotion: {dynamics: {bodies: {arm: {density: 1,"
            " pose: {position: [0, 0, 0]}}}}}",
            "no body is named 'arm'",
        ),
    ],
)
def test_what_cannot_move_a_root_is_told(problems, more, told):
    (found,) = problems(more.replace("PATH", PATH) + "\n")
    assert told in found
