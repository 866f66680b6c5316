r"""Draw a scene at one time of its motion, with the smallest distances of some of its pairs.

    python -m pip install matplotlib
    python tools/render_scene.py --time 2.45 --out docs/images/engine_scene.png \
        --pair piston_1 crankshaft --pair piston_4 block --pair crankshaft block \
        --pair piston_1 piston_2 --pair piston_2 piston_3

Bodies that the scene colours translucent are cut open through their origin, on the side of the
eye. Each distance is the engine's own answer for the drawn poses, coloured by its thresholds; a
hollow point lies behind something.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from raster import Camera, Picture

from proximity_monitor import engine, motion, scene
from proximity_monitor.engine.models.model import DisplayMesh

matplotlib.use("Agg")
import matplotlib.patheffects
import matplotlib.pyplot as plt

FINER = 2  # pixels are averaged over this many in each direction
MARGINS = (30, 30, 96, 84)  # left, right, top, bottom, in pixels: room for the labels
SECTION = np.array([0.36, 0.55, 0.74])
COLOURS = {"clear": "#17734a", "warn": "#b86200", "stop": "#b3202c"}


@dataclass(frozen=True)
class Measured:
    """One smallest distance: its label, its state, its two points (2, 2) in pixels."""

    label: str
    value: str
    state: str
    points: np.ndarray
    hidden: np.ndarray  # (2,) whether something is in front of the point


def main() -> None:
    """Draw what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="engine", help="a bundled scene's name, or a file")
    parser.add_argument("--time", type=float, default=0.0, help="seconds into the motion")
    parser.add_argument("--out", type=Path, required=True, help="the picture to write (.png)")
    parser.add_argument("--pair", nargs=2, action="append", default=[], metavar=("A", "B"))
    parser.add_argument("--azimuth", type=float, default=-74.0, help="of the viewpoint, degrees")
    parser.add_argument("--elevation", type=float, default=21.0, help="of the viewpoint, degrees")
    parser.add_argument("--size", type=int, nargs=2, default=(1200, 800), metavar=("W", "H"))
    args = parser.parse_args()

    path = Path(args.scene)
    sc = scene.load_scene(path if path.suffix else scene.bundled(args.scene))
    poses = {body.name: body.pose for body in sc.bodies if not body.moving}
    models = {body.name: scene.load_model(body, sc.unit) for body in sc.bodies}
    if sc.motion is not None:
        moves = motion.from_scene(sc, models)
        poses |= moves.poses(args.time)
        for robot in sc.robots:
            poses |= robot.poses(moves.joints(args.time))
        for name, points in moves.control_points(args.time).items():
            models[name].deform(points)
    shown = {name: model.display_mesh(0.002 * model.radius) for name, model in models.items()}
    frame = tuple(FINER * v for v in (*args.size, *MARGINS))
    camera = Camera.fit(_kept(sc, shown, poses, args.azimuth), args.azimuth, args.elevation, frame)
    picture = _draw(sc, shown, poses, camera, args.azimuth)
    chosen = [
        _measure(sc, pair, models, poses, picture)
        for pair in sc.pairs
        if any({pair.a, pair.b} == set(asked) for asked in args.pair)
    ]
    _write(args.out, _finish(picture), chosen)


def _placed(shown: DisplayMesh, pose: np.ndarray) -> np.ndarray:
    return shown.vertices @ pose[:3, :3].T + pose[:3, 3]


def _cut(body, pose: np.ndarray, azimuth: float) -> tuple[float, ...] | None:
    """Return the plane that opens a translucent body, upright and across the world's x or y."""
    if body.colour[3] >= 1.0:
        return None
    eye = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])
    facing = np.where(np.abs(eye) == np.abs(eye).max(), np.sign(eye), 0.0)
    return (*facing, facing @ pose[:3, 3])


def _kept(sc, shown, poses, azimuth: float) -> np.ndarray:
    """Return all vertices that are not cut away, in the world."""
    kept = []
    for body in (body for body in sc.bodies if body.name in poses):
        vertices = _placed(shown[body.name], poses[body.name])
        cut = _cut(body, poses[body.name], azimuth)
        kept.append(vertices if cut is None else vertices[vertices @ cut[:3] <= cut[3]])
    return np.vstack(kept)


