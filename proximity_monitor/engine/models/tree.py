"""Build the hierarchy of a model from triangles, and check that it is right."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import SINGLE_EPS
from ..kernels.base.trees import REVISION, BoxTree, MeshTree
from ..kernels.tree.build import build_tree
from ..kernels.tree.fit import AABB, HYBRID, LSS, OBB, PSS, RSS
from ..kernels.tree.fit_tree import fit_tree
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
from ..kernels.tree.pairing import pair_up
from ..kernels.tree.welding import first_drawn, first_equal, without_twins

VOLUMES = {"rss": RSS, "lss": LSS, "pss": PSS, "hybrid": HYBRID, "obb": OBB, "aabb": AABB}
"""The kinds of volume by name, with their numbers in the kernels."""

BOXES = ("obb", "aabb")
"""The kinds that are boxes. The radius of other kinds is the half thickness of a box."""

_EDGES = {"rss": 2, "lss": 1, "pss": 0, "hybrid": 2, "obb": 2, "aabb": 2}
"""How many half edges longer than 0 a core of each kind may have."""


Tree = MeshTree | BoxTree


class Coincident(NamedTuple):
    """Which vertices and triangles of a mesh coincided when its hierarchy was built."""

    first: NDArray[np.int32] | None
    """(n,) for each vertex the first one at the same place; None: all are at different places."""
    twins: NDArray[np.int32]
    """(k, 2) in tree order: a triangle that coincided with another one, and this other triangle."""


class Built(NamedTuple):
    """What `build` returns."""

    tree: Tree
    distinct: Tree
    """The same without volumes that hold only twins, for searches of the nearest triangle."""
    order: NDArray[np.int32]
    """(m,) the number of each triangle in tree order."""
    depth: int
    """The number of levels."""
    coincident: Coincident


def weld(vertices: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return (n,) for each vertex (n, 3) the first one with equal coordinates."""
    given = np.ascontiguousarray(vertices, np.float64)
    return first_equal((given + 0.0).view(np.int64))  # -0.0 becomes 0.0


def build(
    corners: NDArray[np.float64],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    volume: str = "rss",
    swept: float = 0.0,
    deviation: float = 0.0,
) -> Built:
    """Build the hierarchy over triangles.

    Coincidence is decided by coordinates, not by indices. So triangles that do not share vertices
    get the same hierarchy as if they did.

    Args:
        corners: (m, 9) metres; C-contiguous.
        vertices: (n, 3) metres; C-contiguous.
        faces: (m, 3) the vertices of the corners.
        volume: a key of VOLUMES.
        swept: metres; radius of the ball that sweeps the triangles.
        deviation: metres; how far they may be from the part that they stand for.
    """
    first = weld(vertices)
    if (first[1:] > first[:-1]).all():
        first = None
    else:
        faces = first.take(faces)
        faces.setflags(write=False)  # like the mesh's, so that kernels are compiled only once
    scale = _scale(corners, 0.0, swept, deviation)
    drawn = first_drawn(faces)
    leaves, distinct = pair_up(corners, faces, drawn, scale[0])
    children, order, depth = build_tree(corners, leaves, distinct)
    again = np.flatnonzero(drawn[order] != order)
    where = np.empty(len(order), np.int32)
    where[order] = np.arange(len(order), dtype=np.int32)
    twins = np.stack((again.astype(np.int32), where[drawn[order[again]]]), axis=1)
    faces = faces.take(order, axis=0)
    tree = _fitted(children, corners.take(order, axis=0), faces, scale, volume)
    return Built(
        tree, _distinct(tree, faces, twins), order.astype(np.int32), depth + 1,
        Coincident(first, twins),
    )  # fmt: skip


