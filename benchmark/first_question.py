"""The first question about each other pair of kinds, once questions about meshes are compiled.

    python benchmark/first_question.py

Each question has a process and an empty NUMBA_CACHE_DIR of its own. It compiles a question about
two meshes, waits until its worker processes have ended, makes two models and asks for their
distance: by `engine.distance` or an `Assembly`, which compile what they need; then once more by the
`Assembly` with a budget, when it compiles all that its later questions may need. Takes about a
minute and a half a pair. Nothing else should run meanwhile.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile

_PAIRS = (
    ("revolution", "revolution"), ("surface", "surface"), ("revolution", "surface"),
    ("surface", "mesh"), ("revolution", "mesh"),
)  # fmt: skip

_CHILD = """
import json, sys
from time import perf_counter
import numpy as np
from proximity_monitor import engine
from proximity_monitor.engine.kernels.base import ahead
from proximity_monitor.study.surfaces import wavy

def mesh():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    return engine.TriangleMesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))

def surface():
    return engine.ParametricSurface([wavy(1, 10)])

def revolution():
    return engine.shapes.cylinder(0.3, 1.0)

here, there = np.eye(4), np.eye(4)
there[0, 3] = 5.0
engine.distance(mesh(), here, mesh(), there)
for worker in ahead._helpers:
    worker.wait()
start = perf_counter()
a, b = (globals()[kind]() for kind in sys.argv[1:3])
made = perf_counter()
if sys.argv[3] == "Assembly":
    many, poses = engine.Assembly([a, b]), np.stack((here, there))
    many.distances(poses, [[0, 1]])
    asked = perf_counter()
    many.distances(poses, [[0, 1]], budget_s=1.0)
else:
    engine.distance(a, here, b, there)
    asked = perf_counter()
print(json.dumps([made - start, asked - made, perf_counter() - asked]))
"""


def _measure(*about: str) -> tuple[float, float, float]:
    """Return the seconds for making two models of these kinds, and for the questions."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
        ended = subprocess.run(
            [sys.executable, "-c", _CHILD, *about], env=environment, check=True, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
    return tuple(json.loads(ended.stdout))


def main() -> None:
    """Measure and print a table."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    print("| pair of kinds | models, s | distance, s | Assembly, s | with a budget, s |")
    print("|---|---|---|---|---|")
    for pair in _PAIRS:
        models, *times = (*_measure(*pair, "distance")[:2], *_measure(*pair, "Assembly")[1:])
        row = " | ".join(f"{each:.1f}" for each in (models, *times))
        print(f"| {' and '.join(pair)} | {row} |", flush=True)


if __name__ == "__main__":
    main()
