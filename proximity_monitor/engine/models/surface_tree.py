"""Build the tree over pieces of surfaces, and check that it is right."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.tables import arrays_of
from ..kernels.base.trees import NET_WIDTH, NONE, PIECE, REVISION, SurfaceTree, Trims
from ..kernels.surface.limits import fit_limits
from ..kernels.surface.trim import INSIDE
from ..kernels.tree.build import build_tree
from ..kernels.tree.fit_surface import fit_surface, project
from ..kernels.tree.layout import (
    EMPTY,
    EMPTY_RADIUS,
    EXTENT,
    FIELDS,
    STRIDE,
    WIDTH,
    first_of,
    last_of,
)
from ..kernels.tree.measure import measure
from .edges import with_edges
from .nurbs import Net, frozen
from .parts import Parts
from .tree import TreeError


def build_surface(
    nets: Sequence[Net], parts: Parts, trims: Trims, deviation: float, gap: float
) -> tuple[SurfaceTree, NDArray[np.int32], int]:
    """Build the tree over the pieces of nets.

    Args:
        nets: those of the patches and curves.
        parts: into how many parts their spans are cut.
        trims: their loops.
        deviation: metres; how far they may be from the part that they stand for.
        gap: metres; how near to the patches of a solid the surfaces are that close its gaps.

    Returns:
        The tree; (m,) the number, in the order of `_cut` and `with_edges`, of each piece in tree
        order; and the number of levels.

    Raises:
        ModelError: a loop leaves the rectangle of its patch.
    """
    pieces, flat, lost = with_edges(*_cut(nets, parts), trims)
    points, starts = _projected(pieces, flat)
    low = np.minimum.reduceat(points, starts[:-1])
    high = np.maximum.reduceat(points, starts[:-1])
    # The structure depends only on the places of pieces, so each piece is replaced by a point.
    stand_ins = np.ascontiguousarray(np.tile(0.5 * low + 0.5 * high, 3))
    leaves = np.full((len(pieces), 2), -1, np.int32)
    leaves[:, 0] = np.arange(len(pieces))
    children, order, depth = build_tree(stand_ins, leaves, len(pieces))
    children.setflags(write=False)  # as in a refit, so that kernels are compiled only once
    scale = _scale(nets, parts, lost, 0.0, deviation, gap)
    tree, _ = _fitted(children, _ordered(pieces, order), flat, scale, trims)
    return tree, order.astype(np.int32), depth + 1


def refit_surface(
    tree: SurfaceTree, order: NDArray[np.int32], nets: Sequence[Net], parts: Parts, gap: float
) -> tuple[SurfaceTree, NDArray[np.float64]]:
    """Fit a tree of the same structure to the pieces of nets whose control points moved.

    Returns:
        The tree, and the control points of its pieces as rows (k, 9) of three, metres.
    """
    if tree.trims.trims["rows"].any():
        pieces, flat, lost = with_edges(*_cut(nets, parts), tree.trims)
        pieces = _ordered(pieces, order)
    else:  # nothing but the nets depends on control points
        pieces, flat, lost = tree.pieces.copy(), np.empty_like(tree.nets), 0.0
        end = 0
        for net, own in zip(nets, parts, strict=True):
            end += _rows(net, own, flat[end:]).size
    revision, deviation = tree.scale[REVISION] + 1.0, tree.scale[REVISION + 2]
    scale = _scale(nets, parts, lost, revision, deviation, gap)
    return _fitted(tree.children, pieces, flat, scale, tree.trims)


def projected(tree: SurfaceTree) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the control points (n, 3) of all pieces, metres, and each piece's start (m + 1,)."""
    return _projected(tree.pieces, tree.nets)