def refit(
    tree: Tree,
    coincident: Coincident,
    corners: NDArray[np.float64],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    volume: str,
) -> tuple[Tree, Tree]:
    """Return a hierarchy of the same structure over the same triangles, whose vertices moved.

    Args:
        tree: the hierarchy that was built.
        coincident: as `build` returned it.
        corners: (m, 9) metres, in tree order; C-contiguous. The new hierarchy keeps the array.
        vertices: (n, 3) metres.
        faces: (m, 3) the vertices of the corners, in tree order.
        volume: a key of VOLUMES.

    Returns:
        The new `Built.tree` and `Built.distinct`.
    """
    first = coincident.first
    if first is not None:
        # A vertex that has moved away from the first one of its old place counts for itself.
        there = (vertices == vertices.take(first, axis=0)).all(axis=1)
        faces = np.where(there, first, np.arange(len(first), dtype=np.int32)).take(faces)
    scale = _scale(corners, tree.scale[REVISION] + 1.0, *tree.scale[REVISION + 1 :])
    fitted = _fitted(tree.children, corners, faces, scale, volume)
    return fitted, _distinct(fitted, faces, coincident.twins)


def _distinct(tree: Tree, faces: NDArray[np.int32], twins: NDArray[np.int32]) -> Tree:
    """Return a hierarchy without volumes that hold only twins; the given one if there are none."""
    if len(twins) == 0:
        return tree
    nodes = without_twins(tree.nodes, tree.children, faces, twins)
    nodes.setflags(write=False)
    return tree._replace(nodes=nodes)


def _fitted(
    children: NDArray[np.int32],
    corners: NDArray[np.float64],
    faces: NDArray[np.int32],
    scale: NDArray[np.float64],
    volume: str,
) -> Tree:
    """Return the hierarchy of a given structure over triangles in tree order."""
    nodes, centres, sizes = fit_tree(corners, faces, children, scale[0], VOLUMES[volume])
    kind = BoxTree if volume in BOXES else MeshTree
    tree = kind(nodes, centres, children, sizes, corners, scale)
    for array in tree:
        array.setflags(write=False)
    return tree


def _scale(
    corners: NDArray[np.float64], revision: float, swept: float, deviation: float
) -> NDArray[np.float64]:
    """Return the `scale` (6,) of a hierarchy: see `MeshTree`."""
    given = corners.view()
    given.setflags(write=False)  # as in a tree, so that kernels are compiled only once
    _, largest, longest = measure(given, np.empty(3))
    # The unit is the least power of two not below `largest`: dividing by it is exact. frexp is used
    # because a rounded logarithm may give the power below. It is 1 if all is at the origin.
    share, power = math.frexp(largest)
    unit = math.ldexp(1.0, power - (share == 0.5)) if largest > 1e-300 else 1.0
    return np.array([unit, 1.0 / unit, longest, revision, swept, deviation])


class TreeError(AssertionError):
    """A hierarchy fails a check of `check_tree`."""


def check_tree(tree: Tree, volume: str = "rss") -> None:
    """Check that each volume holds its triangles and each triangle is in exactly one leaf.

    Args:
        tree: the hierarchy.
        volume: a key of VOLUMES. A line swept sphere may have one edge only, a point swept sphere
            none.

    Raises:
        TreeError: a check fails; the message says which, and in which node and lane.
    """
    if isinstance(tree, BoxTree) != (volume in BOXES):
        raise TreeError(f"{type(tree).__name__}: its volumes are to be {volume!r}")
    seen = np.zeros(len(tree.triangles), dtype=np.int64)
    _check_node(tree, 0, seen, _EDGES[volume])
    if not (seen == 1).all():
        wrong = int(np.flatnonzero(seen != 1)[0])
        raise TreeError(f"triangle {wrong} stands in {int(seen[wrong])} leaves")
    radii = tree.nodes.reshape(-1, FIELDS, WIDTH)[:, 9]
    reachable = (tree.children.reshape(-1, WIDTH) == EMPTY) & ~(radii <= EMPTY_RADIUS)
    if reachable.any():
        node, lane = np.argwhere(reachable)[0]
        raise TreeError(f"node {node} lane {lane}: unused, but a search could reach it")
    _check_scale(tree)


def _check_scale(tree: Tree) -> None:
    """Check that node units and metres agree, and that no corner exceeds the largest norm."""
    unit, inverse, longest = tree.scale[:3]
    if not (inverse * unit == 1.0 and np.abs(tree.triangles).max() <= unit):
        raise TreeError(f"scale: {unit} metres in a node unit, of which {inverse} in a metre")
    norms = np.sqrt((tree.triangles.reshape(-1, 3) ** 2).sum(axis=1))
    if not norms.max() <= longest:
        raise TreeError(f"scale: a corner lies {norms.max()} from the origin, beyond {longest}")


