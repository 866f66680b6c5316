"""Which compiled entries find the largest ball inside two solids, by the kinds of both."""

from __future__ import annotations

from collections import namedtuple

from ..base.jit import entry, specialised
from ..base.state import MeshTree, SurfaceTree
from ..inside.ball import search_ball
from ..inside.ball_begin import begin_ball
from ..inside.ball_feet import write_ball
from ..inside.ball_seeds import add_seeds
from ..surface import solid  # noqa: F401 - it implements what surfaces are asked for

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


BALLS = {
    (False, False): _MESHES,
    (True, True): _entries(SurfaceTree, SurfaceTree, "of_surfaces"),
    (True, False): _entries(SurfaceTree, MeshTree, "of_surface_and_mesh"),
}
"""By whether the first and the second solid are parametric surfaces. One that is comes first.
Whatever its volumes are, any mesh's are taken for swept spheres."""
