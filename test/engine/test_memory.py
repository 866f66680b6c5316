"""Memory that outlives its search is reused, never by two searches at once, and without traces."""

import gc
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from engine_bodies import IDENTITY, translation
from engine_surfaces import bumps

from proximity_monitor import engine
from proximity_monitor.engine.questions import ball, memory, run
from proximity_monitor.engine.questions.result import Status

ICO = trimesh.creation.icosphere(3)
BALL = engine.TriangleMesh(ICO.vertices, ICO.faces)
OTHER = engine.TriangleMesh(0.9 * ICO.vertices, ICO.faces)
NET, TURNED = bumps(1), bumps(2)
APART, INTO = translation(2.1, 0.1, 0.2), translation(1.2, 0.3, 0.1)
ABOVE = translation(0.1, 0.2, 0.5)
PROFILE = [[0.8, 0.0], [1.2, -0.3], [1.2, 0.3], [0.8, 0.0]]
CROWD = [translation(x, 0.2, 0.1) for x in np.linspace(2.5, 1.8, 9)]

QUESTIONS = {
    "distance": lambda: engine.distance(BALL, IDENTITY, OTHER, APART).row,
    "priority": lambda: engine.distance(BALL, IDENTITY, OTHER, APART, order="priority").row,
    "within": lambda: engine.within(BALL, IDENTITY, OTHER, APART, 0.5).row,
    "collide": lambda: engine.collide(BALL, IDENTITY, OTHER, INTO).contacts,
    "all contacts": lambda: engine.collide(BALL, IDENTITY, OTHER, INTO, all_contacts=True).contacts,
    "manifold": lambda: engine.distance(BALL, IDENTITY, BALL, APART, manifold=True).manifold.lower,
    "depth": lambda: engine.signed_distance(BALL, IDENTITY, OTHER, INTO, depth_err=1e-4).row,
    "clear": lambda: engine.signed_distance(BALL, IDENTITY, OTHER, APART).row,
    "surfaces": lambda: engine.distance(NET, IDENTITY, TURNED, ABOVE).row,
    "surface and mesh": lambda: engine.distance(NET, IDENTITY, BALL, APART).row,
    "deepest point": lambda: engine.signed_distance(NET, IDENTITY, BALL, INTO).row,
    "batch": lambda: np.array(
        engine.distances(BALL, np.tile(IDENTITY, (9, 1, 1)), OTHER, CROWD).lower
    ),
}


@pytest.fixture(autouse=True, scope="module")
def others_are_gone() -> None:
    """Keep searches of earlier tests from giving their memory back during these tests.

    A question that compiles leaves frames that hold its memory until garbage is collected. So ask
    every question once, then collect.
    """
    for ask in QUESTIONS.values():
        ask()
    gc.collect()


@pytest.fixture(autouse=True)
def none_kept() -> Iterator[None]:
    """Start and end each test with no kept memory."""
    memory._kept.clear()
    yield
    memory._kept.clear()


@pytest.fixture
def made(monkeypatch) -> list[memory.Memory]:
    """Return a list to which each new Memory is appended."""
    found = []
    begin = memory.Memory.__init__

    def note(self, kind):
        begin(self, kind)
        found.append(self)

    monkeypatch.setattr(memory.Memory, "__init__", note)
    return found


@pytest.mark.parametrize("name", QUESTIONS)
def test_a_question_uses_the_memory_of_the_one_before(name, made):
    QUESTIONS[name]()
    count = len(made)
    assert 0 < count <= 2 and set(memory._kept) == set(made)
    for _ in range(3):
        QUESTIONS[name]()
    assert len(made) == count


def arrays(kept: memory.Memory) -> list[np.ndarray]:
    """Return all arrays that a search writes to or remembers in."""
    if hasattr(kept, "ball"):
        return [*kept.ball, *kept.more]
    state = kept.state
    return [state.motions, state.progress, *state.open, *state.waiting, state.far]


def spoil(kept: memory.Memory) -> None:
    """Fill the memory with values that no search can use: NaN, or indices of missing elements."""
    for array in arrays(kept):
        array.reshape(-1).view(np.uint8)[:] = 0xFF


@pytest.mark.parametrize("name", QUESTIONS)
def test_no_search_finds_anything_in_the_memory_of_another(name):
    expected = np.array(QUESTIONS[name]())
    assert memory._kept
    for kept in memory._kept:
        spoil(kept)
    np.testing.assert_array_equal(QUESTIONS[name](), expected)


def test_models_of_other_sizes_and_questions_of_all_kinds_take_turns():
    expected = {name: np.array(ask()) for name, ask in QUESTIONS.items()}
    rng = np.random.default_rng(0)
    for name in rng.choice(list(QUESTIONS), 40):
        np.testing.assert_array_equal(QUESTIONS[name](), expected[name])


def span(array: np.ndarray) -> tuple[int, int]:
    """Return the first and the end address of an array."""
    begin = array.__array_interface__["data"][0]
    return begin, begin + array.nbytes


def owned(*pairs: engine.Pair) -> list[np.ndarray]:
    """Return the non-empty arrays of the pairs' searches."""
    searches = [each for pair in pairs for each in (pair._search, pair._signed) if each]
    kept = [each._own if hasattr(each, "_own") else each._depth._own for each in searches]
    return [array for each in kept for array in arrays(each) if array.nbytes]


