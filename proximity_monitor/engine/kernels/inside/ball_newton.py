"""Newton's method on opposite normals: find where two overlapping surfaces are farthest apart.

A largest ball between two smooth surfaces touches them at points whose normals are opposite
(Thomas, Turnbull, Ros and Cameron 2000, sections 3 and 4). Let a point lie between both surfaces, n
be about normal to them, and y perpendicular to n. Near the point's feet the surfaces are at heights
h_a(y) and h_b(y) along n. Their normals are opposite where the gap h_a - h_b is stationary. Slopes
and second derivatives at the feet predict this place to second order. The next trial point is the
middle between both surfaces there. The ball around it is certified like any other.

An ascent along the depths' gradients alone (`ball_trial`) makes small steps along such a gap,
because both gradients are about perpendicular to it.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.trees import MeshTree, RevolutionTree, SurfaceTree
from ..base.vectors import along, cross, dot, moved, rotated, scaled, sub, unit
from .ball_begin import add_seed
from .ball_cells import radius_limit
from .ball_point import place_of
from .ball_state import NEWTON, NONE
from .ball_trial import try_point
from .feet import bend_at

OPPOSITE = -0.8
"""Surfaces count as nearly parallel if the inner product of both `way`s, the directions along which
the depths grow, is below this."""

_STRAIGHT = -0.98
"""If that product is below this, `seed_between` tries the middle between both feet."""

_WORTH = 0.02
"""Share of the tolerance that a step, and each component of it, must promise to gain."""

_CURVED, _FLAT = 0.5, 500.0
"""Maximum length of a step: this share of the radii of curvature, this multiple of the gap."""


@shared
def frame_between(point):
    """Return a unit vector about normal to both surfaces, outward of a, and two perpendicular ones.

    The first is zero if the surfaces, seen from `point`, are not nearly parallel.
    """
    a = (point.way[0, 0], point.way[0, 1], point.way[0, 2])
    b = (point.way[1, 0], point.way[1, 1], point.way[1, 2])
    if not dot(a, b) < OPPOSITE:
        return (0.0, 0.0, 0.0), a, b
    n = unit(sub(b, a))
    e = unit(cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0)))
    return n, e, cross(n, e)


@kernel
def seed_between(state, limit):
    """Make the next seed the point of equal depths on the line through the trial point's feet.

    Do so only if the feet are opposite and so far apart that a ball between them would matter.
    Without this seed, the cells near it would have to shrink to the size of the ball first.
    """
    at, trial = state.at[0], state.trial[0]
    if trial.side[0] == 0 or trial.side[1] == 0 or at.seed < at.seeds:
        return
    a, b = trial.depth[0], trial.depth[1]
    n, _, _ = frame_between(trial)
    ways = trial.way[0, 0] * trial.way[1, 0] + trial.way[0, 1] * trial.way[1, 1]
    ways += trial.way[0, 2] * trial.way[1, 2]
    if 0.5 * (a + b) > limit and ways < _STRAIGHT:
        at.seed = at.seeds = 0
        at.middle = NONE
        add_seed(state, along(place_of(trial), n, 0.5 * (a - b)))


@shared
def foot_bend(tree, motion, k, point, n, e, f):
    """Call `feet.bend_at` for a solid with vectors n, e and f of a's frame.

    Returns whether there is such a height; the foot's offset from the point along e, f and n; the
    slopes; and the bends.
    """
    n, e, f = rotated(motion, n), rotated(motion, e), rotated(motion, f)
    sound, place, slope, bend = bend_at(tree, k, point, n, e, f)
    d = sub(place, moved(motion, (point.place[0], point.place[1], point.place[2])))
    return sound, (dot(e, d), dot(f, d), dot(n, d)), slope, bend


@shared
def principal(k11, k12, k22):
    """Return the eigenvalues of a symmetric 2 × 2 matrix, and the unit eigenvector of the first."""
    angle = 0.5 * np.arctan2(2.0 * k12, k11 - k22)
    c, s = np.cos(angle), np.sin(angle)
    return (
        c * c * k11 + 2.0 * c * s * k12 + s * s * k22,
        s * s * k11 - 2.0 * c * s * k12 + c * c * k22,
        c,
        s,
    )


@shared
def _over(d, g, k):
    """Return a surface's height and slopes over the middle; at d, its slopes are g, its bends k."""
    g1, g2 = g[0] - k[0] * d[0] - k[1] * d[1], g[1] - k[1] * d[0] - k[2] * d[1]
    bend = k[0] * d[0] * d[0] + 2.0 * k[1] * d[0] * d[1] + k[2] * d[1] * d[1]
    return d[2] - g1 * d[0] - g2 * d[1] - 0.5 * bend, g1, g2


