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


@kernel
def _near(tree, p, nearby, state, steps, stack, bounds, found):
    """Return a triangle near p, a point in the tree's frame."""
    distance, nearby, top = begin_nearest(tree, p, nearby, stack, bounds)
    slack = state.progress[0].bound_slack
    _, nearby, _, left = nearest(
        tree, p, distance, nearby, top, slack, 0.0, stack, bounds, found, steps
    )
    state.progress[0].bound_tests += WIDTH * (steps - left)
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
    """Find a triangle of a near b's middle, then one of b near that triangle; measure the pair.

    One walk down a hierarchy finds each triangle, so it is near but perhaps not the nearest. If the
    models' spheres meet, either model may surround the other, and a second walk down each pays.
    """
    progress, motions = state.progress[0], state.motions
    found = on_stack(WIDTH, np.float32(0.0))
    q = moved(motions[0], scaled(row(tree_b.centres, 0), tree_b.scale[0]))
    ta = tb = np.int64(0)
    way = sub(q, scaled(row(tree_a.centres, 0), tree_a.scale[0]))
    reach = radius_of(tree_a) + radius_of(tree_b)
    for _ in range(2 if dot(way, way) < reach * reach else 1):
        ta = walk(Middle(q, 0.0), tree_a, found)
        p = moved(motions[1], _point_near(tree_a, ta, q))
        tb = walk(Middle(p, 0.0), tree_b, found)
        q = moved(motions[0], _point_near(tree_b, tb, p))
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
