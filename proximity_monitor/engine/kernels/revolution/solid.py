"""Solids of revolution in the search for balls: queries are answered in each point's half-plane.

Results are returned as points of the patches, so that all other queries go to the patches.
"""

from __future__ import annotations

from ..base.jit import implements, inlined, kernel
from ..base.trees import RevolutionTree
from ..elements.errors import joints_err
from ..inside import feet
from ..inside.ball_bowls import bowls
from ..inside.ball_caps import cap_height
from ..inside.ball_newton import begin_newton
from ..inside.winding import ray_steps, winding_number
from ..surface import solid
from .cap import height_within
from .closest import nearest_on
from .inside import turns_around
from .meridian import angle_of, patches_of, place_in
from .places import place_of
from .sleeves import sleeves

_LOOKS = 8
"""Looks at arcs that count as one step of a descent."""

_WINDING = 2
"""Steps that a winding number counts as."""


@implements(feet.seek, RevolutionTree)
@kernel
def _seek(tree, p, k, at, point, stack, reached, found, steps):
    place = place_in(tree, p, (0.0, 0.0, 0.0))
    spare = 4.0 * at.slack + 2.0 * place.margin
    least, away, piece, t, looks = nearest_on(
        tree, place.rho, place.z, place.margin, solid.share_of(at), spare
    )
    element, (u, v, _) = place_of(tree, piece, t, angle_of(tree, p))
    point.away[k], point.loose[k], point.near[k] = away, away - least, element
    point.spot[k, 0], point.spot[k, 1] = u, v
    at.height = 0
    return max(steps - 1 - looks // _LOOKS, 0)


@implements(winding_number, RevolutionTree)
@kernel
def _winding(tree, p, slack, stack, gaps):
    place, joints = place_in(tree, p, (0.0, 0.0, 0.0)), joints_err(tree)
    margin = place.margin + slack + joints
    return turns_around(tree, place.rho, place.z, margin, joints)


@implements(ray_steps, RevolutionTree)
@inlined
def _ray_steps(tree):
    return _WINDING


@implements(cap_height, RevolutionTree)
@inlined
def _cap(tree, o, n, radius, height, top, slack, stack):
    answer, looks = height_within(tree, o, n, radius, height, top)
    return answer, 1 + looks // _LOOKS


# All other queries go to the patches, unchanged.


@implements(feet.foot_of, RevolutionTree)
@inlined
def _foot(tree, p, k, point):
    return feet.foot_of(patches_of(tree), p, k, point)


@implements(feet.normal_at, RevolutionTree)
@inlined
def _normal_at(tree, k, point):
    return feet.normal_at(patches_of(tree), k, point)


@implements(feet.facet_of, RevolutionTree)
@inlined
def _facet(tree, k, point):
    return feet.facet_of(patches_of(tree), k, point)


@implements(feet.spot_of_row, RevolutionTree)
@inlined
def _spot(tree, element, row, side):
    return feet.spot_of_row(patches_of(tree), element, row, side)


@implements(feet.middle_of, RevolutionTree)
@inlined
def _middle(tree, element):
    return feet.middle_of(patches_of(tree), element)


@implements(feet.corner_of, RevolutionTree)
@inlined
def _corner(tree, element):
    return feet.corner_of(patches_of(tree), element)


@implements(begin_newton, RevolutionTree, RevolutionTree)
@inlined
def _newton(tree_a, tree_b, state):
    return begin_newton(patches_of(tree_a), patches_of(tree_b), state)


@implements(bowls, RevolutionTree, RevolutionTree)
@inlined
def _bowls(tree_a, tree_b, region_a, region_b, way, state, centre, half, limit, spare, row):
    if way == 0:
        found, looks = sleeves(tree_a, tree_b, state, centre, half, limit, row)
        return found, looks // _LOOKS
    return bowls(
        patches_of(tree_a), patches_of(tree_b), region_a, region_b, way, state, centre, half, limit,
        spare, row,
    )  # fmt: skip
