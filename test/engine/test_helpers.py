"""Helpers that one process compiled are linked into the kernels of others."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import namedtuple

import numpy as np
import pytest
from numba import typeof, types

from proximity_monitor.engine.kernels.base import cache, jit
from proximity_monitor.engine.kernels.base.tables import TREES
from proximity_monitor.engine.kernels.base.trees import MeshTree

ASK = """
import numpy as np
from numba.core import event
from proximity_monitor.engine.kernels.base import ahead, cache, motion
ahead.not_here()
class Heard(event.Listener):
    names = []
    def on_start(self, start):
        self.names.append(start.data["dispatcher"].py_func.__name__)
    def on_end(self, end):
        pass
event.register("numba:compile", Heard())
pose = np.array([[0.0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 5], [0, 0, 0, 1]])
made = np.zeros((2, 12))
slack = motion.relative_motion_pair(pose, np.eye(4), 1.0, 2.0, made)
print(repr((made.tolist(), slack)), len(Heard.names), len(cache.refused))
"""


def ask(place):
    """Return a process's result, how many functions it compiled, and how many files it refused."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(place)}
    done = subprocess.run(
        [sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True
    )
    found, compiled, refused = done.stdout.strip().rsplit(" ", 2)
    return found, int(compiled), int(refused)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    place = tmp_path_factory.mktemp("helpers")
    return place, *ask(place)


def without(place, left, suffix):
    """Copy what is cached to `left`, except files of one kind; return `left`."""
    for file in place.rglob("*"):
        if file.is_file() and file.suffix != suffix:
            copy = left / file.relative_to(place)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
    return left


@pytest.mark.long
def test_a_kernel_is_linked_of_helpers_that_another_process_compiled(first, tmp_path):
    place, found, compiled, refused = first
    assert compiled > 3
    assert refused == 0
    left = without(place, tmp_path, ".nbc")
    assert ask(left) == (found, 1, 0), "the kernel alone was compiled"
    assert ask(left) == (found, 0, 0), "and kept"


def test_machine_code_that_is_kept_needs_no_helpers(first, tmp_path):
    place, found, *_ = first
    assert ask(without(place, tmp_path, ".part")) == (found, 0, 0)


@pytest.mark.long
def test_a_broken_helper_is_compiled_anew(first, tmp_path):
    place, found, _, _ = first
    left = without(place, tmp_path, ".nbc")
    parts = sorted(left.rglob("*.part"))
    broken = bytearray(parts[0].read_bytes())
    broken[len(broken) // 2] ^= 4
    parts[0].write_bytes(broken)
    answer, compiled, refused = ask(left)
    assert answer == found
    assert compiled >= 2
    assert refused >= 1
    parts[-1].unlink()  # a helper that another helper calls, or the kernel's own
    assert ask(without(left, tmp_path / "again", ".nbc"))[0] == found


def test_versions_of_one_function_are_kept_apart():
    """The same sum: in the written order, and in any order."""

    def total(values):
        found = 0.0
        for i in range(len(values)):
            found += values[i]
        return found

    kinds = (typeof(np.zeros(3)),)
    names, symbols = set(), set()
    for made in (jit.kernel(total), jit.loop16(total), jit.inlined(total)):
        made.compile(kinds)
        names.add(made._cache._name(kinds, made.targetctx.codegen()))
        symbols.add(made.overloads[kinds].fndesc.mangled_name)
    assert len(names) == len(symbols) == 3


@pytest.mark.long
def test_a_helper_s_code_has_one_name_in_all_processes():
    """Otherwise, two processes that compile at the same time cannot use each other's code."""
    script = """
from numba.core.compiler import Flags
from proximity_monitor.engine.kernels.base import jit
flags = Flags()
flags.fastmath = jit._FREE
print(flags.get_mangle_string())
"""
    names = {
        subprocess.run(
            [sys.executable, "-c", script], env={**os.environ, "PYTHONHASHSEED": str(seed)},
            capture_output=True, text=True, check=True,
        ).stdout
        for seed in range(3)
    }  # fmt: skip
    assert len(names) == 1


def test_what_is_compiled_for_types_of_others_is_not_kept():
    """Others may change what they implement for their types, and this cache would not know."""
    Own = namedtuple("Own", "values")
    own = typeof(Own(np.zeros(3)))
    ours = TREES[MeshTree]
    assert not cache._is_foreign((ours, types.int64, typeof((np.zeros(3), 1.0))))
    for foreign in (own, types.Tuple((types.int64, own))):
        assert cache._is_foreign((ours, foreign))

    @jit.kernel
    def length(one):
        return len(one.values)

    before = set(cache._present)
    length.compile((own,))
    assert set(cache._present) == before
