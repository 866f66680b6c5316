"""What a tolerance saves in `closest_points` for many points at once.

    python benchmark/tolerances.py [--points N]

The points are at random in a cube around each model, or on the axis of a torus, from which whole
circles of the torus are about equally near. `µs` is processor time a point. `gap` is the largest
difference between upper and lower bound. `parameters` is how far u or v of the point found is from
the exact answer: median and 99th percentile. It is given for a single patch, and leaves out exact
answers near the patch's edges.
"""

from __future__ import annotations

import argparse
from time import thread_time

import numpy as np
from numpy.typing import NDArray
from surface_scenes import teapot, torus

from proximity_monitor import engine
from proximity_monitor.engine.questions.result import ClosestPoints
from proximity_monitor.study import shapes
from proximity_monitor.study.surfaces import wavy

ERRORS = [{}, {"abs_err": 1e-6}, {"rel_err": 1e-3}, {"rel_err": 0.05}]
_ROUNDS = 3
_OFF_EDGES = 1e-2


def main(arguments: list[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n")[0], epilog=__doc__.partition("\n")[2],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--points", type=int, default=5000, help="number of points (%(default)s)")
    count, rng = parser.parse_args(arguments).points, np.random.default_rng(1)
    wall = engine.Curve([[0.0, 0.0], [1.4, 0.6], [0.3, 1.2], [0.0, 2.0]])
    asked = {
        name: (model, model.centre + model.radius * rng.uniform(-1.5, 1.5, (count, 3)))
        for name, model in {
            "wavy net": wavy(1, 10),
            "teapot, 32 patches": teapot(),
            "solid of revolution": engine.SolidOfRevolution([wall]),
            "mesh, 40,000 triangles": engine.TriangleMesh(*shapes.sphere(1.0)),
        }.items()
    }
    axis = np.zeros((count // 50, 3))
    axis[:, 2] = np.linspace(-0.5, 0.5, len(axis))
    asked["torus, from its axis"] = torus(), axis
    names = [" ".join(f"{key}={value:g}" for key, value in each.items()) for each in ERRORS]
    print("| model |" + "".join(f" {name or 'exact'}: µs | gap | parameters |" for name in names))
    print("| --- |" + " --- |" * (3 * len(names)))
    for name, (model, points) in asked.items():
        exact = engine.closest_points(model, np.eye(4), points)
        cells = [_cells(model, points, errors, exact) for errors in ERRORS]
        print(f"| {name} |" + "".join(cells), flush=True)


def _cells(
    model: engine.Model, points: NDArray[np.float64], errors: dict[str, float],
    exact: ClosestPoints,
) -> str:  # fmt: skip
    """Return the three columns of a tolerance: time, gap, error of the parameters."""
    best = np.inf
    for _ in range(_ROUNDS):
        start = thread_time()
        found = engine.closest_points(model, np.eye(4), points, **errors)
        best = min(best, thread_time() - start)
    off = "-"
    if errors and isinstance(model, engine.Patch):
        inner = (np.abs(exact.parameters - 0.5) < 0.5 - _OFF_EDGES).all(axis=1)
        apart = np.abs(found.parameters - exact.parameters)[inner].max(axis=1)
        off = f"{np.median(apart):.0e}, 99 %: {np.percentile(apart, 99):.0e}"
    gap = (found.upper - found.lower).max()
    return f" {1e6 * best / len(points):.2f} | {gap:.0e} | {off} |"


if __name__ == "__main__":
    main()
