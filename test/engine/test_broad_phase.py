"""The broad phase against all pairs of balls, compared exactly."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor.engine.assembly.broad_phase import BroadPhase


def meeting(centres, radii, moving):
    """Return all pairs of balls that meet, computed with rational numbers."""
    exact = [[Fraction(float(x)) for x in centre] for centre in centres]
    pairs = set()
    for i, j in itertools.combinations(range(len(radii)), 2):
        square = sum((x - y) ** 2 for x, y in zip(exact[i], exact[j], strict=True))
        reach = Fraction(float(radii[i])) + Fraction(float(radii[j]))
        if (moving[i] or moving[j]) and square <= reach**2:
            pairs.add((i, j))
    return pairs


def near(broad, centres, radii, moving=None, taking_part=None):
    count = len(radii)
    moving = np.ones(count, bool) if moving is None else moving
    taking_part = np.arange(count) if taking_part is None else taking_part
    found = broad.near(np.asarray(centres, float), np.asarray(radii, float), moving, taking_part)
    listed = [tuple(pair) for pair in found.tolist()]
    assert listed == sorted(set(listed)), "sorted, each once"
    return set(listed)


@pytest.mark.long
@settings(deadline=None, max_examples=150)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(0, 40),
    scale=st.sampled_from([1e-300, 1e-150, 1e-3, 1.0, 1e9, 1e45]),
    away=st.sampled_from([0.0, 1.0, 1e6]),
    flat=st.sampled_from([(), (0,), (0, 1), (0, 1, 2)]),
)
def test_no_pair_that_meets_is_left_out(seed, count, scale, away, flat):
    """Balls of any size and place. Their centres may lie in a plane, on a line or in one point."""
    random = np.random.default_rng(seed)
    centres = random.uniform(-1.0, 1.0, (count, 3)) + away
    centres[:, list(flat)] = away
    radii = random.uniform(0.0, 0.5, count) * random.integers(0, 2, count)
    moving = random.random(count) < 0.7
    broad = BroadPhase()
    for _ in range(3):
        expected = meeting(scale * centres, scale * radii, moving)
        found = near(broad, scale * centres, scale * radii, moving)
        assert expected <= found
        gaps = [
            np.linalg.norm(centres[i] - centres[j]) - radii[i] - radii[j]
            for i, j in found - expected
        ]
        # Rounding adds only pairs that almost touch, or whose size is below any that matters.
        assert all(gap <= 1e-14 * (1.0 + away) for gap in gaps) or scale < 1e-100
        centres += random.normal(size=centres.shape) * 0.05
        centres[:, list(flat)] = away


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("place", [0.0, 0.1, 1e7])
def test_balls_that_touch_in_a_point_meet(axis, place):
    centres = np.full((2, 3), place)
    centres[1, axis] += 0.75
    assert near(BroadPhase(), centres, [0.5, centres[1, axis] - place - 0.5]) == {(0, 1)}


def test_the_order_of_many_jumps_is_found_anew():
    random = np.random.default_rng(2)
    broad = BroadPhase()
    for _ in range(4):
        centres = random.permutation(np.stack([np.arange(4000.0)] + 2 * [np.zeros(4000)], axis=1))
        found = near(broad, centres, np.full(4000, 0.5))
        along = np.argsort(centres[:, 0])
        neighbours = {tuple(sorted(pair)) for pair in itertools.pairwise(along.tolist())}
        assert found == neighbours


def test_all_in_one_place():
    count = 300
    found = near(BroadPhase(), np.ones((count, 3)), np.zeros(count))
    assert len(found) == count * (count - 1) // 2


def test_only_those_that_take_part_and_only_pairs_that_move():
    centres, radii = np.zeros((5, 3)), np.ones(5)
    moving = np.array([False, True, False, False, True])
    broad = BroadPhase()
    assert near(broad, centres, radii, moving, np.array([0, 1, 2])) == {(0, 1), (1, 2)}
    assert near(broad, centres, radii, moving, np.array([0, 2, 3])) == set()
    assert near(broad, centres, radii, moving, np.array([3, 4])) == {(3, 4)}
    assert near(broad, centres, radii, moving, np.array([4])) == set()


def test_the_list_grows_with_the_crowd():
    """First there are more pairs than room for them, then few again."""
    random = np.random.default_rng(3)
    broad = BroadPhase()
    centres = random.uniform(size=(200, 3))
    everyone = near(broad, centres, np.full(200, 2.0))
    assert len(everyone) == 200 * 199 // 2
    assert near(broad, centres, np.full(200, 0.0)) == set()
