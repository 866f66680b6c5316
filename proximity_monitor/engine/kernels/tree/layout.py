"""How a hierarchy lies in memory: the lanes of a node, and what the child of a lane says.

A child is a node (>= 0), a leaf of one or two triangles, or nothing. Two triangles that share an
edge and are flat together mostly fill the rectangle around them, as a quadrilateral does; one alone
fills half of it. So a leaf holds two where it can: there is half as much to bound, and it is
bounded as tightly.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import inlined, kernel

WIDTH = 16
"""Lanes of a node: one AVX-512 register of float32. LLVM does not vectorise a loop over 8."""

FIELDS = 12
"""Numbers of a lane: centre 3, û 3, v̂ 3, radius, half lengths along û and v̂; node units."""

STRIDE = WIDTH * FIELDS
"""Numbers of a node: field f of lane k stands at `node * STRIDE + f * WIDTH + k`."""

EMPTY_RADIUS = -1e30
"""Radius of an unused lane: its bound is beyond every distance, so it never survives."""

CENTRE_X, CENTRE_Y, CENTRE_Z = uint64(0), uint64(WIDTH), uint64(2 * WIDTH)
U_X, U_Y, U_Z = uint64(3 * WIDTH), uint64(4 * WIDTH), uint64(5 * WIDTH)
V_X, V_Y, V_Z = uint64(6 * WIDTH), uint64(7 * WIDTH), uint64(8 * WIDTH)
RADIUS, HALF_U, HALF_V = uint64(9 * WIDTH), uint64(10 * WIDTH), uint64(11 * WIDTH)
"""Where the fields of a lane stand, from that of its centre's x on. They are `uint64`: see
`lower_bounds`. Of a box RADIUS is the half thickness."""

EMPTY = -(2**31)
"""Child of an unused lane."""

EXTENT, PROMISE = 0, 1
"""Columns of a tree's sizes: how large a volume is, and what opening it promises (promise.py)."""

LARGEST = 2
"""Triangles of a leaf, at the most."""


@inlined
def leaf(first, count):
    """The child that is a leaf of `count` triangles, in tree order from `first` on."""
    return ~(2 * first + (count - 1))


@inlined
def first_of(child):
    """The first triangle of a leaf."""
    return ~child >> 1


@inlined
def last_of(child):
    """The last triangle of a leaf."""
    return (~child >> 1) + (~child & 1)


@inlined
def radius_of(tree):
    """The radius of a sphere around a model, metres."""
    return tree.centres[0, 3] * tree.scale[0]


@kernel
def row(array, i):
    """The first three numbers of a row."""
    return (array[i, 0], array[i, 1], array[i, 2])


@kernel
def read_vector(nodes, base):
    """Three consecutive fields of a lane, as float64: the centre, or from U_X or V_X on an axis."""
    return (
        np.float64(nodes[base + CENTRE_X]),
        np.float64(nodes[base + CENTRE_Y]),
        np.float64(nodes[base + CENTRE_Z]),
    )
