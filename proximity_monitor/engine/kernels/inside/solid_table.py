"""A solid as one table of addresses, as `base/tables.py` has models and searches."""

from __future__ import annotations

import numpy as np

from ..base.addressed import Addressed, arrays_at, constant
from ..base.jit import inlined
from ..base.tables import MODEL_ROWS, TREES, table, tree_at
from ..base.trees import MeshTree
from .angles import MOMENTS
from .solids import Region

_REGION = MODEL_ROWS
"""The row from which on the table is about the region; a model's own table comes first."""

_LAYOUT = {
    "samples": (np.int32, 0), "ball": (np.float64, 0), "box": (np.float64, 3),
    "rim_tree": TREES[MeshTree], "moments": (np.float64, MOMENTS), "extent": (np.float64, 0),
}  # fmt: skip
_ARRAYS = constant(Addressed(Region, _LAYOUT, readonly=True))
"""What it says of the region: its arrays, and `extent`, its two numbers."""


def solid_table(model, region, extent):
    """The table of a hierarchy of all triangles and its Region, int64 (n, 2).

    Args:
        model: the hierarchy's own table (see tables.py).
        region: where it has an inside.
        extent: (2,) float64; `inside` and `rim` of the region.

    Whoever keeps the table has to keep the arrays.
    """
    arrays = region.samples, region.ball, region.box, *region.rim_tree, region.moments, extent
    return np.concatenate((model, table(arrays)), axis=0)


@inlined
def solid_at(kind, solid):
    """The tree, which is of that type, the labels of its elements and the Region of a table."""
    tree, labels = tree_at(kind, solid)
    return tree, labels, region_at(solid)


@inlined
def region_at(solid):
    """The Region alone: a surface's tree may be of another kind."""
    held = arrays_at(_ARRAYS, _REGION, solid)
    inside, rim = np.int64(held.extent[0]), held.extent[1]
    return Region(inside, held.samples, held.ball, held.box, rim, held.rim_tree, held.moments)
