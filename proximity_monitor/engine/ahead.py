"""What is compiled ahead, side by side, by processes of their own (see kernels/base/ahead.py)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from queue import Empty, Queue
from threading import Thread
from typing import Any

import numpy as np
from numba import typeof
from numpy.typing import NDArray

from .kernels.base import ahead, cache, claims
from .kernels.base.trees import ARC, CURVE_PIECE, PIECE
from .kernels.inside import ball, solids
from .kernels.inside.contain import Insides, settle_signs
from .kernels.pairs import (
    late,
    mesh_mesh,
    revolution_revolution,
    surface_mesh,
    surface_surface,
)
from .kernels.revolution import build as arcs
from .kernels.revolution import reach
from .kernels.surface import limits
from .kernels.tree import build, fit_surface, fit_tree, pairing

Kernel = tuple[Any, tuple[Any, ...]]
"""An entry, and examples of its arguments: their types are what counts."""

_IDLE_S = 5.0
"""How long a process waits for something to do."""


def _meshes() -> Iterator[Kernel]:
    """What the distances of meshes need, those first that are needed late and take longest."""
    real, rows = 0.0, np.empty((0, 4))
    integers, lanes = np.empty((0, 2), np.int32), np.empty(0, np.int32)
    table, tables = np.empty((0, 2), np.int64), np.empty((0, 0, 2), np.int64)
    asked = tables, table, rows, rows, table, 0, 0, 1, 0, True, np.empty(0)
    yield mesh_mesh.search, asked
    yield fit_tree.fit_tree, (rows, integers, lanes, real, None)
    yield build.build_tree, (rows, integers, 0)
    yield pairing.pair_up, (rows, _frozen(integers), lanes, real)


def _watching() -> Iterator[Kernel]:
    """What watching a scene of meshes needs besides."""
    rows, integers = np.empty((0, 4)), np.empty((0, 2), np.int32)
    lanes, table = np.empty(0, np.int32), np.empty((0, 2), np.int64)
    tables = np.empty((0, 0, 2), np.int64)
    yield ball.search_ball, (tables, table, True, 0)
    signs, poses = np.empty(0, np.bool_), np.empty((0, 4, 4))
    insides = Insides(np.empty(0, np.int8), table, lanes, tables)
    progress, scratch = np.empty((2, 2), np.int64), np.empty((2, 2, 0), np.int32)
    settled = insides, poses, integers, rows, signs, 0, 0, 1, 0, progress, scratch, rows
    yield settle_signs, settled
    yield solids.part_volumes, (_frozen(rows), 0.0, lanes, lanes)


def _solids() -> Iterator[Kernel]:
    """What making a solid of revolution needs as soon as its profile is checked."""
    points, starts, children = np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, np.int32)
    yield fit_surface.fit_surface, (points, starts, _frozen(children), 0.0)
    yield arcs.build_arcs, (np.empty(0, CURVE_PIECE), 0.0, 0.0)
    yield limits.fit_limits, (np.empty(0, PIECE), np.empty(0), np.empty(0))
    yield reach.take_reaches, (np.empty(0, ARC), 0.0)


def _search(part: Any, search: Any) -> Callable[[], Iterator[Kernel]]:
    """A search of models with elements that are divided, and the part that it needs late."""

    def kernels() -> Iterator[Kernel]:
        rows, table = np.empty((0, 4)), np.empty((0, 2), np.int64)
        yield part, (np.empty((2, 0, 2), np.int64), table)
        asked = np.empty((0, 0, 2), np.int64), table, rows, rows, table, 0, 0, 1, 0, True
        yield search, (*asked, np.empty(0))

    return kernels


_OF_SURFACES = _search(late.surfaces, surface_surface.search)
_ACROSS = _search(late.surface_mesh, surface_mesh.search)

FORESEEN: tuple[tuple[set[str], Callable[[], Iterator[Kernel]]], ...] = (
    ({"solid of revolution"}, _solids),
    ({"surface", "mesh"}, _ACROSS),
    ({"solid of revolution", "mesh"}, _ACROSS),
    ({"surface"}, _OF_SURFACES),
    ({"solid of revolution"}, _search(late.rings, revolution_revolution.search)),
    ({"mesh"}, _meshes),
    ({"mesh", ahead.WATCHING}, _watching),
)
"""What is compiled, in this order, once all of these are wanted: kinds of models, and WATCHING.
What is wanted later goes before what is left then, if it stands above."""


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """A view that is not written to: of another type for a kernel."""
    view = array.view()
    view.setflags(write=False)
    return view


def work(directory: str) -> None:
    """Compile what is wanted and no other process compiles, and keep it in a directory.

    The names of what is wanted come by the standard input, a line each; it ends at once when that
    does, or when it has had nothing to do for a while.
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


def _compile(kernel: Any, arguments: tuple[Any, ...]) -> None:
    """Compile a kernel that no process has or compiles."""
    types = tuple(typeof(argument) for argument in arguments)
    if kernel._cache.is_wanting(types, kernel.targetctx):
        with suppress(Exception):  # whoever needs it compiles it, and says what is wrong
            kernel.compile(types)


def _listen(names: Queue[str]) -> None:
    """Hand on what is wanted, until the process that began this one has ended; then end."""
    left = b""
    while read := os.read(0, 4096):  # not by sys.stdin, which would keep its lock at the end
        *lines, left = (left + read).split(b"\n")
        for line in lines:
            names.put(line.decode())
    with claims.writing:
        os._exit(0)
