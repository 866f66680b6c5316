"""Check the answers about every pair of links of real robots against pinocchio and coal.

    python benchmark/robots.py [--robot NAME ...] [--configurations N] [--quick] [--out DIR]
                               [--before FILE]

Each robot of `example-robot-data` is loaded as a scene would be. The node's scheduler watches it at
random configurations within its joint limits. An answer is wrong if its bounds do not contain the
distance that coal finds (to ALLOWANCE). It is also wrong if it says that links are apart although
they touch or one is inside the other, or the other way round. Writes robots.csv and robots.md,
prints robots.md, and ends with status 1 if an answer is wrong.
"""

from __future__ import annotations

import argparse
import csv
import math
import re
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from robot_truth import Truth

from proximity_monitor.scene import Robot, Scene, SceneError, load_scene
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.paths import model_path
from proximity_monitor.scene.state import PoseSample

ALLOWANCE = 1e-6
"""Metres; the accuracy of coal's iterations for primitives."""
BUDGET_S = 3600.0
"""Long enough that no pair is left out for lack of time."""
OUT = Path(__file__).resolve().parents[1] / "build" / "benchmark"
QUICK = ("double_pendulum", "panda", "ur5_robot", "z1", "finger_edu")
COLUMNS = "robot", "links", "pairs", "triangles", "answers", "wrong", "missed", "widest", "s"

NOTES = """\
`answers` is the number of pairs of links times the number of configurations. `wrong` counts answers
whose bounds do not contain the distance that pinocchio and coal find, or that contradict them on
contact; `missed` counts those among them that say clear although there is contact. `widest` is the
greatest width (mm) of the bounds of a pair that is apart; it comes from the deviation of meshes
that represent cylinders. Joints are at random positions between their limits, or within half a turn
or a metre about 0 if they have none.
"""


class Row(NamedTuple):
    """The results of one robot."""

    robot: str
    links: int
    pairs: int
    triangles: int
    answers: int
    wrong: int
    missed: int
    widest: float
    """Millimetres; widest bounds of a pair that is apart."""
    s: float
    examples: tuple[str, ...]


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    options = _parser().parse_args(arguments)
    try:
        root = model_path("package://example-robot-data/package.xml", Path("/")).parent
    except SceneError as error:
        sys.exit(str(error))
    robots = descriptions(root)
    chosen = {
        name: path
        for name, path in robots.items()
        if (not options.robot or any(asked in name for asked in options.robot))
        and (not options.quick or name in QUICK)
    }
    if not chosen:
        sys.exit(f"--robot: no match; known are {', '.join(robots)}")
    configurations = options.configurations or (10 if options.quick else 100)
    rows, refused = [], {}
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=len(chosen) * configurations)
        for name, path in chosen.items():
            progress.update(task, description=name)
            try:
                row = _watch(
                    name, path, root.parent, configurations, lambda: progress.advance(task)
                )
            except (SceneError, ValueError, RuntimeError) as error:
                # The first of its problems, without the name of the temporary scene.
                refused[name] = re.sub(r"^\S*scene\.yaml:\d+: ", "", str(error).splitlines()[0])
                progress.advance(task, configurations)
                continue
            rows.append(row)
            told = [f"{row.wrong} of {row.answers} answers wrong, {row.s:.0f} s", *row.examples]
            for line in told:
                progress.console.print(f"{name}: {line}", soft_wrap=True)
    page = _page(rows, refused, _before(options.before))
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "robots.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(row[: len(COLUMNS)] for row in rows)
    (options.out / "robots.md").write_text(page)
    print(page, end="")
    return int(any(row.wrong for row in rows))


def descriptions(root: Path) -> dict[str, Path]:
    """Return all descriptions by file name, or by folder if two files have the same name."""
    found = sorted((root / "robots").rglob("*.urdf"))
    stems = [path.stem for path in found]
    return {path.stem if stems.count(path.stem) == 1 else path.parts[-3]: path for path in found}


def _watch(name: str, urdf: Path, packages: Path, configurations: int, advance) -> Row:
    began = perf_counter()
    scene = robot_alone(urdf)
    robot, names = scene.robots[0], _links(scene, urdf)
    truth = Truth(urdf, packages, [(names[p.a], names[p.b]) for p in scene.pairs])
    monitor = Monitor(scene, load_models(scene))
    random = np.random.default_rng(sum(name.encode()))
    wrong = missed = 0
    widest, worst = 0.0, {}
    for step in range(configurations):
        positions = configuration(robot, random)
        real = truth.at(positions)
        poses = robot.poses(positions)
        _check_poses(poses, truth.poses(), names)
        tick = monitor.tick({k: PoseSample(p) for k, p in poses.items()}, BUDGET_S)
        lower, upper = tick.pairs.lower, tick.pairs.upper
        off = _errors(real, lower, upper)
        bad = ~(off <= ALLOWANCE)  # also if an answer is NaN
        wrong += int(bad.sum())
        missed += int((bad & (real <= 0.0)).sum())
        widest = max(widest, float((upper - lower)[real > 0.0].max(initial=0.0)))
        for k in np.flatnonzero(bad).tolist():
            pair = scene.pairs[k]
            key = pair.a, pair.b
            if key not in worst or off[k] > worst[key][0]:
                worst[key] = float(off[k]), step, real[k], lower[k], upper[k]
        advance()
    examples = [
        f"{a} - {b}, configuration {step}: truth {1e3 * real:.6f} mm, answer"
        f" {1e3 * low:.6f} to {1e3 * high:.6f}"
        for (a, b), (_, step, real, low, high) in sorted(worst.items(), key=lambda e: -e[1][0])[:5]
    ]
    answers = configurations * len(scene.pairs)
    return Row(
        name, len(scene.bodies), len(scene.pairs), truth.triangles, answers, wrong, missed,
        1e3 * widest, perf_counter() - began, tuple(examples),
    )  # fmt: skip


