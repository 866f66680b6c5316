"""The tolerance of a nearest-point search: how much nearer another point may be than the one found.

The model is a core swept by a ball of some radius. Once a point of the core at distance d is found,
the search skips points that are nearer by less than max(share (d - radius), spare). `share` is the
relative tolerance, `spare` the absolute one in metres. The resulting limit rises with d, so a point
skipped at an earlier, larger d is no nearer than the last limit.
"""

from __future__ import annotations

from ..base.jit import inlined

LOOSEST = 1e3
"""Relative errors above this value are replaced by it. With an infinite one, no point would be
found, and its product with a radius 0 would be NaN."""


@inlined
def share_of_error(rel_err):
    """Return the share s of d such that d <= (1 + rel_err) · (1 - s) d."""
    rel_err = min(rel_err, LOOSEST)
    return rel_err / (1.0 + rel_err)


@inlined
def spare_of_error(tree, abs_err, least):
    """Return `abs_err`, metres, limited to the model's size, but at least `least`."""
    return max(min(abs_err, tree.scale[2]), least)


@inlined
def limit_of(distance, share, spare, radius):
    """Return the distance, metres, from which on the search skips points."""
    return distance - max(share * (distance - radius), spare)


@inlined
def distance_of(limit, share, spare, radius):
    """Return the initial distance, metres, whose `limit_of` is `limit`.

    If the search finds no point nearer than it, all points are at `limit` or beyond.
    """
    return max(limit + spare, radius + (limit - radius) / (1.0 - share))
