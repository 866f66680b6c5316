"""Queries take every real number without compiling, and refuse all else, naming the argument."""

from __future__ import annotations

import sys
from decimal import Decimal
from fractions import Fraction

import numba
import numpy as np
import pytest
from engine_bodies import IDENTITY, box, sphere, torus, translation
from numba.core.dispatcher import Dispatcher

from proximity_monitor import engine
from proximity_monitor.engine import kernels
from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.assembly.broad_phase import BroadPhase
from proximity_monitor.engine.assembly.schedule import Schedule
from proximity_monitor.engine.kernels.base.state import ANSWER
from proximity_monitor.engine.poses import check_pose
from proximity_monitor.engine.questions import run, setup

A, B = sphere(2), box()
HERE, THERE = IDENTITY, translation(3.0, 0.5)
POSES = np.stack((HERE, THERE))
PAIRS = np.array([[0, 1]])

NUMBERS = {
    "int": 1,
    "numpy int": np.int16(1),
    "unsigned": np.uint64(1),
    "half": np.float16(1.0),
    "single": np.float32(1.0),
    "double": np.float64(1.0),
    "long double": np.longdouble(1.0),
    "fraction": Fraction(1),
    "decimal": Decimal(1),
    "array": np.array(1.0),
    "array of int": np.array(1, np.int32),
    "array of objects": np.array(Fraction(1), object),
}
OTHERS = {
    "None": None,
    "text": "0.1",
    "numpy text": np.str_("0.1"),
    "bytes": b"1",
    "complex": 1.0 + 0.0j,
    "numpy complex": np.complex64(1.0),
    "truth": True,
    "numpy truth": np.bool_(True),
    "list": [0.1],
    "two": np.array([0.1, 0.2]),
    "one in a row": np.array([0.1]),
    "time": np.timedelta64(1, "s"),
    "complex array": np.array(1.0 + 2.0j),
    "too large": 10**400,
}
ASSEMBLY = engine.Assembly([A, B])


def pair():
    return engine.Pair(A, B)


QUESTIONS = {
    "rel_err": [
        lambda x: engine.distance(A, HERE, B, THERE, rel_err=x),
        lambda x: engine.closest_points(A, HERE, [[0.0, 0.0, 0.0]], rel_err=x),
        lambda x: engine.signed_distance(A, HERE, B, THERE, rel_err=x),
        lambda x: engine.distances(A, POSES, B, POSES, rel_err=x),
        lambda x: pair().ideal(HERE, THERE, rel_err=x),
        lambda x: ASSEMBLY.distances(POSES, PAIRS, rel_err=x),
    ],
    "abs_err": [
        lambda x: engine.distance(A, HERE, B, THERE, abs_err=x),
        lambda x: engine.closest_points(A, HERE, [[0.0, 0.0, 0.0]], abs_err=x),
        lambda x: engine.signed_distance(A, HERE, B, THERE, abs_err=x),
        lambda x: engine.distances(A, POSES, B, POSES, abs_err=x),
        lambda x: pair().ideal(HERE, THERE, abs_err=x),
        lambda x: ASSEMBLY.distances(POSES, PAIRS, abs_err=x),
    ],
    "budget_s": [
        lambda x: engine.distance(A, HERE, B, THERE, budget_s=x),
        lambda x: engine.signed_distance(A, HERE, B, THERE, budget_s=x),
        lambda x: ASSEMBLY.distances(POSES, PAIRS, budget_s=x),
        lambda x: engine.distances(A, POSES, B, POSES, budget_s=x),
        lambda x: engine.distances(A, POSES, B, POSES, budget_s=x, signed=True),
        lambda x: engine.closest_points(A, HERE, [[0.0, 0.0, 0.0]], budget_s=x, signed=True),
    ],
    "clearance": [
        lambda x: engine.within(A, HERE, B, THERE, x),
        lambda x: engine.distances(A, POSES, B, POSES, clearance=x),
        lambda x: engine.distances(A, POSES, B, POSES, clearance=x, signed=True),
        lambda x: ASSEMBLY.distances(POSES, PAIRS, clearance=x),
    ],
}
EVERY = [(name, k) for name, asks in QUESTIONS.items() for k in range(len(asks))]


def forms():
    """Return how many signatures the kernels are compiled for, in total."""
    rooms = [room for name, room in sys.modules.items() if name.startswith(kernels.__name__)]
    found = (each for room in rooms for each in vars(room).values())
    return sum(len(each.overloads) for each in found if isinstance(each, Dispatcher))


