"""Which kernels separate processes compile ahead, in parallel (see kernels/base/ahead.py)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from queue import Empty, Queue
from threading import Thread
from typing import Any

import numpy as np
from numba import boolean, float64, from_dtype, int64, typeof, types
from numpy.typing import NDArray

from .kernels.base import ahead, cache, claims
from .kernels.base.cache import kernel_name
from .kernels.base.state import CELL
from .kernels.base.tables import TREES
from .kernels.base.trees import ARC, CURVE_PIECE, PIECE, RevolutionTree, SurfaceTree
from .kernels.inside import ball, solids
from .kernels.inside.contain import Insides, settle_signs
from .kernels.pairs import mesh_mesh, revolution_revolution, surface_mesh, surface_surface
from .kernels.pairs.entries import ARGUMENTS
from .kernels.pairs.parts import SEARCHES, parts_of
from .kernels.revolution import build as arcs
from .kernels.revolution import reach
from .kernels.revolution.closest import nearest_under
from .kernels.surface import limits
from .kernels.surface.cells import divide_cell
from .kernels.tree import build, fit_surface, fit_tree, pairing

Kernel = tuple[Any, tuple[types.Type, ...]]
"""A compiled function and the types of its arguments."""

_IDLE_S = 5.0
"""How many seconds an idle process waits before it ends."""


def _meshes() -> Iterator[Kernel]:
    """Yield the kernels for distances of meshes: first those needed late that take longest."""
    real, rows = 0.0, np.empty((0, 4))
    integers, lanes = np.empty((0, 2), np.int32), np.empty(0, np.int32)
    yield mesh_mesh.search, ARGUMENTS
    yield _like(fit_tree.fit_tree, rows, integers, lanes, real, None)
    yield _like(build.build_tree, rows, integers, 0)
    yield _like(pairing.pair_up, rows, _frozen(integers), lanes, real)


def _watching() -> Iterator[Kernel]:
    """Yield the further kernels for watching a scene of meshes."""
    rows, integers = np.empty((0, 4)), np.empty((0, 2), np.int32)
    lanes, table = np.empty(0, np.int32), np.empty((0, 2), np.int64)
    tables = np.empty((0, 0, 2), np.int64)
    yield _like(ball.search_ball, tables, table, True, 0)
    signs, poses = np.empty(0, np.bool_), np.empty((0, 4, 4))
    insides = Insides(np.empty(0, np.int8), table, lanes, tables)
    progress, scratch = np.empty((2, 2), np.int64), np.empty((2, 2, 0), np.int32)
    settled = insides, poses, integers, rows, signs, 0, 0, 1, 0, progress, scratch, rows
    yield _like(settle_signs, *settled)
    yield _like(solids.part_volumes, _frozen(rows), 0.0, lanes, lanes)


def _solids() -> Iterator[Kernel]:
    """Yield the kernels that building a solid of revolution needs once its profile is checked."""
    points, starts, children = np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, np.int32)
    yield _like(fit_surface.fit_surface, points, starts, _frozen(children), 0.0)
    yield _like(arcs.build_arcs, np.empty(0, CURVE_PIECE), 0.0, 0.0)
    yield _like(limits.fit_limits, np.empty(0, PIECE), np.empty(0), np.empty(0))
    yield _like(reach.take_reaches, np.empty(0, ARC), 0.0)


def _point() -> Iterator[Kernel]:
    """Yield what finds the point of a profile that is nearest to a point."""
    yield nearest_under, (TREES[RevolutionTree], int64, *[float64] * 5, int64)


def _cell() -> Iterator[Kernel]:
    """Yield what divides a cell of a surface."""
    cells = from_dtype(CELL)[::1]
    yield divide_cell, (TREES[SurfaceTree], int64, cells, float64[::1], int64, boolean, boolean)


def _search(entry: Any, profile: bool = False) -> Callable[[], Iterator[Kernel]]:
    """Return a function that yields the lazy parts of a search, and the search."""

    def kernels() -> Iterator[Kernel]:
        for part in parts_of(entry, profile):
            yield part.kernel, part.arguments
        yield entry, ARGUMENTS

    return kernels


_BESIDE_MESHES = surface_mesh.search

FORESEEN: tuple[tuple[set[str], Callable[[], Iterator[Kernel]]], ...] = (
    (
        {kernel_name(_BESIDE_MESHES.py_func), "solid of revolution"},
        _search(_BESIDE_MESHES, profile=True),
    ),
    *(({kernel_name(search.py_func)}, _search(search)) for search in SEARCHES),
    ({"solid of revolution"}, _solids),
    # Two searches need either. Until it is compiled, the first question mostly shows which.
    ({"solid of revolution"}, _point),
    ({"surface"}, _cell),
    ({"surface", "mesh"}, _search(_BESIDE_MESHES)),
    ({"solid of revolution", "mesh"}, _search(_BESIDE_MESHES, profile=True)),
    ({"surface"}, _search(surface_surface.search)),
    ({"solid of revolution"}, _search(revolution_revolution.search)),
    ({"mesh"}, _meshes),
    ({"mesh", ahead.WATCHING}, _watching),
)
"""Each row: the names that must all be wanted, and the kernels to compile then. A name is a kind of
model, WATCHING, or an entry that a question is waiting for. The topmost wanted row with kernels
left goes first, also if it is wanted later."""


def _like(kernel: Any, *arguments: Any) -> Kernel:
    """Return a kernel for arguments of the types of these examples."""
    return kernel, tuple(map(typeof, arguments))


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only view, which has a type of its own for numba."""
    view = array.view()
    view.setflags(write=False)
    return view


def work(directory: str) -> None:
    """Compile the wanted kernels that no other process compiles, and cache them in a directory.

    The wanted names arrive on standard input, one per line. The process ends at once when its
    standard input ends, and after `_IDLE_S` without work. It does nothing if its own cache is
    in another directory.
    """
    ahead.not_here()
    if str(cache.CACHE_DIRECTORY) != directory:
        return
    names: Queue[str] = Queue()
    Thread(target=_listen, args=(names,), daemon=True).start()
    wanted: set[str] = set()
    foreseen = [(needs, list(kernels())) for needs, kernels in FORESEEN]
    with suppress(Empty):
        while True:
            while not names.empty():
                wanted.add(names.get())
            if left := next((left for needs, left in foreseen if left and needs <= wanted), None):
                _compile(*left.pop(0))
            else:
                wanted.add(names.get(timeout=_IDLE_S))


def _compile(kernel: Any, arguments: tuple[types.Type, ...]) -> None:
    """Compile a kernel unless it is cached or another process compiles it."""
    if kernel._cache.is_wanting(arguments, kernel.targetctx):
        with suppress(Exception):  # the process that needs it compiles it and reports the error
            kernel.compile(arguments)


def _listen(names: Queue[str]) -> None:
    """Put wanted names into the queue until the parent process ends; then end this process."""
    left = b""
    while read := os.read(0, 4096):  # not sys.stdin, whose lock this thread would hold at exit
        *lines, left = (left + read).split(b"\n")
        for line in lines:
            names.put(line.decode())
    with claims.writing:
        os._exit(0)
