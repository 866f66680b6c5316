"""Compiled entries that find how deep a surface reaches into a solid, by the kinds of both."""

from __future__ import annotations

from ..base.jit import entry, specialised
from ..base.trees import MeshTree, SurfaceTree
from ..inside.deepest import begin_deepest, search_deepest, write_deepest
from ..surface import pieces, solid  # noqa: F401 - they implement stubs for surfaces
from . import mesh_mesh, surface_surface  # noqa: F401 - the same for elements


def _entries(kind_solid, kind_surface, name):
    kinds = {"SOLID": kind_solid, "SURFACE": kind_surface}
    return tuple(
        entry(specialised(each, f"{each.__name__}_{name}", __name__=__name__, **kinds))
        for each in (begin_deepest, search_deepest, write_deepest)
    )


DEPTHS = {
    (False, False): _entries(MeshTree, MeshTree, "triangles"),
    (False, True): _entries(MeshTree, SurfaceTree, "cells"),
    (True, False): _entries(SurfaceTree, MeshTree, "triangles_in_surface"),
    (True, True): _entries(SurfaceTree, SurfaceTree, "cells_in_surface"),
}
"""The kernels that begin a search, continue it, and write what it found. The key says whether the
solid is made of parametric surfaces, and whether the surface is one. The volumes of every mesh are
treated as swept spheres.
"""
