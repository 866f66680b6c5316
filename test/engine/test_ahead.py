"""Kernels that worker processes compile: each once, in silence, for no longer than needed."""

from __future__ import annotations

import fcntl
import io
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from engine_surfaces import patch

from proximity_monitor import engine
from proximity_monitor.engine import ahead as foreseen
from proximity_monitor.engine.kernels.base import ahead, cache, claims
from proximity_monitor.engine.kernels.pairs import (
    mesh_mesh,
    revolution_revolution,
    surface_mesh,
    surface_surface,
)
from proximity_monitor.engine.kernels.pairs.parts import parts_of
from proximity_monitor.engine.kernels.revolution.closest import nearest_under
from proximity_monitor.engine.kernels.surface.cells import divide_cell
from proximity_monitor.engine.questions import setup

COMMON = [
    (divide_cell, (surface_surface.search, surface_mesh.search)),
    (nearest_under, (revolution_revolution.search, surface_mesh.search)),
]

SOON_S = 20.0
"""Seconds that are enough, on any machine, for work that takes a process a fraction of one."""

ASK = (
    "import numpy; from proximity_monitor.engine.poses import check_pose; "
    "check_pose(numpy.eye(4)); print('done', flush=True)"  # the kernel that compiles fastest
)
WORK = """
import sys
import numpy as np
from proximity_monitor.engine import ahead
from proximity_monitor.engine.kernels.base import cache, motion
ahead._IDLE_S = 0.5
ahead.FORESEEN = (({"one", "two"}, lambda: [ahead._like(motion.pose_deviation, np.eye(4))]),)
ahead.work(str(cache.CACHE_DIRECTORY))
"""
IN_TURN = """
import sys, time
from types import SimpleNamespace
from proximity_monitor.engine import ahead
from proximity_monitor.engine.kernels.base import cache
ahead._IDLE_S = 0.5
heard = []
listen = ahead.Queue.put
def put(names, name):
    listen(names, name)
    heard.append(name)
ahead.Queue.put = put
def kernel(name):
    def compiled(types):
        print(name, flush=True)
        while len(heard) < 2:
            time.sleep(0.01)
    wanting = SimpleNamespace(is_wanting=lambda *_: True)
    return SimpleNamespace(_cache=wanting, targetctx=None, compile=compiled), ()
ahead.FORESEEN = (
    ({"one", "two"}, lambda: [kernel("above")]),
    ({"one"}, lambda: [kernel("first"), kernel("second")]),
)
ahead.work(str(cache.CACHE_DIRECTORY))
"""
PARENT = """
import os, signal, sys
from pathlib import Path
from proximity_monitor.engine.kernels.base import ahead
ahead._processors = lambda: 2
ahead._RUN = "import sys, time; from proximity_monitor.engine import ahead; {}, {}; " \\
    "ahead.Thread(target=ahead._listen, args=(ahead.Queue(),)).start(); time.sleep(600)"
ahead.want("mesh")
ahead.begin(Path("/tmp/proximity_monitor/kernels"))
(helper,) = ahead._helpers
print(helper.pid, flush=True)
"""


def run(code, place, **options):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(place)}
    return subprocess.Popen(
        [sys.executable, "-c", code], env=environment, text=True, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options,
    )  # fmt: skip


def kept(place):
    return list(place.rglob("*.nbc"))


