"""What a search of surfaces hands over when a budget ends it, and contacts that are cut."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from engine_bodies import IDENTITY, translation
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.questions import memory, pair, run, touching

RING = engine.ParametricSurface(torus_patches())
CROSSED, LIFTED = translation(1.0, 0.0, 0.1), translation(0.9, 0.1, 0.2)


def contacts(at, budget_s=None, asked=None):
    asked = asked or engine.Pair(RING, RING)
    return asked.collide(IDENTITY, at, all_contacts=True, budget_s=budget_s)


def as_set(found):
    return {tuple(each) for each in found.contacts.tolist()}


@pytest.mark.parametrize("at", [CROSSED, translation(2.7, 0.2, 0.3)], ids=["crossing", "apart"])
def test_only_the_parts_in_its_pairs_are_handed_over(at):
    """A search makes thousands of parts, and rules most of them out."""
    asked = engine.Pair(RING, RING)
    asked.distance(IDENTITY, at, manifold=True)
    search = asked._search
    divided = search.divided()
    cells = divided.cells()
    waiting, progress = search.state.waiting, search.progress
    whole = waiting.cells_a[: progress["cells_a"]], waiting.cells_b[: progress["cells_b"]]
    for kept, every, name, own in zip(cells.sides, whole, ("a", "b"), cells.pairs.T, strict=True):
        assert set(own) == set(range(len(kept)))
        for field in ("element", "low", "high"):
            np.testing.assert_array_equal(kept[field][own], every[field][divided.pairs[name]])
    if at is not CROSSED:
        assert sum(map(len, cells.sides)) < 0.2 * sum(map(len, whole))


def test_an_abandoned_search_gives_its_memory_back_at_once():
    """Its own search, for the pieces, and that of the pair."""
    gc.collect()
    gc.disable()
    try:
        asked = engine.Pair(RING, RING)
        while asked._pieces is None or asked._pieces._prepared is None:
            contacts(CROSSED, 0.0, asked)
        memory._kept.clear()
        del asked
        assert len(memory._kept) == 2
    finally:
        gc.enable()


@pytest.mark.parametrize(
    "ask",
    [
        lambda asked: asked.collide(IDENTITY, LIFTED, all_contacts=True, budget_s=10.0),
        lambda asked: asked.collide(IDENTITY, LIFTED, all_contacts=True, budget_s=0.0),
        lambda asked: asked.within(IDENTITY, CROSSED, 0.1, budget_s=0.0),
        lambda asked: asked.distance(IDENTITY, LIFTED),
    ],
    ids=["contacts", "cut contacts", "within", "distance"],
)
def test_a_question_in_between_makes_contacts_begin_anew(ask):
    """What two searches of one question found in part does not add up to all contacts."""
    asked = engine.Pair(RING, RING)
    while asked._pieces is None:
        contacts(CROSSED, 0.0, asked)
    begun = asked._pieces
    ask(asked)
    contacts(CROSSED, 0.0, asked)
    assert asked._pieces is not begun
    found = contacts(CROSSED, 10.0, asked)
    assert found.complete
    assert as_set(found) == as_set(contacts(CROSSED))


def test_contacts_can_be_asked_for_after_an_interrupt(monkeypatch):
    asked = engine.Pair(RING, RING)
    while asked._pieces is None:
        contacts(CROSSED, 0.0, asked)

    def interrupted(*given):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        for name in ("_of_leaves", "table"):
            patch.setattr(touching, name, interrupted)
        contacts(CROSSED, 10.0, asked)
    found = contacts(CROSSED, 10.0, asked)
    assert found.complete
    assert as_set(found) == as_set(contacts(CROSSED))


def test_time_is_kept_to_hand_over_a_manifold(monkeypatch):
    given = []
    search = run.Search.run

    def watched(self, *args, **how):
        given.append(args[6])
        return search(self, *args, **how)

    monkeypatch.setattr(run.Search, "run", watched)
    monkeypatch.setattr(pair, "perf_counter", lambda: 0.0)
    asked = engine.Pair(RING, RING)
    for manifold in (False, True):
        asked.distance(IDENTITY, CROSSED, budget_s=1e-3, manifold=manifold)
    assert given[0] - given[1] == pytest.approx(pair._HAND_OVER_S)
