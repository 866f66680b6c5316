"""How much nearer than the point that was found another one may be.

With a share of the distance of a model swept by a ball of some radius, and a spare of metres, what
is nearer than d by less than max(share (d - radius), spare) is not looked for. That limit rises
with d, so whatever was left out on the way to the last d is no nearer than the last limit.
"""

from __future__ import annotations

from ..base.jit import inlined

LOOSEST = 1e3
"""Relative errors above it are taken for it: with an infinite one no point would be found, and it
makes no number of a radius 0."""


@inlined
def share_of_error(rel_err):
    """The share s of d such that d <= (1 + rel_err) · (1 - s) d."""
    rel_err = min(rel_err, LOOSEST)
    return rel_err / (1.0 + rel_err)


@inlined
def spare_of_error(tree, abs_err, least):
    """The metres that an absolute error spares: no more than the model's size, but the least."""
    return max(min(abs_err, tree.scale[2]), least)


@inlined
def limit_of(distance, share, spare, radius):
    """The distance from which on nothing is looked for, metres."""
    return distance - max(share * (distance - radius), spare)


@inlined
def distance_of(limit, share, spare, radius):
    """A distance to begin with, metres: where nothing is nearer, all is at the limit or beyond."""
    return max(limit + spare, radius + (limit - radius) / (1.0 - share))
