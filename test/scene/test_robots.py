"""Robots of a scene file: links become bodies, joints move them."""

import math
from importlib import metadata

import numpy as np
import pytest
from crane import CRANE, SCENE, WEDGE

from proximity_monitor import engine
from proximity_monitor.scene import SceneError, load_scene, paths
from proximity_monitor.scene.naming import safe
from proximity_monitor.scene.opening import load_models

HEAD = "scene.yaml:"


@pytest.fixture
def load(tmp_path):
    """Return a function that writes a scene beside a crane and loads it."""
    meshes = tmp_path / "crane" / "meshes"
    meshes.mkdir(parents=True)
    (meshes / "wedge.obj").write_text(WEDGE)
    (tmp_path / "crane" / "crane.urdf").write_text(CRANE)

    def write_and_load(text=SCENE, urdf=None):
        if urdf is not None:
            (tmp_path / "crane" / "crane.urdf").write_text(urdf)
        path = tmp_path / "scene.yaml"
        path.write_text(text)
        return load_scene(path)

    return write_and_load


@pytest.fixture
def problems(load):
    def message_lines(*texts):
        with pytest.raises(SceneError) as caught:
            load(*texts)
        return [line.partition(HEAD)[2] for line in str(caught.value).splitlines()]

    return message_lines


def names_of(pairs):
    return {frozenset((pair.a, pair.b)) for pair in pairs}


def both(*names):
    return {frozenset(name.split()) for name in names}


def test_links_with_a_shape_are_bodies(load):
    bodies = {body.name: body for body in load().bodies}
    assert list(bodies) == ["floor", "crane_base", "crane_boom", "crane_hook_1", "crane_lamp"]
    assert {name for name, body in bodies.items() if body.moving} == {
        "crane_boom", "crane_hook_1", "crane_lamp",
    }  # fmt: skip
    assert all(bodies[name].topic is None for name in bodies if name != "floor")
    # Only a fixed joint holds the base.
    np.testing.assert_allclose(bodies["crane_base"].pose[:3, 3], [0.0, 0.0, 0.1])


def test_what_is_watched_and_what_is_not(load):
    """Not watched: neighbours (`frame` has no shape), and the lamp, which is fixed to the boom."""
    assert names_of(load().pairs) == both(
        "floor crane_boom", "floor crane_hook_1", "floor crane_lamp", "crane_base crane_hook_1",
        "crane_base crane_lamp", "crane_hook_1 crane_lamp",
    )  # fmt: skip


def test_neighbours_are_watched_if_asked_for_but_never_what_is_rigidly_joined(load):
    pairs = names_of(load(SCENE + "    exclude_adjacent: false\n").pairs)
    assert both("crane_base crane_boom", "crane_boom crane_hook_1") < pairs
    assert not pairs & both("crane_boom crane_lamp")


def test_pairs_of_links_are_excluded_by_name(load):
    pairs = names_of(load(SCENE + "    exclude: [[hook-1, lamp]]\n").pairs)
    assert not pairs & both("crane_hook_1 crane_lamp")
    assert both("crane_base crane_hook_1") < pairs


def test_pairs_that_touch_at_the_start_are_excluded_if_asked_for(load):
    """The boom's tube, of radius 0.05 m, starts on the axis of the base's ball, 0.2 m above it."""
    text = SCENE + "    exclude_adjacent: false\n    exclude_touching: true\n"
    low = CRANE.replace('<origin xyz="0 0 0.5"/>', '<origin xyz="0 0 0.36"/>')
    assert both("crane_base crane_boom") < names_of(load(text).pairs)
    pairs = names_of(load(text, low).pairs)
    assert not pairs & both("crane_base crane_boom")
    # The hook, 0.1 m high, starts 0.1 m below the boom's axis, and just touches the boom's end.
    assert not pairs & both("crane_boom crane_hook_1")
    pairs = names_of(load(text.replace("drop: 100", "drop: 101"), low).pairs)
    assert both("crane_boom crane_hook_1") < pairs


def test_a_link_inside_another_at_the_start_touches_it(load):
    """The hook hangs in a boom so thick that their surfaces are far apart."""
    text = SCENE + "    exclude_adjacent: false\n    exclude_touching: true\n"
    thick = CRANE.replace('radius="0.05" length="1"', 'radius="0.9" length="3"')
    assert not names_of(load(text, thick).pairs) & both("crane_boom crane_hook_1")
    hollow = text + "    solid: false\n"
    assert both("crane_boom crane_hook_1") < names_of(load(hollow, thick).pairs)


