"""One hash for every table of the engine."""

from __future__ import annotations

import numpy as np
from numba import uint64

from .jit import inlined

EMPTY_HASH = uint64(0)
"""What `mixed` begins with."""


@inlined
def mixed(code, value):
    """A hash of what `code` is one of and one more integer.

    Folded before it is multiplied: the coordinates of drawings differ in their upper bits alone,
    and a product's lower bits know nothing of those.
    """
    code = uint64(code) ^ uint64(value)
    return (code ^ (code >> uint64(32))) * uint64(0x9E3779B97F4A7C15)


@inlined
def slot(code, size):
    """Where a table of so many slots, a power of two, begins to look for what has a hash."""
    return np.int64((uint64(code) >> uint64(32)) & uint64(size - 1))


@inlined
def slots_for(count):
    """How many slots a table for so many entries has, half of them free."""
    size = 4
    while size < 2 * count:
        size *= 2
    return size
