"""Hierarchies and searches as tables of addresses: what Python hands to a kernel in one argument.

Each array that crosses from Python costs a tenth of a microsecond, and a model and a search are
fifteen of them. A table (2, n) holds the addresses of n arrays and how many rows each has.
"""

from __future__ import annotations

import numpy as np

from ..base.state import KEPT
from .jit import inlined
from .memory import read_only, rows_at
from .state import State, Tree


def table(arrays):
    """The table of some arrays, int64 (2, n); whoever keeps it has to keep them."""
    addresses = [array.__array_interface__["data"][0] for array in arrays]
    return np.array([addresses, [len(array) for array in arrays]], np.int64)


@inlined
def tree_at(model):
    """The hierarchy of a table of a Tree's arrays and the faces of its triangles, and the faces."""
    at, rows = model[0], model[1]
    tree = Tree(
        read_only(rows_at(at[0], rows[0], 0, np.float32(0.0))),
        read_only(rows_at(at[1], rows[1], 4, 0.0)),
        read_only(rows_at(at[2], rows[2], 0, np.int32(0))),
        read_only(rows_at(at[3], rows[3], 0, np.float32(0.0))),
        read_only(rows_at(at[4], rows[4], 9, 0.0)),
        read_only(rows_at(at[5], rows[5], 0, 0.0)),
    )
    return tree, rows_at(at[6], rows[6], 0, np.int32(0))


@inlined
def state_at(memory):
    """The search of a table of a State's arrays."""
    at, rows = memory[0], memory[1]
    return State(
        rows_at(at[0], rows[0], 12, 0.0),
        rows_at(at[1], rows[1], 0, 0.0),
        rows_at(at[2], rows[2], 0, np.int64(0)),
        rows_at(at[3], rows[3], 2, np.int32(0)),
        rows_at(at[4], rows[4], 0, 0.0),
        rows_at(at[5], rows[5], 0, np.int64(0)),
        rows_at(at[6], rows[6], 3, 0.0),
        rows_at(at[7], rows[7], KEPT, np.int32(0)),
        rows_at(at[8], rows[8], KEPT, np.int32(0)),
        rows_at(at[9], rows[9], 0, np.int64(0)),
        rows_at(at[10], rows[10], 0, 0.0),
    )
