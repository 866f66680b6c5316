"""Tell whether a part of a body lies inside another body, if some bodies are closed surfaces."""

from __future__ import annotations

from collections import namedtuple

from ..base.jit import entry, implements, inlined, specialised
from ..base.tables import tree_at
from ..base.trees import SurfaceTree
from ..elements.errors import joints_err, points_err
from ..inside.contain import Insides, errors_of, look_for_part, look_in, part_inside
from . import crossing  # noqa: F401 - it implements what a winding number needs

MixedInsides = namedtuple("MixedInsides", (*Insides._fields, "holders", "divided"))
"""`Insides`; and for each body, the table of its own hierarchy (`holders`, int64, n × k × 2) and
whether it is a SurfaceTree (`divided`, bool, n)."""

look_for_part_in_surface = entry(
    specialised(look_for_part, "look_for_part_in_surface", __name__=__name__, HOLDER=SurfaceTree)
)


@implements(look_in, MixedInsides)
@inlined
def _look_in(
    insides, number, holder, body, samples, motion, slack, apart, progress, scratch, steps
):  # fmt: skip
    stack, waiting = scratch[0], scratch[1]
    if insides.divided[number]:
        surface, _ = tree_at(SurfaceTree, insides.holders[number])
        return part_inside(
            surface, body, samples, motion, slack, apart, progress, stack, waiting, steps
        )
    return part_inside(holder, body, samples, motion, slack, apart, progress, stack, waiting, steps)


@implements(errors_of, MixedInsides)
@inlined
def _errors(insides, i, j):
    found = 0.0
    for k in (i, j):
        if insides.divided[k]:
            surface, _ = tree_at(SurfaceTree, insides.holders[k])
            found += points_err(surface) + joints_err(surface)
    return found
