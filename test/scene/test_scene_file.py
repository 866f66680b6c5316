"""What a scene file says, and every fault of its form, reported with line and key."""

import numpy as np
import pytest

from proximity_monitor.scene import (
    Box,
    Cone,
    Cylinder,
    SceneError,
    Sphere,
    Thresholds,
    Torus,
    load_scene,
)

FULL = """\
version: 1
frame: cell
unit: mm
rate_hz: 25
budget_ms: 5
tolerance: {rel_err: 0.01, abs_err: 0.5}
thresholds: {warn: 10, stop: 2, hysteresis: 1e-1}
bodies:
  - name: table
    model: part.stl
    scale: 2
    pose: {position: [1, 2, 3], quaternion: [0, 0, 0.7071, 0.7071]}
    colour: [0.1, 0.2, 0.3]
  - name: arm
    primitive: {cylinder: {radius: 50, height: 400}}
    topic: /cell/arm
  - name: tool
    primitive: {sphere: {radius: 30, subdivisions: 2}}
    moving: true
    colour: [0, 0, 0, 0.5]
  - name: bin
    primitive: {box: {size: [100, 200, 300]}}
    pose: {position: [0, 0, 0]}
"""

# A sound scene, in which tests put faults; the bodies begin on line 4.
HEAD = "version: 1\nunit: m\nbodies:\n"
BALL = "  - {name: ball, primitive: {sphere: {radius: 1}}, moving: true}\n"
ROOM = "  - {name: room, primitive: {box: {size: [9, 9, 9]}}, pose: {position: [0, 0, 0]}}\n"


def test_a_whole_file_in_si_units(load, tmp_path):
    scene = load(FULL)
    table, arm, tool, bin_ = scene.bodies
    assert scene.path == tmp_path / "scene.yaml"
    assert (scene.frame, scene.rate_hz, scene.budget_s) == ("cell", 25.0, 0.005)
    assert (scene.unit.name, scene.unit.to_metre, scene.unit.symbol) == ("millimetre", 1e-3, "mm")
    assert scene.thresholds.warn == pytest.approx(0.01, rel=1e-15)
    assert scene.thresholds.hysteresis == pytest.approx(1e-4, rel=1e-15)
    assert table.model == tmp_path / "part.stl"
    assert (table.scale, table.topic, table.moving) == (2.0, None, False)
    assert table.colour == (0.1, 0.2, 0.3, 1.0)
    assert arm.primitive == Cylinder(radius=0.05, height=0.4)
    assert (arm.model, arm.pose, arm.topic, arm.moving) == (None, None, "/cell/arm", True)
    assert tool.primitive == Sphere(radius=0.03, subdivisions=2)
    assert tool.topic == "bodies/tool/pose"
    assert bin_.primitive == Box((0.1, 0.2, 0.3))
    assert scene.motion is None


def test_a_rounded_quaternion_is_normalised_exactly(load):
    pose = load(FULL).bodies[0].pose
    turned = [[0, -1, 0, 0.001], [1, 0, 0, 0.002], [0, 0, 1, 0.003], [0, 0, 0, 1]]
    np.testing.assert_allclose(pose, turned, atol=1e-15)
    assert not pose.flags.writeable


def test_what_may_be_left_out(load):
    scene = load(HEAD + BALL + ROOM)
    assert (scene.frame, scene.rate_hz, scene.budget_s) == ("world", 30.0, 0.008)
    assert scene.thresholds == Thresholds(0.0, 0.0, 0.0)
    assert scene.bodies[0].colour == (0.7, 0.7, 0.7, 1.0)
    assert scene.bodies[0].scale == 1.0
    assert [(pair.rel_err, pair.abs_err) for pair in scene.pairs] == [(0.0, 0.0)]


def test_inches(load):
    scene = load(FULL.replace("unit: mm", "unit: in"))
    assert scene.bodies[1].primitive.radius == pytest.approx(50 * 0.0254)
    assert scene.pairs[0].abs_err == pytest.approx(0.5 * 0.0254)


