"""A solid as one table of addresses, as `base/tables.py` has models and searches."""

from __future__ import annotations

import numpy as np

from ..base.addressed import arrays_at, constant
from ..base.jit import inlined
from ..base.memory import read_only, rows_at
from ..base.tables import MODEL_ROWS, TREES, table, tree_at
from ..base.trees import MeshTree
from .angles import MOMENTS
from .solids import Region

_REGION = MODEL_ROWS
"""The row from which on the table is about the region; a model's own table comes first."""

_RIM = _REGION + 2
"""... about the tree of its rim."""

_TRIANGLES = constant(TREES[MeshTree])


def solid_table(model, region, extent):
    """The table of a hierarchy of all triangles and its Region, int64 (n, 2).

    Args:
        model: the hierarchy's own table (see tables.py).
        region: where it has an inside.
        extent: (2,) float64; `inside` and `rim` of the region.

    Whoever keeps the table has to keep the arrays.
    """
    arrays = region.samples, region.ball, *region.rim_tree, region.moments, extent
    return np.concatenate((model, table(arrays)), axis=0)


@inlined
def solid_at(kind, solid):
    """The tree, which is of that type, the labels of its elements and the Region of a table."""
    tree, labels = tree_at(kind, solid)
    return tree, labels, region_at(solid)


@inlined
def region_at(solid):
    """The Region alone: a surface's tree may be of another kind."""
    extent = rows_at(solid[_REGION + 9, 0], solid[_REGION + 9, 1], 0, 0.0)
    return Region(
        np.int64(extent[0]),
        read_only(rows_at(solid[_REGION, 0], solid[_REGION, 1], 0, np.int32(0))),
        read_only(rows_at(solid[_REGION + 1, 0], solid[_REGION + 1, 1], 0, 0.0)),
        extent[1],
        arrays_at(_TRIANGLES, _RIM, solid),
        read_only(rows_at(solid[_REGION + 8, 0], solid[_REGION + 8, 1], MOMENTS, 0.0)),
    )
