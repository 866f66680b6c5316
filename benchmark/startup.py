"""Start-up of the engine, each case in processes of its own, and what a call from Python costs.

    python benchmark/startup.py

Times begin when the interpreter is up. The cold start compiles into an empty NUMBA_CACHE_DIR, and
includes the processes that it starts to compile. Calls are timed in processor time: they are so
short that other programs would distort the clock's time.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

_REPEATS = 5

_CHILD = """
import json
from time import perf_counter, thread_time
start = perf_counter()
import proximity_monitor.engine as engine
imported = perf_counter()
import numpy as np
tetrahedron = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
a, b = engine.TriangleMesh(tetrahedron, faces), engine.TriangleMesh(tetrahedron, faces)
here, there = np.eye(4), np.eye(4)
there[0, 3] = 2.0
built = perf_counter()
pair = engine.Pair(a, b)
pair.distance(here, there)
asked = perf_counter()
engine.Assembly([a, b]).distances(np.stack((here, there)), [[0, 1]])
gathered = perf_counter()
singles = []
for _ in range(2000):
    began = thread_time()
    pair.distance(here, there)
    singles.append(thread_time() - began)
heres, theres = np.tile(here, (256, 1, 1)), np.tile(there, (256, 1, 1))
engine.distances(a, heres, b, theres)
batches = []
for _ in range(20):
    began = thread_time()
    engine.distances(a, heres, b, theres)
    batches.append((thread_time() - began) / 256)
print(json.dumps({
    "import": imported - start, "build": built - imported, "query": asked - built,
    "assembly": gathered - asked, "all": gathered - start,
    "single": sorted(singles)[1000], "batch": sorted(batches)[10],
}))
"""


def main() -> None:
    """Measure and print a table."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
        cold = _run(environment)
        runs = [_run(environment) for _ in range(_REPEATS)]
    warm = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
    print(f"| seconds | cold | warm, median of {_REPEATS} |\n| --- | --- | --- |")
    for what, key in (
        ("import proximity_monitor.engine", "import"),
        ("two models of four triangles", "build"),
        ("first query", "query"),
        ("first question to an assembly", "assembly"),
        ("all of these", "all"),
    ):
        print(f"| {what} | {cold[key]:.3f} | {warm[key]:.3f} |")
    single, batch = 1e6 * warm["single"], 1e6 * warm["batch"]
    print(
        f"\nA query of two tetrahedra takes {single:.2f} µs by `Pair.distance` and {batch:.2f} µs "
        f"in `distances`: a call costs {single - batch:.2f} µs more than its search."
    )


def _run(environment: dict[str, str]) -> dict[str, float]:
    """Run the measurement in a new process, and return the times that it prints."""
    command = [sys.executable, "-P", "-c", _CHILD]
    done = subprocess.run(command, env=environment, check=True, text=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout)


if __name__ == "__main__":
    main()