SCHEMA_FAULTS = {
    "unknown key": (
        "unit: m\n",
        "unit: m\nratehz: 3\n",
        "3: ratehz: unknown key; did you mean 'rate_hz'?",
    ),
    "unknown key unlike any": (
        "unit: m\n",
        "unit: m\nq: 3\n",
        "3: q: unknown key; known: version, description, frame, unit",
    ),
    "unknown unit": (
        "unit: m\n",
        "unit: cm\n",
        "2: unit: must be one of 'm', 'mm', 'in' (got 'cm')",
    ),
    "unit missing": ("unit: m\n", "", "1: needs the key 'unit'"),
    "nothing to watch": (f"bodies:\n{BALL}{ROOM}", "", "1: needs the key 'bodies' or 'robots'"),
    "no bodies": (BALL + ROOM, "  []\n", "3: bodies: must have at least 1 entry (got 0)"),
    "text for a number": (
        "unit: m\n",
        "unit: m\nrate_hz: fast\n",
        "3: rate_hz: must be a number (got 'fast')",
    ),
    "yes for a number": (
        "unit: m\n",
        "unit: m\nrate_hz: yes\n",
        "3: rate_hz: must be a number (got true)",
    ),
    "rate": ("unit: m\n", "unit: m\nrate_hz: 0\n", "3: rate_hz: must be at least 0.1 (got 0)"),
    "budget": (
        "unit: m\n",
        "unit: m\nbudget_ms: -1\n",
        "3: budget_ms: must be at least 0 (got -1)",
    ),
    "frame": ("unit: m\n", "unit: m\nframe: /a b\n", "3: frame: must be a frame name"),
    "empty section": (
        "unit: m\n",
        "unit: m\ntolerance:\n",
        "3: tolerance: must be a mapping (got nothing)",
    ),
    "negative tolerance": (
        "unit: m\n",
        "unit: m\ntolerance:\n  abs_err: -1\n",
        "4: tolerance.abs_err: must be at least 0 (got -1)",
    ),
    "negative hysteresis": (
        "unit: m\n",
        "unit: m\nthresholds:\n  warn: 1\n  hysteresis: -1\n",
        "5: thresholds.hysteresis: must be at least 0 (got -1)",
    ),
    "body is no mapping": (BALL, "  - ball\n", "4: bodies[0]: must be a mapping (got 'ball')"),
    "name missing": ("name: ball, ", "", "4: bodies[0]: needs the key 'name'"),
    "name with an edge": (
        "name: ball",
        "name: ' Ball'",
        "4: bodies[0].name: must be a text of 1 to",
    ),
    "name like a pair": ("name: ball", "name: a - b", "4: bodies[0].name: must be a text of 1 to"),
    "scale 0": (
        "moving: true",
        "scale: 0, moving: true",
        "4: bodies[0].scale: must be greater than 0 (got 0)",
    ),
    "scale negative": (
        "moving",
        "scale: -1, moving",
        "4: bodies[0].scale: must be greater than 0 (got -1)",
    ),
    "scale misspelt": (
        "moving",
        "scal: 1, moving",
        "4: bodies[0].scal: unknown key; did you mean 'scale'?",
    ),
    "neither shape": (
        "primitive: {sphere: {radius: 1}}, ",
        "",
        "4: bodies[0]: needs exactly one of 'model', 'primitive', 'cloud' (got none)",
    ),
    "both shapes": (
        "moving",
        "model: part.stl, moving",
        "4: bodies[0]: needs exactly one of 'model', 'primitive', 'cloud' (got 'model' and"
        " 'primitive')",
    ),
    "neither pose nor topic": (
        ", moving: true",
        "",
        "4: bodies[0]: needs exactly one of 'pose', 'topic', 'moving', 'cloud' (got none)",
    ),
    "topic and moving": (
        "moving",
        "topic: ball, moving",
        "4: bodies[0]: needs exactly one of 'pose', 'topic', 'moving', 'cloud' (got 'topic' and"
        " 'moving')",
    ),
    "not moving": (
        "moving: true",
        "moving: false",
        "4: bodies[0].moving: must be true (got false)",
    ),
    "two primitives": (
        "radius: 1}",
        "radius: 1}, box: {size: [1, 1, 1]}",
        "4: bodies[0].primitive: must have exactly 1 key of box, cylinder, sphere, capsule, cone, "
        "torus, point (got 2)",
    ),
    "radius 0": (
        "radius: 1",
        "radius: 0",
        "4: bodies[0].primitive.sphere.radius: must be greater than 0 (got 0)",
    ),
    "flat box": (
        "9, 9, 9",
        "9, 9, 0",
        "5: bodies[1].primitive.box.size[2]: must be greater than 0 (got 0)",
    ),
    "part of a triangle": (
        "radius: 1",
        "radius: 1, subdivisions: 1.5",
        "4: bodies[0].primitive.sphere.subdivisions: must be a whole number (got 1.5)",
    ),
    "short position": (
        "0, 0, 0",
        "0, 0",
        "5: bodies[1].pose.position: must have exactly 3 entries (got 2)",
    ),
    "position missing": ("position: [0, 0, 0]", "", "5: bodies[1].pose: needs the key 'position'"),
    "short quaternion": (
        "[0, 0, 0]}",
        "[0, 0, 0], quaternion: [0, 0, 1]}",
        "5: bodies[1].pose.quaternion: must have exactly 4 entries (got 3)",
    ),
    "colour": (
        "moving",
        "colour: [0, 0, 255], moving",
        "4: bodies[0].colour[2]: must be at most 1 (got 255)",
    ),
    "long colour": (
        "moving",
        "colour: [0, 0, 0, 0, 0], moving",
        "4: bodies[0].colour: must have 3 to 4 entries (got 5)",
    ),
    "empty topic": ("moving: true", "topic: ''", "4: bodies[0].topic: must not be empty"),
    "not a number": (
        "radius: 1",
        "radius: .nan",
        "4: bodies[0].primitive.sphere.radius: must be a finite",
    ),
    "infinite": (
        "0, 0, 0",
        "0, -.inf, 0",
        "5: bodies[1].pose.position[1]: must be a finite number (got -.inf)",
    ),
    "too large for a float": (
        "radius: 1",
        "radius: 1e999",
        "4: bodies[0].primitive.sphere.radius: must be a fin",
    ),
    "stands twice": ("unit: m\n", "unit: m\nunit: mm\n", "3: unit: appears twice, first on line 2"),
    "a date": ("name: ball", "name: 2024-01-01", "4: bodies[0].name: is a YAML timestamp"),
    "code": (
        "name: ball",
        "name: !!python/object/apply:os.getcwd []",
        "4: bodies[0].name: is a YAML python/object",
    ),
    "control characters": (
        "name: ball",
        'name: "ball\\n"',
        "4: bodies[0].name: must not contain control",
    ),
}