@pytest.mark.parametrize(("name", "k"), EVERY)
def test_every_real_number_is_one_and_compiles_nothing(name, k):
    ask, before = QUESTIONS[name][k], 0
    while forms() > before:  # a budget may end while the first kernels are compiled
        before = forms()
        ask(1.0)
    for number in NUMBERS.values():
        ask(number)
    assert forms() == before


@pytest.mark.parametrize(("name", "k"), EVERY)
@pytest.mark.parametrize("kind", OTHERS)
def test_what_is_no_real_number_is_refused_by_name(name, k, kind):
    value = OTHERS[kind]
    if value is None and name != "rel_err" and name != "abs_err" and (name, k) != ("clearance", 0):
        return  # None is allowed here: no limit
    if kind in ("list", "one in a row") and QUESTIONS[name][k] in COLUMNS:
        return  # allowed here: one number for each pair
    with pytest.raises((TypeError, ValueError), match=rf"^{name}\b"):
        QUESTIONS[name][k](value)


COLUMNS = [QUESTIONS["rel_err"][-1], QUESTIONS["abs_err"][-1], QUESTIONS["clearance"][-1]]


@pytest.mark.parametrize("threads", [True, 1.0, "2", None, np.array([1, 2])])
def test_threads_are_a_whole_number(threads):
    with pytest.raises(TypeError, match=r"^threads = "):
        engine.distances(A, POSES, B, POSES, threads=threads)
    with pytest.raises(TypeError, match=r"^threads = "):
        ASSEMBLY.distances(POSES, PAIRS, threads=threads)


class Matrix(np.ndarray):
    """A subclass of numpy's array."""


def layouts(array):
    """Return the same numbers in other types and layouts."""
    single = np.asarray(array)
    frozen = single.copy()
    frozen.setflags(write=False)
    fractions = np.array([Fraction(x) for x in single.ravel().tolist()], object)
    return {
        "list": single.tolist(),
        "single": single.astype(np.float32),
        "long double": single.astype(np.longdouble),
        "other bytes": single.astype(single.dtype.newbyteorder()),
        "columns": np.asfortranarray(single),
        "every other": np.repeat(single, 2, axis=0)[::2],
        "backwards": np.flip(np.flip(single).copy()),
        "read-only": frozen,
        "subclass": single.view(Matrix),
        "fractions": fractions.reshape(single.shape),
    }


ARRAYS = {
    "pose": (THERE, lambda x: engine.distance(A, HERE, B, x).upper),
    "signed": (THERE, lambda x: engine.signed_distance(A, HERE, B, x).upper),
    "within": (THERE, lambda x: engine.within(A, HERE, B, x, 0.5).lower),
    "collide": (THERE, lambda x: engine.collide(A, HERE, B, x).colliding),
    "check_pose": (THERE, lambda x: check_pose(x)),
    "poses": (POSES, lambda x: engine.distances(A, POSES, B, x).upper),
    "of an assembly": (POSES, lambda x: ASSEMBLY.distances(x, PAIRS).upper),
    "points": (POSES[:, 0, :3], lambda x: engine.closest_points(A, HERE, x).upper),
    "vertices": (B.vertices, lambda x: engine.distance(A, HERE, mesh_of(x), THERE).upper),
}
INTEGERS = {
    "pairs": (PAIRS, lambda x: ASSEMBLY.distances(POSES, x).upper),
    "hints": (np.array([[3, 5]]), lambda x: ASSEMBLY.distances(POSES, PAIRS, hints=x).upper),
}


def mesh_of(vertices):
    return engine.TriangleMesh(vertices, B.faces)


@pytest.mark.parametrize("kind", ARRAYS)
def test_every_layout_of_numbers_is_taken_and_compiles_nothing(kind):
    given, ask = ARRAYS[kind]
    expected, before = ask(given.copy()), forms()
    for name, same in layouts(given).items():
        assert ask(same) == pytest.approx(expected, rel=1e-6), name
    assert forms() == before


