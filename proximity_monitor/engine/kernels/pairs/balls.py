"""Which compiled entries find the largest ball inside two solids, by the kinds of both."""

from __future__ import annotations

from collections import namedtuple

from ..base.jit import entry, specialised
from ..base.trees import MeshTree, RevolutionTree, SurfaceTree
from ..inside.ball import search_ball
from ..inside.ball_begin import begin_ball
from ..inside.ball_feet import write_ball
from ..inside.ball_seeds import add_seeds
from ..revolution import solid  # noqa: F401 - it implements what surfaces are asked for, as well

Entries = namedtuple("Entries", "begin search write add_seeds")
"""What begins a search, goes on with it, writes what it found, and adds seeds."""

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
"""By the types of both solids' trees, in this order: of unlike ones the solid of revolution comes
first, and the mesh last. Whatever its volumes are, any mesh's are taken for swept spheres; a solid
of revolution beside a surface is taken for its patches.
"""
