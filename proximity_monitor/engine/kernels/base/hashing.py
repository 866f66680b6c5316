"""One hash for every table of the engine."""

from __future__ import annotations

import numpy as np
from numba import uint64

from .jit import inlined

EMPTY_HASH = uint64(0)
"""The first `code` for `mixed`."""


@inlined
def mixed(code, value):
    """Return the hash of a sequence, from the hash `code` of all but its last integer, `value`.

    The upper bits are folded into the lower ones before the multiplication. Coordinates of drawings
    often differ only in their upper bits, and these do not affect the lower bits of a product.
    """
    code = uint64(code) ^ uint64(value)
    return (code ^ (code >> uint64(32))) * uint64(0x9E3779B97F4A7C15)


@inlined
def slot(code, size):
    """Return the first slot to probe for a hash, in a table of `size` slots, a power of two."""
    return np.int64((uint64(code) >> uint64(32)) & uint64(size - 1))


@inlined
def slots_for(count):
    """Return the number of slots of a table for `count` entries: at least half stay free."""
    size = 4
    while size < 2 * count:
        size *= 2
    return size
