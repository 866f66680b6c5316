"""Pairs of triangles that are hard for floating point, one generator for each kind."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from engine_bodies import rotation

Pair = tuple[np.ndarray, np.ndarray]


def _inside(rng: np.random.Generator, triangle: np.ndarray) -> np.ndarray:
    return rng.dirichlet((0.5, 0.5, 0.5)) @ triangle


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def _small(rng: np.random.Generator, low: float, high: float) -> float:
    return 10.0 ** rng.uniform(low, high)


def apart(rng: np.random.Generator) -> Pair:
    return rng.normal(size=(3, 3)), rng.normal(size=(3, 3)) + 3.0 * rng.normal(size=3)


def close(rng: np.random.Generator) -> Pair:
    return rng.normal(size=(3, 3)), rng.normal(size=(3, 3))


def other_scales(rng: np.random.Generator) -> Pair:
    a, b = close(rng)
    return a * _small(rng, -8, 8), b * _small(rng, -8, 8)


def far_from_origin(rng: np.random.Generator) -> Pair:
    a, b = close(rng)
    return a + 1e6, b + 1e6 + rng.normal(size=3)


def parallel_planes(rng: np.random.Generator) -> Pair:
    a, b = close(rng)
    a[:, 2], b[:, 2] = 0.0, _small(rng, -16, 0)
    b[:, :2] += rng.normal(size=2) * rng.choice((0.0, 1.0, 4.0))
    turn = rotation(rng)
    return a @ turn.T, b @ turn.T


def coplanar(rng: np.random.Generator) -> Pair:
    a, b = close(rng)
    a[:, 2] = b[:, 2] = rng.choice((0.0, 0.5))
    b[:, :2] += rng.normal(size=2) * rng.choice((0.0, 2.0, 4.0))
    return a, b


def on_a_grid(rng: np.random.Generator) -> Pair:
    """Return a pair that may touch, be coplanar, shared or degenerate, with exact coordinates."""
    return rng.integers(-2, 3, (3, 3)).astype(float), rng.integers(-2, 3, (3, 3)).astype(float)


def on_a_flat_grid(rng: np.random.Generator) -> Pair:
    a, b = on_a_grid(rng)
    a[:, 2], b[:, 2] = 0.0, rng.integers(2)
    return a, b


def shared_vertex(rng: np.random.Generator) -> Pair:
    a, b = close(rng)
    b[rng.integers(3)] = a[rng.integers(3)]
    return a, b


def shared_edge(rng: np.random.Generator) -> Pair:
    a, b = close(rng)
    b[0], b[2] = a[1], a[0]
    return a, b


def touching(rng: np.random.Generator) -> Pair:
    a, b = close(rng)
    b[0] = _inside(rng, a) + rng.normal(size=3) * _small(rng, -17, -8)
    return a, b


def grazing(rng: np.random.Generator) -> Pair:
    """An edge passes through a point of the triangle, often on its rim, but for a tiny shift."""
    a, b = close(rng)
    weights = rng.dirichlet((0.5, 0.5, 0.5))
    weights[rng.integers(3)] *= rng.integers(2)
    through, along = weights @ a / weights.sum(), rng.normal(size=3)
    b[0], b[1] = through + along, through - along * rng.choice((0.0, 1.0)) * rng.uniform()
    return a, b + rng.normal(size=3) * _small(rng, -17, -6)


def slivers(rng: np.random.Generator) -> Pair:
    """The triangles are 1e7 to 1e17 times as long as they are high."""
    a, b = close(rng)
    for t in (a, b):
        if rng.uniform() < 0.7:
            t[2] = t[0] + (t[1] - t[0]) * rng.uniform() + rng.normal(size=3) * _small(rng, -17, -7)
    return a, b + rng.normal(size=3) * rng.choice((0.0, 1e-9, 1.0))


def above_a_needle(rng: np.random.Generator) -> Pair:
    """A corner is straight above the inside of a sliver, whose plane is hardly defined."""
    along, across, up = rotation(rng)
    start = rng.normal(size=3)
    width = _small(rng, -14, -3)
    a = np.array([start, start + along, start + rng.uniform() * along + width * across])
    corner = a.mean(axis=0) + rng.uniform(0.1, 2.0) * up
    b = np.array([corner, corner + up + along, corner + up - along])
    return (a, b) if rng.integers(2) else (b, a)


def zero_area(rng: np.random.Generator) -> Pair:
    """The triangles are segments and points, with repeated or collinear corners."""
    a, b = close(rng)
    for t in (a, b):
        t[:] = [t, t[[0, 0, 2]], t[[0, 1, 1]], t[[0, 0, 0]], [t[0], t[1], (t[0] + t[1]) / 2]][
            rng.integers(5)
        ]
    return a, b


def nearly_parallel_edges(rng: np.random.Generator) -> Pair:
    """Two edges pass each other at an angle of 1e-16 to 0.1."""
    a, b = close(rng)
    edge = a[1] - a[0]
    across = _unit(np.cross(edge, rng.normal(size=3)))
    nearest = a[0] + edge * rng.uniform() + across * _small(rng, -9, 1) * rng.integers(2)
    other = edge + np.cross(edge, across) * _small(rng, -16, -1) * rng.choice((-1.0, 1.0))
    before, after = rng.uniform(0.1, 1.5, 2)
    b[0], b[1] = nearest - before * other, nearest + after * other
    b[2] = nearest + across * rng.normal()
    return a, b


def tiny_gap(rng: np.random.Generator) -> Pair:
    """A corner is 1e-12 above a face."""
    a, b = close(rng)
    normal = _unit(np.cross(a[1] - a[0], a[2] - a[0]))
    b[0] = _inside(rng, a) + 1e-12 * normal
    b[1:] = b[0] + np.abs(rng.normal(size=(2, 1))) * normal + 0.3 * rng.normal(size=(2, 3))
    return a, b


def straight_through_a_needle(rng: np.random.Generator) -> Pair:
    """A segment's line meets a needle, often beyond the segment's end: signs depend on 1e-29.

    The needle's height is at the limit of doubled precision. No coordinate of it vanishes.
    """
    up = rng.choice((-1.0, 1.0), 3) * rng.integers(1, 4, 3)
    along = np.cross(up, rng.permutation((1.0, 2.0, -1.0)))
    across = np.cross(along, up)
    a = np.array([across * 2.0 ** rng.uniform(-104, -90), along, -along])
    near, far = rng.permutation([-0.5, 0.125, 0.25, 0.5, 1.0, 2.0])[:2]
    b = np.array([near * up, far * up, far * up + rng.integers(-2, 3, 3)])
    return (a, b) if rng.integers(2) else (b, a)


def edges_that_graze(rng: np.random.Generator) -> Pair:
    """Two edges cross in a point, or nearly, at an angle of 1e-12 to 0.1."""
    a, b = close(rng)
    edge = a[1] - a[0]
    through = a[0] + rng.uniform() * edge + rng.choice((0.0, 1e-16, 1e-12)) * rng.normal(size=3)
    other = edge + np.cross(edge, rng.normal(size=3)) * _small(rng, -12, -1)
    b[0], b[1] = through - rng.uniform() * other, through + rng.uniform() * other
    return a, b


KINDS: dict[str, Callable[[np.random.Generator], Pair]] = {
    make.__name__: make
    for make in [
        apart,
        close,
        other_scales,
        far_from_origin,
        parallel_planes,
        coplanar,
        on_a_grid,
        on_a_flat_grid,
        shared_vertex,
        shared_edge,
        touching,
        grazing,
        slivers,
        above_a_needle,
        zero_area,
        nearly_parallel_edges,
        tiny_gap,
        straight_through_a_needle,
        edges_that_graze,
    ]
}
"""The generator of each kind, by name."""
