"""Which compiled entries find how deep a surface reaches into a solid, by the surface's kind."""

from __future__ import annotations

from ..base.jit import entry, specialised
from ..base.state import BoxTree, MeshTree, SurfaceTree
from ..inside.deepest import begin_deepest, search_deepest, write_deepest
from ..surface import pieces  # noqa: F401 - it implements what pieces of surfaces are asked for
from . import mesh_mesh, surface_surface  # noqa: F401 - the same for points of elements


def _entries(kind, name):
    return tuple(
        entry(specialised(each, f"{each.__name__}_{name}", __name__=__name__, SURFACE=kind))
        for each in (begin_deepest, search_deepest, write_deepest)
    )


_OVER_TRIANGLES = _entries(MeshTree, "triangles")

DEPTHS = {
    MeshTree: _OVER_TRIANGLES,
    BoxTree: _OVER_TRIANGLES,  # whatever the volumes are: boxes may be taken for swept spheres
    SurfaceTree: _entries(SurfaceTree, "cells"),
}
"""What begins a search, goes on with it, and writes what it found."""
