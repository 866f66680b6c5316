"""Time PQP, the program of the 1999 paper, beside this engine in one process, on one thread.

    python benchmark/pqp.py DIR [--scene NAME ...] [--quick] [--out DIR] [--data DIR]

DIR holds PQP's own sources (PQP.cpp and its headers, version 1.3). Users must fetch them: their
licence is for research and education, so no part of them is kept here. They are compiled with the
system's compiler ($CXX, or c++). Prints a table in Markdown; writes pqp.csv.
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import gc
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import thread_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from recorded import available

from proximity_monitor import engine
from proximity_monitor.engine.questions.result import Distances
from proximity_monitor.study.scenes import SCENES, StudyScene, Track
from proximity_monitor.study.shapes import Mesh

HERE = Path(__file__).resolve().parent
OUT = HERE.parent / "build" / "benchmark"

NOTES = """\
PQP / ours: how many times as long PQP takes as `engine.distances`, in blocks of successive poses
that both answer in turn; the best of ROUNDS turns of each block, then all blocks together. PQP
has its best of four settings: depth first or with a queue of 100, with or without its cached
triangles. `within` asks about half the median distance, and about all of it. An opening bounds
sixteen pairs of volumes; `/ ideal` is the number of openings divided by that of a search that is
given the distance, for the same error. Where models cross, that search opens nothing.
"""

SOURCES = ("PQP.cpp", "BV.cpp", "Build.cpp", "TriDist.cpp")
SETTINGS = tuple((queue, cached) for queue in (2, 100) for cached in (1, 0))
BATCH, FEW, SLOW_S = 256, 12, 0.001
"""Poses of a block: BATCH, or FEW if the scene's first query takes PQP SLOW_S seconds or more."""
ROUNDS, BLOCKS, QUICK = 5, 12, 3
"""How often a block is asked; blocks of a scene, and with --quick."""
HOPELESS, LONG_S = 1.25, 0.1
"""A setting that took HOPELESS times as long as the best one so far is given up. A block that
takes PQP more than LONG_S seconds is asked once."""
WIDTH = 16


class Question(NamedTuple):
    """One question to both engines: an error, or a clearance as a share of the median distance."""

    name: str
    rel_err: float = 0.0
    share: float | None = None


QUESTIONS = (
    Question("exact"),
    Question("10 %", 0.1),
    Question("100 %", 1.0),
    Question("within 1/2", share=0.5),
    Question("within 1", share=1.0),
)


class Pqp:
    """PQP, compiled from its sources.

    Raises:
        FileNotFoundError: the sources are not there.
        subprocess.CalledProcessError: the sources do not compile.
    """

    def __init__(self, folder: Path) -> None:
        if not (folder / SOURCES[0]).exists() and (folder / "src" / SOURCES[0]).exists():
            folder = folder / "src"
        sources = [folder / name for name in SOURCES]
        if missing := [str(path) for path in sources if not path.exists()]:
            raise FileNotFoundError(f"missing sources of PQP: {', '.join(missing)}")
        with TemporaryDirectory() as made:
            path = Path(made) / "libpqp.so"
            command = [os.environ.get("CXX", "c++"), "-O3", "-march=native", "-w", "-fPIC"]
            command += ["-shared", "-o", path, "-I", folder, HERE / "pqp.cpp", *sources]
            subprocess.run(command, check=True)
            self._library = ctypes.CDLL(str(path))
        real, address = ctypes.POINTER(ctypes.c_double), ctypes.c_void_p
        self._library.make_model.restype = address
        self._library.make_model.argtypes = [real, ctypes.c_long]
        self._library.free_model.argtypes = [address]
        self._library.ask.restype = ctypes.c_double
        self._library.ask.argtypes = [
            address, address, real, real, ctypes.c_long, ctypes.c_double, ctypes.c_double,
            ctypes.c_int, ctypes.c_int, real, ctypes.POINTER(ctypes.c_long),
        ]  # fmt: skip

    def model(self, mesh: Mesh) -> int:
        """Return the address of a model; it stays until the process ends."""
        vertices, faces = mesh
        corners = np.ascontiguousarray(vertices[faces].reshape(-1, 9), np.float64)
        return self._library.make_model(_reals(corners), len(corners))

    def ask(
        self, a: int, b: int, poses_a: NDArray, poses_b: NDArray, question: Question,
        clearance: float, setting: tuple[int, int],
    ) -> tuple[float, NDArray[np.float64], int]:  # fmt: skip
        """Return the seconds of a block, its answers, and how many bound tests it took."""
        answers, tests = np.empty(len(poses_a)), ctypes.c_long()
        seconds = self._library.ask(
            a, b, _reals(poses_a), _reals(poses_b), len(poses_a), question.rel_err,
            -1.0 if question.share is None else clearance, *setting, _reals(answers), tests,
        )  # fmt: skip
        return seconds, answers, tests.value


