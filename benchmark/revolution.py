"""Solids of revolution: fat arcs beside meshes, FCL and OCCT, on the same solids, on one thread.

    python benchmark/revolution.py [--quick] [--frames N] [--finest N] [--out DIR]

Writes a page, DIR/revolution.md, and its figures, DIR/images/revolution_*.png. With `--out docs`
it replaces those of the documentation.

The models are the five solids of the bundled scene `chess`, scaled to a largest coordinate of 1 m,
after Son, Yoon, Kim and Elber, "Efficient Minimum Distance Computation for Solids of Revolution",
2020. The page covers: all 15 pairs, at random poses and along a motion, at the precisions 1e-3,
1e-4 and 1e-5 m (their Figure 12); the size and the building of hierarchies (their Tables 1 and 2,
and Figure 9); a sixth solid that morphs through the five (their Figure 8), and all five deforming
at once; exact answers beside OCCT's, for the five solids and for two tori; and depths of overlap.

A mesh has enough triangles that no chord is farther from the solid than the precision. FCL and this
engine get the same mesh. If it would need more than --finest triangles, it is made coarser, and the
table says `fewer`. Times are processor time, microseconds, medians over all pairs. Ends with status
1 if two answers contradict each other.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import math
import sys
from functools import partial
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import occt
import peers
from numpy.typing import NDArray
from revolution_depth import FITTED, HEADINGS, depths, fits
from revolution_mesh import tessellated
from revolution_motion import deforming, morphing, motion
from revolution_page import table, write_page
from surface_scenes import at, torus, turned

from proximity_monitor import engine
from proximity_monitor.engine.kernels.revolution.build import build_arcs
from proximity_monitor.engine.kernels.revolution.reach import take_reaches

OUT = Path(__file__).resolve().parents[1] / "build" / "benchmark"
MODELS = Path(engine.__file__).parents[1] / "scene" / "bundled" / "chess" / "models"
NAMES = "pawn", "cup", "bottle", "table", "light_mill"
PRECISIONS = 1e-3, 1e-4, 1e-5
PAPER = {  # Tables 1 and 2: MB of PQP's hierarchy and of theirs; nodes of PQP's and fat biarcs
    "pawn": ((62, 0.081, "287K", 103), (550, 0.203, "2.5M", 211), (1437, 0.527, "26.5M", 479)),
    "cup": ((59, 0.096, "272K", 119), (657, 0.199, "3.0M", 199), (1294, 0.474, "25.9M", 399)),
    "bottle": ((66, 0.099, "308K", 123), (593, 0.191, "2.7M", 187), (2003, 0.506, "29.2M", 411)),
    "table": ((62, 0.079, "289K", 95), (674, 0.181, "3.1M", 179), (1395, 0.415, "26.3M", 335)),
    "light_mill": ((91, 0.187, "424K", 247), (982, 0.347, "4.5M", 375), (590, 0.776, "42.5M", 687)),
}
HERE = np.eye(4)
BESIDE_OCCT = ["queries", "fat arcs, us", "max", "OCCT", "ratio", "open", "OCCT wrong", "by"]


def solids() -> dict[str, engine.SolidOfRevolution]:
    """Return the five solids, each scaled to a largest coordinate of 1 m."""
    made = {}
    for name in NAMES:
        solid = engine.load(MODELS / f"{name}.json", unit=1.0)
        solid.deform(solid.control_points / np.abs(solid.control_points).max())
        made[name] = solid
    return made


def poses(count: int, seed: int) -> NDArray[np.float64]:
    """Return random poses (count, 4, 4), from near to a few sizes away."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        way = rng.normal(size=3)
        made.append(at(turned(rng), way / np.linalg.norm(way) * rng.uniform(0.8, 3.0)))
    return np.array(made)


def _time(ask: Any, arguments: Any) -> tuple[NDArray[np.float64], list[Any]]:
    times, answers = [], []
    for each in arguments:
        start = thread_time()
        answers.append(ask(each))
        times.append(1e6 * (thread_time() - start))
    return np.array(times), answers


