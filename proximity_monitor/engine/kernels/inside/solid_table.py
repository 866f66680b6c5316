"""A solid as one table of addresses, like the tables of models and searches in base/tables.py."""

from __future__ import annotations

import numpy as np

from ..base.addressed import Addressed, arrays_at, constant
from ..base.jit import inlined
from ..base.tables import MODEL_ROWS, TREES, table, tree_at
from ..base.trees import MeshTree
from .angles import MOMENTS
from .solids import Region

_REGION = MODEL_ROWS
"""First row of the region in the table; the model's own table comes before it."""

_LAYOUT = {
    "samples": (np.int32, 0), "ball": (np.float64, 0), "box": (np.float64, 3),
    "rim_tree": TREES[MeshTree], "moments": (np.float64, MOMENTS), "extent": (np.float64, 0),
}  # fmt: skip
_ARRAYS = constant(Addressed(Region, _LAYOUT, readonly=True))
"""Layout of the region in the table: its arrays, and `extent`, which holds its two numbers."""

SOLID_ROWS = _REGION + len(_LAYOUT) - 1 + len(MeshTree._fields)
"""Number of rows of the table."""


def solid_table(model, region, extent):
    """Build the table, int64 (n, 2), of a hierarchy of all triangles and its Region.

    Args:
        model: the hierarchy's own table (see tables.py).
        region: its Region.
        extent: (2,) float64; `inside` and `rim` of the region.

    The caller must keep the arrays alive as long as the table.
    """
    arrays = region.samples, region.ball, region.box, *region.rim_tree, region.moments, extent
    return np.concatenate((model, table(arrays)), axis=0)


@inlined
def solid_at(kind, solid):
    """Return the tree (of type `kind`), the labels of its elements and the Region of a table."""
    tree, labels = tree_at(kind, solid)
    return tree, labels, region_at(solid)


@inlined
def region_at(solid):
    """Return the Region alone, for a table whose tree may be of any kind."""
    held = arrays_at(_ARRAYS, _REGION, solid)
    inside, rim = np.int64(held.extent[0]), held.extent[1]
    return Region(inside, held.samples, held.ball, held.box, rim, held.rim_tree, held.moments)
