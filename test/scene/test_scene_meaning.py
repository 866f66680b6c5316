"""Faults that the form alone does not show: names, poses, thresholds, files."""

import pytest

from proximity_monitor.scene import SceneError, bundled, load_scene

TEXT = """\
version: 1
unit: mm
thresholds:
  warn: 5
  stop: 1
bodies:
  - name: base
    model: part.stl
    pose:
      position: [0, 0, 0]
      quaternion: [0, 0, 0, 1]
  - name: arm
    primitive: {box: {size: [1, 1, 1]}}
    moving: true
  - name: tool
    primitive: {box: {size: [1, 1, 1]}}
    topic: tool_pose
pairs:
  groups:
    both: [arm, tool]
  watch:
    - between: [both, base]
      thresholds: {warn: 3}
    - between: [arm, tool]
"""

FAULTS = {
    "name taken": (
        "name: tool\n",
        "name: arm\n",
        "15: bodies[2].name: 'arm' is already used on line 12",
    ),
    "topic taken": (
        "topic: tool_pose",
        "topic: bodies/arm/pose",
        "17: bodies[2].topic: 'bodies/arm/pose' is already used on line 12",
    ),
    "no file": ("part.stl", "meshes/part.stl", "8: bodies[0].model: no such file: /"),
    "a folder": ("part.stl", ".", "8: bodies[0].model: no such file: /"),
    "a name too long": ("part.stl", "p" * 5000, "8: bodies[0].model: no such file: /"),
    "package without path": (
        "part.stl",
        "package://x",
        "8: bodies[0].model: must have the form package:",
    ),
    "unknown package": (
        "part.stl",
        "package://no_such/a.stl",
        "8: bodies[0].model: package 'no_such' was not found in AMENT_PREFIX_PATH",
    ),
    "quaternion": (
        "[0, 0, 0, 1]",
        "[0, 0, 1, 1]",
        "11: bodies[0].pose.quaternion: must have length 1 (got 1.41421)",
    ),
    "quaternion of zeros": (
        "[0, 0, 0, 1]",
        "[0, 0, 0, 0]",
        "11: bodies[0].pose.quaternion: must have length 1 (got 0)",
    ),
    "thresholds crossed": (
        "stop: 1",
        "stop: 9",
        "3: thresholds: warn must not be less than stop (got warn 5, stop 9 mm)",
    ),
    "a pair's thresholds crossed": (
        "{warn: 3}",
        "{warn: 0.5}",
        "23: pairs.watch[0].thresholds: warn must not be less than stop (got warn 0.5, stop 1 mm)",
    ),
    "unknown name": (
        "[arm, tool]\n  w",
        "[arm, tol]\n  w",
        "20: pairs.groups.both[1]: nothing is named 'tol'; did you mean 'tool'?",
    ),
    "unknown name in watch": (
        "[both, base]",
        "[both, q]",
        "22: pairs.watch[0].between[1]: nothing is named 'q'; known: base, arm, tool, both",
    ),
    "group named as a body": ("both:", "arm:", "20: pairs.groups.arm: 'arm' is a body"),
    "group of illegal name": ("both:", "'a - b':", "20: pairs.groups.a - b: must be a text of 1"),
    "a name twice in a group": (
        "[arm, tool]\n  w",
        "[arm, arm]\n  w",
        "20: pairs.groups.both: must not contain anything twice",
    ),
    "body against itself": (
        "between: [arm, tool]",
        "between: [arm, arm]",
        "24: pairs.watch[1].between: 'arm' and 'arm' are the same body",
    ),
    "three names": (
        "between: [arm, tool]",
        "between: [arm, tool, base]",
        "24: pairs.watch[1].between: must have exactly 2 entries (got 3)",
    ),
    "unknown name in exclude": (
        "  watch:",
        "  exclude:\n    - [arm, bse]\n  watch:",
        "22: pairs.exclude[0][1]: nothing is named 'bse'; did you mean 'base'?",
    ),
    "everything excluded": (
        "  watch:",
        "  exclude: [[both, base], [arm, tool]]\n  watch:",
        "18: pairs: leaves no pair to watch",
    ),
    "another word for pairs": (
        TEXT[TEXT.index("pairs:") :],
        "pairs: everything\n",
        "18: pairs: must be 'all' (got 'everything')",
    ),
}


