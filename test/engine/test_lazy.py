"""Parts of searches that are compiled when a search first calls them."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from engine_bodies import IDENTITY, soup, sphere, translation
from engine_surfaces import bumps
from test_revolution_core import BUSH, RING

from proximity_monitor import engine
from proximity_monitor.engine import shapes
from proximity_monitor.engine.kernels.base import lazy
from proximity_monitor.engine.kernels.pairs.parts import SEARCHES, parts_of
from proximity_monitor.engine.questions import setup

NET, BALL = engine.ParametricSurface([bumps(3)]), sphere(3, 0.6)
ROD = shapes.cylinder(0.4, 1.5)
QUESTIONS = {
    "two surfaces": (NET, NET, translation(0.0, 0.0, 0.05)),
    "two rings": (RING, RING, translation(0.5, 0.2, 0.9)),
    "a ball over a surface": (NET, BALL, translation(0.5, 0.5, 0.8)),
    "a ball near a ring": (RING, BALL, translation(2.0, 0.1, 0.2)),
    "triangles around a rod": (ROD, soup(0), translation(0.9, 0.1, 0.2)),
    "a box in a bush": (BUSH, shapes.box((0.4, 0.4, 0.4)), translation(0.3, 0.2, 0.5)),
    "a capsule in a bush": (BUSH, shapes.capsule(0.9, 0.4), translation(0.0, 0.0, 0.5)),
}


@pytest.fixture
def unbound():
    """Let all parts be as if they were not compiled; return them."""
    parts = {each for entry in SEARCHES for each in parts_of(entry, True)}
    setup.bind.cache_clear()
    for part in parts:
        part._address.value = ctypes.cast(part._first, ctypes.c_void_p).value
    yield parts
    for part in parts:
        part.bind()


def bound(parts):
    """Return the parts that have been compiled or loaded since they were as if they were not."""
    first = {part: ctypes.cast(part._first, ctypes.c_void_p).value for part in parts}
    return {part for part in parts if part._address.value != first[part]}


def asked(question):
    a, b, at = question
    return repr(engine.Pair(a, b).distance(IDENTITY, at))


def test_parts_are_compiled_when_they_are_called_and_answers_are_the_same(unbound):
    first = {name: asked(question) for name, question in QUESTIONS.items()}
    assert bound(unbound) == unbound, "the questions above need each part"
    assert {name: asked(question) for name, question in QUESTIONS.items()} == first


def test_what_is_far_apart_needs_few_parts(unbound):
    engine.distance(NET, IDENTITY, BALL, translation(0.5, 0.5, 20.0))
    assert len(bound(unbound)) <= 2


def test_an_assembly_has_all_parts_once_there_is_a_budget(unbound):
    """So that no later question has to compile, which would take seconds."""
    many = engine.Assembly([NET, RING, BALL])
    poses = np.stack((IDENTITY, translation(50.0, 0.0, 0.0), translation(0.0, 90.0, 0.0)))
    many.distances(poses, [[0, 1], [0, 2], [1, 2]])
    few = bound(unbound)
    many.distances(poses, [[0, 1]], budget_s=1.0)
    of_surfaces = {part for part in unbound if len(set(part.arguments[:2])) == 1}
    assert bound(unbound) - few < of_surfaces, "rings and surfaces are searched as surfaces"
    beside_meshes = unbound - of_surfaces
    assert beside_meshes - few, "all are far apart"
    many.distances(poses, [[0, 2], [1, 2]], budget_s=1.0)
    assert bound(unbound) > beside_meshes


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_what_stops_the_compiler_stops_the_question(error, threads, unbound, monkeypatch):
    a, b, at = QUESTIONS["a ball near a ring"]

    def fails(part):
        raise error("while it compiles")

    pair, many, poses = engine.Pair(a, b), engine.Assembly([a, b]), np.stack((IDENTITY, at))
    with monkeypatch.context() as patched:
        patched.setattr(lazy.Part, "bind", fails)
        with pytest.raises(error, match="while it compiles"):
            pair.distance(IDENTITY, at)
        with pytest.raises(error, match="while it compiles"):
            many.distances(poses, 8 * [[0, 1]], threads=threads)
    assert not lazy.failed
    lower = 0.12437078816
    assert pair.distance(IDENTITY, at).lower == pytest.approx(lower, abs=1e-10)
    assert many.distances(poses, 8 * [[0, 1]]).lower == pytest.approx(8 * [lower], abs=1e-10)
