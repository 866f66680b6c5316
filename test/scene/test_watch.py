"""The watched pairs as a rule and exceptions, against the same pairs written out one by one."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor.scene.watch import UNWATCHED, PairSettings, WatchedPairs

KINDS = [
    PairSettings(rel_err=0.5),
    PairSettings(range=2.0),
    PairSettings(range=3.0, question="within"),
]


def written_out(moving, rule, exceptions):
    """Yield (a, b, kind) of every watched pair, in order."""
    other = {(a, b): kind for a, b, kind in exceptions}
    for a, b in itertools.combinations(range(len(moving)), 2):
        kind = other.get((a, b), rule)
        if (moving[a] or moving[b]) and kind != UNWATCHED:
            yield a, b, kind


@st.composite
def watches(draw):
    moving = draw(st.lists(st.booleans(), min_size=1, max_size=9))
    pairs = [
        (a, b) for a, b in itertools.combinations(range(len(moving)), 2) if moving[a] or moving[b]
    ]
    kinds = st.integers(UNWATCHED, len(KINDS) - 1)
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    exceptions = [(a, b, draw(kinds)) for a, b in chosen]
    return moving, draw(kinds), exceptions


def made(moving, rule, exceptions):
    names = [f"body_{i}" for i in range(len(moving))]
    return WatchedPairs(names, moving, KINDS, rule, np.array(exceptions).reshape(-1, 3))


@pytest.mark.long
@settings(deadline=None, max_examples=300)
@given(watch=watches())
def test_the_sequence_is_that_of_the_pairs_written_out(watch):
    moving, rule, exceptions = watch
    expected = list(written_out(moving, rule, exceptions))
    pairs = made(moving, rule, exceptions)
    names = [(f"body_{a}", f"body_{b}") for a, b, _ in expected]
    assert len(pairs) == len(expected)
    assert [(pair.a, pair.b) for pair in pairs] == names
    assert [pair.range for pair in pairs] == [KINDS[kind].range for _, _, kind in expected]
    assert [pairs[i] for i in range(-len(expected), len(expected))] == 2 * list(pairs)
    assert pairs[1:-1] == tuple(pairs)[1:-1]
    with pytest.raises(IndexError):
        pairs[len(expected)]

    a, b, kind = np.array(expected, int).reshape(-1, 3).T
    assert pairs.positions(a, b).tolist() == list(range(len(expected)))
    assert pairs.kind(a, b).tolist() == kind.tolist()
    finite = np.isfinite([KINDS[each].range for each in kind])
    assert sorted(pairs.infinite().tolist()) == np.flatnonzero(~finite).tolist()

    for chosen in itertools.product((False, True), repeat=min(len(moving), 4)):
        mask = np.resize(chosen, len(moving))
        touched = [bool(f and (mask[i] or mask[j])) for i, j, f in zip(a, b, finite, strict=True)]
        assert pairs.finite_of(mask) == sum(touched)
        if not pairs.ruled_finite:
            found = pairs.finite_exceptions_of(mask)
            assert [each.tolist() for each in found] == [a[touched].tolist(), b[touched].tolist()]


@settings(deadline=None, max_examples=200)
@given(watch=watches(), least=st.sampled_from([0.0, 2.5, 10.0]))
def test_a_body_reaches_as_far_as_any_of_its_pairs(watch, least):
    """Then the mean of two bodies' reaches is never less than the range of their pair."""
    pairs = made(*watch)
    reaches = pairs.reaches(least)
    ranges = np.full(len(watch[0]), -np.inf)
    for a, b, kind in written_out(*watch):
        if np.isfinite(KINDS[kind].range):
            for body in (a, b):
                ranges[body] = max(ranges[body], KINDS[kind].range, least)
    assert (reaches >= ranges).all()
    assert reaches.max(initial=0.0) <= max(3.0, least)


def test_ten_thousand_bodies_are_a_rule_and_no_list():
    count = 10_000
    names = [f"b{i}" for i in range(count)]
    exceptions = [(0, 1, UNWATCHED), (5000, 9999, 2)]
    pairs = WatchedPairs(names, [True] * count, KINDS, 1, np.array(exceptions))
    assert len(pairs) == count * (count - 1) // 2 - 1
    assert (pairs[0].a, pairs[0].b) == ("b0", "b2")
    assert (pairs[-1].a, pairs[-1].b) == ("b9998", "b9999")
    at = int(pairs.positions(np.array([5000]), np.array([9999]))[0])
    assert (pairs[at].a, pairs[at].b, pairs[at].question) == ("b5000", "b9999", "within")
    assert len(pairs.infinite()) == 0
