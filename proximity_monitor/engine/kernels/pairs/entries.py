"""Which compiled entry answers queries about two kinds of trees, in which order."""

from __future__ import annotations

from ..base.state import BreadthFirst, DepthFirst, Priority
from ..base.trees import MESHES, BoxTree, MeshTree, RevolutionTree, SurfaceTree
from . import mesh_mesh, revolution_revolution, surface_mesh, surface_surface

_SWEPT = {
    DepthFirst: mesh_mesh.search,
    Priority: mesh_mesh.search_nearest_first,
    BreadthFirst: mesh_mesh.search_by_levels,
}
_BOXES = {
    DepthFirst: mesh_mesh.search_boxes,
    Priority: mesh_mesh.search_boxes_nearest_first,
    BreadthFirst: mesh_mesh.search_boxes_by_levels,
}
_SURFACES = {
    DepthFirst: surface_surface.search,
    Priority: surface_surface.search_nearest_first,
    BreadthFirst: surface_surface.search_by_levels,
}
_SURFACE_MESH = {
    DepthFirst: surface_mesh.search,
    Priority: surface_mesh.search_nearest_first,
    BreadthFirst: surface_mesh.search_by_levels,
}
_RINGS = _SURFACES | {DepthFirst: revolution_revolution.search}

ENTRIES = {
    (MeshTree, MeshTree): _SWEPT,
    (BoxTree, BoxTree): _BOXES,
    # Against swept spheres, boxes are taken for such.
    (MeshTree, BoxTree): _SWEPT,
    (BoxTree, MeshTree): _SWEPT,
    (SurfaceTree, SurfaceTree): _SURFACES,
    (SurfaceTree, MeshTree): _SURFACE_MESH,
    (SurfaceTree, BoxTree): _SURFACE_MESH,
    (MeshTree, SurfaceTree): _SURFACE_MESH,
    (BoxTree, SurfaceTree): _SURFACE_MESH,
    (RevolutionTree, RevolutionTree): _RINGS,
    # Against all else, solids of revolution are taken for their patches.
    (RevolutionTree, SurfaceTree): _SURFACES,
    (SurfaceTree, RevolutionTree): _SURFACES,
    **dict.fromkeys([(RevolutionTree, mesh) for mesh in MESHES], _SURFACE_MESH),
    **dict.fromkeys([(mesh, RevolutionTree) for mesh in MESHES], _SURFACE_MESH),
}
"""By the types of both trees, and then by what a search in that order has open."""


def is_turned(kind_a, kind_b):
    """Whether the entry for these types takes the second model for its first one."""
    return kind_a in MESHES and kind_b not in MESHES
