"""Bounds carried along with moving bodies, against extended-precision distances of point sets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor import engine
from proximity_monitor.engine.assembly.answers import Answers


def rotation(axis, angle):
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def pose(axis=(0, 0, 1), angle=0.0, position=(0, 0, 0)):
    made = np.eye(4)
    made[:3, :3] = rotation(axis, angle)
    made[:3, 3] = position
    return made


def random_pose(random, spread):
    return pose(random.normal(size=3), random.uniform(-3, 3), random.normal(size=3) * spread)


def nudged(random, start, size):
    """Return a pose near `start`: turned by up to `size` radians, moved by up to `size` metres."""
    step = pose(random.normal(size=3), random.uniform(-size, size), random.uniform(-1, 1, 3) * size)
    return start @ step


def placed(model, at):
    return at[:3, :3].astype(np.longdouble) @ model.vertices.T.astype(np.longdouble) + at[:3, 3:]


def true_distance(a, pose_a, b, pose_b):
    """Return the distance of the point sets, computed with a 64-bit mantissa."""
    pa, pb = placed(a, pose_a), placed(b, pose_b)
    return np.sqrt(((pa[:, :, None] - pb[:, None, :]) ** 2).sum(axis=0)).min()


def table(a, b, signed=False):
    """Return a table with one row for two bodies, and that row."""
    answers = Answers([a, b], ["a", "b"])
    return answers, answers.add(np.array([[0, 1]]), np.array([signed]))


def move(answers, pose_a, pose_b):
    answers.move(np.arange(2), np.stack((pose_a, pose_b)))


def answered(a, pose_a, b, pose_b):
    """Return a table with the exact distance at these poses, as a search would leave it."""
    answers, row = table(a, b)
    move(answers, pose_a, pose_b)
    pa, pb = (np.asarray(placed(*each), float).T for each in ((a, pose_a), (b, pose_b)))
    squares = ((pa[:, None] - pb[None]) ** 2).sum(axis=2)
    i, j = np.unravel_index(squares.argmin(), squares.shape)
    true = float(true_distance(a, pose_a, b, pose_b))
    bounds = np.array([[np.nextafter(true, 0.0), np.nextafter(true, np.inf)]])
    answers.keep(row, bounds, np.array([[pa[i], pb[j]]]))
    return answers, row


def carried(a, start_a, b, start_b, end_a, end_b):
    answers, row = answered(a, start_a, b, start_b)
    move(answers, end_a, end_b)
    return answers.intervals(row)


def cloud(random, count=12, size=1.0, away=0.0):
    return engine.points(random.normal(size=(count, 3)) * size + away * random.normal(size=3))


@settings(deadline=None, max_examples=300)
@given(
    seed=st.integers(0, 2**32 - 1),
    spread=st.sampled_from([0.0, 0.1, 3.0, 1e3, 1e7]),
    motion=st.sampled_from([0.0, 1e-15, 1e-9, 1e-3, 0.3, 3.0]),
    away=st.sampled_from([0.0, 2.0, 1e3]),
    defect=st.sampled_from([0.0, 3e-7]),
)
def test_the_interval_contains_the_distance_after_any_motion(seed, spread, motion, away, defect):
    random = np.random.default_rng(seed)
    a, b = (cloud(random, size=random.uniform(0.01, 2), away=away) for _ in range(2))
    starts = [random_pose(random, spread) for _ in range(2)]
    ends = [nudged(random, start, motion) for start in starts]
    for each in (*starts, *ends):
        each[:3, :3] += random.uniform(-defect, defect, (3, 3))
    got = carried(a, starts[0], b, starts[1], *ends)
    true = true_distance(a, ends[0], b, ends[1])
    assert got.lower[0] <= true <= got.upper[0]


def test_pairs_that_were_never_answered_are_certified_too():
    random = np.random.default_rng(5)
    clouds = [cloud(random, 9) for _ in range(100)]
    answers = Answers(clouds, [str(i) for i in range(100)])
    pairs = np.arange(100).reshape(-1, 2)
    rows = answers.add(pairs, np.zeros(50, bool))
    poses = np.stack([random_pose(random, 5.0) for _ in clouds])
    answers.move(np.arange(100), poses)
    got = answers.intervals(rows)
    true = [true_distance(clouds[i], poses[i], clouds[j], poses[j]) for i, j in pairs]
    assert np.all(got.lower <= true)
    assert np.all(true <= got.upper)
    assert (got.lower > 0.0).any(), "far pairs are bounded away by their balls"
    assert not got.same.any()


def unit_clouds():
    """Return two models, radius 1 about their origins. At x = 0 and 3, their gap is 3 - sqrt 2."""
    half = np.sqrt(0.5)
    corners = [[x, y, 0.0] for x in (-half, half) for y in (-half, half)] + [[0, 0, 1], [0, 0, -1]]
    return engine.points(corners), engine.points(corners)


def test_a_translation_widens_by_its_length():
    a, b = unit_clouds()
    start, end = pose(position=(3, 0, 0)), pose(position=(3, 0.25, 0))
    got = carried(a, np.eye(4), b, start, np.eye(4), end)
    before = 3.0 - np.sqrt(2.0)
    assert got.lower[0] == pytest.approx(before - 0.25, abs=1e-12)
    assert got.lower[0] < before - 0.25
    assert got.upper[0] == pytest.approx(np.hypot(before, 0.25), abs=1e-12)


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 0.1])
def test_a_rotation_about_the_centre_widens_by_the_chord_of_the_radius(angle):
    a, b = unit_clouds()
    place = pose(position=(3, 0, 0))
    got = carried(a, np.eye(4), b, place, np.eye(4), place @ pose((0, 1, 1), angle))
    widening = 3.0 - np.sqrt(2.0) - got.lower[0]
    assert widening == pytest.approx(2.0 * np.sin(angle / 2.0), rel=1e-3, abs=1e-12)


def test_the_body_whose_motion_is_cheaper_is_taken_as_the_moving_one():
    """A small part turns on the spot. Seen from it, the large part swings around it."""
    small = engine.points([[0.01, 0, 0], [-0.01, 0, 0], [0, 0.01, 0]])
    large, _ = unit_clouds()
    place = pose(position=(3, 0, 0))
    turned = place @ pose((0, 0, 1), 0.5)
    for pair, poses in (
        ((large, small), (np.eye(4), place, turned)),
        ((small, large), (place, np.eye(4), turned)),
    ):
        first_moves = pair[0] is small
        end = (poses[2], poses[1]) if first_moves else (poses[0], poses[2])
        before = true_distance(pair[0], poses[0], pair[1], poses[1])
        got = carried(pair[0], poses[0], pair[1], poses[1], *end)
        assert before - got.lower[0] < 0.01


def test_bodies_that_move_together_are_still():
    random = np.random.default_rng(3)
    a, b = unit_clouds()
    start = np.eye(4), pose((1, 2, 3), 0.7, (3, 1, 0))
    together = random_pose(random, 10.0)
    got = carried(a, start[0], b, start[1], together @ start[0], together @ start[1])
    assert got.still[0]
    assert not got.same[0]
    assert got.upper[0] - got.lower[0] < 1e-11


def test_the_smallest_real_motion_is_not_still():
    a, b = unit_clouds()
    start = pose(position=(3, 0, 0))
    got = carried(a, np.eye(4), b, start, np.eye(4), pose(position=(3, 1e-9, 0)))
    assert not got.still[0]


def test_bodies_that_do_not_move_keep_the_very_numbers():
    random = np.random.default_rng(4)
    a, b = cloud(random), cloud(random)
    answers, row = answered(a, random_pose(random, 1.0), b, random_pose(random, 1.0))
    first = answers.intervals(row)
    again = answers.intervals(row)
    assert again.same.all()
    assert again.still.all()
    assert (first.lower, first.upper) == (again.lower, again.upper)
    assert np.array_equal(first.points, again.points)


def test_a_ball_beyond_any_number_that_can_be_squared_leaves_the_bounds_that_always_hold():
    """A model may reach 1e45 m. Products of such lengths are still finite."""
    a, b = engine.points([[1e45, 0, 0], [0, 1e45, 0]]), engine.points([[0, 0, 0]])
    answers, row = table(a, b)
    got = answers.intervals(row)
    assert 0.0 <= got.lower[0] <= 1e45 <= got.upper[0] < np.inf


@settings(deadline=None, max_examples=100)
@given(
    seed=st.integers(0, 2**32 - 1),
    motion=st.sampled_from([0.0, 1e-3, 0.5]),
    bend=st.sampled_from([0.0, 1e-9, 1e-2, 0.5]),
)
def test_the_interval_contains_the_distance_after_motion_and_deformation(seed, motion, bend):
    random = np.random.default_rng(seed)
    a, b = cloud(random), cloud(random)
    starts = [random_pose(random, 2.0) for _ in range(2)]
    answers, row = answered(a, starts[0], b, starts[1])
    ends = starts
    for _ in range(3):
        step = random.uniform(-bend, bend, a.vertices.shape)
        before = a.vertices
        a.deform(before + step)
        answers.reshape(0, np.linalg.norm(a.vertices - before, axis=1).max() * (1 + 1e-15))
        ends = [nudged(random, each, motion) for each in ends]
        move(answers, *ends)
        got = answers.intervals(row)
        true = true_distance(a, ends[0], b, ends[1])
        assert got.lower[0] <= true <= got.upper[0]


def test_after_a_deformation_of_unknown_size_the_new_ball_alone_bounds():
    random = np.random.default_rng(6)
    a, b = cloud(random), cloud(random)
    answers, row = answered(a, np.eye(4), b, pose(position=(20, 0, 0)))
    a.deform(3.0 * a.vertices)
    answers.reshape(0, np.inf)
    got = answers.intervals(row)
    apart = np.linalg.norm(b.centre + np.array([20, 0, 0]) - a.centre) - a.radius - b.radius
    assert got.lower[0] == pytest.approx(apart, abs=1e-12)
    true = true_distance(a, np.eye(4), b, pose(position=(20, 0, 0)))
    assert got.lower[0] <= true <= got.upper[0]


def test_bodies_at_the_same_pose_are_not_still_when_their_answer_was_forgotten():
    random = np.random.default_rng(6)
    a, b = cloud(random), cloud(random)
    answers, row = answered(a, np.eye(4), b, np.eye(4))
    assert answers.intervals(row).still[0]
    answers.reshape(0, np.inf)
    assert not answers.intervals(row).still[0]


BOX = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
BOX_FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]  # fmt: skip


@settings(deadline=None, max_examples=100)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.sampled_from([0.1, 0.6, 1.5]),
    motion=st.sampled_from([0.0, 1e-3, 0.3, 3.0]),
)
def test_a_signed_distance_stays_within_its_bounds_through_any_jump(seed, size, motion):
    """The bodies are apart, cross or contain each other. The oracle is a new search."""
    random = np.random.default_rng(seed)
    a, b = engine.TriangleMesh(BOX, BOX_FACES), engine.TriangleMesh(size * BOX, BOX_FACES)
    starts = [random_pose(random, 1.0) for _ in range(2)]
    ends = [nudged(random, each, motion) for each in starts]
    answers, row = table(a, b, signed=True)
    move(answers, *starts)
    before = engine.signed_distance(a, starts[0], b, starts[1])
    bounds = np.array([[before.lower, before.upper]])
    answers.keep(row, bounds, np.array([[before.point_a, before.point_b]]))
    move(answers, *ends)
    got = answers.intervals(row)
    after = engine.signed_distance(a, ends[0], b, ends[1])
    assert got.lower[0] <= after.upper
    assert after.lower <= got.upper[0]


def test_solids_that_overlap_stay_so_while_they_move_less_than_their_depth():
    a, b = engine.TriangleMesh(BOX, BOX_FACES), engine.TriangleMesh(0.5 * BOX, BOX_FACES)
    answers, row = table(a, b, signed=True)
    answers.keep(row, np.array([[-0.5, -0.5]]), np.zeros((1, 2, 3)))
    move(answers, np.eye(4), pose(position=(0.1, 0, 0)))
    got = answers.intervals(row)
    assert got.upper[0] == pytest.approx(-0.4, abs=1e-12)
    assert got.lower[0] == pytest.approx(-0.6, abs=1e-12)


def test_rows_are_used_again_and_begin_with_nothing():
    random = np.random.default_rng(8)
    a, b = cloud(random), cloud(random)
    answers, row = answered(a, np.eye(4), b, np.eye(4))
    answers.drop(row)
    again = answers.add(np.array([[1, 0]]), np.array([False]))
    assert again.tolist() == row.tolist()
    got = answers.intervals(again)
    assert not got.same[0]
    assert got.points[0, 0].tolist() == b.vertices[0].tolist()


def test_a_pose_that_is_none_is_refused_by_name_and_moves_nothing():
    random = np.random.default_rng(9)
    answers, row = table(cloud(random), cloud(random))
    before = answers.intervals(row)
    with pytest.raises(ValueError, match="pose of b"):
        move(answers, pose(position=(1, 0, 0)), 2.0 * np.eye(4))
    assert np.array_equal(answers.poses, np.tile(np.eye(4), (2, 1, 1)))
    assert answers.intervals(row).lower == before.lower