@pytest.mark.parametrize("old, new, expected", SCHEMA_FAULTS.values(), ids=SCHEMA_FAULTS)
def test_faults_of_form(problems, old, new, expected):
    text = HEAD + BALL + ROOM
    assert old in text
    found = problems(text.replace(old, new))
    assert len(found) == 1
    assert found[0].startswith(expected)


def with_primitive(text):
    return HEAD + BALL.replace("sphere: {radius: 1}", text).replace("moving", "\n    moving") + ROOM


@pytest.mark.parametrize(
    "text, expected",
    [
        ("cone: {radius: 20, height: 60}", Cone(0.02, 0.06)),
        ("cone: {radius: 20, top_radius: 0, height: 60}", Cone(0.02, 0.06)),
        ("cone: {radius: 20, top_radius: 30, height: 60}", Cone(0.02, 0.06, 0.03)),
        ("torus: {radius: 20, tube: 5}", Torus(0.02, 0.005)),
        ("torus: {radius: 20, tube: 20}", Torus(0.02, 0.02)),
    ],
)
def test_cones_and_tori_in_the_scenes_unit(load, text, expected):
    scene = load(with_primitive(text).replace("unit: m\n", "unit: mm\n"))
    assert scene.bodies[0].primitive == expected


@pytest.mark.parametrize(
    "text, expected",
    [
        ("cone: {radius: 0, height: 1}", "cone.radius: must be greater than 0 (got 0)"),
        ("cone: {radius: 1, height: -1}", "cone.height: must be greater than 0 (got -1)"),
        ("cone: {radius: 1}", "cone: needs the key 'height'"),
        (
            "cone: {radius: 1, top_radius: -1, height: 1}",
            "cone.top_radius: must be at least 0 (got -1)",
        ),
        (
            "cone: {radius: 1, top_radius: .nan, height: 1}",
            "cone.top_radius: must be a finite number (got .nan)",
        ),
        ("torus: {radius: .nan, tube: 1}", "torus.radius: must be a finite number (got .nan)"),
        ("torus: {radius: 1, tube: 0}", "torus.tube: must be greater than 0 (got 0)"),
        ("torus: {radius: 1, tube: 1.5}", "torus.tube: must be at most the radius, 1 (got 1.5)"),
    ],
)
def test_faults_of_cones_and_tori(problems, text, expected):
    assert problems(with_primitive(text)) == [f"4: bodies[0].primitive.{expected}"]


