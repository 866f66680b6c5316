"""Hierarchies and searches as tables of addresses, which Python passes to a kernel as one argument.

Passing an array from Python costs a tenth of a microsecond, and a model and a search have fifteen
arrays. A table (n, 2) holds the address of each array and its number of rows.
"""

from __future__ import annotations

import numpy as np
from numba.extending import intrinsic

from .addressed import Addressed, begins_at
from .jit import entry, implements, inlined
from .memory import addresses, records_at, rows_at
from .state import (
    CELL,
    CELL_PAIR,
    FAR,
    KEPT,
    MINIMUM,
    PROGRESS,
    QUERY,
    RING,
    BreadthFirst,
    DepthFirst,
    Dividing,
    Priority,
    State,
    Turning,
    Waiting,
)
from .trees import (
    ARC,
    CURVE_PIECE,
    PIECE,
    SEGMENT,
    TRIM,
    VECTORS,
    BoxTree,
    MeshTree,
    RevolutionTree,
    SurfaceTree,
    Trims,
)


def table(arrays):
    """Return the table of some arrays, int64 (n, 2). The caller must keep the arrays alive."""
    made = np.empty((len(arrays), 2), np.int64)
    _fill(arrays, made)
    return made


@entry
def _fill(arrays, made):
    """Write the table of a tuple of arrays; numpy takes ten times as long to give an address."""
    found = addresses(arrays)
    for i in range(len(made)):
        made[i, 0], made[i, 1] = found[i], found[len(made) + i]


_SINGLE, _DOUBLE, _INT, _LONG = np.float32, np.float64, np.int32, np.int64

_SHARED = {
    "nodes": (_SINGLE, 0), "centres": (_DOUBLE, 4), "children": (_INT, 0), "sizes": (_SINGLE, 2),
}  # fmt: skip
_OVER_TRIANGLES = _SHARED | {"triangles": (_DOUBLE, 9), "scale": (_DOUBLE, 0)}
_TRIMS = {
    "trims": (TRIM, 0), "rows": (_INT, 0), "entries": (_INT, 0), "segments": (SEGMENT, 0),
    "nets": (_DOUBLE, 0),
}  # fmt: skip
_OVER_PIECES = _SHARED | {
    "pieces": (PIECE, 0), "nets": (_DOUBLE, 0), "scale": (_DOUBLE, 0),
    "trims": Addressed(Trims, _TRIMS, readonly=True),
}  # fmt: skip
_PROFILE = {
    "arcs": (ARC, 0), "curves": (CURVE_PIECE, 0), "places": (_INT, 0), "frame": (_DOUBLE, 3),
    "samples": (_DOUBLE, 3), "reaches": (_DOUBLE, VECTORS),
}  # fmt: skip
"""Type and number of columns of each array of a tree, as kernels assume; 0 for one dimension."""

TREES = {
    kind: Addressed(kind, layout, readonly=True)
    for kind, layout in (
        (MeshTree, _OVER_TRIANGLES),
        (BoxTree, _OVER_TRIANGLES),
        (SurfaceTree, _OVER_PIECES),
        (RevolutionTree, _OVER_PIECES | _PROFILE),
    )
}
"""The layout of each kind of tree in a model's table, after its first row (the labels)."""

MODEL_ROWS = 1 + max(len(each.arrays) for each in TREES.values())
"""Rows of a model's table, the same for each kind, so that several tables make one array."""

_PIECES = 1 + len(TREES[MeshTree].arrays)
"""A row that is empty in the table of a tree over triangles, and in no other."""


def model_table(labels, tree, *more):
    """Return the table of a hierarchy: labels of its elements, its tree, and further arrays.

    `more` are the arrays that a RevolutionTree has in addition to a SurfaceTree.

    Raises:
        TypeError: an array does not have the type or shape that `tree_at` assumes.
    """
    arrays = (*arrays_of(tree), *more)
    own = TREES[RevolutionTree if more else type(tree)].arrays
    for array, (name, dtype, columns) in zip(arrays, own, strict=True):
        shape = (columns,) if columns else ()
        if array.dtype != dtype or array.shape[1:] != shape or not array.flags.c_contiguous:
            found = f"{name}: {array.dtype} {array.shape}"
            raise TypeError(f"{found}, expected {dtype} (n, {columns or ''})")
    made = np.zeros((MODEL_ROWS, 2), np.int64)
    made[: 1 + len(arrays)] = table((labels, *arrays))
    return made


