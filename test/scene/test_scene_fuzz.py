"""Any text in a scene file gives a scene or a SceneError."""

import random

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from proximity_monitor.scene import Scene, SceneError, bundled, load_scene

SOUND = """\
version: 1
frame: cell
unit: mm
rate_hz: 25
budget_ms: 5
tolerance: {rel_err: 0.01, abs_err: 0.5}
thresholds: {warn: 10, stop: 2, hysteresis: 1e-1}
bodies:
  - name: table
    primitive: {box: {size: [100, 200, 300]}}
    pose: {position: [1, 2, 3], quaternion: [0, 0, 0, 1]}
    colour: [0.1, 0.2, 0.3]
  - {name: shaft, primitive: {cylinder: {radius: 50, height: 400, segments: 16}}, topic: /cell/arm}
  - {name: piston, primitive: {sphere: {radius: 30, subdivisions: 2}}, scale: 2, moving: true}
  - {name: cart, primitive: {cone: {radius: 3, top_radius: 2, height: 1}}, moving: true}
  - {name: door, primitive: {torus: {radius: 3, tube: 2}}, moving: true}
  - {name: tool, primitive: {box: {size: [1, 2, 3]}}, moving: true}
pairs:
  groups: {both: [shaft, piston]}
  watch:
    - {between: [both, table], thresholds: {warn: 5, stop: 1}}
    - {between: [both, both], tolerance: {rel_err: 0}}
  exclude: [[shaft, table]]
robots:
  - name: crane
    urdf: crane.urdf
    pose: {position: [0, 500, 0]}
    angles_deg: {swing: 30}
    offsets: {drop: 20}
    exclude: [[boom, hook]]
motion:
  slider_crank:
    crank: shaft
    crank_origin: [0, 0, 50]
    crank_axis: [0, 2, 0]
    slide_direction: [0, 0, 1]
    crank_radius: 30
    rod_length: 110
    rpm: 60
    pistons: {piston: {phase_deg: 90, offset: [0, 20, 0]}}
  script:
    loop: false
    bodies:
      cart:
        keys:
          - {t: 0, position: [1, 2, 3], quaternion: [0, 0, 0, 1]}
          - {t: 1.5, position: [1, 2, 3], rotation: {axis: [0, 1, 1], angle_deg: 90}}
      door: {hinge: {origin: [1, 0, 0], axis: [0, 0, 1], angles_deg: [[0, 0], [1, 90]]}}
    joints: {swing: {angles_deg: [[0, 0], [5, 90]]}}
  bag: {path: ., topics: {/tool: tool}, rate: 2, seek_s: 1}
"""
CRANE = """<robot name="crane">
  <link name="base"/>
  <link name="boom"><collision><geometry><box size="1 0.1 0.1"/></geometry></collision></link>
  <link name="hook"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="swing" type="continuous"><parent link="base"/><child link="boom"/></joint>
  <joint name="drop" type="prismatic"><parent link="boom"/><child link="hook"/></joint>
</robot>
"""
WORDS = """
null true -1 0 1e999 .nan .inf 1e308 -1e308 1e-320 2 0x10 1:30 2024-01-01 '' {} [] [[]] {a: 1}
table shaft piston both all package://a/b /dev/null &a *a !!int !!set <<: ? | > % @ ` # --- ...
"""

SOUND_DATA = yaml.safe_load(SOUND)  # parsed once: it takes as long as reading a scene
values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(["table", "shaft", "piston", "both", "all", "m", "mm"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)
relaxed = settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


def holds(path, text: str | bytes) -> None:
    path.with_name("crane.urdf").write_text(CRANE)
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    try:
        assert isinstance(load_scene(path), Scene)
    except SceneError as error:
        assert str(error)


def replaced(data, choices: random.Random, value):
    """A copy of nested data with one node, chosen by chance, replaced or removed."""
    if not isinstance(data, dict | list) or not data or choices.random() < 0.15:
        return value
    if isinstance(data, list):
        index = choices.randrange(len(data))
        return [*data[:index], replaced(data[index], choices, value), *data[index + 1 :]]
    key = choices.choice(list(data))
    if choices.random() < 0.15:
        return {other: each for other, each in data.items() if other != key}
    return {**data, key: replaced(data[key], choices, value)}


def test_the_text_to_be_spoilt_is_sound(tmp_path):
    path = tmp_path / "scene.yaml"
    path.with_name("crane.urdf").write_text(CRANE)
    path.write_text(SOUND)
    scene = load_scene(path)
    assert len(scene.pairs) == 2
    assert len(scene.robots[0].links) == 2


@pytest.mark.long
@relaxed
@given(choices=st.randoms(use_true_random=False), value=values)
def test_any_value_in_any_place(tmp_path, choices, value):
    data = replaced(SOUND_DATA, choices, value)
    holds(tmp_path / "scene.yaml", yaml.safe_dump(data, sort_keys=False))


@pytest.mark.long
@relaxed
@given(
    start=st.integers(0, len(SOUND)),
    length=st.integers(0, 30),
    insert=st.sampled_from(WORDS.split()) | st.text(max_size=6),
)
def test_any_text_in_any_place(tmp_path, start, length, insert):
    holds(tmp_path / "scene.yaml", SOUND[:start] + insert + SOUND[start + length :])


@relaxed
@given(st.binary(max_size=200))
def test_any_bytes(tmp_path, data):
    holds(tmp_path / "scene.yaml", data)


@relaxed
@given(length=st.integers(0, 4000))
def test_a_bundled_scene_cut_short(tmp_path, length):
    holds(tmp_path / "scene.yaml", bundled("engine").read_text(encoding="utf-8")[:length])
