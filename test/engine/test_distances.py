"""Many poses in one call: the answers of `distance`, whatever the number of threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, soup, sphere, torus

from proximity_monitor import engine

COUNT = 1300
"""More than five times what a thread takes at once."""

FIELDS = (
    "lower", "upper", "points_a", "points_b", "elements", "bound_tests", "primitive_tests",
)  # fmt: skip


def path(seed, count=COUNT):
    """Return poses along a path of small steps, with a jump now and then."""
    rng = np.random.default_rng(seed)
    poses = np.empty((count, 4, 4))
    for k in range(count):
        if k % 200 == 0:
            here = pose(rng, 2.0)
        here[:3, 3] += 0.01 * rng.normal(size=3)
        poses[k] = here
    return poses


@pytest.mark.parametrize(
    "tolerance", [{}, {"rel_err": 0.1}, {"abs_err": 0.05}, {"order": "priority"}]
)
def test_the_answers_do_not_depend_on_the_threads(tolerance):
    a, b = torus(24), sphere(2)
    poses_a, poses_b = path(1), path(2)
    one = engine.distances(a, poses_a, b, poses_b, **tolerance)
    assert len(one) == COUNT
    for threads in (2, 4):
        many = engine.distances(a, poses_a, b, poses_b, threads=threads, **tolerance)
        for field in FIELDS:
            assert np.array_equal(getattr(one, field), getattr(many, field)), field


def test_the_answers_are_those_of_single_questions():
    a, b = torus(24), soup(3)
    poses_a, poses_b = path(3), path(4)
    many = engine.distances(a, poses_a, b, poses_b)
    for k in range(0, COUNT, 13):
        alone = engine.distance(a, poses_a[k], b, poses_b[k])
        size = 1e-14 * (5.0 + np.abs(poses_a[k] - poses_b[k]).max())
        assert many.upper[k] == pytest.approx(alone.upper, abs=size)
        assert many.lower[k] == pytest.approx(alone.lower, abs=size)
        gap = np.linalg.norm(many.points_a[k] - many.points_b[k])
        assert many.upper[k] == pytest.approx(gap, abs=size)
    assert (many.lower <= many.upper).all()
    assert (many.lower == 0.0).any()
    assert (many.lower > 0.0).any()


def test_tolerances_hold_for_each():
    a, b = torus(24), sphere(3)
    poses_a, poses_b = path(5, 300), path(6, 300)
    exact = engine.distances(a, poses_a, b, poses_b)
    loose = engine.distances(a, poses_a, b, poses_b, rel_err=0.2)
    assert (loose.lower <= exact.upper).all()
    assert (exact.lower <= loose.upper).all()
    assert (loose.upper <= 1.2 * exact.upper + 1e-13).all()
    assert loose.bound_tests.sum() < exact.bound_tests.sum()


def test_no_poses_have_no_answers():
    none = engine.distances(box(), np.empty((0, 4, 4)), box(), np.empty((0, 4, 4)), threads=2)
    assert len(none) == 0
    assert none.points_a.shape == (0, 3)
    assert none.elements.shape == (0, 2)


@pytest.mark.parametrize("threads", [1, 3])
def test_a_bad_pose_is_named_from_every_thread(threads):
    poses = np.tile(np.eye(4), (COUNT, 1, 1))
    bad = poses.copy()
    bad[1111, 0, 0] = np.nan
    with pytest.raises(ValueError, match=r"poses_b\[1111\]\[0, 0\] = nan"):
        engine.distances(box(), poses, box(), bad, threads=threads)


@pytest.mark.parametrize(
    "options",
    [{"threads": 0}, {"threads": -1}, {"rel_err": -1.0}, {"abs_err": np.nan}, {"order": "x"}],
)
def test_options_that_make_no_sense(options):
    poses = np.eye(4)[None]
    with pytest.raises(ValueError, match=next(iter(options))):
        engine.distances(box(), poses, box(), poses, **options)


def test_models_are_shared_by_threads_that_ask_on_their_own():
    a, b = torus(24), sphere(3)
    poses = path(7, 400)
    expected = [engine.distance(a, p, b, IDENTITY).upper for p in poses]

    def ask(first):
        pair = engine.Pair(a, b)
        return [pair.distance(p, IDENTITY).upper for p in poses[first::4]]

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(ask, range(4)))
    for first, found in enumerate(answers):
        assert found == pytest.approx(expected[first::4], abs=1e-13)