def _errors(real: NDArray, lower: NDArray, upper: NDArray) -> NDArray:
    """Return by how much (m) each answer misses the truth; in contact any upper bound is right."""
    apart = real > 0.0
    below = np.where(apart, real - upper, -np.inf)
    return np.maximum(lower - np.maximum(real, 0.0), below)


def robot_alone(urdf: Path, *, neighbours: bool = True) -> Scene:
    """Return a scene of the robot alone: all pairs of links that joints move against each other.

    Args:
        urdf: the description.
        neighbours: also watch links that a joint connects, which overlap there.
    """
    apart = "false" if neighbours else "true"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.yaml"
        path.write_text(
            "version: 1\nunit: m\n"
            f"robots: [{{name: robot, urdf: '{urdf}', exclude_adjacent: {apart}}}]\n"
        )
        return load_scene(path)


def _links(scene: Scene, urdf: Path) -> dict[str, str]:
    """Return the name of each body's link, by the body's name."""
    links = re.findall(r"<link\s[^>]*?name\s*=\s*[\"']([^\"']+)[\"']", urdf.read_text())
    names = {f"robot_{re.sub('[^a-z0-9_]', '_', link.lower())}": link for link in links}
    names |= {name.removeprefix("robot_"): link for name, link in names.items()}
    return {body.name: names[body.name] for body in scene.bodies}


def configuration(robot: Robot, random: np.random.Generator) -> dict[str, float]:
    """Return random positions of all joints, mimic joints included."""
    positions = {}
    for joint in robot.kinematics.free:
        reach = 1.0 if joint.kind == "prismatic" else math.pi
        low = joint.lower if math.isfinite(joint.lower) else -reach
        high = joint.upper if math.isfinite(joint.upper) else reach
        positions[joint.name] = float(random.uniform(low, high))
    waiting = {joint.name: joint.mimic for joint in robot.kinematics.joints if joint.mimic}
    while waiting:
        for name, mimic in list(waiting.items()):
            if mimic.joint in positions:
                positions[name] = mimic.multiplier * positions[mimic.joint] + mimic.offset
                del waiting[name]
    return positions


def _check_poses(
    ours: Mapping[str, NDArray], theirs: Mapping[str, NDArray], names: Mapping[str, str]
) -> None:
    for body, pose in ours.items():
        error = float(np.abs(pose - theirs[names[body]]).max())
        if error > 1e-9:
            raise ValueError(f"{names[body]}: pinocchio's pose differs by {error:g}")


def _before(path: Path | None) -> dict[str, str]:
    """Return the share of wrong answers in an earlier run, by robot."""
    if path is None:
        return {}
    with path.open(newline="") as file:
        return {
            row["robot"]: f"{100 * int(row['wrong']) / int(row['answers']):.3g} %"
            for row in csv.DictReader(file)
        }


def _page(rows: Sequence[Row], refused: Mapping[str, str], before: Mapping[str, str]) -> str:
    heads = ["robot", "links", "pairs", "triangles", "answers", "wrong"]
    heads += [*(["before"] if before else []), "missed", "widest (mm)", "s"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in rows:
        was = [before.get(row.robot, "")] if before else []
        lines.append(
            f"| {row.robot} | {row.links} | {row.pairs} | {row.triangles} | {row.answers} |"
            f" {' | '.join([str(row.wrong), *was])} | {row.missed} | {row.widest:.3g} |"
            f" {row.s:.0f} |"
        )
    total = [sum(column) for column in zip(*(row[1:7] for row in rows), strict=True)]
    lines.append(f"\n{len(rows)} robots, {total[3]:,} answers, {total[4]:,} wrong." if rows else "")
    lines += [f"Not loaded: {name}: {reason}" for name, reason in refused.items()]
    return "\n".join(lines) + "\n\n" + NOTES


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--robot", action="append", default=[], metavar="NAME", help="part of a robot's name"
    )
    parser.add_argument(
        "--configurations", type=int, metavar="N", help="number per robot (default: 100)"
    )
    parser.add_argument(
        "--quick", action="store_true", help="only some small robots, 10 configurations each"
    )
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR")
    parser.add_argument(
        "--before", type=Path, metavar="FILE", help="robots.csv of an earlier run, to compare with"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
