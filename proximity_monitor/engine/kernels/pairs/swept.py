"""Bounds between hierarchies of swept spheres, whatever their elements.

Hierarchies of boxes use the same bounds, and only `tighten` them, lane by lane.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import implements, inlined
from ..base.state import Dividing, Waiting
from ..base.trees import BoxTree, MeshTree, SurfaceTree
from ..bounds.boxes import box_bounds
from ..bounds.cross import cross_nodes, left_between
from ..bounds.volumes import far_bound, lower_bounds, place, tighten
from ..search import stubs
from ..tree.layout import EMPTY, STRIDE, WIDTH

_SWEPT = MeshTree, SurfaceTree
_TREES = *_SWEPT, BoxTree


@implements(stubs.lane_bounds, _TREES, _TREES)
@inlined
def _lane_bounds(fixed, tree, lane, motions, node, slack, reach, inherited, scratch):
    single, found, motion = scratch.single, scratch.found, motions[0]
    if place(fixed, lane, motions, tree, node, slack, single):
        lower_bounds(tree.nodes, uint64(node * STRIDE), single, found, uint64(0))
        tighten(fixed, tree, lane, motion, node, slack, reach, found, np.int64(0))
        return inherited
    for k in range(WIDTH):
        empty = tree.children[node * WIDTH + k] == EMPTY
        found[k] = np.float32(1e30) if empty else np.float32(-1.0)
    return max(inherited, far_bound(fixed, lane, motion, tree, node, slack))


@implements(tighten, _SWEPT, _SWEPT)
@inlined
def _no_tighter(fixed, tree, lane, motion, node, slack, reach, bounds, first):
    pass


@implements(tighten, BoxTree, BoxTree)
@inlined
def _tighter(fixed, tree, lane, motion, node, slack, reach, bounds, first):
    box_bounds(fixed, lane, motion, tree, node, slack, reach, bounds, first)


implements(stubs.cross_leaves, _TREES, _TREES)(cross_nodes)


@implements(left_between, Waiting)
@implements(left_between, Dividing, SurfaceTree)
@inlined
def _all_are_left(waiting, tree, node, progress, limit, reaches):
    return (1 << WIDTH) - 1
