"""What normal cones prune: spheres, with and without them, and separating directions.

Thomas, Turnbull, Ros and Cameron 2000, section 6: at the nearest points of two smooth surfaces the
normals are opposite, and lie along the line between the points. So a pair of cells is pruned if no
such points are possible within three cones: the normals of each cell, and all directions from one
cell to the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine

from .part import Job, Part, Row, Rows, only, values
from .words import folded, number, percent, table

METHODS = ("spheres", "spheres and cones", "directions", "directions and cones")
_LEVELS, _QUICK = 7, 3
_MOST = 400_000
"""Pairs of a level at most; a method that leaves more is not measured further."""

_SLACK_SHARE = 1e-3
"""A pair is kept unless its bound exceeds the distance by this share, as if the search knew an
upper bound that is 0.1 % too large."""

Reals = NDArray[np.float64]


class Cells:
    """The cells of a level: control points, enclosing spheres, normal cones.

    Args:
        nets: (k, 4, 4, 3) bicubic control nets.
    """

    def __init__(self, nets: Reals) -> None:
        self.points = nets.reshape(len(nets), -1, 3)
        self.centre = 0.5 * (self.points.min(axis=1) + self.points.max(axis=1))
        self.radius = _length(self.points - self.centre[:, None]).max(axis=1)
        along_u, wide_u = _cone(np.diff(nets, axis=1))
        along_v, wide_v = _cone(np.diff(nets, axis=2))
        normal = np.cross(along_u, along_v)
        sine, cosine = _length(normal), abs((along_u * along_v).sum(axis=-1))
        self.normal = normal / np.maximum(sine, 1e-300)[:, None]
        # The paper's formula. It holds for disjoint cones; the scanned paper has the condition
        # reversed.
        a, b = np.sin(wide_u), np.sin(wide_v)
        share = np.sqrt(a * a + 2.0 * a * b * cosine + b * b) / np.maximum(sine, 1e-300)
        holds = (np.arccos(np.clip(cosine, 0.0, 1.0)) > wide_u + wide_v) & (share < 1.0)
        self.wide = np.where(holds, np.arcsin(np.clip(share, 0.0, 1.0)), np.pi)


def _length(vectors: Reals) -> Reals:
    return np.linalg.norm(vectors, axis=-1)


def _cone(edges: Reals) -> tuple[Reals, Reals]:
    """Return axes (k, 3) and half angles (k,) of cones around the edges of control nets."""
    edges = edges.reshape(len(edges), -1, 3)
    edges = edges / np.maximum(_length(edges), 1e-300)[..., None]
    axis = edges.mean(axis=1)
    axis /= np.maximum(_length(axis), 1e-300)[:, None]
    return axis, np.arccos(np.clip((edges * axis[:, None]).sum(axis=-1).min(axis=1), -1.0, 1.0))


def _angle(a: Reals, b: Reals) -> Reals:
    """Return angles between lines, not vectors: neither side of a sheet counts as its outside."""
    return np.arccos(np.clip(abs((a * b).sum(axis=-1)), 0.0, 1.0))


def quarters(nets: Reals) -> Reals:
    """Halve each net along u and along v; return the quarters (4 k, ...), each net's together."""
    for axis in (1, 2):
        points, low, high = np.moveaxis(nets, axis, 1), [], []
        for _ in range(4):
            low.append(points[:, 0])
            high.insert(0, points[:, -1])
            points = 0.5 * (points[:, 1:] + points[:, :-1])
        halves = [np.moveaxis(np.stack(each, axis=1), 1, axis) for each in (low, high)]
        nets = np.stack(halves, axis=1).reshape(-1, *nets.shape[1:])
    return nets


def pruned(a: Cells, b: Cells, pairs: NDArray[np.int64], method: str, distance: float) -> NDArray:
    """Return which pairs (k, 2) of cells a method proves not to hold the nearest points."""
    i, j = pairs.T
    way = b.centre[j] - a.centre[i]
    apart, radii = _length(way), a.radius[i] + b.radius[j]
    line = way / np.maximum(apart, 1e-300)[:, None]
    bound = apart - radii
    if method.startswith("directions"):
        for n in (line, a.normal[i], b.normal[j]):
            n = n * np.where((n * way).sum(axis=-1) < 0.0, -1.0, 1.0)[:, None]
            for first in range(0, len(pairs), 50_000):
                some = slice(first, first + 50_000)
                low = (b.points[j[some]] @ n[some, :, None])[..., 0].min(axis=1)
                high = (a.points[i[some]] @ n[some, :, None])[..., 0].max(axis=1)
                bound[some] = np.maximum(bound[some], low - high)
    out = bound >= (1.0 + _SLACK_SHARE) * distance
    if method.endswith("cones"):
        wide = np.where(apart > radii, np.arcsin(np.minimum(radii / apart, 1.0)), np.pi)
        out |= _angle(a.normal[i], b.normal[j]) > a.wide[i] + b.wide[j]
        out |= _angle(a.normal[i], line) > a.wide[i] + wide
        out |= _angle(b.normal[j], line) > b.wide[j] + wide
    return out


