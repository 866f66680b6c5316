"""Whether one of two bodies whose surfaces are apart lies inside the other: for many pairs at once.

A connected part whose surface does not meet a closed one lies wholly on the side of any of its
points. So where the surfaces are apart, the winding number around one vertex of each part tells.
Where parts are many, as in a cloud of points, so does one vertex of each volume that is smaller
than the surfaces are apart: its other points are on the same side, being nearer to that one.
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
"""What n bodies enclose: where (int8, n), their Region.inside; samples (int32, k) of all of them;
spans (int64, n × 2), which of these are a body's: the first, and one after the last; and tables
(int64, n × 2 × 7) of hierarchies that hold all triangles (see tables.py). A winding number counts
those that lie on others, which a search for the nearest leaves out.
"""


FEW = 256
"""Parts of a body, at the most, of which each is looked at."""

NONE, UNDECIDED = -1, -2
"""No triangle; and that some are left to look at."""

HOLDER = MeshTree
"""The kind of tree of whatever a part is looked for in: another one in surface/contain.py."""


@shared
def part_inside(holder, body, samples, motion, slack, apart, progress, waiting, scratch, steps):
    """A triangle of a part of `body` that may lie inside `holder`, whose surface it does not meet.

    The samples are of the body, `motion` brings them to the frame of the holder, and the surfaces
    are `apart` metres apart or more, which is above 4 `slack`: also where rounding moved a sample.
    Returns NONE where all are surely outside, or UNDECIDED after so many steps, and how many steps
    are left; `progress` (2,), zeros to begin with, and `waiting` are what it goes on with.
    `scratch` is room for a descent.
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
    """As `part_inside`, of tables of hierarchies, without the steps that are left."""
    tree, _ = tree_at(HOLDER, holder)
    other, _ = tree_at(MeshTree, body)
    found, _ = part_inside(
        tree, other, samples, motion, slack, apart, progress, waiting, scratch, steps
    )
    return found


look_for_part_in_mesh = entry(specialised(look_for_part, "look_for_part_in_mesh"))


@kernel
def _holds_triangle(holder, body, t, motion, slack, stack, gaps):
    """Whether a triangle of the body, which the holder's surface does not meet, may be inside."""
    p = moved(motion, corners(body.triangles, t)[0])
    return winding_number(holder, p, slack, stack, gaps) != 0  # or unknown


def look_in(
    insides, number, holder, body, samples, motion, slack, apart, progress, scratch, steps
):  # fmt: skip
    """As `part_inside`, in the body of that number, whose hierarchy over triangles is `holder`.

    A stub: surfaces have another hierarchy besides, that of their own elements.
    """


def errors_of(insides, i, j):
    """What points of two bodies err by, and what closes their gaps, metres: a stub."""


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
    """As `part_inside`, of body i or j, whose surfaces are so far apart, in the other."""
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
    """Make answers about surfaces into such about signed distances, where `signed` (k,).

    The answers (k, ANSWER) are those of `answer_queries` about pairs (k, 2) of bodies at poses
    (n, 4, 4); first, first + every, ... below last of them. Where the surfaces may meet, or one
    body lie inside the other, the sign is open, and `lower` is -inf. Then the search counts as cut,
    unless its upper bound has decided about the clearance: `wanted` (k, 3) is rel_err, abs_err and
    clearance.

    Returns `last`, or after about `steps` steps the first answer that is not settled; it goes on
    with `progress` (2, 2), zeros to begin with, and `scratch` (2, 2, m). With no steps at all it is
    left open whether one body lies inside the other.
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
