"""Properties of every question. Hypothesis looks for a question that violates one.

Half of the questions are about bodies anywhere. The other half are about triangles on a small grid
at quarter turns, where nearly all is degenerate: parallel, coplanar, shared, touching, of no area.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import permutations, product

import numpy as np
import pytest
from engine_bodies import IDENTITY, ORDERS, SMALL, VOLUMES, of, pose
from engine_oracles import (
    exact_mesh_distance,
    exact_motion,
    exact_squared_distance,
    exactly_moved,
    magnitude,
    root,
    triangles,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor import engine
from proximity_monitor.engine import Status

ACCURACY = 4e-15
"""Largest error of a bound, as a share of the larger model's coordinates."""

FLOOR = 2e-45
"""Further allowance in metres, for coordinates that are next to nothing."""

PLAIN = settings(max_examples=40, deadline=None)


@dataclass(frozen=True)
class Question:
    """Two models, their poses, and the exact squared distance."""

    a: engine.TriangleMesh
    pose_a: np.ndarray
    b: engine.TriangleMesh
    pose_b: np.ndarray
    squared: Fraction

    @property
    def accuracy(self) -> float:
        """Metres that a bound may be off: a share of the coordinates, and FLOOR."""
        return ACCURACY * magnitude(self.a, self.b, self.pose_a, self.pose_b) + FLOOR

    def __repr__(self) -> str:
        models = [(m.name, triangles(m).tolist()[:6]) for m in (self.a, self.b)]
        return f"{models} {self.pose_a.tolist()} {self.pose_b.tolist()}"


