"""Compilation while a monitor gets ready: every kernel is foreseen, and no tick compiles."""

import importlib
import os
import subprocess
import sys

import pytest

from proximity_monitor.engine import compiling

LOADED = """
import sys
from numba.core.caching import NullCache
from proximity_monitor.engine import ahead
from proximity_monitor.scene import load_scene
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.state import PoseSample
import numpy as np

def loaded():
    start = "proximity_monitor.engine.kernels."
    return {
        f"{name.removeprefix(start)}.{function.__name__}"
        for name, module in list(sys.modules.items()) if name.startswith(start)
        for function in vars(module).values()
        if hasattr(function, "py_func") and function.overloads and function.__module__ == name
        and not isinstance(function._cache, NullCache)
    }

scene = load_scene(sys.argv[1])
monitor = Monitor(scene, load_models(scene))
print(*sorted(loaded()))
inside = {"a": PoseSample(np.eye(4)), "b": PoseSample(np.eye(4))}
monitor.tick(inside, 1.0)
monitor.tick(inside, 1.0, distances=False)
print(*sorted(loaded()))
for wanted, kernels in ahead.FORESEEN:
    for kernel, types in kernels() if wanted <= {"mesh", "watching"} else ():
        print(kernel.py_func.__name__, types in kernel.overloads or [types, kernel.signatures])
"""
SCENE = """version: 1
unit: m
bodies:
  - {{name: a, primitive: {{box: {{size: [1, 1, 1]}}}}, moving: true{0}}}
  - {{name: b, primitive: {{box: {{size: [1, 1, 1]}}}}, moving: true{0}}}
pairs: all
"""
SHARED = {
    "search.descent.advance", "elements.primitives.measure_triangles", "tree.ranges.node_ranges",
    "inside.angles.surely_outside", "inside.ball._begin_bounding", "inside.ball._begin_cells",
    "inside.ball._bound_cell", "inside.ball._go_on", "inside.ball_caps._one_way",
    "inside.ball_kinds._plane_alike",
    "inside.ball_caps._by_volumes", "inside.ball_caps.plane", "inside.ball_frame.common_box",
    "inside.ball_point.continue_depth", "inside.ball_rows.bound_of", "inside.ball_tangents.tangent",
    "inside.contain.part_inside",
}  # fmt: skip
"""Kernels compiled into the code of others. They are loaded only if this process compiled them."""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Return a directory for kernels, at first empty."""
    return tmp_path_factory.mktemp("cache")


@pytest.mark.long
@pytest.mark.parametrize("body", ["", ", solid: false"])
def test_the_kernels_that_a_scene_needs_are_those_that_it_loads(body, cache, tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(SCENE.format(body))
    foreseen = compiling.WATCHING - SHARED
    for compiles in (True, False):  # the first process compiles what the second one loads
        run = subprocess.run(
            [sys.executable, "-c", LOADED, str(path)],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        )
        *lists, compiled = run.stdout.split("\n", 2)
        ready, ticked = (set(line.split()) - SHARED for line in lists)
        assert ticked == ready, "a tick that compiles comes half a minute late"
        if compiles and not body:
            assert ready > foreseen, "some would be compiled only when a tick needs them"
    assert ready < foreseen if body else ready == foreseen, "surfaces need less"
    if not body:
        for line in compiled.splitlines():
            assert line.endswith(" True"), "compiled ahead, but for other types than are needed"


def test_progress_counts_what_is_compiled(tmp_path):
    code = (
        "import numpy as np; from proximity_monitor.engine import compiling\n"
        "from proximity_monitor.engine.poses import check_pose\n"
        "said = []\n"
        "say = lambda progress: said.append(str(progress))\n"
        "with compiling.Progress({'base.motion.pose_deviation', 'x.y'}, say):\n"
        "    check_pose(np.eye(4))\n"
        "print(said)"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )
    assert run.stdout == "['compiling kernels: 0 of 2', 'compiling kernels: 1 of 2']\n"


def test_what_is_foreseen_exists():
    assert SHARED <= compiling.WATCHING
    for name in compiling.WATCHING:
        file, _, function = name.rpartition(".")
        module = importlib.import_module(f"proximity_monitor.engine.kernels.{file}")
        assert hasattr(getattr(module, function), "py_func")