def test_links_are_solids_unless_the_robot_says_otherwise(load):
    for said, meant in (("", True), ("    solid: false\n", False), ("    solid: robust\n", True)):
        scene = load(SCENE + said)
        models = load_models(scene)
        assert [models[name].is_solid for name in models] == [True, *4 * [meant]]


def test_a_link_that_must_be_a_solid_is_told_by_key_and_line(load, tmp_path):
    load()
    (tmp_path / "crane" / "meshes" / "wedge.obj").write_text(WEDGE.rpartition("f")[0])
    scene = load(SCENE + "    meshes: visual\n    solid: true\n")
    expected = r"scene.yaml:11: robots\[0\]\.solid: true, but body 'crane_base' is not a solid: not"
    with pytest.raises(engine.ModelError, match=expected):
        load_models(scene)


def test_a_link_of_a_mesh_that_faces_inwards_and_a_box_is_one_solid(load, tmp_path):
    """If their orientations differed, each would cancel the other where they overlap."""
    load()
    inwards = WEDGE.replace(
        "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3", "f 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4"
    )
    (tmp_path / "crane" / "meshes" / "wedge.obj").write_text(inwards)
    both_shapes = CRANE.replace(
        '    <visual>\n      <origin xyz="0 0 1"/>',
        '    <visual><geometry><box size="1 1 1"/></geometry></visual>\n'
        '    <visual>\n      <origin xyz="0 0 0"/>',
    ).replace('scale="2 -1 1"', "")
    models = load_models(load(SCENE + "    meshes: visual\n", both_shapes))
    tip = engine.points([[0.1, 0.1, 0.1]])
    assert engine.signed_distance(models["crane_boom"], np.eye(4), tip, np.eye(4)).upper < 0.0


def test_a_robots_name_is_a_group(load):
    text = SCENE + "pairs:\n  watch:\n    - between: [crane, floor]\n      thresholds: {warn: 7}\n"
    pairs = load(text).pairs
    assert names_of(pairs) == both("floor crane_boom", "floor crane_hook_1", "floor crane_lamp")
    assert {pair.thresholds.warn for pair in pairs} == {0.007}


def test_poses_follow_the_joints(load):
    (robot,) = load().robots
    assert robot.topic == "joint_states"
    assert robot.start == pytest.approx({"swing": math.pi / 2, "drop": 0.1})
    assert list(robot.links) == ["crane_boom", "crane_hook_1", "crane_lamp"]
    poses = robot.poses({})
    np.testing.assert_allclose(poses["crane_hook_1"][:3, 3], [0, 1, 0.5], atol=1e-15)
    poses = robot.poses({"swing": 0.0, "somebody_elses": math.nan})
    np.testing.assert_allclose(poses["crane_hook_1"][:3, 3], [1, 0, 0.5], atol=1e-15)
    np.testing.assert_allclose(poses["crane_lamp"][:3, 3], [0.5, 0, 0.54], atol=1e-15)


def test_the_base_is_placed_in_the_scenes_unit(load):
    half = math.sqrt(0.5)
    pose = f"    pose: {{position: [1000, 0, 0], quaternion: [0, 0, {half}, {half}]}}\n"
    scene = load(SCENE + pose)
    base = next(body for body in scene.bodies if body.name == "crane_base")
    np.testing.assert_allclose(base.pose[:3, 3], [1.0, 0.0, 0.1])
    hook = scene.robots[0].poses({})["crane_hook_1"]
    np.testing.assert_allclose(hook[:3, 3], [0.0, 0.0, 0.5], atol=1e-12)


def test_shapes_of_a_link_are_one_model_in_its_frame(load):
    models = load_models(load())
    base = models["crane_base"].vertices
    np.testing.assert_allclose(base.min(axis=0), [-0.2, -0.2, -0.1])
    np.testing.assert_allclose(base.max(axis=0), [0.2, 0.2, 0.35], atol=1e-3)
    assert isinstance(models["crane_boom"], engine.SolidOfRevolution)  # its one cylinder, exactly
    assert models["crane_boom"].deviation < 1e-14
    boom = models["crane_boom"].display_mesh(1e-4).vertices
    np.testing.assert_allclose(boom.min(axis=0), [0.0, -0.05, -0.05], atol=1e-3)
    np.testing.assert_allclose(boom.max(axis=0), [1.0, 0.05, 0.05], atol=1e-3)


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def test_meshes_are_in_metres_whatever_the_unit_and_mirrored_ones_face_outwards(load):
    models = load_models(load(SCENE + "    meshes: visual\n"))
    assert set(models) == {"floor", "crane_base", "crane_boom"}
    np.testing.assert_allclose(models["crane_base"].vertices.max(axis=0), [1.0, 2.0, 3.0])
    boom = models["crane_boom"]
    np.testing.assert_allclose(boom.vertices.min(axis=0), [0.0, -2.0, 1.0])
    np.testing.assert_allclose(boom.vertices.max(axis=0), [2.0, 0.0, 4.0])
    assert volume(boom) == pytest.approx(2.0)


