"""Figures 5 and 6 of the 1999 paper: spheres side by side, and one sphere inside another."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from matplotlib.figure import Figure

from proximity_monitor import engine

from ..scenes import SCENES, Track
from .certificate import check
from .paper import VOLUMES
from .part import Job, Part, Rows, only, values
from .style import figure, log_axis, looks, name_axes
from .timing import Asker, Query, blocks, summary, take_turns
from .words import folded, number, table


def _measure(job: Job, rel_err: float, full: int, quick: int) -> Rows:
    """Return one row for each kind of volume.

    Raises:
        BrokenCertificateError: two kinds of volume whose answers contradict each other.
    """
    (track,) = job.scene.tracks
    steps = len(track.poses_a)
    turns = blocks(steps, min(job.scene.block, 16), quick if job.quick else full)
    askers = {volume: _asker(job.models(volume=volume), track, rel_err) for volume in VOLUMES}
    found = take_turns(askers, turns, job.advance)
    rows = []
    for volume, timed in found.items():
        # All allow the same error, so two contradict each other if their intervals do not overlap.
        check(f"{job.name}, {volume}", timed, found["rss"])
        row = {"scene": job.name, "gap": float(job.name.partition("/")[2]), "volume": volume}
        rows.append(row | summary(timed))
    return rows


def _asker(models: dict[str, engine.TriangleMesh], track: Track, rel_err: float) -> Asker:
    pair = engine.Pair(models[track.a], models[track.b])

    def ask(steps: Sequence[int]) -> list[Query]:
        return [
            partial(pair.distance, track.poses_a[i], track.poses_b[i], rel_err=rel_err)
            for i in steps
        ]

    return ask


def _draw(rows: Rows, logarithmic: bool) -> Figure:
    fig = figure(2, 1, 9.0, 3.8)
    for axes, key, what in zip(
        fig.axes,
        ("mean_us", "bound_tests"),
        ("mean processor time [µs]", "bound tests a query"),
        strict=True,
    ):
        for volume, look in looks(values(rows, "volume")).items():
            mine = sorted(only(rows, volume=volume), key=lambda row: row["gap"])
            axes.plot([r["gap"] for r in mine], [r[key] for r in mine], label=volume, **look)
        log_axis(axes.yaxis)
        if logarithmic:
            log_axis(axes.xaxis)
        name_axes(axes, "", "gap between the surfaces [radii]", what)
    fig.axes[0].legend(fontsize=8)
    return fig


def _table(rows: Rows) -> str:
    volumes = values(rows, "volume")
    headings = ["gap", "queries", *(f"{volume}, µs" for volume in volumes)]
    headings += [f"{volume}, tests" for volume in volumes]
    lines = []
    for gap in sorted(values(rows, "gap")):
        mine = [only(rows, gap=gap, volume=volume)[0] for volume in volumes]
        line = [f"{gap:g}", f"{mine[0]['queries']}"]
        line += [number(row["mean_us"]) for row in mine]
        lines.append(line + [number(row["bound_tests"]) for row in mine])
    return folded("Mean times, and mean numbers of bound tests", table(headings, lines))


def _growth(rows: Rows, volume: str, key: str) -> float:
    """Return how many times as much the largest gap takes as the smallest."""
    mine = sorted(only(rows, volume=volume), key=lambda row: row["gap"])
    return float(mine[-1][key] / mine[0][key])


def _times_rss(rows: Rows, gap: float) -> str:
    base = only(rows, gap=gap, volume="rss")[0]["mean_us"]
    others = (("pss", "lss"), (only(rows, gap=gap, volume=v)[0] for v in ("pss", "lss")))
    return " and ".join(
        f"{number(row['mean_us'] / base, 2)} ({volume})"
        for volume, row in zip(*others, strict=True)
    )


def _tell_separated(rows: Rows) -> str:
    small, large = min(values(rows, "gap")), max(values(rows, "gap"))
    growth = ", ".join(
        f"{volume} {number(_growth(rows, volume, 'bound_tests'), 2)}"
        for volume in values(rows, "volume")
    )
    return (
        "Exact distance of two spheres of 40,000 triangles and 1 m radius at random orientations. "
        "This is the paper's own scene, as far as the paper describes it. It plots pss, lss and "
        "rss, and gives no numbers.\n\n{separated}\n\n"
        + _table(rows)
        + "\nIn the paper, rss is far faster than the others. With growing distance every kind "
        "takes more time, up to a limit, because the distance dilates the volumes, so that more of "
        f"them overlap (section 5.4). Here the looser kinds take {_times_rss(rows, small)} times "
        f"as long as rss at a gap of {small:g}, {_times_rss(rows, large)} times at {large:g}. "
        f"From the smallest to the largest gap the bound tests grow by these factors: {growth}.\n"
    )


def _tell_concentric(rows: Rows) -> str:
    gaps = sorted(values(rows, "gap"))
    small, large = gaps[0], gaps[-1]
    shrink = ", ".join(
        f"{volume} {number(1.0 / _growth(rows, volume, 'bound_tests'), 2)}"
        for volume in values(rows, "volume")
    )
    return (
        "Distance, with a relative error of 10 % allowed, between a sphere of 40,000 triangles and "
        "a concentric one of 1 m radius. The paper does not say which error it allowed, and gives "
        "no numbers beside its plot.\n\n{concentric}\n\n"
        + _table(rows)
        + "\nThe surfaces are about equally far apart everywhere, so the tolerance decides. "
        "Volumes that are thin compared with a tenth of the gap are pruned at once. If a level of "
        "the hierarchy just fails to be pruned, all of it is opened. In the paper, the work for "
        f"rss grows least as the gap closes. Here the looser kinds take {_times_rss(rows, small)} "
        f"times as long as rss at a gap of {small:g}, {_times_rss(rows, large)} times at "
        f"{large:g}. From the largest to the smallest gap the bound tests grow by these factors: "
        f"{shrink}.\n"
    )


def _named(family: str) -> tuple[str, ...]:
    return tuple(name for name in SCENES if name.startswith(f"{family}/"))


PARTS = (
    Part(
        "separated",
        "Spheres side by side (Figure 5 of the 1999 paper)",
        partial(_measure, rel_err=0.0, full=16, quick=1),
        _tell_separated,
        {"separated": partial(_draw, logarithmic=True)},
        _named("spheres"),
    ),
    Part(
        "concentric",
        "Concentric spheres (Figure 6 of the 1999 paper)",
        partial(_measure, rel_err=0.1, full=15, quick=1),
        _tell_concentric,
        {"concentric": partial(_draw, logarithmic=False)},
        _named("concentric"),
    ),
)
