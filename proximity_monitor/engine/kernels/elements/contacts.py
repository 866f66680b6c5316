"""Find a contact point and a contact normal for each pair of triangles that touch or cross.

The normal points from a to b: moving b along it separates the models. If the cores of two swept
models are apart, the normal is the direction between the cores' nearest points. Otherwise it is a's
face normal or the reversed face normal of b, whichever needs the shorter motion of b along it until
the triangles lie on opposite sides of a plane.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel
from ..base.state import DepthFirst, Waiting
from ..base.tables import state_at, tree_at
from ..base.trees import SWEPT, MeshTree
from ..base.vectors import across, dot, face_normal, moved, scaled, sub, unit
from .primitives import corners, measure_triangles, mixed
from .swept import surface_points

_NOISE = 8.0
"""If two points are no farther apart than this multiple of the slack, the direction between them
means nothing."""


@kernel
def _longest(t):
    """Return the longest edge of a triangle that may be a segment or a point."""
    longest = sub(t[1], t[0])
    for e in (sub(t[2], t[1]), sub(t[0], t[2])):
        if dot(e, e) > dot(longest, longest):
            longest = e
    return longest


@kernel
def _overlap(a, b, n):
    """Return how far b has to move along n to lie beyond a."""
    last = max(dot(a[0], n), max(dot(a[1], n), dot(a[2], n)))
    return last - min(dot(b[0], n), min(dot(b[1], n), dot(b[2], n)))


@kernel
def _normal(a, b):
    """Return the contact normal of two triangles that have a point in common."""
    na, nb = face_normal(a), scaled(face_normal(b), -1.0)
    flat_a, flat_b = dot(na, na) > 0.0, dot(nb, nb) > 0.0
    if flat_a and flat_b:
        return na if _overlap(a, b, na) <= _overlap(a, b, nb) else nb
    if flat_a or flat_b:
        return na if flat_a else nb
    n = across(_longest(a), _longest(b))
    back = scaled(n, -1.0)
    return n if _overlap(a, b, n) <= _overlap(a, b, back) else back


@entry
def contacts(model_a, model_b, memory, pose, pairs, points, normals):
    """Write `points` (k, 3) and unit `normals` (k, 3), world frame, of touching triangle `pairs`.

    `pairs` (k, 2) holds triangles in tree order. `memory` belongs to the finished search that found
    them. `pose` is the pose of a.
    """
    tree_a, _ = tree_at(MeshTree, model_a)
    tree_b, _ = tree_at(MeshTree, model_b)
    state = state_at(DepthFirst, Waiting, memory)
    progress, motion = state.progress[0], state.motions[0]
    near_a, near_b = progress.element_a, progress.element_b
    for k in range(pairs.shape[0]):
        ta, tb = np.int64(pairs[k, 0]), np.int64(pairs[k, 1])
        progress.distance = np.inf
        measure_triangles(tree_a, tree_b, state, ta, tb, 0.0)
        a, b = corners(tree_a.triangles, ta), corners(tree_b.triangles, tb)
        b = (moved(motion, b[0]), moved(motion, b[1]), moved(motion, b[2]))
        p = mixed(a, progress.weights_a)
        q = mixed(b, progress.weights_b)
        apart = progress.distance > _NOISE * progress.slack
        normal = unit(sub(q, p)) if apart else _normal(a, b)
        p, q = surface_points(p, q, tree_a.scale[SWEPT], tree_b.scale[SWEPT])
        for i in range(3):
            points[k, i] = pose[i, 0] * p[0] + pose[i, 1] * p[1] + pose[i, 2] * p[2] + pose[i, 3]
            normals[k, i] = pose[i, 0] * normal[0] + pose[i, 1] * normal[1] + pose[i, 2] * normal[2]
    progress.element_a, progress.element_b = near_a, near_b
