"""Compiled entries that find the largest ball inside two solids, by the kinds of both."""

from __future__ import annotations

from collections import namedtuple

from ..base.jit import entry, specialised
from ..base.trees import MeshTree, RevolutionTree, SurfaceTree
from ..inside.ball import search_ball
from ..inside.ball_begin import begin_ball
from ..inside.ball_feet import write_ball
from ..inside.ball_seeds import add_seeds
from ..revolution import solid  # noqa: F401 - it implements stubs for these solids

Entries = namedtuple("Entries", "begin search write add_seeds")
"""The kernels that begin a search, continue it, write what it found, and add seeds."""

_MESHES = Entries(begin_ball, search_ball, write_ball, add_seeds)


def _entries(first, second, name):
    kinds = {"KIND_A": first, "KIND_B": second}
    return Entries(*(
        entry(specialised(each.py_func, f"{each.py_func.__name__}_{name}", __name__=__name__,
                          **kinds))
        for each in _MESHES
    ))  # fmt: skip


_SURFACES = _entries(SurfaceTree, SurfaceTree, "of_surfaces")

BALLS = {
    (MeshTree, MeshTree): _MESHES,
    (SurfaceTree, MeshTree): _entries(SurfaceTree, MeshTree, "of_surface_and_mesh"),
    (SurfaceTree, SurfaceTree): _SURFACES,
    (RevolutionTree, MeshTree): _entries(RevolutionTree, MeshTree, "of_revolution_and_mesh"),
    (RevolutionTree, SurfaceTree): _SURFACES,
    (RevolutionTree, RevolutionTree): _entries(RevolutionTree, RevolutionTree, "of_revolutions"),
}
"""The entries by the tree types of both solids. Of two unlike types, the solid of revolution comes
first and the mesh last. The volumes of every mesh are treated as swept spheres. A solid of
revolution beside a surface is treated as its patches.
"""
