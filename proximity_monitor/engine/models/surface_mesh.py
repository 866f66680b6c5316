"""Triangles that show surfaces, with the surfaces' own normals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .model import DisplayMesh
from .nurbs import Net
from .trim_mesh import trimmed_grid

_MOST = 64
"""The most steps on a span."""

_ENOUGH = 120_000
"""The most triangles of a model, unless each span has only one step."""

_PARTS = 4
"""Into how many parts a span of a rational patch is cut to bound its second derivatives."""

_ASIDE = (1e-6, 1e-3, 0.1)
"""If a normal vanishes, it is taken at points that are these shares of the way to the middle of the
domain, one after the other."""


def tessellated_surface(nets: Sequence[Net], tolerance: float) -> DisplayMesh:
    """Return triangles for patches, and degenerate triangles for curves.

    Each span is cut into equal steps. Each step in u with a step in v makes two triangles. Let h
    and k be the steps as shares of their spans. Then a point of a triangle and the point of the
    surface with the same parameters are no farther apart than
    (h² |S_uu| + 2 h k |S_uv| + k² |S_vv|) / 8 (Filip, Magedson and Markot 1986).
    """
    bends = [_bends(net) for net in nets]
    while True:
        steps = [_steps(net, bend, tolerance) for net, bend in zip(nets, bends, strict=True)]
        count = sum(
            int(in_u.sum()) * (1 if net.is_curve else 2 * int(in_v.sum()))
            for net, (in_u, in_v) in zip(nets, steps, strict=True)
        )
        if count <= _ENOUGH or all(each.max() == 1 for pair in steps for each in pair):
            break
        tolerance = max(2.0 * tolerance, max(each.max() for bend in bends for each in bend) / 8e6)
    vertices, faces, normals, start = [], [], [], 0
    for net, (in_u, in_v) in zip(nets, steps, strict=True):
        along_u, along_v = net.spans
        u = _parameters(along_u.low, along_u.high, in_u)
        v = np.zeros(1) if net.is_curve else _parameters(along_v.low, along_v.high, in_v)
        if net.trim is None:
            places, triangles = _grid(net, u, v)
        else:
            places, triangles = trimmed_grid(net.trim, u, v)
        vertices.append(net.derivatives(*places.T, 0)[:, 0, 0])
        normals.append(unit_normals(net, *places.T))
        faces.append(start + triangles)
        start += len(places)
    curves = all(net.is_curve for net in nets)
    return DisplayMesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        None if curves else np.concatenate(normals),
        max(_off(*each) for each in zip(nets, bends, steps, strict=True)),
    )


def _off(
    net: Net, bends: tuple[NDArray[np.float64], ...], steps: tuple[NDArray[np.int64], ...]
) -> float:
    """Return how far the triangles are from the patch, metres: the formula above, and rounding.

    For a trimmed patch this is infinite: its triangles end at chords of the loops, and the distance
    of these chords is not bounded here.
    """
    if net.trim is not None:
        return math.inf
    uu, uv, vv = bends
    h, k = 1.0 / steps[0][:, None], 1.0 / steps[1]
    bent = (h * h * uu + 2.0 * h * k * uv + k * k * vv) / 8.0
    return float(bent.max()) + 1e-12 * float(np.abs(net.points).max())


def _grid(
    net: Net, u: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the parameters (k, 2) of a grid's nodes, and triangles (j, 3) of their indices."""
    places = np.column_stack((np.repeat(u, len(v)), np.tile(v, len(u))))
    at = np.arange(len(places)).reshape(len(u), len(v))
    if net.is_curve:
        a, b = at[:-1, 0], at[1:, 0]
        return places, np.stack((a, b, b), axis=1)
    corners = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    a, b, c, d = (each.ravel() for each in corners)
    return places, np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))