@pytest.mark.parametrize("old, new, expected", FAULTS.values(), ids=FAULTS)
def test_faults(problems, old, new, expected):
    assert old in TEXT
    found = problems(TEXT.replace(old, new))
    assert any(line.startswith(expected) for line in found), found


def test_the_text_is_sound_without_a_fault(load):
    assert len(load(TEXT).pairs) == 3


def test_two_fixed_bodies_cannot_be_watched(problems):
    text = TEXT.replace("moving: true", "pose: {position: [0, 0, 0]}")
    found = problems(text.replace("between: [arm, tool]", "between: [arm, base]"))
    (fixed,) = [line for line in found if "fixed" in line]
    assert fixed.startswith("24: pairs.watch[1].between: 'arm' and 'base' are fixed")


def test_all_faults_of_meaning_are_told_together(problems):
    text = TEXT.replace("part.stl", "gone.stl").replace("name: tool\n", "name: arm\n")
    assert [int(line.partition(":")[0]) for line in problems(text)] == [8, 15, 20, 24]


@pytest.mark.parametrize("topic", ["/a", "~/a", "a/b_1", "_a/B", "/cell_1/arm/pose"])
def test_legal_topics(load, topic):
    assert load(TEXT.replace("tool_pose", topic)).bodies[2].topic == topic


@pytest.mark.parametrize(
    "topic", ["a b", "/", "a/", "a//b", "1a", "a/1", "a~b", "~a", "{node}", "é"]
)
def test_illegal_topics(problems, topic):
    (found,) = problems(TEXT.replace("tool_pose", f"'{topic}'"))
    assert found.startswith("17: bodies[2].topic: must be a topic name")


def test_model_in_another_package(load, tmp_path, monkeypatch):
    share = tmp_path / "overlay" / "share" / "robot_parts" / "meshes"
    share.mkdir(parents=True)
    (share / "base.stl").write_text("")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nonexistent::{tmp_path / 'overlay'}")
    text = TEXT.replace("part.stl", "package://robot_parts/meshes/base.stl")
    assert load(text).bodies[0].model == share / "base.stl"
    with pytest.raises(SceneError, match=r"no such file: /.*/share/robot_parts/gone\.stl"):
        load(text.replace("meshes/base", "gone"))


def test_the_own_package_is_found_without_a_workspace(load, monkeypatch):
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    model = (
        load(TEXT.replace("part.stl", "package://proximity_monitor/package.xml")).bodies[0].model
    )
    assert model.name == "package.xml"
    path = "package://proximity_monitor/scene/bundled/engine/scene.yaml"
    assert load(TEXT.replace("part.stl", path)).bodies[0].model == bundled("engine")


def test_absolute_model_path(load, tmp_path):
    (tmp_path / "elsewhere.stl").write_text("")
    model = load(TEXT.replace("part.stl", f"{tmp_path}/elsewhere.stl")).bodies[0].model
    assert model == tmp_path / "elsewhere.stl"


def test_bundled_scenes_load():
    scene = load_scene(bundled("engine"))
    assert scene.path == bundled("engine")
    assert all(body.model.is_file() for body in scene.bodies)


@pytest.mark.parametrize("name", ["nope", "", "../bundled/engine"])
def test_unknown_bundled_scene(name):
    with pytest.raises(SceneError, match=r"no bundled scene '.*'; known: .*\bengine\b"):
        bundled(name)


def test_a_topic_is_no_longer_than_dds_allows(problems, load):
    text = "version: 1\nunit: m\nbodies:\n  - {name: a, primitive: {point: {}}, topic: TOPIC}\n"
    text += "  - {name: b, primitive: {point: {}}, moving: true}\n"
    assert load(text.replace("TOPIC", "x" * 200)).bodies[0].topic == "x" * 200
    (found,) = problems(text.replace("TOPIC", "x" * 201))
    assert found == "4: bodies[0].topic: must have at most 200 characters as a topic (got 201)"