def _in_batch(a: Any, b: Any, many: NDArray[np.float64], how: dict[str, float]) -> float:
    """Return the mean time (microseconds) of one call that asks about all poses of b."""
    here = np.tile(HERE, (len(many), 1, 1))
    best = math.inf
    for _ in range(3):
        start = thread_time()
        engine.distances(a, here, b, many, **how)
        best = min(best, thread_time() - start)
    return 1e6 * best / len(many)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    first, _, rest = __doc__.partition("\n")
    parser = argparse.ArgumentParser(
        description=first, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer poses and frames, only two precisions"
    )
    parser.add_argument(
        "--frames", type=int, default=50_000, help="frames of the motion (%(default)s)"
    )
    parser.add_argument(
        "--finest",
        type=int,
        default=1_000_000,
        help="maximum number of triangles of a mesh (%(default)s)",
    )
    parser.add_argument("--out", type=Path, default=OUT, help="output folder (%(default)s)")
    options = parser.parse_args(arguments)
    randoms, frames = (40, 300) if options.quick else (1000, options.frames)
    precisions = PRECISIONS[:2] if options.quick else PRECISIONS
    gc.disable()  # a collection over numba's objects takes as long as thousands of questions
    made = solids()
    sizes, built = _sizes(made, precisions, options.finest)
    distances, bars, in_distances = _distances(made, precisions, randoms, frames, options.finest)
    morphs, morphed = morphing(made, precisions, 20 if options.quick else 1000)
    deformed = deforming(made, 20 if options.quick else 200)
    exact, in_exact = _exact(made, 10 if options.quick else 60)
    tori, in_tori = _tori(10 if options.quick else 60)
    rough = {k: engine.TriangleMesh(*tessellated(v, 1e-3, 10**6)[:2]) for k, v in made.items()}
    deep, in_depths = depths(made, rough, 1e-3, 4 if options.quick else 20)
    fitted, in_fits = fits(4 if options.quick else 20)
    command = " ".join(["python benchmark/revolution.py", *(arguments or sys.argv[1:])])
    page = write_page(
        options.out, command, frames, (built, bars, morphed),
        {"sizes": sizes, "distances": distances, "morphing": morphs, "deforming": deformed,
         "exact": exact, "tori": tori, "depths": table(HEADINGS, [deep]),
         "fits": table(FITTED, fitted)},
    )  # fmt: skip
    print(page, end="")
    if contradictions := in_distances + in_exact + in_tori + in_depths + in_fits:
        print(f"{contradictions} ANSWERS CONTRADICT EACH OTHER", file=sys.stderr)
    return 1 if contradictions else 0


def _sizes(made: dict, precisions: tuple, finest: int) -> tuple[str, dict]:
    """Return the table of hierarchies, and their build times (milliseconds) by precision."""
    rows, built = [], {precision: [] for precision in precisions}
    for name, solid in made.items():
        hierarchy = solid._hierarchy
        for k, precision in enumerate(precisions):
            size = solid.profile.size
            best = math.inf
            for _ in range(20):
                start = thread_time()
                arcs = build_arcs(hierarchy.curves, size, precision)
                reaches = take_reaches(arcs, size)
                best = min(best, thread_time() - start)
            built[precision].append(1e3 * best)
            vertices, faces, reached = tessellated(solid, precision, finest)
            mesh = engine.TriangleMesh(vertices, faces, solid=False)
            own = arcs.nbytes + reaches.nbytes + hierarchy.curves.nbytes
            theirs = sum(each.nbytes for each in mesh._hierarchy.tree)
            fewer = "" if reached == precision else " (fewer)"
            pqp_size, paper_size, pqp_nodes, paper_nodes = PAPER[name][k]
            rows.append([
                name.replace("_", " "), f"{precision:g}", f"{pqp_size}", f"{paper_size}",
                f"{own / 1e6:.3f}", f"{theirs / 1e6:.1f}{fewer}",
                f"{theirs / own:,.0f}", pqp_nodes, str(paper_nodes), str(len(arcs)),
                f"{len(faces):,}", f"{1e3 * best:.3f}",
            ])  # fmt: skip
    return table(
        ["solid", "precision, m", "PQP, MB", "paper, MB", "fat arcs, MB", "our meshes, MB",
         "meshes / arcs", "PQP, nodes", "paper, fat biarcs", "fat arcs", "triangles", "build, ms"],
        rows,
    ), built  # fmt: skip