def _projected(
    pieces: NDArray, nets: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return `project` of arrays, as read-only ones, so that it is compiled only once."""
    pieces, nets = pieces.view(), nets.view()
    pieces.flags.writeable = nets.flags.writeable = False
    return project(pieces, nets)


def _cut(nets: Sequence[Net], parts: Parts) -> tuple[NDArray, NDArray[np.float64]]:
    """Cut nets into pieces (m,) PIECE; return them and their nets, flat as in SurfaceTree."""
    pieces, flat, start = [], [], 0
    for patch, (net, own_parts) in enumerate(zip(nets, parts, strict=True)):
        along_u, along_v = net.parts(own_parts)
        rows, s_v = _rows(net, own_parts), len(along_v.low)
        count, _, room = rows.shape
        own = np.zeros(count, PIECE)
        own["net"] = start + 4 * room * np.arange(count)
        own["points"] = (along_u.degree + 1) * (along_v.degree + 1)
        own["room"], own["degree_u"], own["degree_v"] = room, along_u.degree, along_v.degree
        own["rational"], own["patch"] = net.weights is not None, patch
        own["side"], own["edge"] = INSIDE, NONE
        for end, u, v in (
            ("low", along_u.low, along_v.low),
            ("high", along_u.high, along_v.high),
        ):
            own[end][:, 0], own[end][:, 1] = np.repeat(u, s_v), np.tile(v, count // s_v)
        pieces.append(own)
        flat.append(rows.reshape(-1))
        start += rows.size
    cut = np.concatenate(pieces)
    cut["face"] = np.arange(len(cut))
    return cut, np.concatenate(flat)


def _rows(
    net: Net, parts: tuple[int, int], into: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the nets of a net's pieces (m, 4, room): see PIECE; at the beginning of `into`."""
    made = net.pieces(parts)
    s_u, s_v, n_u, n_v, _ = made.shape
    count, points = s_u * s_v, n_u * n_v
    room = -(-points // NET_WIDTH) * NET_WIDTH
    flat = np.empty(4 * count * room) if into is None else into[: 4 * count * room]
    rows = flat.reshape(count, 4, room)
    rows[..., :points] = made.reshape(count, points, 4).transpose(0, 2, 1)
    rows[..., points:] = rows[..., points - 1 : points]
    return rows


def _ordered(pieces: NDArray, order: NDArray) -> NDArray:
    """Return pieces in tree order."""
    pieces = pieces.take(order)
    pieces["face"] = np.argsort(order)[pieces["face"]]
    return pieces


def _fitted(
    children: NDArray[np.int32],
    pieces: NDArray,
    nets: NDArray[np.float64],
    scale: NDArray[np.float64],
    trims: Trims,
) -> tuple[SurfaceTree, NDArray[np.float64]]:
    """Return the tree of a given structure over pieces in tree order, and their control points."""
    points, starts = _projected(pieces, nets)
    corners = in_threes(points)
    _, largest, longest = measure(corners, np.empty(3))
    # A power of two above every coordinate: dividing by it is exact.
    unit = math.ldexp(1.0, math.frexp(largest)[1]) if largest > 1e-300 else 1.0
    scale[:3] = unit, 1.0 / unit, longest * (1.0 + 8.0 * DOUBLE_EPS)
    nodes, centres, sizes = fit_surface(points, starts, children, unit)
    fit_limits(pieces, nets, scale)
    tree = SurfaceTree(nodes, centres, children, sizes, pieces, nets, scale, trims)
    for array in arrays_of(tree):
        frozen(array)
    return tree, corners


def in_threes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (n, 3) as rows (k, 9) of three, filled up with the last point."""
    missing = -len(points) % 3
    made = np.concatenate((points, points[-1:].repeat(missing, axis=0)))
    return frozen(made.reshape(-1, 9))


def _scale(
    nets: Sequence[Net], parts: Parts, lost: float, revision: float, deviation: float, gap: float
) -> NDArray[np.float64]:
    """Return the `scale` of a tree without its first three numbers: see `SurfaceTree`.

    Rounding may move an edge by `lost` metres.
    """
    error = max(net.error(own) for net, own in zip(nets, parts, strict=True)) + lost
    return np.array([0.0, 0.0, 0.0, revision, 0.0, deviation, error, gap])


def check_surface_tree(tree: SurfaceTree) -> None:
    """Check that each volume holds all control points below it and each piece is in one leaf.

    Raises:
        TreeError: a check fails; the message says which, and in which node and lane.
    """
    seen = np.zeros(len(tree.pieces), np.int64)
    points, starts = projected(tree)
    _check_node(tree, 0, points, starts, seen)
    if not (seen == 1).all():
        wrong = int(np.flatnonzero(seen != 1)[0])
        raise TreeError(f"piece {wrong} stands in {int(seen[wrong])} leaves")
    radii = tree.nodes.reshape(-1, FIELDS, WIDTH)[:, 9]
    if ((tree.children.reshape(-1, WIDTH) == EMPTY) & ~(radii <= EMPTY_RADIUS)).any():
        raise TreeError("an unused lane could be reached")
    unit, inverse, longest = tree.scale[:3]
    if not (inverse * unit == 1.0 and np.abs(points).max() <= unit):
        raise TreeError(f"scale: {unit} metres in a node unit, of which {inverse} in a metre")
    if not np.sqrt((points**2).sum(axis=1)).max() <= longest:
        raise TreeError(f"scale: a control point lies beyond {longest} from the origin")


def _check_node(
    tree: SurfaceTree,
    node: int,
    points: NDArray[np.float64],
    starts: NDArray[np.int64],
    seen: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Check a node and all nodes below it; return the control points that it holds."""
    lanes = tree.nodes[node * STRIDE : (node + 1) * STRIDE].reshape(FIELDS, WIDTH)
    lanes, held = lanes.astype(np.float64), []
    own = tree.children[node * WIDTH : (node + 1) * WIDTH]
    if own[0] < 0 and (own >= 0).any():
        raise TreeError(f"node {node} lane 0: a piece, though the node is not a lowest one")
    for lane in range(WIDTH):
        child = int(tree.children[node * WIDTH + lane])
        if child == EMPTY:
            continue
        if child < 0:
            piece = first_of.py_func(child)
            if last_of.py_func(child) != piece:
                raise TreeError(f"node {node} lane {lane}: a leaf of two pieces")
            seen[piece] += 1
            below = points[starts[piece] : starts[piece + 1]]
        else:
            below = _check_node(tree, child, points, starts, seen)
        held.append(below)
        volume, where = lanes[:, lane], f"node {node} lane {lane}"
        u, v, (radius, a, b) = volume[3:6], volume[6:9], volume[9:]
        d = below / tree.scale[0] - (tree.centres[node, :3] + volume[:3])
        s, t = np.clip(d @ u, -a, a), np.clip(d @ v, -b, b)
        outside = np.sqrt(((d - np.outer(s, u) - np.outer(t, v)) ** 2).sum(axis=1)).max() - radius
        if not outside <= 0.0:
            raise TreeError(f"{where}: a control point lies {outside} outside")
        reach = np.sqrt(volume[:3] @ volume[:3]) + radius + a + b
        if not reach <= tree.centres[node, 3]:
            raise TreeError(f"{where}: reaches {reach} beyond its node's reach")
        if not 1.5 * tree.sizes[node * WIDTH + lane, EXTENT] >= a + b + radius:
            raise TreeError(f"{where}: its size is too small")
    return np.concatenate(held)
