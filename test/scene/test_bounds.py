"""Bounds of moved bodies against distances of point sets in extended precision."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor.scene import bounds


@dataclass
class Cloud:
    """The least that a model has: points and a sphere around them."""

    vertices: np.ndarray

    @property
    def centre(self):
        return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2.0

    @property
    def radius(self):
        return np.linalg.norm(self.vertices - self.centre, axis=1).max() * (1.0 + 1e-14)


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
    """A pose near another: turned by up to `size` radians, moved by up to `size` metres."""
    step = pose(random.normal(size=3), random.uniform(-size, size), random.uniform(-1, 1, 3) * size)
    return start @ step


def true_distance(a, pose_a, b, pose_b):
    """Of the point sets, with 64 bits of mantissa."""
    pa, pb = (
        p[:3, :3].astype(np.longdouble) @ m.vertices.T.astype(np.longdouble) + p[:3, 3:]
        for m, p in ((a, pose_a), (b, pose_b))
    )
    return np.sqrt(((pa[:, :, None] - pb[:, None, :]) ** 2).sum(axis=0)).min()


def answered(a, pose_a, b, pose_b):
    """Answers that hold the exact distance of one placement, as a search would leave them."""
    spheres = bounds.extents([(a, b)])
    placement = bounds.place(pose_a[None], pose_b[None], spheres)
    pa = a.vertices @ pose_a[:3, :3].T + pose_a[:3, 3]
    pb = b.vertices @ pose_b[:3, :3].T + pose_b[:3, 3]
    squares = ((pa[:, None] - pb[None]) ** 2).sum(axis=2)
    i, j = np.unravel_index(squares.argmin(), squares.shape)
    lower = float(true_distance(a, pose_a, b, pose_b))
    return spheres, bounds.Answers(
        lower=np.array([np.nextafter(lower, 0.0)]),
        witness_a=bounds.carry_back(pose_a, pa[i])[None],
        witness_b=bounds.carry_back(pose_b, pb[j])[None],
        relative=placement.relative,
        size=placement.size,
        defect=placement.defect,
    )


def widened(spheres, answers, pose_a, pose_b):
    return bounds.widen(answers, bounds.place(pose_a[None], pose_b[None], spheres), spheres)


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
    a, b = (
        Cloud(random.normal(size=(12, 3)) * random.uniform(0.01, 2) + away * random.normal(size=3))
        for _ in range(2)
    )
    starts = [random_pose(random, spread) for _ in range(2)]
    ends = [nudged(random, start, motion) for start in starts]
    for each in (*starts, *ends):
        each[:3, :3] += random.uniform(-defect, defect, (3, 3))
    spheres, answers = answered(a, starts[0], b, starts[1])
    got = widened(spheres, answers, *ends)
    true = true_distance(a, ends[0], b, ends[1])
    assert got.lower[0] <= true <= got.upper[0]


def test_pairs_that_were_never_answered_are_certified_too():
    random = np.random.default_rng(5)
    clouds = [
        (Cloud(random.normal(size=(9, 3))), Cloud(random.normal(size=(9, 3)))) for _ in range(50)
    ]
    spheres = bounds.extents(clouds)
    answers = bounds.unanswered(
        np.array([a.vertices[0] for a, _ in clouds]), np.array([b.vertices[0] for _, b in clouds])
    )
    poses = [(random_pose(random, 5.0), random_pose(random, 5.0)) for _ in clouds]
    pose_a, pose_b = (np.array(each) for each in zip(*poses, strict=True))
    got = bounds.widen(answers, bounds.place(pose_a, pose_b, spheres), spheres)
    true = [true_distance(a, pa, b, pb) for (a, b), (pa, pb) in zip(clouds, poses, strict=True)]
    assert np.all(got.lower <= true)
    assert np.all(true <= got.upper)
    assert (got.lower > 0.0).any(), "far pairs are bounded away by their spheres"


def unit_clouds():
    """Two models with centre at their origin and radius 1, 3 - sqrt 2 apart when 3 apart in x."""
    half = np.sqrt(0.5)
    corners = [[x, y, 0.0] for x in (-half, half) for y in (-half, half)] + [[0, 0, 1], [0, 0, -1]]
    return Cloud(np.array(corners)), Cloud(np.array(corners))


def test_a_translation_widens_by_its_length():
    a, b = unit_clouds()
    start, end = pose(position=(3, 0, 0)), pose(position=(3, 0.25, 0))
    got = widened(*answered(a, np.eye(4), b, start), np.eye(4), end)
    before = 3.0 - np.sqrt(2.0)
    assert got.lower[0] == pytest.approx(before - 0.25, abs=1e-12)
    assert got.lower[0] < before - 0.25
    assert got.upper[0] == pytest.approx(np.hypot(before, 0.25), abs=1e-12)


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 0.1])
def test_a_rotation_about_the_centre_widens_by_the_chord_of_the_radius(angle):
    a, b = unit_clouds()
    place = pose(position=(3, 0, 0))
    got = widened(*answered(a, np.eye(4), b, place), np.eye(4), place @ pose((0, 1, 1), angle))
    widening = 3.0 - np.sqrt(2.0) - got.lower[0]
    assert widening == pytest.approx(2.0 * np.sin(angle / 2.0), rel=1e-3, abs=1e-12)


def test_the_body_whose_motion_is_cheaper_is_taken_as_the_moving_one():
    """A small part turning on the spot: seen from it, the large part swings about it."""
    small = Cloud(np.array([[0.01, 0, 0], [-0.01, 0, 0], [0, 0.01, 0]]))
    large, _ = unit_clouds()
    place = pose(position=(3, 0, 0))
    turned = place @ pose((0, 0, 1), 0.5)
    for pair, poses in (
        ((large, small), (np.eye(4), place, turned)),
        ((small, large), (place, np.eye(4), turned)),
    ):
        first_moves = pair[0] is small
        start = (poses[0], poses[1])
        end = (poses[2], poses[1]) if first_moves else (poses[0], poses[2])
        spheres, answers = answered(pair[0], start[0], pair[1], start[1])
        got = widened(spheres, answers, *end)
        assert answers.lower[0] - got.lower[0] < 0.01


def test_bodies_that_move_together_are_still():
    random = np.random.default_rng(3)
    a, b = unit_clouds()
    start = np.eye(4), pose((1, 2, 3), 0.7, (3, 1, 0))
    carried = random_pose(random, 10.0)
    got = widened(*answered(a, start[0], b, start[1]), carried @ start[0], carried @ start[1])
    assert got.still[0]
    assert got.upper[0] - got.lower[0] < 1e-11


def test_the_smallest_real_motion_is_not_still():
    a, b = unit_clouds()
    got = widened(
        *answered(a, np.eye(4), b, pose(position=(3, 0, 0))), np.eye(4), pose(position=(3, 1e-9, 0))
    )
    assert not got.still[0]


def test_coordinates_too_large_to_square_leave_the_bounds_that_always_hold():
    a, b = unit_clouds()
    for far in (1e155, 1e300):
        with np.errstate(over="ignore", invalid="ignore"):
            got = widened(
                *answered(a, np.eye(4), b, pose(position=(3, 0, 0))),
                np.eye(4),
                pose(position=(far, 0, 0)),
            )
        assert got.lower[0] == 0.0
        assert got.upper[0] == np.inf


def test_no_pairs_are_no_error():
    spheres = bounds.extents([])
    empty = np.zeros((0, 4, 4))
    answers = bounds.unanswered(np.zeros((0, 3)), np.zeros((0, 3)))
    assert bounds.widen(answers, bounds.place(empty, empty, spheres), spheres).lower.shape == (0,)