def _draw(sc, shown, poses, camera: Camera, azimuth: float) -> Picture:
    picture = Picture(camera)
    for body in (body for body in sc.bodies if body.name in poses):
        vertices = _placed(shown[body.name], poses[body.name])
        colour = np.asarray(body.colour[:3])
        cut = _cut(body, poses[body.name], azimuth)
        section = 0.4 * colour + 0.6 * SECTION
        picture.add(vertices, shown[body.name].faces, colour**0.6, cut, section)
    return picture


def _finish(picture: Picture) -> np.ndarray:
    drawn = picture.shaded((1.0, 1.0, 1.0))
    height, width = drawn.shape[0] // FINER, drawn.shape[1] // FINER
    return drawn.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))


def _measure(sc, pair, models, poses, picture: Picture) -> Measured:
    found = engine.distance(models[pair.a], poses[pair.a], models[pair.b], poses[pair.b])
    limits = pair.thresholds
    state = "stop" if found.upper <= limits.stop else "warn" if found.upper <= limits.warn else ""
    value = found.upper / sc.unit.to_metre
    column, row, height = picture.camera.project(np.vstack((found.point_a, found.point_b))).T
    at = (
        np.clip(row.astype(int), 0, picture.camera.height - 1),
        np.clip(column.astype(int), 0, picture.camera.width - 1),
    )
    # Two pixels of slack: the point itself lies on a drawn surface.
    in_front = picture.near[at] - 2.0 * picture.camera.pixel
    return Measured(
        f"{pair.a} to {pair.b}".replace("_", " "),
        f"{value:.3f} {sc.unit.symbol}" if value < 1.0 else f"{value:.2f} {sc.unit.symbol}",
        state or "clear",
        np.column_stack((column, row)) / FINER,
        in_front > height,
    )


def _write(path: Path, drawn: np.ndarray, measured: list[Measured]) -> None:
    height, width = drawn.shape[:2]
    figure = plt.figure(figsize=(width / 100, height / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(drawn, interpolation="nearest")
    axes.set_axis_off()
    middle = np.median([each.points[:, 1].mean() for each in measured]) if measured else 0.0
    above = [each for each in measured if each.points[:, 1].mean() <= middle]
    below = [each for each in measured if each.points[:, 1].mean() > middle]
    for row, y, side in ((above, 44.0, 1.0), (below, height - 44.0, -1.0)):
        row.sort(key=lambda each: each.points[:, 0].mean())
        for each, x in zip(row, _spread(row, width), strict=True):
            _label(axes, each, (x, y), side)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _spread(row: list[Measured], width: int) -> np.ndarray:
    """Return a column for each label: that of its line, moved aside as far as the row needs."""
    wanted = np.array([each.points[:, 0].mean() for each in row])
    gap = min(235.0, (width - 250.0) / max(1, len(row) - 1))
    x = wanted.copy()
    for _ in range(200):
        for k in range(len(x) - 1):
            push = max(0.0, gap - (x[k + 1] - x[k])) / 2
            x[k], x[k + 1] = x[k] - push, x[k + 1] + push
        x = np.clip(x, 125.0, width - 125.0)
    return x


def _label(axes, each: Measured, at: tuple[float, float], side: float) -> None:
    colour = COLOURS[each.state]
    casing = [matplotlib.patheffects.withStroke(linewidth=5.0, foreground="white")]
    (x0, y0), (x1, y1) = each.points
    axes.plot((x0, x1), (y0, y1), color=colour, linewidth=2.4, path_effects=casing, zorder=3)
    for x, y, hidden in zip((x0, x1), (y0, y1), each.hidden, strict=True):
        face, edge = ("white", colour) if hidden else (colour, "white")
        axes.plot(x, y, "o", markersize=6.0, mfc=face, mec=edge, mew=1.3, zorder=4)
    axes.plot(
        (at[0], 0.5 * (x0 + x1)), (at[1] + side * 22.0, 0.5 * (y0 + y1)),
        color=colour, linewidth=1.0, zorder=2,
        path_effects=[matplotlib.patheffects.withStroke(linewidth=3.0, foreground="white")],
    )  # fmt: skip
    axes.text(*at, each.value, ha="center", va="bottom", color=colour, fontsize=15, weight="bold")
    axes.text(at[0], at[1] + 4, each.label, ha="center", va="top", color="#30363d", fontsize=11)


if __name__ == "__main__":
    main()