def _check_node(tree: Tree, node: int, seen: NDArray[np.int64], edges: int) -> NDArray[np.int64]:
    """Check a node and all nodes below it; return the triangles (tree order) that it holds."""
    lanes = tree.nodes[node * STRIDE : (node + 1) * STRIDE].reshape(FIELDS, WIDTH)
    lanes = lanes.astype(np.float64)
    held = []
    own = tree.children[node * WIDTH : (node + 1) * WIDTH]
    if own[0] < 0 and (own >= 0).any():
        raise TreeError(f"node {node} lane 0: a triangle, though the node is not a lowest one")
    for lane in range(WIDTH):
        child = int(tree.children[node * WIDTH + lane])
        if child == EMPTY:
            continue
        if child < 0:
            below = np.arange(first_of.py_func(child), last_of.py_func(child) + 1)
            seen[below] += 1
        else:
            below = _check_node(tree, child, seen, edges)
        held.append(below)
        _check_core(tree, node, lane, lanes[:, lane], edges)
        _check_volume(tree, node, lane, lanes[:, lane], below)
    return np.concatenate(held)


def _check_volume(
    tree: Tree, node: int, lane: int, volume: NDArray[np.float64], triangles: NDArray[np.int64]
) -> None:
    """Check that every corner lies in the volume, and the volume in the node's reach."""
    c = volume[0:3]
    corners = tree.triangles[triangles].reshape(-1, 3) / tree.scale[0]
    d = corners - (tree.centres[node, :3] + c)
    outside = (_outside_box if isinstance(tree, BoxTree) else _outside_swept)(volume, d)
    if not outside <= 0.0:
        raise TreeError(f"node {node} lane {lane}: a corner lies {outside} outside")
    reach = np.sqrt(c @ c) + volume[9:].sum()
    if not reach <= tree.centres[node, 3]:
        raise TreeError(f"node {node} lane {lane}: reaches {reach} beyond its node's reach")


def _outside_swept(volume: NDArray[np.float64], d: NDArray[np.float64]) -> float:
    """Return how far points (n, 3), relative to the centre, are beyond the radius at most."""
    u, v, (radius, a, b) = volume[3:6], volume[6:9], volume[9:]
    s, t = np.clip(d @ u, -a, a), np.clip(d @ v, -b, b)
    return float(np.sqrt(((d - np.outer(s, u) - np.outer(t, v)) ** 2).sum(axis=1)).max() - radius)


def _outside_box(volume: NDArray[np.float64], d: NDArray[np.float64]) -> float:
    """Return how far points (n, 3), relative to the centre, are beyond a side at most.

    Rounding left the axes not quite perpendicular, so coordinates are found by solving a system.
    """
    u, v, (thickness, a, b) = volume[3:6], volume[6:9], volume[9:]
    coordinates = np.linalg.solve(np.stack((u, v, np.cross(u, v)), axis=1), d.T)
    return float((np.abs(coordinates).max(axis=1) - (a, b, thickness)).max())


def _check_core(tree: Tree, node: int, lane: int, volume: NDArray[np.float64], edges: int) -> None:
    """Check that a core has the edges of its kind, perpendicular unit axes and the right size."""
    u, v = volume[3:6], volume[6:9]
    radius, a, b = volume[9:].tolist()
    if not (a >= 0.0 and b >= 0.0):
        raise TreeError(f"node {node} lane {lane}: half lengths {a} and {b} are not positive")
    used = int(a > 0.0) + int(b > 0.0)
    if used > edges:
        raise TreeError(f"node {node} lane {lane}: a core of {used} edges, expected {edges}")
    # SINGLE_MARGIN assumes this for angles and lengths.
    gram = np.array((u, v)) @ np.array((u, v)).T
    if not np.abs(gram - np.eye(2)).max() <= 4.0 * SINGLE_EPS:
        raise TreeError(f"node {node} lane {lane}: its axes are not perpendicular units")
    size = float(tree.sizes[node * WIDTH + lane, EXTENT])
    if not 1.5 * size >= a + b + radius:
        raise TreeError(f"node {node} lane {lane}: its size {size} is too small")
