"""Decide for many pairs of bodies with disjoint surfaces whether one lies inside the other.

A connected part that does not meet a closed surface lies wholly on one side of it. So if the
surfaces are apart, the winding number around one vertex of each part decides. If a body has many
parts, as a cloud of points has, one vertex of each small volume decides instead: if the volume is
smaller than the distance of the surfaces, its other points are nearer to that vertex than to the
surface, so they are on the same side.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import entry, implements, inlined, kernel, shared, specialised
from ..base.memory import on_stack, table_on_stack
from ..base.motion import deviation, relative_motions, slack_of_bounds
from ..base.state import LOWER, OUT_OF_TIME, STATUS, UPPER
from ..base.tables import tree_at
from ..base.trees import MeshTree
from ..base.vectors import moved, norm, scaled, sub
from ..elements.primitives import corners
from ..tree.layout import EMPTY, WIDTH, first_of, last_of
from .solids import HALF, WHOLE
from .volumes import sphere_of
from .winding import ray_steps, winding_number

Insides = namedtuple("Insides", "where spans samples tables")
"""The insides of n bodies. where (int8, n), their Region.inside; samples (int32, k), those of all
bodies; spans (int64, n × 2), a body's range of samples: the first, and one after the last; and
tables (int64, n × MODEL_ROWS × 2, see tables.py) of hierarchies of all triangles of a mesh, or of a
triangle of points of each element of a surface. All triangles, because a winding number also counts
those that lie on others, which a search for the nearest leaves out.
"""


FEW = 256
"""Up to this number of parts, one vertex of each part is tested; else one of each small volume."""

NONE, UNDECIDED = -1, -2
"""Instead of a triangle: none found; and some are left to test."""

HOLDER = MeshTree
"""The kind of the holder's tree; surface/contain.py substitutes another kind."""


@shared
def part_inside(holder, body, samples, motion, slack, apart, progress, waiting, scratch, steps):
    """Find a triangle of a part of `body` that may lie inside `holder`; the surfaces do not meet.

    `samples` are those of the body; `motion` moves them to the holder's frame. The surfaces are at
    least `apart` metres apart, even after rounding moves a sample; `apart` is above 4 `slack`.
    Returns (triangle, steps left). The triangle is NONE if all parts are certainly outside, or
    UNDECIDED if the steps run out. Then the next call continues from `progress` (2,), zeros at
    first, and `waiting`. `scratch` is for a descent.
    """
    gaps = on_stack(WIDTH, np.float32(0.0))
    if len(samples) <= FEW:
        while progress[0] < len(samples):
            if steps <= 0:
                return UNDECIDED, steps
            t = samples[progress[0]] // 3
            progress[0] += 1
            steps -= ray_steps(holder)
            if _holds_triangle(holder, body, t, motion, slack, scratch, gaps):
                return t, steps
        return NONE, steps
    root = holder.centres[0]
    middle = scaled((root[0], root[1], root[2]), holder.scale[0])
    reach = root[3] * holder.scale[0] * (1.0 + 1e-6) + 2.0 * slack
    if progress[0] == 0:
        waiting[0] = 0
        progress[0], progress[1] = 1, 1
    while progress[1] > 0:
        if steps <= 0:
            return UNDECIDED, steps
        progress[1] -= 1
        node = waiting[progress[1]]
        for lane in range(node * WIDTH, (node + 1) * WIDTH):
            child = body.children[lane]
            if child == EMPTY:
                continue
            steps -= 1
            centre, radius = sphere_of(body, lane)
            if norm(sub(moved(motion, centre), middle)) > reach + radius:
                continue
            small = 2.0 * radius + 4.0 * slack < apart
            if child >= 0 and not small:
                waiting[progress[1]] = child
                progress[1] += 1
                continue
            while child >= 0:
                child = body.children[child * WIDTH]
            last = first_of(child) if small else last_of(child)
            for t in range(first_of(child), last + 1):
                steps -= ray_steps(holder)
                if _holds_triangle(holder, body, t, motion, slack, scratch, gaps):
                    return t, steps
    return NONE, steps


def look_for_part(
    holder, body, samples, motion, slack, apart, progress, waiting, scratch, steps
):  # fmt: skip
    """Do the same as `part_inside` for tables of hierarchies; return the triangle alone."""
    tree, _ = tree_at(HOLDER, holder)
    other, _ = tree_at(MeshTree, body)
    found, _ = part_inside(
        tree, other, samples, motion, slack, apart, progress, waiting, scratch, steps
    )
    return found


look_for_part_in_mesh = entry(specialised(look_for_part, "look_for_part_in_mesh"))