def test_a_robot_alone_is_a_scene(load):
    text = SCENE.replace(SCENE[SCENE.index("bodies") : SCENE.index("robots")], "")
    assert names_of(load(text).pairs) == both(
        "crane_base crane_hook_1", "crane_base crane_lamp", "crane_hook_1 crane_lamp"
    )  # fmt: skip


def test_two_robots_of_one_description(load):
    second = "  - {name: left, urdf: crane/crane.urdf, topic: left/joint_states}\n"
    scene = load(SCENE + second)
    assert [robot.topic for robot in scene.robots] == ["joint_states", "left/joint_states"]
    assert both("crane_hook_1 left_hook_1") < names_of(scene.pairs)


def test_a_script_moves_joints(load):
    from proximity_monitor import motion

    scene = load(SCENE + "motion:\n  script:\n    joints:\n"
                         "      swing: {angles_deg: [[0, 0], [2, 90]]}\n"
                         "      drop: {offsets: [[0, 0], [2, 500]]}\n")  # fmt: skip
    joints = motion.from_scene(scene).joints(1.0)
    assert joints == pytest.approx({"swing": math.pi / 4, "drop": 0.25})


FAULTS = {
    "no such file": ("crane/crane.urdf", "crane.urdf", "7: robots[0].urdf: no such file: "),
    "no robot at all": ("crane/crane.urdf", "crane/meshes/wedge.obj", "7: robots[0].urdf: "),
    "a name twice": ("name: crane", "name: floor", "6: robots[0].name: 'floor' is already"),
    "a joint that is not": (
        "swing: 90", "swinge: 90",
        "8: robots[0].angles_deg.swinge: 'swinge' is not a joint whose position can be set; did",
    ),
    "a fixed joint": ("swing: 90", "stand: 90", "8: robots[0].angles_deg.stand: 'stand' is not"),
    "a turn that slides": (
        "{swing: 90}", "{drop: 90}",
        "8: robots[0].angles_deg.drop: 'drop' slides; give its positions as 'offsets'",
    ),
    "a slide that turns": (
        "{drop: 100}", "{swing: 1}",
        "9: robots[0].offsets.swing: 'swing' turns; give its positions as 'angles_deg'",
    ),
    "beyond a limit": (
        "swing: 90", "swing: 180",
        "8: robots[0].angles_deg.swing: must be within its limits, -171.887 to 171.887",
    ),
    "beyond a limit in the unit": (
        "drop: 100", "drop: 900",
        "9: robots[0].offsets.drop: must be within its limits, 0 to 800 (got 900)",
    ),
    "a link that is not": (
        "    offsets:", "    exclude: [[hook, lamp]]\n    offsets:",
        "9: robots[0].exclude[0][0]: the robot has no link 'hook' with a shape; did you mean",
    ),
    "a link without shape": (
        "    offsets:", "    exclude: [[boom, frame]]\n    offsets:",
        "9: robots[0].exclude[0][1]: the robot has no link 'frame' with a shape",
    ),
    "a link with itself": (
        "    offsets:", "    exclude: [[lamp, lamp]]\n    offsets:",
        "9: robots[0].exclude[0]: 'lamp' and 'lamp' are the same link; name two links",
    ),
    "a bad topic": (
        "    offsets:", "    topic: no topic\n    offsets:",
        "9: robots[0].topic: must be a topic name",
    ),
    "a bad pose": (
        "    offsets:", "    pose: {position: [0, 0, 0], quaternion: [0, 0, 0, 2]}\n    offsets:",
        "9: robots[0].pose.quaternion: must have length 1",
    ),
    "a group of its name": (
        "    offsets: {drop: 100}", "pairs: {groups: {crane: [floor]}}",
        "9: pairs.groups.crane: 'crane' is a robot; give the group another name",
    ),
    "a link driven as a body": (
        "    offsets: {drop: 100}",
        "motion: {script: {bodies: {crane_boom: {keys: [{t: 0, position: [0, 0, 0]}]}}}}",
        "9: motion.script.bodies.crane_boom: 'crane_boom' is a robot link",
    ),
    "a scripted joint that is not": (
        "    offsets: {drop: 100}",
        "motion: {script: {joints: {sving: {angles_deg: [[0, 0]]}}}}",
        "9: motion.script.joints.sving: 'sving' is not a joint whose position can be set; did",
    ),
    "a scripted joint of another kind": (
        "    offsets: {drop: 100}",
        "motion: {script: {joints: {swing: {offsets: [[0, 0]]}}}}",
        "9: motion.script.joints.swing: 'swing' turns; give its positions as 'angles_deg'",
    ),
    "unknown meshes": (
        "    offsets:", "    meshes: both\n    offsets:",
        "9: robots[0].meshes: must be one of 'collision', 'visual'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("old, new, expected", FAULTS.values(), ids=FAULTS)
def test_faults_are_told_by_key_and_line(problems, old, new, expected):
    assert old in SCENE
    found = problems(SCENE.replace(old, new, 1))
    assert len(found) == 1
    assert found[0].startswith(expected)


@pytest.mark.parametrize(
    ("link", "names"),
    [("hook 1", ("crane_hook-1", "crane_hook 1")), ("Boom", ("crane_boom", "crane_Boom")),
     ("BOOM", ("crane_boom", "crane_BOOM"))],
)  # fmt: skip
def test_links_whose_small_letters_are_the_same_keep_their_own(load, link, names):
    scene = load(SCENE, CRANE.replace('"lamp"', f'"{link}"'))
    bodies = {body.name for body in scene.bodies}
    assert bodies >= set(names) and len({safe(body) for body in bodies}) == len(bodies) == 5
    assert {scene.robots[0].links[name] for name in names} >= {link}


def test_links_of_one_name_with_the_robots_in_front_are_told(problems):
    (found,) = problems(SCENE, CRANE.replace('"lamp"', '"crane_boom"'))
    assert (
        "would become the body 'crane_boom', but that name is already used; give the robot" in found
    )


@pytest.mark.parametrize("robot_first", [True, False])
def test_a_robot_that_has_a_links_name_is_told(problems, robot_first):
    named = "crane_boom"
    robots = [f"  - {{name: {name}, urdf: crane/crane.urdf}}\n" for name in ("crane", named)]
    head = SCENE[: SCENE.index("  - name: crane")]
    found = problems(head + "".join(reversed(robots) if robot_first else robots))
    assert any(f"'{named}'" in line and "already used" in line for line in found), found


def test_a_body_that_has_a_links_name_is_told(problems):
    (found,) = problems(SCENE.replace("name: floor", "name: crane_boom"))
    assert found.startswith("6: robots[0].name: link 'boom' would become the body 'crane_boom'")


@pytest.mark.parametrize(
    ("filename", "message"),
    [
        ("meshes/gone.obj", "link 'Base': no such file: "),
        ("package://crane/../../secret.obj", "is outside its package"),
        ("package://crane//etc/secret.obj", "is outside its package"),
        ("package:///etc/passwd", "must have the form package://PACKAGE/PATH"),
        ("package://elsewhere/part.obj", "package 'elsewhere' was not found"),
        ("file://meshes/wedge.obj", "must have the form file:///PATH"),
        ("http://example.com/part.obj", "must begin with package:// or file://"),
    ],
)
@pytest.mark.parametrize("touching", ["true", "false"])
def test_meshes_that_are_not_there(problems, filename, message, touching):
    urdf = CRANE.replace("meshes/wedge.obj", filename, 1)
    text = f"{SCENE}    meshes: visual\n    exclude_touching: {touching}\n"
    (found,) = problems(text, urdf)
    assert found.startswith("7: robots[0].urdf: ")
    assert message in found


def test_a_mesh_by_its_absolute_path(load, tmp_path):
    there = (tmp_path / "crane" / "meshes" / "wedge.obj").as_uri()
    models = load_models(load(SCENE + "    meshes: visual\n",
                              CRANE.replace("meshes/wedge.obj", there, 1)))  # fmt: skip
    np.testing.assert_allclose(models["crane_base"].vertices.max(axis=0), [1.0, 2.0, 3.0])


def test_a_mesh_of_another_package_in_the_workspace(load, tmp_path, monkeypatch):
    share = tmp_path / "ws" / "share" / "elsewhere"
    share.mkdir(parents=True)
    (share / "part.obj").write_text(WEDGE.replace("v 1 0 0", "v 9 0 0"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ws"))
    urdf = CRANE.replace("meshes/wedge.obj", "package://elsewhere/part.obj", 1)
    models = load_models(load(SCENE + "    meshes: visual\n", urdf))
    assert models["crane_base"].vertices.max() == 9.0


def test_a_description_that_is_not_installed_says_how_to_get_it(problems, monkeypatch):
    def nothing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(paths.metadata, "files", nothing)
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    (found,) = problems(SCENE.replace("crane/crane.urdf", "package://example-robot-data/a.urdf"))
    assert found.endswith(
        "source the workspace that contains it, or, in the checkout: pip install '.[robots]'"
    )
