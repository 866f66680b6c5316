"""The hierarchy of a model: how it is built from triangles, and the proof that it is right."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .kernels.build import EMPTY, build_tree
from .kernels.state import Tree
from .kernels.volumes import FIELDS, STRIDE, WIDTH


def build(corners: NDArray[np.float64]) -> tuple[Tree, NDArray[np.int32], int]:
    """Build the hierarchy over triangles.

    Args:
        corners: (m, 9) metres; C-contiguous.

    Returns:
        The hierarchy, (m,) which triangle stands where in tree order, and the number of levels.
    """
    largest = float(np.abs(corners).max())
    # A power of two: dividing by it is exact. Zero for a model at the origin alone.
    unit = 2.0 ** np.ceil(np.log2(largest)) if largest > 1e-300 else 1.0
    nodes, centres, children, sizes, order, depth = build_tree(corners, unit)
    norms = np.sqrt((corners.reshape(-1, 3) ** 2).sum(axis=1))
    scale = np.array([unit, 1.0 / unit, norms.max()])
    triangles = np.ascontiguousarray(corners[order])
    tree = Tree(nodes, centres, children, sizes, triangles, scale)
    for array in tree:
        array.setflags(write=False)
    return tree, order.astype(np.int32), depth + 1


class TreeError(AssertionError):
    """A hierarchy does not contain what it should."""


def check_tree(tree: Tree) -> None:
    """Prove that each volume contains its triangles and each triangle stands in exactly one leaf.

    Raises:
        TreeError: naming the node and the lane.
    """
    seen = np.zeros(len(tree.triangles), dtype=np.int64)
    _check_node(tree, 0, seen)
    if not (seen == 1).all():
        wrong = int(np.flatnonzero(seen != 1)[0])
        raise TreeError(f"triangle {wrong} stands in {int(seen[wrong])} leaves")


def _check_node(tree: Tree, node: int, seen: NDArray[np.int64]) -> NDArray[np.int64]:
    """Check one node and all below; returns the triangles (tree order) that it holds."""
    lanes = tree.nodes[node * STRIDE : (node + 1) * STRIDE].reshape(FIELDS, WIDTH)
    lanes = lanes.astype(np.float64)
    held = []
    for lane in range(WIDTH):
        child = int(tree.children[node * WIDTH + lane])
        if child == EMPTY:
            continue
        if child < 0:
            below = np.array([~child])
            seen[~child] += 1
        else:
            below = _check_node(tree, child, seen)
        held.append(below)
        _check_volume(tree, node, lane, lanes[:, lane], below)
    return np.concatenate(held)


def _check_volume(
    tree: Tree, node: int, lane: int, volume: NDArray[np.float64], triangles: NDArray[np.int64]
) -> None:
    """Every corner lies within the radius of the rectangle, and the volume within the reach."""
    c, u, v, radius = volume[0:3], volume[3:6], volume[6:9], volume[9]
    corners = tree.triangles[triangles].reshape(-1, 3) / tree.scale[0]
    d = corners - tree.centres[node, :3] - c
    s = np.clip(d @ u / max(u @ u, 1e-300), -1.0, 1.0)
    t = np.clip(d @ v / max(v @ v, 1e-300), -1.0, 1.0)
    distance = np.sqrt(((d - np.outer(s, u) - np.outer(t, v)) ** 2).sum(axis=1)).max()
    if distance > radius:
        raise TreeError(f"node {node} lane {lane}: a corner lies {distance - radius:g} outside")
    if abs(u @ v) > 1e-5 * np.sqrt((u @ u) * (v @ v)):
        raise TreeError(f"node {node} lane {lane}: the rectangle's edges are not perpendicular")
    reach = sum(np.sqrt(x @ x) for x in (c, u, v)) + radius
    if reach > tree.centres[node, 3]:
        raise TreeError(f"node {node} lane {lane}: reaches {reach} beyond its node's reach")
