"""The meshes of the generated scenes, (n, 3) float64 vertices and (m, 3) int32 faces each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Mesh = tuple[NDArray[np.float64], NDArray[np.int32]]


def sphere(radius: float, around: int = 200, bands: int = 101) -> Mesh:
    """Return a sphere of meridians and parallels: by default of 40,000 triangles."""
    polar = np.linspace(0.0, np.pi, bands + 1)[1:-1, None]
    azimuth = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[None, :]
    ring = np.stack(
        np.broadcast_arrays(
            np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)
        ),
        axis=-1,
    ).reshape(-1, 3)
    vertices = radius * np.concatenate(([[0.0, 0.0, 1.0]], ring, [[0.0, 0.0, -1.0]]))
    first = 1 + np.arange(around)
    last = first + (bands - 2) * around
    top = np.stack((np.zeros(around, int), first, np.roll(first, -1)), axis=1)
    bottom = np.stack((np.full(around, len(vertices) - 1), np.roll(last, -1), last), axis=1)
    sides = _quads(bands - 1, around, close_rows=False) + 1
    return vertices, np.concatenate((top, sides, bottom)).astype(np.int32)


def torus(
    major: int,
    minor: int,
    point: Callable[[NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[np.float64], ...]],
) -> Mesh:
    """Return a torus of 2 major minor triangles.

    Args:
        major: steps around the axis.
        minor: steps around the tube.
        point: returns the ring's radius, the tube's radius and a lift along the axis, from the
            angles around the axis and around the tube.
    """
    u = np.linspace(0.0, 2.0 * np.pi, major, endpoint=False)[:, None]
    v = np.linspace(0.0, 2.0 * np.pi, minor, endpoint=False)[None, :]
    ring, tube, lift = np.broadcast_arrays(*point(u, v))
    reach = ring + tube * np.cos(v)
    vertices = np.stack((reach * np.cos(u), reach * np.sin(u), lift + tube * np.sin(v)), axis=-1)
    return vertices.reshape(-1, 3), _quads(major, minor).astype(np.int32)


def wrinkled_torus() -> Mesh:
    """Return a torus of 20,000 triangles with fine folds around and along the tube."""
    return torus(
        100,
        100,
        lambda u, v: (
            0.15 + 0.006 * np.sin(9 * u),
            0.05 + 0.004 * np.sin(14 * v + 3 * u) + 0.003 * np.sin(31 * u),
            0.008 * np.sin(5 * u),
        ),
    )


def lumpy_torus(major: int = 54, minor: int = 30) -> Mesh:
    """Return the obstacle of the falling tori: by default of 3,240 triangles."""
    return torus(
        major,
        minor,
        lambda u, v: (0.85, 0.3 + 0.035 * np.sin(7 * u) * np.cos(3 * v) + 0.02 * np.sin(4 * u), 0),
    )


def warped_torus() -> Mesh:
    """Return the torus that falls: 1,332 triangles."""
    return torus(37, 18, lambda u, v: (0.36, 0.10 + 0 * v, 0.09 * np.sin(2 * u)))


def ring() -> Mesh:
    """Return a link of the chain: 256 triangles."""
    return torus(16, 8, lambda u, v: (1.0, 0.18 + 0 * (u + v), 0))


def cave(corridor: NDArray[np.float64], clear: float) -> Mesh:
    """Return a cave of 50,992 triangles, 8 m across, 3 m high: floor and ceiling meet at its rim.

    It has 458 stalactites and stalagmites of 24 long thin triangles each. They are shortened if
    they would come nearer to the corridor than `clear`.

    Args:
        corridor: (k, 3) points, metres.
        clear: metres.
    """
    random = np.random.default_rng(51)
    steps = 101
    x, y = np.meshgrid(*2 * [np.linspace(-4.0, 4.0, steps)], indexing="ij")
    radius = np.minimum(np.hypot(x, y) / 4.0, 1.0)
    bumps = [random.normal(0.0, 0.05, (steps, steps)) for _ in range(2)]
    height = 1.5 * np.sqrt(1.0 - 0.995 * radius**4)
    sheets = [
        np.stack((x, y, sign * (height + bump)), axis=-1).reshape(-1, 3)
        for sign, bump in zip((1.0, -1.0), bumps, strict=True)
    ]
    cells = _quads(steps, steps, close_rows=False, close_columns=False)
    parts = [(sheet, cells) for sheet in sheets]
    # The sheets have 2 x 20,000 triangles; the cones below have the others, 24 each.
    for i in range(458):
        parts.append(_cone(random, sheets[i % 2], -1.0 if i % 2 == 0 else 1.0, corridor, clear))
    return _joined(parts)


def _cone(
    random: np.random.Generator,
    sheet: NDArray[np.float64],
    direction: float,
    corridor: NDArray[np.float64],
    clear: float,
) -> Mesh:
    """Return one stalactite (direction -1) or stalagmite (+1): eight sides, two storeys."""
    while np.hypot(*(root := sheet[random.integers(len(sheet))])[:2]) > 3.6:
        pass
    width, length = random.uniform(0.03, 0.12), random.uniform(0.3, 1.6)
    along = np.array([random.normal(0.0, 0.04), random.normal(0.0, 0.04), direction])
    shares = np.linspace(0.0, 1.0, 50)[:, None, None]
    while np.linalg.norm(root + shares * length * along - corridor, axis=2).min() < clear + width:
        length *= 0.8
        if length < 0.02:
            break
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    circle = np.stack((np.cos(angle), np.sin(angle), np.zeros(8)), axis=1)
    lower = root - 0.1 * along + width * circle
    upper = root + 0.5 * length * along + random.uniform(0.3, 0.6) * width * circle
    tip = np.full(8, 16)
    cap = np.stack((8 + np.arange(8), 8 + (np.arange(8) + 1) % 8, tip), axis=1)
    return (
        np.concatenate((lower, upper, [root + length * along])),
        np.concatenate((_quads(2, 8, close_rows=False), cap)),
    )


def _quads(
    rows: int, columns: int, close_rows: bool = True, close_columns: bool = True
) -> NDArray[np.int64]:
    """Return two triangles for each cell of a grid of vertices, which may be closed either way."""
    i, j = np.meshgrid(
        np.arange(rows if close_rows else rows - 1),
        np.arange(columns if close_columns else columns - 1),
        indexing="ij",
    )
    i, j = i.ravel(), j.ravel()
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = (i + 1) % rows * columns + j, (i + 1) % rows * columns + (j + 1) % columns
    return np.concatenate((np.stack((a, c, d), axis=1), np.stack((a, d, b), axis=1)))


def _joined(parts: list[Mesh]) -> Mesh:
    """Return several meshes as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in parts[:-1]])
    faces = [faces + start for (_, faces), start in zip(parts, starts, strict=True)]
    return np.concatenate([v for v, _ in parts]), np.concatenate(faces).astype(np.int32)
