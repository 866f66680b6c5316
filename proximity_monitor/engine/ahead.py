"""What is compiled ahead, side by side, by processes of their own (see kernels/base/ahead.py)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from threading import Thread
from typing import Any

import numpy as np
from numba import typeof
from numpy.typing import NDArray

from .kernels.base import ahead, cache, claims
from .kernels.inside import ball, solids
from .kernels.inside.contain import Insides, settle_signs
from .kernels.pairs import mesh_mesh
from .kernels.tree import build, fit_tree, pairing

Kernel = tuple[Any, tuple[Any, ...]]
"""An entry, and examples of its arguments: their types are what counts."""


def kernels(watching: bool) -> Iterator[Kernel]:
    """The kernels that take long to compile, those first that are needed late and take longest.

    All questions about the distances of meshes need some of them, `watching` a scene the rest.
    """
    real, reals, rows = 0.0, np.empty(0), np.empty((0, 4))
    integers, lanes = np.empty((0, 2), np.int32), np.empty(0, np.int32)
    table = np.empty((2, 0), np.int64)
    tables = np.empty((0, 2, 0), np.int64)
    asked = tables, table, rows, rows, table, 0, 0, 1, 0, True, reals
    yield mesh_mesh.search, asked
    frozen_rows = _frozen(rows)
    if watching:
        yield ball.search_ball, (tables, table, True, 0)
        signs, poses = np.empty(0, np.bool_), np.empty((0, 4, 4))
        insides = Insides(np.empty(0, np.int8), table, lanes, tables)
        progress, scratch = np.empty((2, 2), np.int64), np.empty((2, 2, 0), np.int32)
        settled = insides, poses, integers, rows, signs, 0, 0, 1, 0, progress, scratch, rows
        yield settle_signs, settled
        yield solids.part_volumes, (frozen_rows, real, lanes, lanes)
    yield fit_tree.fit_tree, (rows, integers, lanes, real, None)
    yield build.build_tree, (rows, integers, 0)
    yield pairing.pair_up, (rows, _frozen(integers), lanes, real)


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """A view that is not written to: of another type for a kernel."""
    view = array.view()
    view.setflags(write=False)
    return view


def work(directory: str, watching: bool) -> None:
    """Compile what no other process does, and keep it in a directory.

    Ends at once when the standard input does.
    """
    Thread(target=_end_with_parent, daemon=True).start()
    ahead.not_here()
    if str(cache.CACHE_DIRECTORY) != directory:
        return
    for kernel, arguments in kernels(watching):
        types = tuple(typeof(argument) for argument in arguments)
        if kernel._cache.is_wanting(types, kernel.targetctx):
            with suppress(Exception):  # whoever needs it compiles it, and says what is wrong
                kernel.compile(types)


def _end_with_parent() -> None:
    """Wait until the process that began this one has ended, and end."""
    while os.read(0, 1):  # not by sys.stdin, which would keep its lock when the interpreter ends
        pass
    with claims.writing:
        os._exit(0)