@kernel
def _holds_triangle(holder, body, t, motion, slack, stack, gaps):
    """Return whether a body's triangle may be inside the holder; it does not meet its surface."""
    p = moved(motion, corners(body.triangles, t)[0])
    return winding_number(holder, p, slack, stack, gaps) != 0  # UNKNOWN counts as inside


def look_in(
    insides, number, holder, body, samples, motion, slack, apart, progress, scratch, steps
):  # fmt: skip
    """Do the same as `part_inside` in body `number`, whose triangle hierarchy is `holder`.

    A stub, because a surface also has a hierarchy of its own elements.
    """


def errors_of(insides, i, j):
    """Return the errors of two bodies' points and gaps (see errors.py) together, metres. A stub."""


@implements(look_in, Insides)
@inlined
def _look_in_mesh(
    insides, number, holder, body, samples, motion, slack, apart, progress, scratch, steps
):  # fmt: skip
    return part_inside(
        holder, body, samples, motion, slack, apart, progress, scratch[0], scratch[1], steps
    )


@implements(errors_of, Insides)
@inlined
def _exact(insides, i, j):
    return 0.0


@kernel
def _one_in_the_other(insides, i, j, motions, slack, apart, progress, scratch, steps):
    """Do the same as `part_inside` for body i in body j, and for body j in body i."""
    where, spans = insides.where, insides.spans
    tree_a, _ = tree_at(MeshTree, insides.tables[i])
    tree_b, _ = tree_at(MeshTree, insides.tables[j])
    if where[j] == WHOLE:
        samples = insides.samples[spans[i, 0] : spans[i, 1]]
        found, steps = look_in(
            insides, j, tree_b, tree_a, samples, motions[1], slack, apart, progress[0], scratch[0],
            steps,
        )  # fmt: skip
        if found != NONE:
            return found, steps
    if where[i] == WHOLE:
        samples = insides.samples[spans[j, 0] : spans[j, 1]]
        return look_in(
            insides, i, tree_a, tree_b, samples, motions[0], slack, apart, progress[1], scratch[1],
            steps,
        )  # fmt: skip
    return NONE, steps


@entry
def settle_signs(
    insides, poses, pairs, wanted, signed, first, last, every, steps, progress, scratch, answers
):  # fmt: skip
    """Turn answers about surfaces into answers about signed distances, for rows with `signed` (k,).

    `answers` (k, ANSWER) are the rows that `answer_queries` wrote for `pairs` (k, 2) of bodies at
    `poses` (n, 4, 4). This treats rows first, first + every, ... below last. If the surfaces may
    meet, or one body may lie inside the other, or has holes (HALF), the sign is open and `lower`
    becomes -inf. The row then counts as out of time, unless its upper bound already decides about
    the clearance. `wanted` (k, 3) holds rel_err, abs_err and clearance.

    Returns `last`, or after about `steps` steps the first row that is not settled. The next call
    continues with `progress` (2, 2), zeros at first, and `scratch` (2, 2, m). If `steps` is 0, it
    stays open whether one body lies inside the other.
    """
    motions = table_on_stack(2, 12, 0.0)
    where, leave_open = insides.where, steps <= 0
    for k in range(first, last, every):
        if not signed[k]:
            continue
        answer, i, j = answers[k], pairs[k, 0], pairs[k, 1]
        certain = answer[STATUS] != OUT_OF_TIME and where[i] != HALF and where[j] != HALF
        if certain:
            pose_a, pose_b = poses[i], poses[j]
            relative_motions(pose_a, pose_b, motions[0], motions[1])
            t = motions[0]
            apart = np.sqrt(t[9] * t[9] + t[10] * t[10] + t[11] * t[11])
            tree_a, _ = tree_at(MeshTree, insides.tables[i])
            tree_b, _ = tree_at(MeshTree, insides.tables[j])
            error = deviation(pose_a) + deviation(pose_b)
            slack = slack_of_bounds(tree_a.scale[2], tree_b.scale[2], apart, error)
            slack += errors_of(insides, i, j)
            certain = answer[LOWER] > 4.0 * slack
            if certain and (where[i] == WHOLE or where[j] == WHOLE):
                found = UNDECIDED
                if not leave_open:
                    found, steps = _one_in_the_other(
                        insides, i, j, motions, slack, answer[LOWER], progress, scratch, steps
                    )
                    if found == UNDECIDED:
                        return k
                certain = found == NONE
        for side in range(2):
            progress[side, 0] = progress[side, 1] = 0
        if not certain:
            answer[LOWER] = -np.inf
            if not answer[UPPER] <= wanted[k, 2] < np.inf:
                answer[STATUS] = OUT_OF_TIME
    return last
