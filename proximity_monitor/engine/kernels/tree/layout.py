"""The memory layout of a hierarchy: the lanes of a node, and the encoding of a lane's child.

A child is a node (>= 0), a leaf of one or two triangles, or nothing. Two triangles that share an
edge and are nearly coplanar mostly fill the rectangle around them, like a quadrilateral; a single
triangle fills half of its rectangle. So a leaf holds two triangles if possible: there are half as
many leaves to bound, and the bounds are as tight.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import inlined, kernel

WIDTH = 16
"""Lanes of a node: one AVX-512 register of float32. LLVM does not vectorise a loop over 8."""

FIELDS = 12
"""Numbers per lane: centre 3, û 3, v̂ 3, radius, half lengths along û and v̂; node units."""

STRIDE = WIDTH * FIELDS
"""Numbers per node: field f of lane k is at `node * STRIDE + f * WIDTH + k`."""

EMPTY_RADIUS = -1e30
"""Radius of an unused lane: its bound is beyond every distance, so it is always pruned."""

CENTRE_X, CENTRE_Y, CENTRE_Z = uint64(0), uint64(WIDTH), uint64(2 * WIDTH)
U_X, U_Y, U_Z = uint64(3 * WIDTH), uint64(4 * WIDTH), uint64(5 * WIDTH)
V_X, V_Y, V_Z = uint64(6 * WIDTH), uint64(7 * WIDTH), uint64(8 * WIDTH)
RADIUS, HALF_U, HALF_V = uint64(9 * WIDTH), uint64(10 * WIDTH), uint64(11 * WIDTH)
"""Offsets of a lane's fields from that of its centre's x. They are `uint64`: see `lower_bounds`.
For a box, RADIUS is the half thickness."""

EMPTY = -(2**31)
"""Child of an unused lane."""

EXTENT, PROMISE = 0, 1
"""Columns of a tree's sizes: how large a volume is, and what opening it promises (promise.py)."""

LARGEST = 2
"""Most triangles of a leaf."""


@inlined
def leaf(first, count):
    """Return the child code of a leaf of `count` triangles, from `first` on in tree order."""
    return ~(2 * first + (count - 1))


@inlined
def first_of(child):
    """Return the first triangle of a leaf."""
    return ~child >> 1


@inlined
def last_of(child):
    """Return the last triangle of a leaf."""
    return (~child >> 1) + (~child & 1)


@inlined
def radius_of(tree):
    """Return the radius (m) of a sphere that holds a model, about the centre of node 0."""
    return tree.centres[0, 3] * tree.scale[0]


@kernel
def row(array, i):
    """Return the first three numbers of a row."""
    return (array[i, 0], array[i, 1], array[i, 2])


@kernel
def read_vector(nodes, base):
    """Return three consecutive fields of a lane as float64.

    `base` is the lane's for its centre; add U_X or V_X for an axis.
    """
    return (
        np.float64(nodes[base + CENTRE_X]),
        np.float64(nodes[base + CENTRE_Y]),
        np.float64(nodes[base + CENTRE_Z]),
    )