@pytest.mark.parametrize("text", ["cone: {radius: 1, height: 1}", "torus: {radius: 2, tube: 1}"])
def test_cones_and_tori_are_solids_without_being_told(problems, text):
    (found,) = problems(with_primitive(text).replace("moving", "solid: robust, moving"))
    assert found.startswith("5: bodies[0].solid: robust is only for meshes")


def test_all_faults_of_form_are_told_together_in_the_order_of_lines(problems):
    found = problems("bodies: []\nunit: cm\nversion: 1\nbudgetms: 3\n")
    assert [line[0] for line in found] == ["1", "2", "4"]


@pytest.mark.parametrize("version", ["2", "0", "'1'", "1.0", "true", "[1]"])
def test_another_version_is_the_only_thing_said(problems, version):
    (found,) = problems(f"version: {version}\nelements: []\n")
    assert found.startswith("1: version: ")
    assert found.endswith(" is not supported; this release reads version 1")


TEXT_FAULTS = {
    "empty": ("", "is empty"),
    "only a comment": ("# nothing\n", "is empty"),
    "no mapping": ("[1, 2]", "1: must be a mapping (got a list)"),
    "broken": ("version: 1\nunit: [m\n", "3: is not valid YAML: while parsing a flow sequence"),
    "tab": ("version: 1\n\tunit: m\n", "2: is not valid YAML"),
    "two documents": ("version: 1\n---\nversion: 1\n", "2: is not valid YAML"),
    "a list as key": ("? [1]\n: 2\n", "1: a key must be a plain word"),
    "a control character in a key": ('version: 1\n"a\\0": 2\n', "2: a key must not contain"),
    "a control character": ("version: 1\nunit: \x01\n", "2: is not text"),
    "deep": ("[" * 5000, "is nested deeper than"),
    "deep in blocks": ("- " * 5000 + "1", "is nested deeper than"),
    "deeper than a scene is": ("[" * 40 + "]" * 40, "1: is nested deeper than 32 levels"),
    "an alias of itself": ("version: &a [*a]\n", "1: is nested deeper than 32 levels"),
    "aliases that multiply": (
        "a0: &a0 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n"
        + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 10)),
        "has more than 200000 values",
    ),
}


@pytest.mark.parametrize("text, expected", TEXT_FAULTS.values(), ids=TEXT_FAULTS)
def test_faults_of_the_text(load, text, expected):
    with pytest.raises(SceneError) as caught:
        load(text)
    assert expected in str(caught.value)
    assert str(caught.value).count("\n") == 0


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(SceneError, match=r"none\.yaml: cannot be read: No such file"):
        load_scene(tmp_path / "none.yaml")
    with pytest.raises(SceneError, match="cannot be read: Is a directory"):
        load_scene(str(tmp_path))
    with pytest.raises(SceneError, match="cannot be read"):
        load_scene("a\0b")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"version: 1\n\xff\xfe\x00")
    with pytest.raises(SceneError, match=r"binary\.yaml:2: is not UTF-8 text"):
        load_scene(binary)
    binary.write_bytes(b"#" * (4 * 1024 * 1024 + 1))
    with pytest.raises(SceneError, match="larger than 4 MiB"):
        load_scene(binary)


def test_a_byte_order_mark_and_foreign_line_ends_do_no_harm(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + (HEAD + BALL + ROOM).replace("\n", "\r\n").encode())
    assert len(load_scene(path).bodies) == 2
