"""Entries for the parts of searches that are compiled separately, each called as in its search.

No query uses these entries. To compile one is to compile the part, in parallel with the search that
needs it (see LATE).
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, specialised
from ..base.state import DepthFirst, Dividing, Turning
from ..base.tables import state_at, tree_at
from ..base.trees import MeshTree, RevolutionTree, SurfaceTree
from ..revolution.closest import nearest_under
from ..revolution.rings import search_rings
from ..search.stubs import divide, look_ahead
from ..surface.cells import divide_cell
from . import divided  # noqa: F401 - it implements the stub
from . import revolution_revolution as of_rings
from . import surface_mesh as across
from . import surface_surface as of_surfaces

KIND_A = KIND_B = WAITING = None
"""Placeholders. Each compiled entry substitutes its own types."""


def _profile(models, memory):
    """Find the point of a profile that is nearest to a point; arguments as for `_cells`."""
    tree, _ = tree_at(KIND_A, models[0])
    return nearest_under(tree, np.int64(0), 0.0, 0.0, 0.0, 0.0, 0.0, np.int64(0))


def _cell(models, memory):
    """Divide one cell of the first model; arguments as for `_cells`."""
    cells = state_at(DepthFirst, WAITING, memory).waiting
    tree, _ = tree_at(KIND_A, models[0])
    return divide_cell(tree, np.int64(0), cells.cells_a, cells.nets_a, np.int64(0), True, True)


def _cells(models, memory):
    """Divide the cells of two models; `models` (2, m, 2) are their tables, `memory` a state's."""
    state = state_at(DepthFirst, WAITING, memory)
    tree_a, _ = tree_at(KIND_A, models[0])
    tree_b, _ = tree_at(KIND_B, models[1])
    return divide(state.waiting, tree_a, tree_b, state, state.progress[0].steps)


def _ahead(models, memory):
    """Look for what dismisses many pairs of volumes at once; arguments as for `_cells`."""
    state = state_at(DepthFirst, WAITING, memory)
    tree_a, _ = tree_at(KIND_A, models[0])
    tree_b, _ = tree_at(KIND_B, models[1])
    return look_ahead(state.waiting, tree_a, tree_b, state)


def _rings(models, memory):
    """Search the rings of two models; arguments as for `_cells`."""
    state = state_at(DepthFirst, WAITING, memory)
    tree_a, _ = tree_at(KIND_A, models[0])
    tree_b, _ = tree_at(KIND_B, models[1])
    return search_rings(tree_a, tree_b, state)


def _part(function, name, kind_a, kind_b, waiting):
    kinds = {"KIND_A": kind_a, "KIND_B": kind_b, "WAITING": waiting}
    return entry(specialised(function, name, __name__=__name__, **kinds))


profile = _part(_profile, "profile", RevolutionTree, None, None)
cell = _part(_cell, "cell", SurfaceTree, None, Dividing)
surfaces = _part(_cells, "surfaces", SurfaceTree, SurfaceTree, Dividing)
surface_mesh = _part(_cells, "surface_mesh", SurfaceTree, MeshTree, Dividing)
surface_mesh_ahead = _part(_ahead, "surface_mesh_ahead", SurfaceTree, MeshTree, Dividing)
rings = _part(_rings, "rings", RevolutionTree, RevolutionTree, Turning)

LATE = {
    of_surfaces.search: (surfaces,),
    across.search: (surface_mesh, surface_mesh_ahead),
    of_rings.search: (rings,),
}
"""The parts of each search that it needs late enough for another process to compile them."""
