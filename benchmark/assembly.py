"""Time the scheduler: an assembly of many moving bodies, and one hard pair, under a budget.

    python benchmark/assembly.py [--quick] [--bodies N ...] [--threads N] [--out DIR]

`crowd` rows: bodies of 1,000 triangles, everything against everything, at 30 Hz with 20 ms a tick.
`pair` rows: two surfaces of 40,000 triangles at 1 kHz with 0.5 ms a tick. `close` is two spheres
side by side, whose exact distance fits into the budget; `nested` is one sphere inside the other,
whose exact distance takes fifty times the budget. Searches run on one thread unless --threads says
otherwise. Writes assembly.csv and assembly.md and prints assembly.md. Ends with status 1 if an
exact distance lies outside of its certified bounds.
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path
from time import thread_time

import numpy as np
from crowd import Crowd, Poses, close_pair, nested_pair
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.scene import Scene
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.state import PoseSample, Tick

OUT = Path(__file__).resolve().parents[1] / "build" / "benchmark"
SIZES = (10, 30, 100, 300, 1000, 3000, 10000)
CHECKED = 20
"""Each tick compares this many listed pairs, and as many of all pairs, with exact distances."""

NOTES = """\
Times are wall-clock milliseconds of a whole tick, from poses to bounds; `cpu` is the processor time
of the calling thread. `near` pairs are, or may be, within their range of 30 mm; the others are
certainly farther. `searched` pairs were not answered by their carried bounds; `left` pairs were not
reached or finished within the budget. `gap` is upper - lower of near pairs, in mm. `first` is the
first tick, at which no pair is known yet. `wrong` counts bounds that do not contain the exact
distance, in a sample of near and far pairs at every tick of a crowd, and at every hundredth tick of
a pair.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer ticks, at most 1,000 bodies")
    parser.add_argument(
        "--bodies", type=int, nargs="+", help="sizes of the crowds (default: 10 to 10,000)"
    )
    parser.add_argument("--threads", type=int, default=1, help="threads for searches (%(default)s)")
    parser.add_argument("--out", type=Path, default=OUT, help="output folder (%(default)s)")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for size in options.bodies or [n for n in SIZES if n <= 1000 or not options.quick]:
        ticks = 60 if options.quick or size > 1000 else 300
        rows.append(_crowd(size, ticks, options.threads))
        print(f"{rows[-1]['scene']}: done", file=sys.stderr)
    for name, pair in (("close", close_pair), ("nested", nested_pair)):
        rows.append(_pair(name, *pair(), 500 if options.quick else 5000, options.threads))
        print(f"{rows[-1]['scene']}: done", file=sys.stderr)
    with (options.out / "assembly.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})
    page = NOTES + "\n" + _table(rows)
    (options.out / "assembly.md").write_text(page)
    print(page, end="")
    return 1 if any(row["wrong"] for row in rows) else 0


def _crowd(size: int, ticks: int, threads: int) -> dict[str, float | str]:
    """Run a crowd of drifting, turning bodies at 30 Hz with 20 ms a tick; return its table row."""
    crowd = Crowd(size)
    names = [body.name for body in crowd.scene.bodies]
    random = np.random.default_rng(1)
    monitor = Monitor(crowd.scene, crowd.models, threads=threads)
    log = Log(f"crowd/{size}", len(crowd.scene.pairs), 0.020)
    for k in range(ticks):
        poses = crowd.poses(k / 30.0)
        samples = dict(zip(names, map(PoseSample, poses), strict=True))
        log.add(monitor, samples)
        tick = log.last
        listed = {state.index: (state.lower, state.upper) for state in _some(tick, random)}
        others = random.integers(0, len(crowd.scene.pairs), CHECKED)
        every = {p: i for i, p in enumerate(tick.pairs.positions.tolist())}
        for index in others.tolist():
            if index in every:
                state = tick.pairs[every[index]]
                listed[index] = state.lower, state.upper
            else:
                listed[index] = tick.beyond, np.inf
        for index, (lower, upper) in listed.items():
            a, b = (int(each[0]) for each in crowd.scene.pairs.bodies(np.array([index])))
            log.check(crowd.mesh, poses[a], crowd.mesh, poses[b], lower, upper)
    return log.row()


def _pair(
    name: str,
    scene: Scene,
    models: dict[str, engine.TriangleMesh],
    poses: Poses,
    ticks: int,
    threads: int,
) -> dict[str, float | str]:
    """Run two surfaces, one of them moving, at 1 kHz with 0.5 ms a tick; return the table row."""
    monitor = Monitor(scene, models, threads=threads)
    log = Log(f"pair/{name}", 1, 0.0005)
    fixed, moving = models.values()
    for k in range(ticks):
        pose = poses(k / 1000.0)
        log.add(monitor, {"moving": PoseSample(pose)})
        if k % 100 == 0:
            (state,) = log.last.pairs
            log.check(fixed, np.eye(4), moving, pose, state.lower, state.upper)
    return log.row()


def _some(tick: Tick, random: np.random.Generator) -> list:
    count = min(CHECKED, len(tick.pairs))
    return [tick.pairs[i] for i in random.choice(len(tick.pairs), count, replace=False).tolist()]


class Log:
    """Times and results of the ticks of one scene."""

    def __init__(self, scene: str, pairs: int, budget_s: float) -> None:
        self._scene, self._pairs, self._budget_s = scene, pairs, budget_s
        self._rows: list[tuple[float, ...]] = []
        self._gaps: list[NDArray[np.float64]] = []
        self._wrong = 0
        self.last: Tick

    def add(self, monitor: Monitor, samples: dict[str, PoseSample]) -> None:
        """Run one tick."""
        start = thread_time()
        tick = self.last = monitor.tick(samples, self._budget_s)
        cpu = thread_time() - start
        gaps = tick.pairs.upper - tick.pairs.lower
        searched = len(tick.searched)
        self._rows.append((tick.elapsed_s, cpu, len(tick.pairs), searched, tick.left))
        self._gaps.append(gaps)

    def check(
        self,
        a: engine.TriangleMesh,
        pose_a: NDArray[np.float64],
        b: engine.TriangleMesh,
        pose_b: NDArray[np.float64],
        lower: float,
        upper: float,
    ) -> None:
        """Compare bounds with the exact distance of two posed meshes; count contradictions."""
        exact = engine.signed_distance(a, pose_a, b, pose_b)
        self._wrong += not (lower <= exact.upper and exact.lower <= upper)

    def row(self) -> dict[str, float | str]:
        """Return the scene's table row, by column name; the first tick is reported separately."""
        elapsed, cpu, near, searched, left = np.array(self._rows[1:]).T
        gaps = np.concatenate(self._gaps[1:])
        over = elapsed - self._budget_s
        return {
            "scene": self._scene,
            "pairs": self._pairs,
            "budget_ms": 1e3 * self._budget_s,
            "ticks": len(elapsed),
            "median_ms": 1e3 * float(np.median(elapsed)),
            "p99_ms": 1e3 * float(np.percentile(elapsed, 99)),
            "max_ms": 1e3 * float(elapsed.max()),
            "first_ms": 1e3 * self._rows[0][0],
            "cpu_median_ms": 1e3 * float(np.median(cpu)),
            "cpu_p99_ms": 1e3 * float(np.percentile(cpu, 99)),
            "in_time": float(np.mean(over <= 1e-4)),
            "near": float(near.mean()),
            "searched": float(searched.mean()),
            "left": float(left.mean()),
            "gap_median_mm": 1e3 * float(np.median(gaps)) if len(gaps) else 0.0,
            "gap_max_mm": 1e3 * float(gaps.max(initial=0.0)),
            "wrong": self._wrong,
        }


def _table(rows: list[dict]) -> str:
    """Return the rows as a Markdown table."""
    columns = [
        ("scene", "scene", ""), ("pairs", "pairs", ","), ("budget, ms", "budget_ms", "g"),
        ("tick median", "median_ms", ".2f"), ("p99", "p99_ms", ".2f"), ("max", "max_ms", ".2f"),
        ("first", "first_ms", ".2f"), ("cpu median", "cpu_median_ms", ".2f"),
        ("cpu p99", "cpu_p99_ms", ".2f"), ("within budget + 0.1 ms", "in_time", ".2%"),
        ("near", "near", ".0f"), ("searched", "searched", ".0f"), ("left", "left", ".1f"),
        ("gap median", "gap_median_mm", ".2g"), ("gap max", "gap_max_mm", ".2g"),
        ("wrong", "wrong", "d"),
    ]  # fmt: skip
    lines = [[heading for heading, _, _ in columns], ["---"] * len(columns)]
    lines += [[format(row[key], spec) for _, key, spec in columns] for row in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    sys.exit(main())