def _reals(array: NDArray[np.float64]) -> ctypes._Pointer:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class Block(NamedTuple):
    """Successive poses of one track."""

    track: Track
    poses_a: NDArray[np.float64]
    poses_b: NDArray[np.float64]


def blocks_of(scene: StudyScene, count: int, length: int) -> list[Block]:
    """Return about `count` blocks of `length` poses, spread evenly over the tracks and steps."""
    every = [
        Block(track, track.poses_a[k : k + length], track.poses_b[k : k + length])
        for k in range(0, len(scene.tracks[0].poses_a), length)
        for track in scene.tracks
    ]
    chosen = np.linspace(0, len(every) - 1, min(max(count, len(scene.tracks)), len(every)))
    return [every[i] for i in chosen.round().astype(int)]


def measure(scene: StudyScene, pqp: Pqp, quick: bool) -> list[dict[str, float]]:
    """Return a row for each question.

    Raises:
        AssertionError: the two engines contradict each other.
    """
    ours = {name: engine.TriangleMesh(*mesh) for name, mesh in scene.meshes.items()}
    theirs = {name: pqp.model(mesh) for name, mesh in scene.meshes.items()}
    rows = []
    median = 0.0
    for question in QUESTIONS:
        clearance = median * (question.share or 0.0)
        (first,) = blocks_of(scene, 1, 1)[:1]
        seconds = pqp.ask(
            theirs[first.track.a], theirs[first.track.b], first.poses_a, first.poses_b,
            question, clearance, SETTINGS[0],
        )[0]  # fmt: skip
        blocks = blocks_of(scene, QUICK if quick else BLOCKS, BATCH if seconds < SLOW_S else FEW)
        exact = [_ours(ours, block, QUESTIONS[0], 0.0)[1].upper for block in blocks]
        if question is QUESTIONS[0]:
            median = float(np.median(np.concatenate(exact)))
        our_s, their_s = np.zeros(len(blocks)), np.zeros((len(SETTINGS), len(blocks)))
        our_tests, their_tests = 0, np.zeros(len(SETTINGS))
        queries = sum(len(block.poses_a) for block in blocks)
        for i, block in enumerate(blocks):
            took, took_pqp = [], np.full((len(SETTINGS), ROUNDS), np.nan)
            known = their_s[:, :i].sum(axis=1)
            for turn in range(ROUNDS):
                seconds, found = _ours(ours, block, question, clearance)
                took.append(seconds)
                for k, setting in enumerate(SETTINGS):
                    if known[k] > HOPELESS * known.min() or took_pqp[k, 0] > LONG_S:
                        continue
                    took_pqp[k, turn], answers, tests = pqp.ask(
                        theirs[block.track.a], theirs[block.track.b],
                        block.poses_a, block.poses_b, question, clearance, setting,
                    )  # fmt: skip
                    if turn == 0:
                        their_tests[k] += tests
                        _compare(question, clearance, found, answers, exact[i])
            our_tests += int(found.bound_tests.sum())
            our_s[i] = min(took)
            their_s[:, i] = [np.nanmin(t) if t[0] >= 0.0 else np.inf for t in took_pqp]
        best = int(their_s.sum(axis=1).argmin())
        rows.append({
            "question": question.name,
            "queries": queries,
            "ours_us": 1e6 * our_s.sum() / queries,
            "pqp_us": 1e6 * their_s[best].sum() / queries,
            "ratio": their_s[best].sum() / our_s.sum(),
            "bound_tests": our_tests / queries,
            "pqp_bound_tests": their_tests[best] / queries,
            "to_ideal": _to_ideal(ours, blocks, question),
        })  # fmt: skip
    return rows