def unit_normals(net: Net, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit normals (k, 3) at u and v (k,): nearby ones if they vanish; 0 on a curve."""
    made = np.zeros((len(u), 3))
    if net.is_curve:
        return made
    along_u, along_v = net.spans
    middle_u = 0.5 * (along_u.low[0] + along_u.high[-1])
    middle_v = 0.5 * (along_v.low[0] + along_v.high[-1])
    size = float(np.ptp(net.points, axis=0).max())
    area = size * size / ((along_u.high[-1] - along_u.low[0]) * (along_v.high[-1] - along_v.low[0]))
    left = np.arange(len(u))
    for share in (0.0, *_ASIDE):
        at_u, at_v = u[left] + share * (middle_u - u[left]), v[left] + share * (middle_v - v[left])
        found = net.derivatives(at_u, at_v, 1)
        product = np.cross(found[:, 1, 0], found[:, 0, 1])
        length = np.linalg.norm(product, axis=1)
        sure = length > 1e-13 * area
        made[left[sure]] = product[sure] / length[sure, None]
        left = left[~sure]
        if not len(left):
            break
    return made


def _bends(net: Net) -> tuple[NDArray[np.float64], ...]:
    """Return bounds of |S_uu|, |S_uv| and |S_vv| on each piece (s_u, s_v) for parameters of 0..1.

    For a rational piece S = X / w, seen from a point in its middle, w S = X is differentiated:
    w S_u = X_u - w_u S, w S_uv = X_uv - w_u S_v - w_v S_u - w_uv S, and so on. Control points give
    closer bounds on smaller parts.
    """
    parts = 1 if net.weights is None else _PARTS
    made = net.pieces((parts, parts))
    weights = made[..., 3:]
    points = made[..., :3] / weights
    points -= 0.5 * (points.min(axis=(2, 3)) + points.max(axis=(2, 3)))[:, :, None, None]
    reach, least = _largest(points), weights.min(axis=(2, 3))[..., 0]

    def bound(i: int, j: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        of_w = _largest(_derived(weights, i, j))
        return _largest(_derived(points * weights, i, j)) + of_w * reach, of_w

    (s_u, w_u), (s_v, w_v) = bound(1, 0), bound(0, 1)
    s_u, s_v = s_u / least, s_v / least
    found = (
        (bound(2, 0)[0] + 2.0 * s_u * w_u) / least,
        (bound(1, 1)[0] + s_u * w_v + s_v * w_u) / least,
        (bound(0, 2)[0] + 2.0 * s_v * w_v) / least,
    )
    in_u, in_v = (len(each.low) for each in net.spans)
    whole = in_u, len(made) // in_u, in_v, made.shape[1] // in_v
    return tuple(parts**2 * each.reshape(whole).max(axis=(1, 3)) for each in found)


def _derived(points: NDArray[np.float64], i: int, j: int) -> NDArray[np.float64]:
    """Return control points of the derivative of order i in u, j in v of Bezier pieces.

    The pieces are (s_u, s_v, n_u, n_v, c).
    """
    for axis, times in ((2, i), (3, j)):
        for _ in range(times):
            points = np.diff(points, axis=axis) * (points.shape[axis] - 1)
    return points


def _largest(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest length of vectors (s_u, s_v, n_u, n_v, c) for each piece; 0 of none."""
    return np.linalg.norm(vectors, axis=-1).max(axis=(2, 3), initial=0.0)


def _steps(
    net: Net, bends: tuple[NDArray[np.float64], ...], tolerance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return how many steps each span in u and in v is cut into, in all pieces along it."""
    uu, uv, vv = bends
    size = float(np.abs(net.points).max())
    # Second derivatives that are only rounding count as 0.
    flat = 1e-13 * size
    uu, uv, vv = (np.where(each <= flat, 0.0, each) for each in (uu, uv, vv))
    tolerance = max(tolerance, flat, 1e-300)
    terms = sum(int(each.any()) for each in (uu, uv, vv))
    share = 8.0 * tolerance / max(terms, 1)
    twist = np.sqrt(2.0 * uv / share)
    in_u = np.maximum(np.sqrt(uu / share), twist).max(axis=1)
    in_v = np.maximum(np.sqrt(vv / share), twist).max(axis=0)
    if net.is_curve:
        in_v = np.ones(1)
    return tuple(np.clip(np.ceil(each), 1, _MOST).astype(np.int64) for each in (in_u, in_v))


def _parameters(
    low: NDArray[np.float64], high: NDArray[np.float64], steps: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the parameters where the steps of all spans begin, and where the last one ends."""
    parts = [
        a + (b - a) * (np.arange(n) / n) for a, b, n in zip(low, high, steps.tolist(), strict=True)
    ]
    return np.concatenate((*parts, high[-1:]))
