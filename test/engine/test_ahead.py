"""Kernels that other processes compile: each once, in silence, and for no longer than needed."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import time

import pytest

from proximity_monitor.engine.kernels.base import ahead, claims

SOON_S = 20.0
"""Seconds within which a process does what takes it a part of one, on any machine."""

ASK = (
    "import numpy; from proximity_monitor.engine.poses import check_pose; "
    "check_pose(numpy.eye(4)); print('done', flush=True)"  # the kernel compiled fastest
)
WORK = """
import sys
import numpy as np
from proximity_monitor.engine import ahead
from proximity_monitor.engine.kernels.base import cache, motion
ahead.kernels = lambda watching: [(motion.pose_deviation, (np.eye(4),))]
ahead.work(str(cache.CACHE_DIRECTORY), False)
"""
PARENT = """
import os, signal, sys
from pathlib import Path
from proximity_monitor.engine.kernels.base import ahead
ahead._processors = lambda: 2
ahead._RUN = "import sys, time; from proximity_monitor.engine import ahead; {}, {}, {}; " \\
    "ahead.Thread(target=ahead._end_with_parent).start(); time.sleep(600)"
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
    """Where a process has kept a kernel that it compiled ahead."""
    place = tmp_path_factory.mktemp("ahead")
    with run(WORK, place) as worker:
        assert worker.wait(10 * SOON_S) == 0
    return place


def test_what_a_worker_keeps_is_taken_and_no_claim_is_left(warm):
    (file,) = kept(warm)
    assert sorted(file.parent.iterdir()) == [file]
    with run(ASK, warm) as asking:
        said = asking.communicate(timeout=SOON_S)
    assert said == ("done\n", "")


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
            return file.read().rpartition(")")[2].split()[0] == "Z"  # and nobody looks after it
    except FileNotFoundError:
        return True


@pytest.fixture
def begun(monkeypatch):
    """Processes that are started, as arguments."""
    started = []
    monkeypatch.setattr(ahead, "_begun", False)
    monkeypatch.setattr(ahead, "_helpers", [])
    monkeypatch.setattr(ahead, "_processors", lambda: 2)
    monkeypatch.setattr(ahead.atexit, "register", lambda end: None)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda *args, **_: started.append(args))
    return started


def test_one_processor_has_no_helper_two_have_one(begun, monkeypatch, tmp_path):
    ahead.begin(tmp_path / "a" / "b")
    assert len(begun) == 1
    ahead.begin(tmp_path / "a" / "b")
    assert len(begun) == 1, "and no second one"
    monkeypatch.setattr(ahead, "_begun", False)
    monkeypatch.setattr(ahead, "_processors", lambda: 1)
    ahead.begin(tmp_path / "a" / "b")
    assert len(begun) == 1


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


def test_a_worker_with_another_store_does_nothing(tmp_path):
    code = WORK.replace("str(cache.CACHE_DIRECTORY)", "'elsewhere'")
    with run(code, tmp_path) as worker:
        assert worker.wait(SOON_S) == 0
    assert not kept(tmp_path)