def _ours(
    models: dict[str, engine.TriangleMesh], block: Block, question: Question, clearance: float
) -> tuple[float, Distances]:
    a, b = models[block.track.a], models[block.track.b]
    asked = {"rel_err": question.rel_err} if question.share is None else {"clearance": clearance}
    gc.disable()
    begun = thread_time()
    found = engine.distances(a, block.poses_a, b, block.poses_b, **asked)
    seconds = thread_time() - begun
    gc.enable()
    return seconds, found


def _compare(
    question: Question, clearance: float, found: Distances, answers: NDArray, exact: NDArray
) -> None:
    """Check that the answers of both engines are right to a millionth.

    Raises:
        AssertionError: they are not.
    """
    near = 1e-6 * (1.0 + exact)
    if question.share is None:
        upper = (1.0 + question.rel_err) * exact + near
        assert np.all((found.lower <= exact + near) & (found.upper <= upper))
        assert np.all((exact - near <= answers) & (answers <= upper))
        return
    clear = np.abs(exact - clearance) > near
    assert np.all((found.within(clearance) == (exact < clearance))[clear])
    assert np.all(((answers > 0.0) == (exact < clearance))[clear])


def _to_ideal(
    models: dict[str, engine.TriangleMesh], blocks: list[Block], question: Question
) -> float:
    """Return our openings over those of the ideal search; NaN for a clearance."""
    if question.share is not None:
        return np.nan
    ours = ideal = 0
    for block in blocks:
        pair = engine.Pair(models[block.track.a], models[block.track.b], coherent=False)
        ours += _ours(models, block, question, 0.0)[1].bound_tests.sum()
        for poses in zip(block.poses_a, block.poses_b, strict=True):
            ideal += pair.ideal(*poses, rel_err=question.rel_err).bound_tests
    return ours / ideal if ideal > 0 else np.nan


def table(scenes: dict[str, StudyScene], pqp: Pqp, quick: bool, out: Path) -> str:
    """Measure scenes, write pqp.csv, and return a summary of it in Markdown."""
    rows = []
    for name, make in scenes.items():
        print(f"PQP beside ours: {name}", file=sys.stderr)
        rows += [{"scene": name, **row} for row in measure(make(), pqp, quick)]
    out.mkdir(parents=True, exist_ok=True)
    with (out / "pqp.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    lines = [NOTES.replace("ROUNDS", str(ROUNDS))]
    names = [question.name for question in QUESTIONS]
    heads = [head for name in names for head in (f"{name}, µs", "PQP / ours")]
    lines += [_row("scene", heads), _row("---", ["---:"] * len(heads))]
    of = {(row["scene"], row["question"]): row for row in rows}
    for scene in scenes:
        mine = [of[scene, name] for name in names]
        cells = [cell for r in mine for cell in (f"{r['ours_us']:.2f}", f"{r['ratio']:.2f}")]
        lines.append(_row(scene, cells))
    means = []
    for name in names:
        ratios = [of[scene, name]["ratio"] for scene in scenes]
        means += ["", f"**{np.exp(np.mean(np.log(ratios))):.2f}**, least {min(ratios):.2f}"]
    lines += [_row("geometric mean", means), ""]
    heads = [h for name in names for h in (f"{name}: openings", "/ ideal", "PQP's bound tests")]
    lines += [_row("scene", heads), _row("---", ["---:"] * len(heads))]
    for scene in scenes:
        cells = []
        for r in (of[scene, name] for name in names):
            cells += [f"{r['bound_tests'] / WIDTH:.1f}", f"{r['to_ideal']:.2f}"]
            cells += [f"{r['pqp_bound_tests']:.0f}"]
        lines.append(_row(scene, cells))
    return "\n".join(lines) + "\n"


def _row(first: str, cells: list[str]) -> str:
    return f"| {first} | {' | '.join(cells)} |"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder with PQP's sources")
    parser.add_argument("--scene", nargs="+", default=[], help="scenes or families; default: all")
    parser.add_argument("--quick", action="store_true", help="only a few blocks of each scene")
    parser.add_argument("--out", type=Path, default=OUT, help="output folder (%(default)s)")
    parser.add_argument("--data", type=Path, help="folder that contains falling_tori")
    options = parser.parse_args()
    scenes = {
        name: make
        for name, make in {**SCENES, **available(options.data)}.items()
        if not options.scene or {name, name.partition("/")[0]} & set(options.scene)
    }
    print(table(scenes, Pqp(options.folder), options.quick, options.out), end="")


if __name__ == "__main__":
    main()