def arrays_of(tree):
    """Yield the arrays of a tree in order."""
    for each in tree:
        if isinstance(each, tuple):
            yield from each
        else:
            yield each


@intrinsic
def _tree_in(typingctx, kind, model):
    """Return the tree in a model's table; `kind` is a key of TREES."""
    return begins_at(TREES[kind.instance_class], 1, kind, model)


@intrinsic
def seen_as(typingctx, kind, tree):
    """Return a tree as one of another type whose arrays are in the same rows of the table."""
    if not isinstance(tree, Addressed):
        return None

    def codegen(context, builder, signature, args):
        return args[1]

    return TREES[kind.instance_class](kind, tree), codegen


def is_tree_of(kind, model):
    """Return whether a model's table holds a tree of type `kind`; each kind implements this stub.

    It matters only for kinds whose models may come in either order (see pairs/entries.py). All
    other kinds return True.
    """


@implements(is_tree_of, (MeshTree, BoxTree, RevolutionTree))
@inlined
def _is_any(kind, model):
    return True


@implements(is_tree_of, SurfaceTree)
@inlined
def _is_over_pieces(kind, model):
    return model[_PIECES, 0] != 0


@inlined
def tree_at(kind, model):
    """Return the tree of type `kind` in a model's table, and the labels of its elements.

    A label is the caller's number of an element: for a triangle, its face.
    """
    return _tree_in(kind, model), rows_at(model[0, 0], model[0, 1], 0, np.int32(0))


@inlined
def revolution_of(tree):
    """Return a SurfaceTree over the patches of a solid of revolution as a RevolutionTree.

    The tree must have a profile.
    """
    return seen_as(RevolutionTree, tree)


@inlined
def has_profile(tree):
    """Return whether a SurfaceTree is over the patches of a solid of revolution."""
    return len(revolution_of(tree).arcs) > 0


_PAIRS = {"pairs": (_INT, 2), "bounds": (_DOUBLE, 0)}
_OPEN = {
    DepthFirst: _PAIRS,
    Priority: _PAIRS | {"frames": (_LONG, 0)},
    BreadthFirst: _PAIRS | {"spread_a": (_INT, KEPT), "spread_b": (_INT, KEPT)},
}
_LEAVES = {"lanes": (_INT, 2), "bounds": (_DOUBLE, 0)}
_CELLS = _LEAVES | {
    "pairs": (CELL_PAIR, 0), "cells_a": (CELL, 0), "nets_a": (_DOUBLE, 0), "roots_a": (_INT, 0),
    "cells_b": (CELL, 0), "nets_b": (_DOUBLE, 0), "roots_b": (_INT, 0),
}  # fmt: skip
_RINGS = _CELLS | {
    "rings": (RING, 0), "heap": (_INT, 0), "arcs_a": (ARC, 0), "arcs_b": (ARC, 0),
    "minima": (MINIMUM, 0), "front": (RING, 0),
}  # fmt: skip
_WAITING = {Waiting: _LEAVES, Dividing: _CELLS, Turning: _RINGS}
_SEARCH = {
    "motions": (_DOUBLE, 12), "progress": (PROGRESS, 0), "collected": (_DOUBLE, 3),
    "far": (FAR, 0),
}  # fmt: skip


def state_type(order, waiting):
    """Return the type of a State, given the types of its `open` and `waiting`."""
    inner = {"open": Addressed(order, _OPEN[order])}
    inner["waiting"] = Addressed(waiting, _WAITING[waiting])
    return Addressed(State, _SEARCH | inner)


@intrinsic
def state_at(typingctx, order, waiting, memory):
    """Return the State in a table that `state_table` made; `order` and `waiting` as above."""
    kind = state_type(order.instance_class, waiting.instance_class)
    return begins_at(kind, 0, order, waiting, memory)


@inlined
def queries_at(asked):
    """Return (as a tuple of one) the array of queries in a table.

    Passing an array of records from Python takes as long as passing six other arrays.
    """
    queries = records_at(asked[0, 0], asked[0, 1], QUERY)
    return (queries,)


def state_table(state):
    """Return the table of a State."""
    return table((*(getattr(state, name) for name in _SEARCH), *state.open, *state.waiting))
