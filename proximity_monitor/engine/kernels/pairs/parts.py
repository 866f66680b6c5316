"""The lazy parts of the searches depth first (see base/lazy.py), by their entries."""

from __future__ import annotations

from ..base.state import DepthFirst
from ..base.trees import MeshTree, RevolutionTree, SurfaceTree
from ..revolution.rings import search_rings
from .beyond_plane import lay_plane
from .divided import divide_some
from .entries import ENTRIES
from .mesh_in_ball import look_for_ball, look_for_plane
from .revolution_around import go_around
from .revolution_core import go_beside
from .revolution_mesh import go_down, open_beside

_BESIDE_MESHES = (
    go_down, lay_plane, look_for_plane, divide_some, look_for_ball, open_beside, go_around,
    go_beside,
)  # fmt: skip
_OF_PROFILES = {go_down, open_beside, go_around, go_beside}
_PARTS = {
    (SurfaceTree, SurfaceTree): (divide_some,),
    (SurfaceTree, MeshTree): _BESIDE_MESHES,
    (RevolutionTree, RevolutionTree): (search_rings,),
}

SEARCHES = {ENTRIES[kinds][DepthFirst]: (kinds, parts) for kinds, parts in _PARTS.items()}
"""For each entry with parts, the types of both trees, and the parts."""


def parts_of(entry, profile):
    """Return the parts that an entry's searches may need, those that many need first.

    PROFILE says whether a model may be a solid of revolution.
    """
    kinds, parts = SEARCHES.get(entry, ((), ()))
    return [each.parts[DepthFirst, *kinds] for each in parts if profile or each not in _OF_PROFILES]
