"""Bodies carried by others."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proximity_monitor.engine.poses import check_pose
from proximity_monitor.scene import Body, pose_matrix
from proximity_monitor.scene.attachments import Attachments
from proximity_monitor.scene.relative_motion import Course
from proximity_monitor.scene.state import PoseSample

TABLE = pose_matrix((1.0, 2.0, 3.0), (0.0, 0.0, 1.0, 0.0))
number = st.floats(-2.0, 2.0)
poses = st.tuples(
    st.tuples(number, number, number),
    st.tuples(number, number, number, number).filter(lambda q: np.linalg.norm(q) > 0.1),
).map(lambda pq: pose_matrix(pq[0], tuple(np.array(pq[1]) / np.linalg.norm(pq[1]))))


def body(name, pose=None):
    return Body(name, None, None, 1.0, pose, None if pose is not None else "t", (1, 1, 1, 1))


BODIES = [body("table", TABLE), body("hand"), body("cup"), body("spoon")]


def at(**places):
    """Return samples of the given poses or positions; the other bodies have none."""
    made = dict.fromkeys(("hand", "cup", "spoon"))
    for name, pose in places.items():
        pose = pose_matrix(pose, (0, 0, 0, 1)) if isinstance(pose, tuple) else pose
        made[name] = PoseSample(pose)
    return made


def test_a_link_of_a_robot_is_not_torn_from_it():
    link = Body("link", None, None, 1.0, None, None, (1, 1, 1, 1))
    attachments = Attachments([*BODIES, link])
    assert attachments.refusal({"link": "cup"}).startswith("link is a robot link, which its joints")
    assert not attachments.refusal({"cup": "link"})


@given(st.tuples(poses, poses, poses, poses))
def test_a_child_keeps_its_place_on_the_parent_from_the_moment_of_attaching(four):
    hand, cup, later, ignored = four
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand"})
    first = attachments.carry(at(hand=hand, cup=cup))
    np.testing.assert_allclose(first["cup"].pose, cup, atol=1e-14)
    carried = attachments.carry(at(hand=later, cup=ignored))["cup"].pose
    np.testing.assert_allclose(carried, later @ np.linalg.inv(hand) @ cup, atol=1e-13)


def test_a_chain_is_carried_as_one_in_whatever_order_it_was_made():
    for order in ({"spoon": "cup", "cup": "hand"}, {"cup": "hand", "spoon": "cup"}):
        attachments = Attachments(BODIES)
        attachments.attach(order)
        attachments.carry(at(hand=(0, 0, 0), cup=(1, 0, 0), spoon=(1, 1, 0)))
        carried = attachments.carry(at(hand=(0, 0, 5), cup=(9, 9, 9), spoon=(9, 9, 9)))
        assert carried["spoon"].pose[:3, 3].tolist() == [1, 1, 5]
        assert attachments.root("spoon") == "hand"


def test_the_place_of_a_child_is_that_of_one_moment_and_asked_for_once():
    asked, then = [], {"hand": (0, 0, 1), "cup": (2, 0, 1), "spoon": (2, 3, 1)}

    def together(*names):
        asked.append(names)
        return tuple(pose_matrix(then[name], (0, 0, 0, 1)) for name in names)

    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand", "spoon": "cup"})
    for _ in range(2):
        now = attachments.carry(at(hand=(5, 0, 0), cup=(0, 0, 0), spoon=(0, 0, 0)), together)
        assert now["cup"].pose[:3, 3].tolist() == [7, 0, 0]
        assert now["spoon"].pose[:3, 3].tolist() == [7, 3, 0]
    assert asked == [("hand", "cup"), ("hand", "spoon")]
    attachments.attach({"cup": "table"})
    attachments.carry(at(cup=(1, 2, 4)), together)
    assert len(asked) == 2, "a fixed body is always where it is"


def test_a_fixed_body_carries_and_is_never_stale():
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "table"})
    attachments.carry(at(cup=(1, 2, 4)))
    carried = attachments.carry({"hand": None, "cup": PoseSample(np.eye(4), True), "spoon": None})
    assert not carried["cup"].stale
    assert carried["cup"].pose[:3, 3].tolist() == [1, 2, 4]


def test_a_child_is_as_stale_and_as_unknown_as_its_parent():
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand", "spoon": "cup"})
    attachments.carry(at(hand=(0, 0, 0), cup=(1, 0, 0), spoon=(2, 0, 0)))
    late = at(cup=(1, 0, 0), spoon=(2, 0, 0)) | {"hand": PoseSample(np.eye(4), stale=True)}
    assert attachments.carry(late)["spoon"].stale
    assert attachments.carry(at(cup=(1, 0, 0)))["spoon"] is None


def test_it_waits_until_both_poses_are_known_and_fresh():
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand"})
    attachments.carry(at(cup=(1, 0, 0)))
    stale = at(cup=(1, 0, 0)) | {"hand": PoseSample(np.eye(4), stale=True)}
    assert attachments.carry(stale)["cup"].pose[:3, 3].tolist() == [1, 0, 0]
    assert (dict(attachments.waiting), dict(attachments.held)) == ({"cup": "hand"}, {})
    attachments.carry(at(hand=(0, 0, 0), cup=(2, 0, 0)))
    assert (dict(attachments.waiting), dict(attachments.held)) == ({}, {"cup": "hand"})


def test_a_detached_child_moves_by_itself_again_and_others_stay_where_they_are():
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand", "spoon": "hand"})
    attachments.carry(at(hand=(0, 0, 0), cup=(1, 0, 0), spoon=(2, 0, 0)))
    attachments.attach({"spoon": "hand"})
    carried = attachments.carry(at(hand=(0, 0, 1), cup=(7, 0, 0), spoon=(8, 0, 0)))
    assert carried["cup"].pose[:3, 3].tolist() == [7, 0, 0]
    assert carried["spoon"].pose[:3, 3].tolist() == [2, 0, 1]


def test_the_same_parents_pose_gives_the_very_same_array():
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand"})
    samples = at(hand=(0.1, 0.2, 0.3), cup=(1, 0, 0))
    first = attachments.carry(samples)["cup"].pose
    assert attachments.carry(samples)["cup"].pose is first


@pytest.mark.parametrize(
    ("parents", "told"),
    [
        ({"cup": "cup"}, "attachments cup -> cup form a cycle"),
        ({"cup": "spoon", "spoon": "hand", "hand": "cup"}, "form a cycle"),
        ({"hand": "cup", "cup": "spoon", "spoon": "cup"}, "cup -> spoon -> cup form a cycle"),
        ({"cup": "lid"}, "no body is named 'lid'"),
        ({"table": "hand"}, "table cannot be attached"),
        ({"lid": "hand"}, "lid cannot be attached, because it is not a moving"),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(parents, told):
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand"})
    attachments.carry(at(hand=(0, 0, 0), cup=(1, 0, 0)))
    assert told in attachments.refusal(parents)
    with pytest.raises(ValueError, match=re.escape(told)):
        attachments.attach(parents)
    assert dict(attachments.held) == {"cup": "hand"}
    assert attachments.refusal({"cup": "hand", "spoon": "table"}) == ""


def test_a_chain_of_poses_that_are_just_allowed_stays_allowed():
    skewed = np.eye(4)
    skewed[0, 1] = 0.9e-6
    bodies = [body(f"b{i}") for i in range(20)]
    attachments = Attachments(bodies)
    attachments.attach({f"b{i + 1}": f"b{i}" for i in range(19)})
    carried = attachments.carry({each.name: PoseSample(skewed) for each in bodies})
    check_pose(carried["b19"].pose)


def test_a_childs_course_is_that_of_its_root():
    attachments = Attachments(BODIES)
    attachments.attach({"cup": "hand", "spoon": "cup"})
    attachments.carry(at(hand=(0, 0, 0), cup=(1, 0, 0), spoon=(1, 1, 0)))
    turn = pose_matrix((0, 0, 0), (0, 0, np.sqrt(0.5), np.sqrt(0.5)))
    course = attachments.course("spoon", Course(np.eye(4), turn, 0.5))
    assert course.before[:3, 3].tolist() == [1, 1, 0]
    assert course.after[:3, 3] == pytest.approx([-1, 1, 0])
    assert attachments.course("spoon", None) is None
