"""Triangle meshes of solids of revolution that are within a precision."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.engine.models.nurbs import Net

_FINER = 8
"""For its error's bound, the curve over a chord is cut into so many Bezier pieces."""


def tessellated(
    solid: engine.SolidOfRevolution, precision: float, most: int
) -> tuple[NDArray[np.float64], NDArray[np.int32], float]:
    """Return vertices, faces, and by how much they may be off the solid, metres.

    That is `precision`, or more if the mesh would have more triangles than `most`.
    """
    while True:
        points = _polygon(solid, 0.5 * precision)
        widest = points[:, 0].max()
        around = max(math.ceil(math.pi / math.acos(1.0 - 0.5 * precision / widest)), 8)
        if 2 * around * len(points) <= most:
            break
        precision *= 1.2
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rho, z = points.T
    vertices = np.stack(
        (np.outer(rho, np.cos(turn)), np.outer(rho, np.sin(turn)), np.tile(z[:, None], around)),
        axis=2,
    ).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(len(points) - 1), np.arange(around), indexing="ij")
    one, two = i * around + j, i * around + (j + 1) % around
    faces = np.concatenate(
        [np.stack(each, axis=2).reshape(-1, 3) for each in (
            (one, two, one + around), (two, two + around, one + around))]
    )  # fmt: skip
    corners = vertices[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return vertices, faces[area > 0.0].astype(np.int32), precision


def _polygon(solid: engine.SolidOfRevolution, error: float) -> NDArray[np.float64]:
    """Return points of the profile; no chord is farther from its curve than `error`, metres.

    Each chord's middle is also within `error` of the curve's point at the middle parameter. Where
    the parameter runs unevenly, this asks for more chords than the distance does.
    """
    rows = []
    for net in solid.profile.nets:
        along, _ = net.spans
        for span, (low, high) in enumerate(zip(along.low, along.high, strict=True)):
            count = 1
            while True:
                t = np.linspace(low, high, 2 * count + 1)
                found = net.derivatives(t, 0 * t, 0)[:, 0, 0, :2]
                ends, middles = found[::2], found[1::2]
                off = np.linalg.norm(middles - 0.5 * (ends[:-1] + ends[1:]), axis=1).max()
                if max(off, _farthest(net, span, ends)) <= error:
                    break
                count *= 2
            rows.append(ends[:-1])
    rows.append(ends[-1:])
    points = np.concatenate(rows)
    points[:, 0] = np.maximum(points[:, 0], 0.0)
    return points


def _farthest(net: Net, span: int, ends: NDArray[np.float64]) -> float:
    """Return how far, at most, the chords of a span's curve are from it, and it from them.

    Args:
        net: the curve.
        span: the span's number.
        ends: (n + 1, 2) the ends of n chords, evenly spaced in the parameter.

    The curve over a chord lies in the hull of its pieces' control points, so it is no farther from
    the chord than the farthest of these. It crosses each normal of the chord, so the chord is no
    farther from it.
    """
    parts = _FINER * (len(ends) - 1)
    nets = net.pieces((parts, 1))[span * parts : (span + 1) * parts, :, 0]
    hulls = (nets[..., :2] / nets[..., 3:]).reshape(len(ends) - 1, -1, 2)
    way = np.diff(ends, axis=0)[:, None]
    off = hulls - ends[:-1, None]
    length = np.maximum((way * way).sum(axis=2), 1e-300)
    share = np.clip((off * way).sum(axis=2) / length, 0.0, 1.0)
    return float(np.linalg.norm(off - share[..., None] * way, axis=2).max())
