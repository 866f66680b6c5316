"""Compiled entries that answer queries, by the kinds of both trees and the order of the search."""

from __future__ import annotations

from numba import boolean, float64, int64

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
    # Against swept spheres, boxes are treated as swept spheres.
    (MeshTree, BoxTree): _SWEPT,
    (BoxTree, MeshTree): _SWEPT,
    (SurfaceTree, SurfaceTree): _SURFACES,
    (SurfaceTree, MeshTree): _SURFACE_MESH,
    (SurfaceTree, BoxTree): _SURFACE_MESH,
    (MeshTree, SurfaceTree): _SURFACE_MESH,
    (BoxTree, SurfaceTree): _SURFACE_MESH,
    (RevolutionTree, RevolutionTree): _RINGS,
    # Against every other kind, solids of revolution are treated as their patches.
    (RevolutionTree, SurfaceTree): _SURFACES,
    (SurfaceTree, RevolutionTree): _SURFACES,
    **dict.fromkeys([(RevolutionTree, mesh) for mesh in MESHES], _SURFACE_MESH),
    **dict.fromkeys([(mesh, RevolutionTree) for mesh in MESHES], _SURFACE_MESH),
}
"""The entries by the types of both trees, then by the type that holds the open pairs, one for each
order of a search."""

_TABLE, _POSES = int64[:, ::1], float64[:, ::1]
ARGUMENTS = (
    int64[:, :, ::1], _TABLE, _POSES, _POSES, _TABLE, int64, int64, int64, int64, boolean,
    float64[::1],
)  # fmt: skip
"""The types of an entry's arguments; see `answer_queries`."""


def is_turned(kind_a, kind_b):
    """Return whether the entry for these types takes the second model as its first."""
    return kind_a in MESHES and kind_b not in MESHES
