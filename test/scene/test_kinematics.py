"""Forward kinematics against closed forms, and against a recursion of quaternions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor.engine.poses import check_pose
from proximity_monitor.scene.kinematics import Joint, Kinematics, KinematicsError, Mimic

EPS = np.finfo(float).eps


def at(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def joint(name, parent, child, kind="revolute", origin=None, axis=(0.0, 0.0, 1.0), mimic=None):
    return Joint(name, kind, parent, child, np.eye(4) if origin is None else origin, axis,
                 mimic=mimic)  # fmt: skip


def chain(*joints):
    """Return a robot whose links l0, l1, … form a chain."""
    names = [f"l{i}" for i in range(len(joints) + 1)]
    return Kinematics(
        names,
        [joint(f"j{i}", names[i], names[i + 1], **each) for i, each in enumerate(joints)],
    )


@pytest.mark.parametrize("first", [-2.0, 0.0, 0.3, 1e-9, math.pi])
@pytest.mark.parametrize("second", [-0.7, 0.0, 2.9])
def test_two_turning_links_in_the_plane(first, second):
    """An elbow arm of 0.4 and 0.25 m. Its tip is the frame of a third, fixed link."""
    arm = chain({}, {"origin": at(0.4, 0, 0)}, {"origin": at(0.25, 0, 0), "kind": "fixed"})
    tip = arm.poses([first, second])[arm.links.index("l3")]
    np.testing.assert_allclose(
        tip[:3, 3],
        [
            0.4 * math.cos(first) + 0.25 * math.cos(first + second),
            0.4 * math.sin(first) + 0.25 * math.sin(first + second),
            0.0,
        ],
        atol=1e-15,
    )
    c, s = math.cos(first + second), math.sin(first + second)
    np.testing.assert_allclose(tip[:3, :3], [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-15)


def test_a_slide_moves_along_its_axis_of_any_length():
    arm = chain({"kind": "prismatic", "axis": (0.0, 3.0, 4.0)})
    np.testing.assert_allclose(arm.poses([0.5])[1], at(0.0, 0.3, 0.4), atol=1e-16)


def test_the_axis_is_in_the_joints_frame():
    quarter = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    arm = chain({"kind": "prismatic", "origin": quarter, "axis": (1.0, 0.0, 0.0)})
    np.testing.assert_allclose(arm.poses([0.5])[1][:3, 3], [0.0, 0.5, 0.0], atol=1e-16)


def test_the_base_moves_everything():
    arm = chain({}, {"origin": at(1, 0, 0)})
    base = at(0.0, 0.0, 2.0)
    free, placed = arm.poses([0.3, 0.4]), arm.poses([0.3, 0.4], base)
    np.testing.assert_allclose(placed, base @ free, atol=1e-15)


def test_mimics_of_mimics_follow_in_straight_lines():
    """With b = 2 a + 0.1 and c = -3 b + 0.5, c = -6 a + 0.2."""
    robot = Kinematics(
        ["base", "l_a", "l_b", "l_c"],
        [
            joint("c", "base", "l_c", "prismatic", mimic=Mimic("b", -3.0, 0.5)),
            joint("a", "base", "l_a", "prismatic"),
            joint("b", "base", "l_b", "prismatic", mimic=Mimic("a", 2.0, 0.1)),
        ],
    )
    assert [each.name for each in robot.free] == ["a"]
    heights = dict(zip(robot.links, robot.poses([0.25])[:, 2, 3], strict=True))
    assert heights == pytest.approx({"base": 0.0, "l_a": 0.25, "l_b": 0.6, "l_c": -1.3})
    assert robot.drivers("l_c") == {"a"}
    assert robot.drivers("base") == frozenset()


def test_a_mimic_of_a_fixed_joint_stands_at_its_offset():
    robot = Kinematics(
        ["base", "held", "follower"],
        [
            joint("hold", "base", "held", "fixed"),
            joint("follow", "held", "follower", "prismatic", mimic=Mimic("hold", 4.0, 0.3)),
        ],
    )
    assert robot.free == ()
    assert robot.poses([])[robot.links.index("follower")][2, 3] == 0.3
    assert robot.unit("follower") == "base"


def test_rigidly_joined_links_are_one_unit():
    robot = Kinematics(
        ["hand", "arm", "tool", "camera", "base"],
        [
            joint("grip", "hand", "tool", "fixed"),
            joint("turn", "base", "arm"),
            joint("look", "arm", "camera", "fixed"),
            joint("wrist", "arm", "hand"),
        ],
    )
    units = {link: robot.unit(link) for link in robot.links}
    assert units == {
        "base": "base", "arm": "arm", "camera": "arm", "hand": "hand", "tool": "hand",
    }  # fmt: skip
    assert [each.name for each in robot.path("tool")] == ["grip", "wrist", "turn"]
    assert robot.drivers("tool") == {"turn", "wrist"}


def test_a_lone_link_stands_at_the_base():
    robot = Kinematics(["only"], [])
    np.testing.assert_array_equal(robot.poses([], at(1, 2, 3)), at(1, 2, 3)[None])
    assert robot.poses(np.empty((5, 0))).shape == (5, 1, 4, 4)


BROKEN = {
    "a link twice": (["a", "a"], [], "link 'a' is defined twice"),
    "a joint twice": (
        ["a", "b", "c"], [joint("j", "a", "b"), joint("j", "b", "c")], "joint 'j' is defined twice",
    ),
    "no such link": (["a"], [joint("j", "a", "b")], "joint 'j': there is no link 'b'"),
    "two parents": (
        ["a", "b", "c"], [joint("j", "a", "c"), joint("k", "b", "c")],
        "link 'c' is the child of 'j' and of 'k'",
    ),
    "two roots": (["a", "b"], [], r"the root, .* \(got a, b\)"),
    "no root": (["a", "b"], [joint("j", "a", "b"), joint("k", "b", "a")], r"\(got none\)"),
    "a ring aside": (
        ["a", "b", "c"], [joint("j", "b", "c"), joint("k", "c", "b")], "links b, c form a cycle",
    ),
    "mimic of nobody": (
        ["a", "b"], [joint("j", "a", "b", mimic=Mimic("x", 1, 0))], "mimics 'x', which does not",
    ),
    "mimics in a ring": (
        ["a", "b", "c"],
        [
            joint("j", "a", "b", mimic=Mimic("k", 1, 0)),
            joint("k", "b", "c", mimic=Mimic("j", 1, 0)),
        ],
        "joints j, k mimic each other in a cycle",
    ),
}  # fmt: skip


@pytest.mark.parametrize("links, joints, message", BROKEN.values(), ids=BROKEN)
def test_what_is_no_tree_is_refused(links, joints, message):
    with pytest.raises(KinematicsError, match=message):
        Kinematics(links, joints)


@pytest.mark.parametrize("values", [[0.0], [0.0, 0.0, 0.0], 0.0, np.zeros((1, 1, 2))])
def test_values_of_another_shape_are_refused(values):
    with pytest.raises(ValueError, match=r"values: shape .*, expected \(2,\) or \(k, 2\)"):
        chain({}, {}).poses(values)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_values_that_are_not_finite_are_refused(value):
    with pytest.raises(ValueError, match="values: every joint position must be finite"):
        chain({}, {}).poses([0.0, value])


# An oracle that uses quaternions and recursion.


def times(p, q):
    (a, u), (b, v) = (p[0], p[1:]), (q[0], q[1:])
    return np.array([a * b - u @ v, *(a * v + b * u + np.cross(u, v))])


def rotated(q, point):
    return times(times(q, np.array([0.0, *point])), q * [1, -1, -1, -1])[1:]


def turn(axis, angle):
    axis = np.array(axis) / np.linalg.norm(axis)
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])


def by_recursion(robot, link, values):
    """Return the position and the quaternion of a link."""
    above = next((each for each in robot if each["child"] == link), None)
    if above is None:
        return np.zeros(3), np.array([1.0, 0, 0, 0])
    place, attitude = by_recursion(robot, above["parent"], values)
    place = place + rotated(attitude, above["place"])
    attitude = times(attitude, turn(*above["attitude"]))
    value = values.get(above["name"], 0.0)
    if above["kind"] == "prismatic":
        along = np.array(above["axis"]) / np.linalg.norm(above["axis"])
        return place + rotated(attitude, value * along), attitude
    return place, times(attitude, turn(above["axis"], value))


lengths = st.floats(-2.0, 2.0)
angles = st.floats(-50.0, 50.0)
axes = st.tuples(lengths, lengths, lengths).filter(lambda axis: math.hypot(*axis) > 0.01)


@st.composite
def robots(draw):
    """Draw joints with any earlier link as parent, values of those that move, and a link order."""
    made, values = [], {}
    for i in range(draw(st.integers(1, 12))):
        each = {
            "name": f"j{i}",
            "kind": draw(st.sampled_from(["fixed", "revolute", "continuous", "prismatic"])),
            "parent": f"l{draw(st.integers(0, i))}",
            "child": f"l{i + 1}",
            "place": draw(st.tuples(lengths, lengths, lengths)),
            "attitude": (draw(axes), draw(angles)),
            "axis": draw(axes),
        }
        made.append(each)
        if each["kind"] != "fixed":
            values[each["name"]] = draw(angles)
    return made, values, draw(st.permutations(range(len(made) + 1)))


def built(robot, order):
    joints = []
    for each in robot:
        origin = at(*each["place"])
        q = turn(*each["attitude"])
        origin[:3, :3] = np.column_stack([rotated(q, column) for column in np.eye(3)])
        joints.append(
            joint(each["name"], each["parent"], each["child"], each["kind"], origin, each["axis"])
        )
    return Kinematics([f"l{i}" for i in order], joints)


@settings(deadline=None, max_examples=100)
@given(robots())
def test_any_tree_agrees_with_the_recursion_and_is_rigid(case):
    robot, values, order = case
    made = built(robot, order)
    poses = made.poses(made.values(values))
    assert made.links[0] == "l0"
    for link, pose in zip(made.links, poses, strict=True):
        place, attitude = by_recursion(robot, link, values)
        scale = 100.0 * len(robot)  # a bound on positions: each joint slides by at most 50 m
        np.testing.assert_allclose(pose[:3, 3], place, atol=50.0 * EPS * scale)
        for axis in np.eye(3):
            np.testing.assert_allclose(
                pose[:3, :3] @ axis, rotated(attitude, axis), atol=40.0 * EPS * len(robot)
            )
        check_pose(pose)
        # Each joint contributes two rotations, and each product rounds by some 4 eps.
        error = np.abs(pose[:3, :3].T @ pose[:3, :3] - np.eye(3)).max()
        assert error <= 20.0 * EPS * (2 * len(robot) + 1)


@settings(deadline=None, max_examples=30)
@given(robots(), st.integers(0, 5))
def test_many_at_once_are_each_alone(case, count):
    robot, values, order = case
    made = built(robot, order)
    rows = np.array([made.values(values) * (1.0 + i) for i in range(count)]).reshape(
        count, len(made.free)
    )
    together = made.poses(rows, at(1, 2, 3))
    assert together.shape == (count, len(made.links), 4, 4)
    for row, poses in zip(rows, together, strict=True):
        np.testing.assert_allclose(poses, made.poses(row, at(1, 2, 3)), rtol=0, atol=1e-12)
