"""Names of bodies as CAD has them, and the words that stand for them in ROS."""

import subprocess
import sys

import pytest

from proximity_monitor.scene import load_scene
from proximity_monitor.scene.naming import safe

LONG = "Grundplatte " + "sehr lang, mit Überlänge; " * 5 + '(links) 7/8"'
CHINESE = "轴承座 左"
SCENE = f"""
version: 1
unit: mm
bodies:
  - {{name: '{LONG}', primitive: {{box: {{size: [9, 9, 9]}}}}, moving: true}}
  - {{name: {CHINESE}, primitive: {{box: {{size: [9, 9, 9]}}}}, moving: true}}
  - {{name: M8x40 v1.2, primitive: {{box: {{size: [9, 9, 9]}}}}, pose: {{position: [50, 0, 0]}}}}
pairs:
  groups: {{Links & rechts: ['{LONG}', {CHINESE}]}}
  watch: [{{between: [Links & rechts, M8x40 v1.2], thresholds: {{warn: 5, stop: 1}}}}]
"""


@pytest.fixture
def path(tmp_path):
    found = tmp_path / "scene.yaml"
    found.write_text(SCENE, encoding="utf-8")
    return found


def test_names_stay_as_they_are_and_topics_get_words(path):
    scene = load_scene(path)
    assert [body.name for body in scene.bodies] == [LONG, CHINESE, "M8x40 v1.2"]
    assert [(pair.a, pair.b) for pair in scene.pairs] == [
        (LONG, "M8x40 v1.2"),
        (CHINESE, "M8x40 v1.2"),
    ]
    topics = [body.topic for body in scene.bodies[:2]]
    assert topics == [f"bodies/{safe(name)}/pose" for name in (LONG, CHINESE)]
    assert topics[1].startswith("bodies/part_")


@pytest.mark.parametrize("name", ["ball", "Ball", "b_1", "x" * 156])
def test_a_word_stands_for_itself(name):
    assert safe(name) == name


@pytest.mark.parametrize("name", [LONG, CHINESE, "1", "x" * 190, "_", "a/b", "a.b", "Ärmel", "-"])
def test_every_other_name_has_a_word_of_its_own(name):
    word = safe(name)
    assert safe(word) == word and word != name
    assert len(word) <= 50 and "__" not in word
    assert safe(name + "x") != word


def test_check_shows_the_words(path):
    command = [sys.executable, "-m", "proximity_monitor", "scene", "check", path]
    said = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=True)
    assert f"moving, bodies/{safe(CHINESE)}/pose" in said.stdout
    assert f"fixed; {safe('M8x40 v1.2')} in topics and parameters" in said.stdout