@shared
def _step(slope, bend, trust, worth):
    """Return the step, at most `trust`, that maximises a gap with this slope and bend.

    Returns 0 if the gap grows by no more than `worth`.
    """
    far = np.sign(slope) * trust
    if bend < 0.0 and abs(slope) < -bend * trust:
        far = -slope / bend
    return far if slope * far + 0.5 * bend * far * far > worth else 0.0


def begin_newton(tree_a, tree_b, state):
    """Make the next point of Newton's method the trial point; return False if it promises no gain.

    A stub, because triangles do not bend.
    """


@implements(begin_newton, (MeshTree, SurfaceTree, RevolutionTree), MeshTree)
@inlined
def _none(tree_a, tree_b, state):
    state.at[0].newtons = 0
    return False


@implements(begin_newton, SurfaceTree, SurfaceTree)
@shared
def _begin(tree_a, tree_b, state):
    at, best = state.at[0], state.best[0]
    at.newtons -= 1
    n, e, f = frame_between(best)
    if not dot(n, n) > 0.5:
        at.newtons = 0
        return False
    sound, d, g, bend = foot_bend(tree_a, state.motions[0], 0, best, n, e, f)
    sound_b, d_b, g_b, bend_b = foot_bend(tree_b, state.motions[1], 1, best, n, e, f)
    h, g1, g2 = _over(d, g, bend)
    h_b, g1_b, g2_b = _over(d_b, g_b, bend_b)
    gap, worth = h - h_b, _WORTH * (radius_limit(at) - at.radius)
    if not (sound and sound_b and gap > 0.0):
        at.newtons = 0
        return False
    most = _CURVED / _FLAT / gap
    for i in range(3):
        most = max(most, max(abs(bend[i]), abs(bend_b[i])))
    trust = min(at.trust, _CURVED / most)
    k1, k2, c, s = principal(bend[0] - bend_b[0], bend[1] - bend_b[1], bend[2] - bend_b[2])
    one = _step(c * (g1 - g1_b) + s * (g2 - g2_b), k1, trust, worth)
    two = _step(c * (g2 - g2_b) - s * (g1 - g1_b), k2, trust, worth)
    if at.trust < np.inf:
        # The last step failed: another face is nearer there, such as the end face of a shaft. In a
        # direction that does not change the gap, a step to either side may lead away from it.
        aside = 2.0 * gap if at.newtons & 1 else -2.0 * gap
        one, two = (aside, two) if one == 0.0 else (one, aside if two == 0.0 else two)
    y1, y2 = c * one - s * two, s * one + c * two
    high = h + g1 * y1 + g2 * y2
    high += 0.5 * (bend[0] * y1 * y1 + 2.0 * bend[1] * y1 * y2 + bend[2] * y2 * y2)
    low = h_b + g1_b * y1 + g2_b * y2
    low += 0.5 * (bend_b[0] * y1 * y1 + 2.0 * bend_b[1] * y1 * y2 + bend_b[2] * y2 * y2)
    if not 0.5 * (high - low) > at.radius + worth:
        at.newtons = 0
        return False
    middle = 0.5 * (high + low)
    step = along(along(scaled(e, y1), f, y2), n, middle)
    move = np.sqrt(dot(step, step)) * (1.0 + 1e-12)
    try_point(
        state, NEWTON, best.place[0] + step[0], best.place[1] + step[1], best.place[2] + step[2],
        best, True, move,
    )  # fmt: skip
    return True
