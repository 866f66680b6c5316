"""Arrays that begin at a cache line.

A node is read in vectors as long as a cache line. If these lie across two lines each, a search
takes up to 5 % more time. numpy begins an array at any multiple of 16 bytes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LINE = 64
"""Bytes of a cache line."""


def in_lines(array: NDArray) -> NDArray:
    """Return an array, or if it begins within a cache line, a copy that does not; read-only."""
    if array.ctypes.data % LINE:
        space = np.empty(array.nbytes + LINE, np.uint8)
        first = -space.ctypes.data % LINE
        copy = space[first : first + array.nbytes].view(array.dtype).reshape(array.shape)
        copy[:] = array
        array = copy
    array.setflags(write=False)
    return array
