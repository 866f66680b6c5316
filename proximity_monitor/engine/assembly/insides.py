"""What many bodies enclose, as the kernels see it that settle signs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..kernels.base.state import SurfaceTree
from ..kernels.inside.contain import Insides
from ..kernels.inside.solids import WHOLE
from ..kernels.surface.contain import MixedInsides
from ..models.model import Model
from ..models.solid import sides_of


def insides_of(models: Sequence[Model], shapes: Sequence[Model]) -> Insides | MixedInsides:
    """The spaces that bodies enclose.

    Args:
        models: of each body its shape.
        shapes: the same shapes, each once.
    """
    regions = [sides_of(model).region for model in shapes]
    starts = np.cumsum([0, *(len(each.samples) for each in regions)])
    place = {id(model): k for k, model in enumerate(shapes)}
    of = np.array([place[id(model)] for model in models])
    insides = Insides(
        np.array([each.inside for each in regions], np.int8)[of],
        np.stack((starts[of], starts[of + 1]), axis=1),
        np.concatenate([each.samples for each in regions]),
        np.stack([model._hierarchy.sampled()[1] for model in models]),
    )
    divided = np.array([isinstance(model._hierarchy.tree, SurfaceTree) for model in models])
    if not (divided & (insides.where == WHOLE)).any():
        return insides
    holders = np.stack([model._hierarchy.table_of_all for model in models])
    return MixedInsides(*insides, holders, divided)
