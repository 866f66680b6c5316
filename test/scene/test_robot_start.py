"""A robot's start positions, the links that touch there, and the joints that a script moves."""

import math

import pytest
from crane import CRANE, SCENE

from proximity_monitor.scene import SceneError, load_scene


@pytest.fixture
def load(tmp_path):
    """Return a function that writes a scene beside a crane and loads it."""
    (tmp_path / "crane").mkdir()

    def write_and_load(text, urdf=CRANE):
        (tmp_path / "crane" / "crane.urdf").write_text(urdf)
        path = tmp_path / "scene.yaml"
        path.write_text(text)
        return load_scene(path)

    return write_and_load


def names_of(pairs):
    return {frozenset((pair.a, pair.b)) for pair in pairs}


def both(*names):
    return {frozenset(name.split()) for name in names}


def test_links_of_which_it_is_open_whether_they_touch_are_watched(load):
    """The second shape makes the cylinder a mesh, and this mesh reaches into the ball beside it."""
    urdf = """<robot name="r"><link name="a">
      <collision><geometry><cylinder radius="0.5" length="1"/></geometry></collision>
      <collision><origin xyz="0 0 2"/><geometry><box size="1 1 1"/></geometry></collision></link>
      <link name="b"><collision><origin xyz="PLACE 0 0"/><geometry><sphere radius="0.5"/></geometry>
      </collision></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint>
      </robot>"""
    text = (
        SCENE.split("    angles")[0] + "    exclude_adjacent: false\n    exclude_touching: true\n"
    )
    near = load(text, urdf.replace("PLACE", "1.0002"))
    assert both("crane_a crane_b") < names_of(near.pairs)
    assert "watched, although they may touch at the robot's start positions" in near.warnings[0]
    assert near.warnings[0].endswith("list those that do in 'exclude': crane_a - crane_b")
    apart = load(text, urdf.replace("PLACE", "1.1"))
    assert both("crane_a crane_b") < names_of(apart.pairs) and apart.warnings == ()
    far = load(text, urdf.replace("PLACE", "0.9"))
    assert not names_of(far.pairs) & both("crane_a crane_b")
    assert far.warnings[0].endswith(
        "not watched, because they touch at the robot's start positions: crane_a - crane_b"
    )


@pytest.mark.parametrize(
    ("place", "watched"), [("1", False), ("1.00000001", False), ("1.000009", True), ("0.9", False)]
)
def test_links_that_are_drawn_touching_may_be_apart_by_what_descriptions_round(
    load, place, watched
):
    urdf = f"""<robot name="r"><link name="a"><collision><geometry><sphere radius="0.5"/></geometry>
      </collision></link><link name="b"><collision><geometry><sphere radius="0.5"/></geometry>
      </collision></link><joint name="j" type="revolute"><origin xyz="{place} 0 0"/>
      <parent link="a"/><child link="b"/></joint></robot>"""
    text = SCENE.split("    angles")[0] + "    exclude_adjacent: false\n"
    pairs = names_of(load(text + "    exclude_touching: true\n", urdf).pairs)
    assert (both("crane_a crane_b") < pairs) == watched


def test_a_limit_that_the_description_rounds_may_be_reached(load):
    urdf = CRANE.replace('lower="-3" upper="3"', 'lower="-3.14159" upper="3.14159"')
    assert load(SCENE.replace("90", "180"), urdf).robots[0].start["swing"] == math.pi
    with pytest.raises(SceneError, match=r"must be within its limits, -180 to 180 \(got 180.01\)"):
        load(SCENE.replace("90", "180.01"), urdf)


SCRIPT = """
  - {name: lift, urdf: lift.urdf, topic: lift/states}
motion: {script: {joints: {JOINT: {KIND: [[0, 0]]}}}}
"""


@pytest.mark.parametrize(
    ("joint", "kind", "told"),
    [
        ("swing", "angles_deg", "write 'crane/swing' or 'lift/swing'"),
        ("crane/swing", "offsets", "'crane/swing' turns; give its positions as 'angles_deg'"),
        ("lift/swing", "angles_deg", "'lift/swing' slides; give its positions as 'offsets'"),
        ("crane/swing", "angles_deg", ""),
        ("lift/swing", "offsets", ""),
        ("drop", "offsets", "write 'crane/drop' or 'lift/drop'"),
    ],
)
def test_a_joint_of_several_robots_is_named_with_its_robot(load, tmp_path, joint, kind, told):
    urdf = CRANE.replace('"swing" type="revolute"', '"swing" type="prismatic"')
    (tmp_path / "lift.urdf").write_text(urdf)
    text = SCENE + SCRIPT.replace("JOINT", joint).replace("KIND", kind)
    if told:
        with pytest.raises(SceneError, match=told):
            load(text)
    else:
        assert list(load(text).motion["script"]["joints"]) == [joint]
    with pytest.raises(SceneError, match=r"several robots|same topic|its positions"):
        load(text.replace("lift/states", "joint_states"))


def test_topics_are_compared_as_without_a_namespace(load, tmp_path):
    (tmp_path / "lift.urdf").write_text(CRANE)
    text = SCENE + SCRIPT.replace("JOINT", "crane/swing").replace("KIND", "angles_deg")
    with pytest.raises(SceneError, match=r"from the same topic, /joint_states \(without a"):
        load(text.replace("lift/states", "/joint_states"))
    load(text.replace("lift/states", "~/joint_states"))