def wait_until(true):
    end = time.monotonic() + SOON_S
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Return a cache root that holds a kernel which a worker compiled ahead."""
    place = tmp_path_factory.mktemp("ahead")
    with run(WORK, place) as worker:
        for name in ("one", "two"):
            worker.stdin.write(f"{name}\n")
            worker.stdin.flush()
        assert worker.wait(10 * SOON_S) == 0, "it ends when there is nothing to do"
    return place


def test_what_is_only_half_wanted_is_not_compiled(tmp_path):
    with run(WORK, tmp_path) as worker:
        worker.stdin.write("one\n")
        worker.stdin.flush()
        assert worker.wait(SOON_S) == 0
    assert not kept(tmp_path)


def test_what_a_worker_keeps_is_taken_and_no_claim_is_left(warm):
    (file,) = kept(warm)
    others = {each.suffix for each in file.parent.iterdir() if each != file}
    assert others <= {".part"}  # bitcode of helpers, which nobody claims
    with run(ASK, warm) as asking:
        said = asking.communicate(timeout=SOON_S)
    assert said == ("done\n", "")


@pytest.mark.long
def test_who_needs_a_kernel_that_another_compiles_waits_for_it(warm, tmp_path):
    (file,) = kept(warm)
    there = tmp_path / file.relative_to(warm)
    there.parent.mkdir(parents=True)
    with open(str(there) + ".lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with run(ASK, tmp_path) as asking:
            with pytest.raises(subprocess.TimeoutExpired):
                asking.wait(3.0)
            there.write_bytes(file.read_bytes())
            lock.close()
            assert asking.communicate(timeout=SOON_S) == ("done\n", ""), "it compiled nothing"


def test_a_claim_of_a_process_that_failed_keeps_nobody_waiting(tmp_path):
    path = tmp_path / "kernel.nbc"
    code = (
        "import os; from pathlib import Path\n"
        "from proximity_monitor.engine.kernels.base import claims\n"
        f"assert not claims.claim(Path({str(path)!r})); print('mine', flush=True); input()"
    )
    with run(code, tmp_path) as other:
        assert other.stdout.readline() == "mine\n"
        assert claims.is_claimed(path)
        other.kill()
        other.wait()
    assert not claims.is_claimed(path)
    assert not claims.claim(path), "it is free at once"
    assert not claims.claim(path), "and one's own claim is no obstacle"
    claims.release(path)
    assert not list(tmp_path.glob("kernel*"))


def test_who_waited_in_vain_leaves_the_claim_to_its_owner(tmp_path, monkeypatch):
    monkeypatch.setattr(claims, "LONGEST_S", 0.05)
    path, lock = tmp_path / "kernel.nbc", tmp_path / "kernel.nbc.lock"
    with lock.open("w") as others:
        fcntl.flock(others, fcntl.LOCK_EX)
        assert claims.claim(path), "it waited"
        claims.release(path)
        assert lock.exists()
        assert claims.is_claimed(path)


def test_where_there_can_be_no_lock_everybody_compiles(tmp_path, monkeypatch):
    assert not claims.claim(tmp_path / "nowhere" / "kernel.nbc")
    monkeypatch.setattr(claims, "POSSIBLE", False)
    assert not claims.claim(tmp_path / "kernel.nbc")
    claims.release(tmp_path / "kernel.nbc")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("end", ["", "os.kill(os.getpid(), signal.SIGKILL)"])
def test_a_helper_ends_with_its_parent(end, tmp_path):
    with run(PARENT + end, tmp_path) as parent:
        helper = int(parent.stdout.readline())
        assert parent.wait(SOON_S) == (-9 if end else 0)
        assert parent.stderr.read() == ""
    wait_until(lambda: _is_gone(helper))


def _is_gone(number):
    try:
        with open(f"/proc/{number}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] == "Z"  # ended, but not yet reaped
    except FileNotFoundError:
        return True


class Started:
    """Stand-in for a process that runs nothing: it records its arguments and its input."""

    def __init__(self, arguments):
        self.arguments, self.stdin, self.ended = arguments, io.BytesIO(), None

    def poll(self):
        return self.ended

    def told(self):
        return self.stdin.getvalue().decode().split()


@pytest.fixture
def begun(monkeypatch):
    """Return the list of the processes that are started, all of them stand-ins."""
    started = []

    def start(arguments, **_):
        started.append(Started(arguments))
        return started[-1]

    monkeypatch.setattr(ahead, "_alone", False)
    monkeypatch.setattr(ahead, "_wanted", ["mesh"])
    monkeypatch.setattr(ahead, "_told", 0)
    monkeypatch.setattr(ahead, "_helpers", [])
    monkeypatch.setattr(ahead, "_processors", lambda: 2)
    monkeypatch.setattr(ahead.atexit, "register", lambda end: None)
    monkeypatch.setattr(ahead.subprocess, "Popen", start)
    return started


def test_two_processors_have_one_helper_which_hears_what_is_wanted(begun, tmp_path):
    ahead.begin(tmp_path / "a" / "b")
    assert [each.told() for each in begun] == [["mesh"]]
    ahead.want("surface")
    assert [each.told() for each in begun] == [["mesh"]], "all may be kept: nothing is started"
    ahead.begin(tmp_path / "a" / "b")
    ahead.want("mesh")
    ahead.begin(tmp_path / "a" / "b")
    assert [each.told() for each in begun] == [["mesh", "surface"]], "and no second one"


def test_a_surface_is_wanted_before_its_first_question(monkeypatch):
    monkeypatch.setattr(ahead, "_wanted", [])
    made = engine.ParametricSurface([patch(1)])
    assert ahead._wanted == ["surface"]
    assert made._made is None, "nothing is built yet"


def test_a_helper_that_has_ended_has_a_successor(begun, tmp_path):
    ahead.begin(tmp_path / "a" / "b")
    begun[0].ended = 0
    ahead.begin(tmp_path / "a" / "b")
    assert len(begun) == 1, "it did what was wanted"
    ahead.want("surface")
    ahead.begin(tmp_path / "a" / "b")
    assert [each.told() for each in begun] == [["mesh"], ["surface"]]


@pytest.mark.parametrize("processors, helpers", [(1, 0), (2, 2), (8, 3)])
def test_a_monitor_has_more_helpers(processors, helpers, begun, monkeypatch, tmp_path):
    monkeypatch.setattr(ahead, "_processors", lambda: processors)
    ahead.want(ahead.WATCHING)
    ahead.begin(tmp_path / "a" / "b")
    assert len(begun) == helpers


def test_who_wants_nothing_has_no_helper(begun, monkeypatch, tmp_path):
    monkeypatch.setattr(ahead, "_wanted", [])
    ahead.begin(tmp_path / "a" / "b")
    assert not begun


@pytest.mark.parametrize("where", ["frozen", "another program", "nowhere"])
def test_a_program_that_is_no_interpreter_is_not_started(where, begun, monkeypatch, tmp_path):
    if where == "frozen":
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    else:
        program = "/usr/bin/blender" if where == "another program" else None
        monkeypatch.setattr(sys, "executable", program)
    ahead.begin(tmp_path / "a" / "b")
    assert not begun


def test_a_process_that_cannot_be_started_is_no_error(begun, monkeypatch, tmp_path):
    def fails(*_, **__):
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(ahead.subprocess, "Popen", fails)
    ahead.begin(tmp_path / "a" / "b")
    assert ahead._helpers == []


@pytest.mark.parametrize("searches", [surface_surface, surface_mesh, revolution_revolution])
def test_what_is_compiled_ahead_is_what_a_search_needs(searches):
    asked = {cache.kernel_name(searches.search.py_func)}
    (kernels,) = [kernels for needs, kernels in foreseen.FORESEEN if needs == asked]
    *parts, search = kernels()
    assert parts == [(each.kernel, each.arguments) for each in parts_of(searches.search, False)]
    assert search == (searches.search, setup.ARGUMENTS)


@pytest.mark.parametrize("part, searches", COMMON)
def test_what_two_searches_need_is_compiled_before_it_is_known_which_is_asked(part, searches):
    rows = [list(kernels()) for _, kernels in foreseen.FORESEEN]
    (alone,) = [row for row in rows if [each for each, _ in row] == [part]]
    common = compiled(*alone[0])
    for search in searches:
        parts = [compiled(each.kernel, each.arguments) for each in parts_of(search, True)]
        assert any(common in needed(each) for each in parts), "it was compiled for other types"


def compiled(kernel, types):
    """Compile a kernel, and return its name in the cache."""
    kernel.compile(types)
    return kernel._cache._name(types, kernel.targetctx.codegen())


def test_a_question_says_which_search_it_waits_for(monkeypatch):
    monkeypatch.setattr(ahead, "_wanted", [])
    setup.code_of.cache_clear()
    setup.code_of(mesh_mesh.search)
    assert ahead._wanted == [], "no worker is started for a search without parts needed late"
    setup.code_of(surface_surface.search)
    assert ahead._wanted == ["pairs.surface_surface.search_surfaces"]


def test_what_is_compiled_ahead_is_what_making_a_solid_needs():
    kernels, *_ = [each for needs, each in foreseen.FORESEEN if needs == {"solid of revolution"}]
    made = engine.shapes.torus(2.0, 0.5)
    assert engine.distance(made, np.eye(4), made, np.eye(4)).lower == 0.0
    of_solids = list(kernels())
    assert len(of_solids) > 3
    for kernel, types in of_solids:
        assert types in kernel.overloads, "it was compiled for other types"


def test_what_is_wanted_meanwhile_goes_before_what_stands_below(tmp_path):
    """The worker hears the second name while it compiles the first of three kernels."""
    with run(IN_TURN, tmp_path) as worker:
        worker.stdin.write("one\n")
        worker.stdin.flush()
        assert worker.stdout.readline() == "first\n"
        worker.stdin.write("two\n")
        worker.stdin.flush()
        assert worker.stdout.readline() == "above\n"
        assert worker.stdout.readline() == "second\n"
        assert worker.wait(SOON_S) == 0


def needed(name):
    """Return the names of a cached kernel and of everything that it calls."""
    (path,) = [each / name for each in cache.DIRECTORIES if (each / name).exists()]
    with path.open("rb") as file:
        below, *_ = cache._read(file, name)
    return {name}.union(*(needed(each) for each, _ in below))


def test_a_worker_with_another_store_does_nothing(tmp_path):
    code = WORK.replace("str(cache.CACHE_DIRECTORY)", "'elsewhere'")
    with run(code, tmp_path) as worker:
        assert worker.wait(SOON_S) == 0
    assert not kept(tmp_path)