@pytest.mark.parametrize("kind", INTEGERS)
def test_every_layout_of_indices_is_taken_and_compiles_nothing(kind):
    given, ask = INTEGERS[kind]
    expected, before = ask(given), forms()
    for dtype in (np.int8, np.uint16, np.int32, np.uint32, np.int64, ">i4"):
        same = given.astype(dtype)
        same.setflags(write=False)
        assert ask(same) == pytest.approx(expected)
    assert ask(given.tolist()) == pytest.approx(expected)
    assert forms() == before
    for other in (given.astype(float), given.astype(complex), given > 0, given.astype(str)):
        with pytest.raises(ValueError, match=f"^{kind}: "):
            ask(other)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ARRAYS)
def test_complex_numbers_text_and_nothing_are_no_coordinates(kind):
    given, ask = ARRAYS[kind]
    objects = given.astype(object)
    objects[(0,) * objects.ndim] = None
    for other in (given.astype(complex), given.astype(str), given > 0.0, objects, None):
        with pytest.raises(ValueError, match=r"pose|points|vertices") as caught:
            ask(other)
        assert "number" in str(caught.value)


@pytest.mark.parametrize("other", [None, "bracket.stl", HERE, A.vertices])
def test_what_is_no_model_is_refused_by_name(other):
    for name, ask in {
        "a": lambda: engine.distance(other, HERE, B, THERE),
        "b": lambda: engine.within(A, HERE, other, THERE, 1.0),
        r"a\b": lambda: engine.distances(other, POSES, B, POSES),
        r"b\b": lambda: engine.signed_distance(A, HERE, other, THERE),
        r"b\b.*": lambda: engine.collide(A, HERE, other, THERE),
        "model": lambda: engine.closest_points(other, HERE, [[0.0, 0.0, 0.0]]),
        r"models\[1\]": lambda: engine.Assembly([A, other]),
        r"models\[0\]": lambda: Answers([other, A], ["a", "b"]),
    }.items():
        with pytest.raises(TypeError, match=rf"^{name}: expected a model .*TriangleMesh"):
            ask()


def test_a_schedule_takes_any_numbers_and_compiles_nothing():
    answers = Answers([A, B], ["a", "b"])
    answers.move(np.arange(2), POSES)
    rows = answers.add(PAIRS, np.zeros(1, bool))
    schedule = Schedule(answers, ASSEMBLY)
    schedule.begin(rows)

    def moment(index, truth, real, whole):
        answers.move(index([0, 1]), POSES)
        schedule.update(index(rows), truth([1, 1]), truth([0, 0]), whole(1))
        queries = schedule.queries(index(schedule.order()))
        schedule.search_together(queries, real(1), whole(1), lambda: real(2))
        found = [engine.distance(A, HERE, B, THERE).row for _ in queries.at]
        schedule.commit(queries, np.reshape(found, (-1, ANSWER)), real(2))
        answers.intervals(index(rows))
        balls = answers.centres.tolist(), [real(5), real(5)]
        BroadPhase().near(*balls, truth([1, 1]), index([0, 1]))
        return schedule.report(real(3))[1]

    assert moment(np.array, lambda x: np.array(x, bool), float, int) == 0
    before = forms()
    assert moment(list, list, int, np.int16) == 0
    assert moment(lambda x: np.array(x, np.uint8), tuple, np.float32, int) == 0
    assert forms() == before


def test_code_gets_arguments_of_the_types_it_is_compiled_for(monkeypatch):
    """The code is called directly, so numba does not compare the types."""
    called, code_of = [], setup.code_of

    def checked(entry):
        def call(*given):
            called.append(entry)
            for each, wanted in zip(given, setup.ARGUMENTS, strict=True):
                found = numba.typeof(each)
                if isinstance(wanted, numba.types.Array):
                    kept = found.dtype, found.ndim, found.layout
                    assert kept == (wanted.dtype, wanted.ndim, wanted.layout)
                else:
                    assert isinstance(found, type(wanted))
            return code_of(entry)(*given)

        return call

    monkeypatch.setattr(run, "code_of", checked)
    pair, here = engine.Pair(torus(8), torus(6)), np.eye(4)
    for there in (np.eye(4, dtype=np.float32), np.asfortranarray(here), here.tolist(), here):
        for order in ("depth_first", "priority", "breadth_first"):
            pair.distance(here, there, order=order, budget_s=1e-6)
        pair.distance(here, there, manifold=True)
        pair.within(here, there, 1)
        pair.collide(here, there, all_contacts=True)
        pair.signed_distance(here, there)
    pair.ideal(here, here)
    poses = np.broadcast_to(here, (3, 4, 4))
    engine.distances(pair.a, poses, pair.b, poses, signed=True)
    assert len(called) > 20
