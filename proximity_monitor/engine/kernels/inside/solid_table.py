"""A solid as one table of addresses, as `base/tables.py` has models and searches."""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined
from ..base.memory import read_only, rows_at
from ..base.tables import MODEL_COLUMNS, mesh_tree_at, table, tree_at
from .angles import MOMENTS
from .solids import Region

_REGION = MODEL_COLUMNS
"""The column from which on the table is about the region; a model's own table comes first."""


def solid_table(model, region, extent):
    """The table of a hierarchy of all triangles and its Region, int64 (2, n).

    Args:
        model: the hierarchy's own table (see tables.py).
        region: where it has an inside.
        extent: (2,) float64; `inside` and `rim` of the region.

    Whoever keeps the table has to keep the arrays.
    """
    arrays = region.samples, region.ball, *region.rim_tree, region.moments, extent
    return np.concatenate((model, table(arrays)), axis=1)


@inlined
def solid_at(kind, solid):
    """The tree, which is of that type, the labels of its elements and the Region of a table."""
    tree, labels = tree_at(kind, solid)
    return tree, labels, region_at(solid)


@inlined
def region_at(solid):
    """The Region alone: a surface's tree may be of another kind."""
    at, rows = solid[0], solid[1]
    extent = rows_at(at[_REGION + 9], rows[_REGION + 9], 0, 0.0)
    return Region(
        np.int64(extent[0]),
        read_only(rows_at(at[_REGION], rows[_REGION], 0, np.int32(0))),
        read_only(rows_at(at[_REGION + 1], rows[_REGION + 1], 0, 0.0)),
        extent[1],
        mesh_tree_at(solid, _REGION + 2),
        read_only(rows_at(at[_REGION + 8], rows[_REGION + 8], MOMENTS, 0.0)),
    )