def test_of_many_problems_the_first_are_told_soon(problems):
    names = [f"part_{k:04d}" for k in range(200)]
    bodies = "".join(
        f"  - {{name: {n}, primitive: {{point: {{}}}}, moving: true}}\n" for n in names
    )
    wrong = "".join(f"      - {name.replace('_', '-')}\n" for name in names)
    text = f"version: 1\nunit: m\nbodies:\n{bodies}pairs:\n  groups:\n    g:\n{wrong}"
    found = problems(text)
    assert len(found) == 21 and found[-1] == " and 180 more"
    assert found[0].endswith("nothing is named 'part-0000'; did you mean 'part_0000'?")
    (found, *_) = problems(text.replace("part-", "XY"))
    assert found.endswith("part_0018, part_0019 and 180 more")


def test_a_range_may_equal_what_it_has_to_hold(load):
    """In binary floating point, 0.2 + 0.1 is more than 0.3."""
    scene = load(
        "version: 1\nunit: m\nrange: 0.3\nthresholds: {warn: 0.2, hysteresis: 0.1}\nbodies:\n"
        "  - {name: a, primitive: {point: {}}, moving: true}\n"
        "  - {name: b, primitive: {point: {}}, moving: true}\n"
    )
    (pair,) = scene.pairs
    assert pair.range == 0.2 + 0.1


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("warn: 2", "warn: 010", "4: thresholds.warn: 010 is a different number in YAML 1.1"),
        ("warn: 2", "warn: 1:30", "4: thresholds.warn: 1:30 is a different number in YAML 1.1"),
        ("name: a", "name: on", "must be text (got true); if it is text, put it in quotes"),
        ("moving: true", "<<: {moving: true}", "bodies[0].<<: merge keys are not supported; write"),
    ],
)
def test_what_yaml_makes_of_plain_words_is_told(problems, old, new, told):
    text = (
        "version: 1\nunit: m\nbodies: [{name: a, primitive: {point: {}}, moving: true}]\n"
        "thresholds: {warn: 2}\n"
    )
    found = problems(text.replace(old, new))
    assert any(told in line for line in found), found
    assert not any("unknown key" in line for line in found)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("position: [0, 0, 0]", "position: [0, -1e300, 0]",
         "10: bodies[0].pose.position[1]: must be at least -1e+09 m (got -1e+300 mm)"),
        ("warn: 5", "warn: 1.1e9", "4: thresholds.warn: must be at most 1e+06 m (got 1.1e+09 mm)"),
        ("stop: 1", "hysteresis: 1e300", "5: thresholds.hysteresis: must be at most 1e+06 m"),
        ("warn: 3", "stop: 1e10", "23: pairs.watch[0].thresholds.stop: must be at most 1e+06 m"),
        ("unit: mm", "unit: mm\ntolerance: {abs_err: 1e10}", "3: tolerance.abs_err: must be at mo"),
        ("unit: mm", "unit: mm\nrange: 1e13", "3: range: must be at most 1e+09 m"),
        ("size: [1, 1, 1]", "size: [1, 1e13, 1]", "primitive.box.size[1]: must be at most 1e+09 m"),
        ("moving: true", "deviation: 1e13\n    moving: true", "deviation: must be at most 1e+09 m"),
    ],
)  # fmt: skip
def test_lengths_have_limits_in_metres(problems, old, new, told):
    assert told in problems(TEXT.replace(old, new))[0]


@pytest.mark.parametrize(("unit", "most"), [("m", 1e6), ("mm", 1e9), ("in", 39370078)])
def test_a_length_may_equal_its_limit(load, unit, most):
    scene = load(TEXT.replace("unit: mm", f"unit: {unit}").replace("warn: 5", f"warn: {most!r}"))
    assert 1e6 - 0.03 < scene.thresholds.warn <= 1e6
