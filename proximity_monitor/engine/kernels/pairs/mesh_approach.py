"""How a search improves the nearest points of two meshes: by queries for the nearest triangle."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, kernel
from ..base.memory import on_stack
from ..base.trees import MESHES
from ..base.vectors import along, dot, moved, scaled, sub
from ..elements.primitives import corners, measure_triangles, mixed
from ..inside.nearest import Middle, begin_nearest, nearest, point_triangle, walk
from ..inside.visit import ROOM
from ..search import stubs
from ..tree.layout import WIDTH, radius_of, row

_SPARE = 0.05
"""A query for the nearest triangle may find one that is this share of the search's tolerance too
far. At 10 %, such a query takes half the steps of an exact one, and serves as well."""

_WALKS, _GAIN = 8, 0.9
"""Most walks down either hierarchy for a guess; and the share of the squared distance below which
a walk must come to be followed by another."""


@kernel
def _near(tree, p, nearby, state, steps, stack, bounds, found):
    """Return a triangle near p, a point in the tree's frame."""
    progress = state.progress[0]
    distance, nearby, top = begin_nearest(tree, p, nearby, stack, bounds)
    slack = progress.bound_slack
    spare = _SPARE * (progress.rel_err * distance + progress.abs_err)
    _, nearby, _, left = nearest(
        tree, p, distance, nearby, top, slack, spare, stack, bounds, found, steps
    )
    progress.bound_tests += WIDTH * (steps - left)
    return nearby


@kernel
def _point_near(tree, t, p):
    """Return the point of triangle t nearest to p."""
    a, b, c = corners(tree.triangles, t)
    _, v, w = point_triangle(p, a, b, c)
    return along(along(a, sub(b, a), v), sub(c, a), w)


@implements(stubs.guess, MESHES, MESHES)
@kernel
def _guess(tree_a, tree_b, state):
    """Find a triangle of each model near the other, from the smaller model's middle; measure both.

    One walk down a hierarchy finds each triangle, so it is near but perhaps not the nearest. If the
    models' spheres meet, either model may surround the other, and more walks pay.
    """
    progress, motions = state.progress[0], state.motions
    found = on_stack(WIDTH, np.float32(0.0))
    p = scaled(row(tree_a.centres, 0), tree_a.scale[0])
    q = moved(motions[0], scaled(row(tree_b.centres, 0), tree_b.scale[0]))
    way = sub(q, p)
    reach = radius_of(tree_a) + radius_of(tree_b)
    if np.sqrt(dot(way, way)) - reach >= progress.limit:
        return  # the spheres around the models will end the search
    if radius_of(tree_a) < radius_of(tree_b):
        p = moved(motions[1], p)
        q = moved(motions[0], _point_near(tree_b, walk(Middle(p, 0.0), tree_b, found), p))
    ta = tb = np.int64(0)
    least = np.inf
    for _ in range(_WALKS if dot(way, way) < reach * reach else 1):
        a = walk(Middle(q, 0.0), tree_a, found)
        p = _point_near(tree_a, a, q)
        moved_p = moved(motions[1], p)
        b = walk(Middle(moved_p, 0.0), tree_b, found)
        q = moved(motions[0], _point_near(tree_b, b, moved_p))
        way = sub(q, p)
        square, before = dot(way, way), least
        if square < least:
            least, ta, tb = square, a, b
        if not square < _GAIN * before:
            break
    progress.primitive_tests += 1
    measure_triangles(tree_a, tree_b, state, ta, tb, 0.0)


@implements(stubs.approach, MESHES, MESHES)
@kernel
def _approach(tree_a, tree_b, state, steps, found):
    """Measure the triangle of b nearest to a's nearest point, then that of a nearest to b's."""
    progress, motions = state.progress[0], state.motions
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    ta, tb = progress.element_a, progress.element_b
    p = mixed(corners(tree_a.triangles, ta), progress.weights_a)
    other = _near(tree_b, moved(motions[1], p), tb, state, steps, stack, bounds, found)
    if other != tb:
        progress.primitive_tests += 1
        measure_triangles(tree_a, tree_b, state, ta, other, 0.0)
    ta, tb = progress.element_a, progress.element_b
    q = mixed(corners(tree_b.triangles, tb), progress.weights_b)
    other = _near(tree_a, moved(motions[0], q), ta, state, steps, stack, bounds, found)
    if other != ta:
        progress.primitive_tests += 1
        measure_triangles(tree_a, tree_b, state, other, tb, 0.0)