def _distances(
    made: dict, precisions: tuple, randoms: int, frames: int, finest: int
) -> tuple[str, dict, int]:
    """Return the table of times, the means of each pair's motion by precision, contradictions."""
    fcl = next((each for each in peers.installed() if each.name == "fcl"), None)
    pairs = list(itertools.combinations_with_replacement(made, 2))
    rows, bars, contradictions = [], {}, 0
    scattered, moving = poses(randoms, 1), motion(frames)
    for precision in precisions:
        meshes = {name: tessellated(solid, precision, finest) for name, solid in made.items()}
        ours = {
            name: engine.TriangleMesh(v, f, solid=False, deviation=reached)
            for name, (v, f, reached) in meshes.items()
        }
        built = {name: fcl.build((v, f)) for name, (v, f, _) in meshes.items()} if fcl else {}
        found: dict[str, list] = {key: [] for key in ("r", "m", "rm", "mm", "f", "fm", "alone")}
        batches: dict[str, list] = {key: [] for key in ("r", "m", "rm", "mm")}
        for i, (a, b) in enumerate(pairs):
            some = scattered[i::15] if len(scattered) > 600 else scattered[:: max(randoms // 20, 1)]
            part = moving[i * frames // 15 : (i + 1) * frames // 15]
            for key, models in (("r", made), ("m", ours)):
                kwargs = {"abs_err": precision} if key == "r" else {}
                for column, many in ((key, some), (key + "m", part)):
                    # Made before timing, as are the objects, requests and answers of FCL.
                    pair = engine.Pair(models[a], models[b], coherent=many is part)
                    pair.distance(HERE, HERE, budget_s=0.01)
                    times, answers = _time(partial(pair.distance, HERE, **kwargs), many)
                    found[column].append(times)
                    if many is some:
                        told = answers
                for each, many in ((key, scattered), (key + "m", part)):
                    batches[each].append(_in_batch(models[a], models[b], many, kwargs))
                if key == "r":
                    known = told
                    alone = partial(engine.distance, models[a], HERE, models[b], **kwargs)
                    found["alone"].append(_time(alone, some)[0])
                else:
                    for one, other in zip(known, told, strict=True):
                        contradictions += (
                            one.lower > other.upper + 1e-12 or other.lower > one.upper + 1e-12
                        )
            if fcl:
                for key, chosen in (("f", some), ("fm", part[:: max(len(part) // 20, 1)])):
                    here = np.tile(HERE, (len(chosen), 1, 1))
                    queries = fcl.queries(built[a], here, built[b], chosen)
                    found[key].append(_time(lambda ask: ask(), queries)[0])
        median = {k: np.median(np.concatenate(v)) if v else np.nan for k, v in found.items()}
        mean = {k: np.concatenate(v).mean() if v else np.nan for k, v in found.items()}
        bars[precision] = {
            key: [float(times.mean()) for times in found[key]] for key in ("rm", "mm", "fm")
        }
        fewer = "" if all(reached == precision for _, _, reached in meshes.values()) else " (fewer)"
        for what, key in (("random", ""), ("motion", "m")):
            r, m, f = "r" + key, "m" + key, "f" + key
            fast, slow = np.mean(batches[r]), np.mean(batches[m])
            rows.append([
                f"{precision:g}{fewer}", what, f"{median[r]:.1f}", f"{mean[r]:.1f}",
                f"{median['alone']:.1f}" if r == "r" else "",
                f"{median[m]:.1f}", f"{median[f]:.0f}", f"{median[m] / median[r]:.1f}",
                f"{median[f] / median[r]:.0f}", f"{mean[f] / mean[r]:.0f}",
                f"{fast:.1f}", f"{slow:.1f}", f"{slow / fast:.1f}",
            ])  # fmt: skip
    headings = [
        "precision, m", "poses", "fat arcs, us", "mean", "alone", "our meshes", "FCL",
        "meshes / arcs", "FCL / arcs", "means", "in batches: arcs", "meshes", "ratio",
    ]  # fmt: skip
    return table(headings, rows), bars, contradictions


def _exact(made: dict, count: int) -> tuple[str, int]:
    """Return the table of exact distances beside OCCT's at random poses, and contradictions."""
    if occt.version() is None:
        return "cadquery-ocp is not installed.\n", 0
    shapes = {name: occt.shape(solid) for name, solid in made.items()}
    names = list(made)
    placed = [(names[k % 5], names[(k // 5) % 5], p) for k, p in enumerate(poses(count, 2))]
    asked = [
        (partial(engine.distance, made[a], HERE, made[b], p), (shapes[a], shapes[b], p))
        for a, b, p in placed
    ]
    row, contradictions = _beside_occt(asked)
    return table(BESIDE_OCCT, [row]), contradictions


def _tori(count: int) -> tuple[str, int]:
    """Return the table of two equal tori, by what OCCT has for a torus, and contradictions."""
    if occt.version() is None:
        return "cadquery-ocp is not installed.\n", 0
    solid = engine.shapes.torus(1.0, 0.3)
    pair = engine.Pair(solid, solid, coherent=False)
    many = poses(count, 5)
    many[:, :3, 3] *= 1.2
    ways = {"Pair": partial(pair.distance, HERE)}
    ways["alone"] = partial(engine.distance, solid, HERE, solid)
    shapes = {
        "toroidal surface": occt.torus(1.0, 0.3),
        "one rational face": occt.shape(solid),
        "eight rational faces": occt.shape(torus()),
    }
    rows, contradictions = [], 0
    for (name, shape), (way, ask) in itertools.product(shapes.items(), ways.items()):
        row, more = _beside_occt([(partial(ask, pose), (shape, shape, pose)) for pose in many])
        rows.append([name, way, *row])
        contradictions += more
    return table(["OCCT's torus", "asked", *BESIDE_OCCT], rows), contradictions


def _beside_occt(asked: list[tuple[Any, tuple[Any, Any, Any]]]) -> tuple[list[str], int]:
    """Return the row of a table, and how many of OCCT's answers contradict ours.

    Args:
        asked: for each query a function that returns our answer; OCCT's two shapes, and the pose of
            the second.
    """
    asks, shapes = zip(*asked, strict=True)
    for ask in asks:
        ask()
    ours, answers = _time(lambda ask: ask(), asks)
    queries = [occt.query(a, occt.placed(b, pose)) for a, b, pose in shapes]
    theirs, values = _time(lambda ask: ask(), queries)
    errors, contradictions, open_ = [], 0, 0
    for answer, value in zip(answers, values, strict=True):
        errors.append(value - answer.upper)
        contradictions += not value >= answer.lower - 1e-6
        open_ += answer.upper - answer.lower > 1e-11
    row = [
        str(len(asked)), f"{np.median(ours):.1f}", f"{np.max(ours):.0f}",
        f"{np.median(theirs):.0f}", f"{np.median(theirs) / np.median(ours):.0f}", str(open_),
        str(sum(x > 1e-6 for x in errors)), f"{max(errors):.0e}",
    ]  # fmt: skip
    return row, contradictions


if __name__ == "__main__":
    sys.exit(main())