def measure(job: Job) -> Rows:
    """Return one row for each method and level of division."""
    models = job.models()
    distance = engine.distance(models["a"], np.eye(4), models["b"], np.eye(4)).upper
    nets = [np.array([net.control for net in models[name].nets]) for name in ("a", "b")]
    whole = np.stack(np.indices([len(each) for each in nets]), axis=-1).reshape(-1, 2)
    left = dict.fromkeys(METHODS, whole)
    quarter = np.stack(np.indices((4, 4)), axis=-1).reshape(1, -1, 2)
    rows: Rows = []
    levels = _QUICK if job.quick else _LEVELS
    for level in range(levels):
        a, b = (Cells(each) for each in nets)
        for method, pairs in left.items():
            row: Row = {"scene": job.name, "level": level, "method": method, "pairs": 0}
            row["pruned"] = 0.0
            if 0 < len(pairs) <= _MOST:
                out = pruned(a, b, pairs, method, distance)
                row |= {"pairs": len(pairs), "pruned": float(out.mean())}
                left[method] = (4 * pairs[~out, None] + quarter).reshape(-1, 2)
            rows.append(row)
        nets = [quarters(each) for each in nets]
        job.advance(1.0 / levels)
    return rows


def _tell(rows: Rows) -> str:
    text = (
        "Two smooth sheets of 16 bicubic patches each, whose nearest points lie inside both. Both "
        "are divided into quarters, level by level. Their distance is known beforehand, so the "
        "order of the search does not matter: the pairs of cells that are left of a level are "
        "those that the method cannot prune. *Spheres* around the control points bound the "
        "distance from below. *Cones* prune pairs of cells without opposite normals along any line "
        "from cell to cell (the paper's signed cases 1 to 4). *Directions* are the engine's own "
        "bound: the gap between both sets of control points along the line of their centres, and "
        f"along the normal of either. A dash: more than {number(_MOST)} pairs.\n"
    )
    for scene in values(rows, "scene"):
        lines = []
        mine = only(rows, scene=scene)
        for level in values(mine, "level"):
            line = [str(level)]
            for method in METHODS:
                (row,) = only(mine, level=level, method=method)
                line += (
                    [number(row["pairs"]), percent(row["pruned"])] if row["pairs"] else 2 * ["-"]
                )
            lines.append(line)
        headings = ["level", *(word for m in METHODS for word in (f"{m}: pairs", "pruned"))]
        text += "\n" + folded(scene, table(headings, lines))
    ends = []
    for scene in values(rows, "scene"):
        mine = [only(rows, scene=scene, method=m) for m in METHODS]
        level = max(r["level"] for r in mine[3] if r["pairs"])
        with_, alone = (next(r["pairs"] for r in mine[k] if r["level"] == level) for k in (3, 2))
        ends.append(f"{scene} {number(with_ / alone, 2) if alone else '-'}")
    return text + (
        "\nThe paper gives no numbers. It says that cones speed up the convergence, most of all in "
        "degenerate cases. With spheres they do: where two domes face each other, cones leave only "
        "the few pairs about the nearest points, at every level. Where the sheets are nearly "
        "parallel, directions prune most pairs; spheres and cones together leave many times as "
        "many. Added to directions, cones prune little at first. At the last level they prune "
        "pairs that are farther than the nearest by less than a thousandth, and leave this share "
        f"of the pairs that directions leave: {'; '.join(ends)}. They do not apply to edges and "
        "creases. The engine's searches use directions. By second derivatives they also prove that "
        "the cells about a nearest point hold no nearer one, so the pairs that cones would prune "
        "need no further search.\n"
    )


PART = Part(
    "cones",
    "Spheres, normal cones and directions (section 6 of the 2000 paper)",
    measure,
    _tell,
    {},
    ("sheets/facing", "sheets/nested", "sheets/waves"),
)
