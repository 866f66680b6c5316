"""A process announces once that it compiles, and never if the cache holds all its kernels."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

QUICK = "import numpy as np; from proximity_monitor import engine; "
# The kernel that compiles fastest.
POSE = "from proximity_monitor.engine.poses import check_pose; check_pose(np.eye(4)); "


def run(code, cache=None):
    """Run code in a process, check that it succeeds, and return its standard error."""
    environment = {**os.environ}
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.mark.long
def test_a_plain_script_is_told_once_on_a_new_machine(tmp_path):
    said = run(QUICK + POSE, tmp_path).splitlines()
    assert len(said) == 1
    assert "compiling proximity_monitor's kernels" in said[0]
    assert str(tmp_path) in said[0]


def test_whoever_sets_up_logging_has_it_there(tmp_path):
    code = "import logging; logging.basicConfig(format='%(levelname)s at %(name)s: %(message)s'); "
    said = run(code + QUICK + POSE, tmp_path)
    assert said.startswith("WARNING at proximity_monitor.engine: compiling")


@pytest.mark.long
def test_an_import_and_other_packages_kernels_say_nothing(tmp_path):
    other = "import numba; numba.njit(lambda x: x + 1)(1)"
    assert run(QUICK + other, tmp_path) == ""


def test_a_warm_cache_is_silent():
    code = QUICK + (
        "a = engine.TriangleMesh(np.eye(3), [[0, 1, 2]]); pose = np.eye(4); pose[0, 3] = 3.0; "
        "engine.distance(a, pose, a, np.eye(4)); engine.collide(a, pose, a, np.eye(4))"
    )
    exec(code, {})  # so that the cache is warm
    assert run(code) == ""
