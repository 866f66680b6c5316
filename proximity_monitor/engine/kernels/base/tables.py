"""Hierarchies and searches as tables of addresses: what Python hands to a kernel in one argument.

Each array that crosses from Python costs a tenth of a microsecond, and a model and a search are
fifteen of them. A table (2, n) holds the addresses of n arrays and how many rows each has.
"""

from __future__ import annotations

import numpy as np

from .jit import entry, implements, inlined
from .memory import addresses, read_only, records_at, rows_at
from .state import (
    CELL,
    CELL_PAIR,
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
    """The table of some arrays, int64 (2, n); whoever keeps it has to keep them."""
    made = np.empty((2, len(arrays)), np.int64)
    _fill(arrays, made)
    return made


@entry
def _fill(arrays, made):
    """Write the table of a tuple of arrays: numpy itself takes ten times as long to tell it."""
    found = addresses(arrays)
    count = made.shape[1]
    for i in range(count):
        made[0, i], made[1, i] = found[i], found[count + i]


PROFILE_ARRAYS = 6
"""Arrays that a RevolutionTree has besides those of a SurfaceTree."""

_SHARED = {
    "nodes": (np.float32, 0), "centres": (np.float64, 4), "children": (np.int32, 0),
    "sizes": (np.float32, 2),
}  # fmt: skip
_OVER_TRIANGLES = _SHARED | {
    "triangles": (np.float64, 9), "scale": (np.float64, 0), "faces": (np.int32, 0),
}  # fmt: skip
_OVER_PIECES = _SHARED | {
    "pieces": (PIECE, 0), "nets": (np.float64, 0), "scale": (np.float64, 0),
    "trims": (TRIM, 0), "rows": (np.int32, 0), "entries": (np.int32, 0), "segments": (SEGMENT, 0),
    "curves": (np.float64, 0), "profile": (np.int64, PROFILE_ARRAYS), "patches": (np.int32, 0),
}  # fmt: skip
"""What kernels take each array for: its type, and its columns; 0 for one dimension."""

_PATCHES = len(_OVER_PIECES) - 1
"""The last column, which tables of trees over triangles leave empty."""

MODEL_COLUMNS = max(len(_OVER_TRIANGLES), len(_OVER_PIECES))
"""Columns of a model's table, whatever its kind, so that those of several make one array."""


def mesh_table(tree, faces):
    """The table of a tree over triangles and their faces.

    Raises:
        TypeError: an array is not what `tree_at` takes it for.
    """
    return _model_table((*tree, faces), _OVER_TRIANGLES)


def surface_table(tree, patches):
    """The table of a tree over pieces, and the patch of each; otherwise as `mesh_table`."""
    return _model_table((*arrays_of(tree), patches), _OVER_PIECES)


def arrays_of(tree):
    """The arrays of a tree, one after the other."""
    for each in tree:
        if isinstance(each, tuple):
            yield from each
        else:
            yield each


def _model_table(arrays, expected):
    for array, (name, (dtype, columns)) in zip(arrays, expected.items(), strict=True):
        shape = (columns,) if columns else ()
        if array.dtype != dtype or array.shape[1:] != shape or not array.flags.c_contiguous:
            found = f"{name}: {array.dtype} {array.shape}"
            raise TypeError(f"{found}, expected {np.dtype(dtype)} (n, {columns or ''})")
    made = np.zeros((2, MODEL_COLUMNS), np.int64)
    made[:, : len(arrays)] = table(arrays)
    return made


def tree_at(kind, model):
    """The hierarchy, a tree of that type, of a table of its arrays and labels; and the labels.

    A label says what an element is called outside: of a triangle its face. Each kind implements it.
    """


def is_tree_of(kind, model):
    """Whether `tree_at` makes a tree of that type of a table; each kind implements it.

    It matters where models of two kinds may come in either order (see pairs/entries.py): a kind of
    which that is not so says yes.
    """


@implements(is_tree_of, (MeshTree, BoxTree, RevolutionTree))
@inlined
def _is_any(kind, model):
    return True


@implements(is_tree_of, SurfaceTree)
@inlined
def _is_over_pieces(kind, model):
    return model[0, _PATCHES] != 0


@inlined
def mesh_tree_at(model, first):
    """The MeshTree whose arrays are the columns from `first` on of a table."""
    at, rows = model[0], model[1]
    return MeshTree(
        read_only(rows_at(at[first], rows[first], 0, np.float32(0.0))),
        read_only(rows_at(at[first + 1], rows[first + 1], 4, 0.0)),
        read_only(rows_at(at[first + 2], rows[first + 2], 0, np.int32(0))),
        read_only(rows_at(at[first + 3], rows[first + 3], 2, np.float32(0.0))),
        read_only(rows_at(at[first + 4], rows[first + 4], 9, 0.0)),
        read_only(rows_at(at[first + 5], rows[first + 5], 0, 0.0)),
    )


@implements(tree_at, MeshTree)
@inlined
def _mesh_at(kind, model):
    return mesh_tree_at(model, 0), rows_at(model[0, 6], model[1, 6], 0, np.int32(0))


@implements(tree_at, BoxTree)
@inlined
def _boxes_at(kind, model):
    tree = mesh_tree_at(model, 0)
    boxes = BoxTree(tree.nodes, tree.centres, tree.children, tree.sizes, tree.triangles, tree.scale)
    return boxes, rows_at(model[0, 6], model[1, 6], 0, np.int32(0))


@implements(tree_at, SurfaceTree)
@inlined
def _surface_at(kind, model):
    at, rows = model[0], model[1]
    tree = SurfaceTree(
        read_only(rows_at(at[0], rows[0], 0, np.float32(0.0))),
        read_only(rows_at(at[1], rows[1], 4, 0.0)),
        read_only(rows_at(at[2], rows[2], 0, np.int32(0))),
        read_only(rows_at(at[3], rows[3], 2, np.float32(0.0))),
        read_only(records_at(at[4], rows[4], PIECE)),
        read_only(rows_at(at[5], rows[5], 0, 0.0)),
        read_only(rows_at(at[6], rows[6], 0, 0.0)),
        Trims(
            read_only(records_at(at[7], rows[7], TRIM)),
            read_only(rows_at(at[8], rows[8], 0, np.int32(0))),
            read_only(rows_at(at[9], rows[9], 0, np.int32(0))),
            read_only(records_at(at[10], rows[10], SEGMENT)),
            read_only(rows_at(at[11], rows[11], 0, 0.0)),
        ),
        read_only(rows_at(at[12], rows[12], PROFILE_ARRAYS, np.int64(0))),
    )
    return tree, rows_at(at[13], rows[13], 0, np.int32(0))


@implements(tree_at, RevolutionTree)
@inlined
def _revolution_at(kind, model):
    tree, patches = _surface_at(SurfaceTree, model)
    return revolution_of(tree), patches


@inlined
def revolution_of(tree):
    """The solid of revolution whose patches a SurfaceTree is over; it must have a profile."""
    at, rows = tree.profile[0], tree.profile[1]
    return RevolutionTree(
        tree.nodes, tree.centres, tree.children, tree.sizes, tree.pieces, tree.nets, tree.scale,
        tree.trims, tree.profile,
        read_only(records_at(at[0], rows[0], ARC)),
        read_only(records_at(at[1], rows[1], CURVE_PIECE)),
        read_only(rows_at(at[2], rows[2], 0, np.int32(0))),
        read_only(rows_at(at[3], rows[3], 3, 0.0)),
        read_only(rows_at(at[4], rows[4], 3, 0.0)),
        read_only(rows_at(at[5], rows[5], VECTORS, 0.0)),
    )  # fmt: skip


def _open_at(order, at, rows):
    """What is open in a search of that order; each order implements it."""


@implements(_open_at, DepthFirst)
@inlined
def _stack_at(order, at, rows):
    return DepthFirst(
        rows_at(at[7], rows[7], 2, np.int32(0)),
        rows_at(at[8], rows[8], 0, 0.0),
    )


@implements(_open_at, Priority)
@inlined
def _queues_at(order, at, rows):
    return Priority(
        rows_at(at[7], rows[7], 2, np.int32(0)),
        rows_at(at[8], rows[8], 0, 0.0),
        rows_at(at[9], rows[9], 0, np.int64(0)),
    )


@implements(_open_at, BreadthFirst)
@inlined
def _levels_at(order, at, rows):
    return BreadthFirst(
        rows_at(at[7], rows[7], 2, np.int32(0)),
        rows_at(at[8], rows[8], 0, 0.0),
        rows_at(at[9], rows[9], KEPT, np.int32(0)),
        rows_at(at[10], rows[10], KEPT, np.int32(0)),
    )


def _waiting_at(kind, at, rows):
    """What waits in a search, of that type; each implements it."""


@implements(_waiting_at, Waiting)
@inlined
def _leaves_at(kind, at, rows):
    return Waiting(rows_at(at[2], rows[2], 2, np.int32(0)), rows_at(at[3], rows[3], 0, 0.0))


@implements(_waiting_at, Dividing)
@inlined
def _cells_at(kind, at, rows):
    return Dividing(
        rows_at(at[2], rows[2], 2, np.int32(0)),
        rows_at(at[3], rows[3], 0, 0.0),
        records_at(at[_CELLS], rows[_CELLS], CELL_PAIR),
        records_at(at[_CELLS + 1], rows[_CELLS + 1], CELL),
        rows_at(at[_CELLS + 2], rows[_CELLS + 2], 0, 0.0),
        rows_at(at[_CELLS + 3], rows[_CELLS + 3], 0, np.int32(0)),
        records_at(at[_CELLS + 4], rows[_CELLS + 4], CELL),
        rows_at(at[_CELLS + 5], rows[_CELLS + 5], 0, 0.0),
        rows_at(at[_CELLS + 6], rows[_CELLS + 6], 0, np.int32(0)),
    )


@implements(_waiting_at, Turning)
@inlined
def _rings_at(kind, at, rows):
    cells = _cells_at(Dividing, at, rows)
    return Turning(
        cells.lanes, cells.bounds, cells.pairs, cells.cells_a, cells.nets_a, cells.roots_a,
        cells.cells_b, cells.nets_b, cells.roots_b,
        records_at(at[_RINGS], rows[_RINGS], RING),
        rows_at(at[_RINGS + 1], rows[_RINGS + 1], 0, np.int32(0)),
        records_at(at[_RINGS + 2], rows[_RINGS + 2], ARC),
        records_at(at[_RINGS + 3], rows[_RINGS + 3], ARC),
        records_at(at[_RINGS + 4], rows[_RINGS + 4], MINIMUM),
        records_at(at[_RINGS + 5], rows[_RINGS + 5], RING),
    )  # fmt: skip


@inlined
def state_at(order, waiting, memory):
    """The search of a table of a State's arrays, as `state_table` makes it."""
    at, rows = memory[0], memory[1]
    return State(
        rows_at(at[0], rows[0], 12, 0.0),
        records_at(at[1], rows[1], PROGRESS),
        _open_at(order, at, rows),
        _waiting_at(waiting, at, rows),
        rows_at(at[4], rows[4], 3, 0.0),
        rows_at(at[5], rows[5], 0, np.int64(0)),
        rows_at(at[6], rows[6], 0, 0.0),
    )


@inlined
def queries_at(asked):
    """The queries of a table: records themselves take Python as long to hand over as six arrays."""
    queries = records_at(asked[0, 0], asked[1, 0], QUERY)
    return (queries,)


_CELLS, _RINGS, _COLUMNS = 11, 18, 24
"""Where the arrays of elements that are divided begin in the table of a state, and those of solids
of revolution; and how many columns there are."""


def state_table(state):
    """The table of a search."""
    s = state
    lanes, bounds, *cells = s.waiting
    shared = s.motions, s.progress, lanes, bounds, s.collected, s.keys, s.reaches
    unused = (s.reaches,) * (_CELLS - len(shared) - len(s.open))
    known = (*shared, *s.open, *unused, *cells)
    return table((*known, *(s.reaches,) * (_COLUMNS - len(known))))