def test_searches_that_can_go_on_share_nothing_with_others():
    pairs = [engine.Pair(BALL, OTHER) for _ in range(3)]
    poses = [translation(2.0 + 0.05 * k, 0.1, 0.2) for k in range(3)]
    whole = [engine.distance(BALL, IDENTITY, OTHER, pose) for pose in poses]
    found = [None] * 3
    while not all(each and each.status is Status.EXACT for each in found):
        for k, pair in enumerate(pairs):
            found[k] = pair.distance(IDENTITY, poses[k], budget_s=0.0)
            pair.signed_distance(IDENTITY, INTO, budget_s=0.0)
            QUESTIONS["distance"]()
            QUESTIONS["depth"]()
    for each, alone in zip(found, whole, strict=True):
        assert each.lower == pytest.approx(alone.lower, abs=1e-12)
        assert each.upper == pytest.approx(alone.upper, abs=1e-12)
    free = [array for each in memory._kept for array in arrays(each) if array.nbytes]
    spans = sorted(map(span, (*owned(*pairs), *free)))
    assert len(spans) > 50
    assert all(end <= begin for (_, end), (begin, _) in pairwise(spans))


def test_a_pair_keeps_what_it_remembers_while_others_come_and_go():
    pair, alone = engine.Pair(BALL, OTHER), engine.Pair(BALL, OTHER)
    tests = {pair: 0, alone: 0}
    for pose in CROWD:
        for asked in (pair, alone):
            tests[asked] += asked.distance(IDENTITY, pose).bound_tests
        for name in ("distance", "within", "clear"):
            QUESTIONS[name]()
    assert tests[pair] == tests[alone]


def test_memory_comes_back_when_nobody_can_go_on_with_the_search():
    pair = engine.Pair(BALL, OTHER)
    cut = pair.distance(IDENTITY, APART, budget_s=0.0)
    assert cut.status is Status.OUT_OF_TIME and not memory._kept
    own = pair._search._own
    del pair
    assert [*memory._kept] == [own]
    listed = engine.collide(BALL, IDENTITY, OTHER, INTO, all_contacts=True)
    contacts = engine.collide(BALL, IDENTITY, OTHER, INTO, all_contacts=True).contacts
    for kept in memory._kept:
        spoil(kept)
    np.testing.assert_array_equal(listed.contacts, contacts)


def test_memory_comes_back_from_a_question_that_is_refused(made):
    bad = 2.0 * IDENTITY
    for _ in range(3):
        with pytest.raises(ValueError, match="pose_b"):
            engine.distance(BALL, IDENTITY, OTHER, bad)
    with pytest.raises(ValueError, match="order"):
        engine.distance(BALL, IDENTITY, OTHER, APART, order="none")
    gc.collect()  # an error and the frames that it passed through may refer to each other
    QUESTIONS["within"]()
    assert len(made) == len(memory._kept) <= 2


def test_what_is_kept_is_bounded():
    engine.distance(BALL, IDENTITY, OTHER, APART, order="breadth_first")
    assert not memory._kept, "a list of a million pairs is too large"
    pairs = [engine.Pair(BALL, OTHER) for _ in range(40)]
    for pair in pairs:
        pair.distance(IDENTITY, APART)
    last = pair._search._own
    del pair
    while pairs:
        del pairs[0]
    assert len(memory._kept) == memory._MOST and memory._kept[0] is last
    assert sum(each.size for each in memory._kept) <= memory._MOST * memory._LARGEST


def test_threads_never_own_the_same_memory(monkeypatch):
    """The answers of several threads equal those of one thread."""
    names = ["distance", "within", "depth", "clear", "surfaces", "batch"]
    expected = {name: np.array(QUESTIONS[name]()) for name in names}
    busy: set[int] = set()
    taken = memory.take

    def take(made, kind):
        found = taken(made, kind)
        assert id(found) not in busy, "two searches own it"
        busy.add(id(found))
        return found

    def give_back(kept):
        busy.remove(id(kept))
        memory.give_back(kept)

    for module, kind in ((run, run.Search), (ball, ball.BallSearch)):
        monkeypatch.setattr(module, "take", take)
        monkeypatch.setattr(kind.__del__, "__defaults__", (give_back,))

    def ask(seed: int) -> None:
        for name in np.random.default_rng(seed).choice(names, 40):
            np.testing.assert_array_equal(QUESTIONS[name](), expected[name])

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(ask, range(8)))
    gc.collect()
    assert not busy


@pytest.mark.skipif(not Path("/proc/self/smaps").exists(), reason="only Linux tells")
def test_no_search_asks_for_huge_pages():
    """The system may take milliseconds to provide a huge page, within a question with a budget."""
    ring = engine.SolidOfRevolution([engine.Curve(PROFILE)])
    searches = [
        run.Search(BALL, OTHER, "breadth_first", True),
        run.Search(ring, ring, "depth_first", True),
        run.Search(NET, BALL, "depth_first", True),
    ]
    places = mappings_with_huge_pages()
    large = 0
    for search in searches:
        for array in (*search.state.open, *search.state.waiting):
            if array.nbytes >= 1 << 22:  # a smaller array may lie in the place of a freed large one
                large += 1
                begin = array.__array_interface__["data"][0]
                end = begin + array.nbytes
                assert not any(low < end and begin < high for low, high in places)
    assert large >= 2


def mappings_with_huge_pages() -> list[tuple[int, int]]:
    """Return the address ranges of this process that are marked for huge pages."""
    found, begin, end = [], 0, 0
    for line in Path("/proc/self/smaps").read_text().splitlines():
        first, *rest = line.split()
        if re.fullmatch("[0-9a-f]+-[0-9a-f]+", first):
            begin, end = (int(each, 16) for each in first.split("-"))
        elif first == "VmFlags:" and "hg" in rest:
            found.append((begin, end))
    return found