def quarter_turns() -> list[np.ndarray]:
    """Return the 24 rotations of a cube. They and their products are exact in floating point."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.eye(4)
        matrix[:3, :3] = np.diag(signs)[list(order)]
        if np.linalg.det(matrix) > 0.0:
            found.append(matrix)
    return found


seeds = st.integers(0, 2**32 - 1)
small = st.integers(-3, 3).map(float)
vectors = st.tuples(small, small, small)


@st.composite
def exact_poses(draw) -> np.ndarray:
    """Draw a quarter turn and a translation in quarters."""
    matrix = draw(st.sampled_from(quarter_turns())).copy()
    matrix[:3, 3] = 0.25 * np.array(draw(vectors))
    return matrix


@st.composite
def on_a_grid(draw) -> Question:
    """Draw two models of up to three triangles with corners on a grid, at quarter turns."""
    corners = st.lists(st.tuples(vectors, vectors, vectors), min_size=1, max_size=3)
    models = [np.array(draw(corners)).reshape(-1, 3) for _ in range(2)]
    a, b = (engine.TriangleMesh(m, np.arange(len(m)).reshape(-1, 3), name="grid") for m in models)
    pose_a, pose_b = draw(exact_poses()), draw(exact_poses())
    moved = [exactly_moved(exact_motion(pose_a, pose_b), t) for t in triangles(b)]
    squared = min(exact_squared_distance(t, m) for t in triangles(a).tolist() for m in moved)
    return Question(a, pose_a, b, pose_b, squared)


@st.composite
def anywhere(draw) -> Question:
    """Draw two small bodies at random poses."""
    a, b = (SMALL[draw(st.sampled_from(list(SMALL)))] for _ in range(2))
    rng = np.random.default_rng(draw(seeds))
    pose_a, pose_b = (pose(rng, draw(st.sampled_from((0.3, 1.0, 3.0)))) for _ in range(2))
    return Question(a, pose_a, b, pose_b, exact_mesh_distance(a, b, pose_b, pose_a))


questions = st.one_of(anywhere(), on_a_grid())


def check(lower: float, upper: float, question: Question) -> None:
    """Check that both bounds hold without a tolerance, and are as near as they promise."""
    assert Fraction(lower) ** 2 <= question.squared <= Fraction(upper) ** 2
    exact = root(question.squared)
    assert float(max(Fraction(upper) - exact, exact - Fraction(lower))) <= question.accuracy


@pytest.mark.long
@PLAIN
@given(questions)
def test_lower_exact_upper_for_every_volume_and_order(question):
    q = question
    for volume, order in product(VOLUMES, ORDERS):
        found = engine.distance(of(q.a, volume), q.pose_a, of(q.b, volume), q.pose_b, order=order)
        check(found.lower, found.upper, q)
        if q.squared == 0:
            assert found.status is Status.INTERSECTING
        elif root(q.squared) > 2 * q.accuracy:
            assert found.status is Status.EXACT


@PLAIN
@given(questions, st.sampled_from(("rel_err", "abs_err")), st.sampled_from((1e-9, 0.01, 0.5, 10.0)))
def test_tolerances_are_kept(question, name, value):
    q = question
    exact = root(q.squared)
    bound = exact * (1 + Fraction(value)) if name == "rel_err" else exact + Fraction(value)
    for order in ORDERS:
        found = engine.distance(q.a, q.pose_a, q.b, q.pose_b, order=order, **{name: value})
        assert Fraction(found.lower) ** 2 <= q.squared <= Fraction(found.upper) ** 2
        # Rounding affects both the answer and the bound that ends the search.
        assert Fraction(found.upper) <= bound + Fraction(2 * (1 + value) * q.accuracy)


@PLAIN
@given(questions)
def test_symmetry(question):
    q = question
    one = engine.distance(q.a, q.pose_a, q.b, q.pose_b)
    other = engine.distance(q.b, q.pose_b, q.a, q.pose_a)
    # A rotation is orthogonal only to 1e-16, so the distance in b's frame differs by that share.
    size = 2.0 * q.accuracy + ACCURACY * magnitude(q.b, q.a, q.pose_b, q.pose_a) + FLOOR
    assert one.upper == pytest.approx(other.upper, abs=size)
    assert one.lower == pytest.approx(other.lower, abs=2.0 * size)
    assert max(one.lower, other.lower) <= min(one.upper, other.upper)


@PLAIN
@given(on_a_grid(), exact_poses())
def test_an_exact_common_motion_changes_nothing(question, motion):
    q = question
    found = engine.distance(q.a, motion @ q.pose_a, q.b, motion @ q.pose_b)
    check(found.lower, found.upper, q)


@pytest.mark.long
@PLAIN
@given(anywhere(), seeds)
def test_a_common_rigid_motion_changes_nothing_but_rounding(question, seed):
    q, motion = question, pose(np.random.default_rng(seed), 5.0)
    one = engine.distance(q.a, q.pose_a, q.b, q.pose_b)
    other = engine.distance(q.a, motion @ q.pose_a, q.b, motion @ q.pose_b)
    # The product of poses is rounded, too: rotations by 1e-16 each, at translations of about 10.
    assert one.upper == pytest.approx(other.upper, abs=5e-14)
    assert max(one.lower, other.lower) <= min(one.upper, other.upper) + 5e-14


@pytest.mark.long
@PLAIN
@given(questions, st.sampled_from((0.0, 0.5, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 2.0)))
def test_within_agrees_with_the_exact_distance(question, share):
    q = question
    exact = root(q.squared)
    clearance = share * float(exact) if exact else share
    for volume in VOLUMES:
        found = engine.within(of(q.a, volume), q.pose_a, of(q.b, volume), q.pose_b, clearance)
        if Fraction(clearance) ** 2 >= q.squared:
            assert found.within
        elif exact - Fraction(clearance) > q.accuracy:
            assert not found.within
        assert Fraction(found.lower) ** 2 <= q.squared <= Fraction(found.upper) ** 2


@PLAIN
@given(questions)
def test_collide_agrees_with_distance_zero(question):
    q = question
    exact = root(q.squared)
    sets = set()
    for volume in VOLUMES:
        a, b = of(q.a, volume), of(q.b, volume)
        found = engine.collide(a, q.pose_a, b, q.pose_b, all_contacts=True)
        touching = engine.distance(a, q.pose_a, b, q.pose_b).lower == 0.0
        assert found.colliding == touching
        assert found.colliding or q.squared > 0
        assert not found.colliding or exact <= q.accuracy
        sets.add(frozenset(map(tuple, found.contacts.tolist())))
    assert len(sets) == 1


@PLAIN
@given(on_a_grid())
def test_all_contacts_are_the_exact_ones(question):
    """Grid distances are 0 or far above rounding, so there is nothing in between."""
    q = question
    motion = exact_motion(q.pose_a, q.pose_b)
    expected = {
        (i, j)
        for i, t in enumerate(triangles(q.a).tolist())
        for j, m in enumerate(triangles(q.b))
        if exact_squared_distance(t, exactly_moved(motion, m)) == 0
    }
    found = engine.collide(q.a, q.pose_a, q.b, q.pose_b, all_contacts=True)
    assert set(map(tuple, found.contacts.tolist())) == expected


@settings(max_examples=10, deadline=None)
@given(anywhere(), seeds, st.sampled_from(ORDERS))
def test_many_poses_are_answered_alike_on_any_number_of_threads(question, seed, order):
    q, rng = question, np.random.default_rng(seed)
    poses_a = np.array([q.pose_a] + [pose(rng, 1.0) for _ in range(600)])
    poses_b = np.array([q.pose_b] + [IDENTITY] * 600)
    one = engine.distances(q.a, poses_a, q.b, poses_b, order=order)
    check(one.lower[0], one.upper[0], q)
    for threads in (2, 3):
        many = engine.distances(q.a, poses_a, q.b, poses_b, order=order, threads=threads)
        assert np.array_equal(one.lower, many.lower)
        assert np.array_equal(one.upper, many.upper)
        assert np.array_equal(one.elements, many.elements)
        assert np.array_equal(one.points_a, many.points_a)


@PLAIN
@given(questions, st.lists(seeds, min_size=1, max_size=5))
def test_what_a_pair_remembers_changes_no_answer(question, detours):
    q, pair = question, engine.Pair(question.a, question.b)
    for seed in detours:
        pair.distance(pose(np.random.default_rng(seed), 1.0), IDENTITY, rel_err=seed % 2)
    found = pair.distance(q.pose_a, q.pose_b)
    check(found.lower, found.upper, q)


@PLAIN
@given(questions)
def test_budgets_only_tighten(question):
    q, pair = question, engine.Pair(question.a, question.b)
    lower, upper = 0.0, np.inf
    for budget in (0.0, 0.0, 1e-5, 1e-5, 60.0):
        found = pair.distance(q.pose_a, q.pose_b, budget_s=budget)
        assert Fraction(found.lower) ** 2 <= q.squared <= Fraction(found.upper) ** 2
        assert lower <= found.lower
        assert found.upper <= upper
        lower, upper = found.lower, found.upper
    check(lower, upper, q)
