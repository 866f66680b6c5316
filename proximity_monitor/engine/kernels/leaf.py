"""What the child of a lane says: a node (>= 0), a leaf of one or two triangles, or nothing.

Two triangles that share an edge and are flat together mostly fill the rectangle around them, as a
quadrilateral does; one alone fills half of it. So a leaf holds two where it can: there is half as
much to bound, and it is bounded as tightly.
"""

from __future__ import annotations

from .jit import inlined

EMPTY = -(2**31)
"""Child of an unused lane."""

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
