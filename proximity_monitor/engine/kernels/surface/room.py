"""Room for more cells: the cells that no pair needs any more are given up.

If very many pairs are about equally near, all of them would be divided in turn, and room would run
out before any was done. So if room is short, the last pair of the heap is divided, and then its
parts, which are now last. Thus one pair after the other is done and gives up its cells. If all of a
surface is equally near, pairs take too long to end. The search notices that few do, and ends.
"""

from __future__ import annotations

from ..base.jit import inlined, kernel, shared
from ..base.trees import NONE
from .heap import kept_aside, place, rebuilt

_SHORT, _FULL = 0.75, 0.9375
"""Shares of the room that is in use. Above the first, room is short. Above the second, it does not
suffice, because the parts of a single pair may need some hundred cells."""

_TURN, _TURNS = 1 << 12, 1 << 5
"""Pairs that are divided in this way until progress is checked, which takes some hundredths of a
second; and the most such turns."""

PATIENCE = _TURN * _TURNS
"""Most pairs that are divided in this way in all."""


@inlined
def is_narrow(progress, pairs):
    """Tell whether room is short, so that the last pair is taken instead of the nearest."""
    return progress.narrow != 0 or progress.dividing + progress.aside > _SHORT * len(pairs)


@inlined
def look_back(progress):
    """End patience if pairs end so slowly that some will be left after all turns."""
    if progress.narrow_divisions < progress.next_check:
        return
    if (
        progress.dividing_before > 0
        and (progress.dividing_before - progress.dividing) * _TURNS < progress.dividing
    ):
        progress.narrow_divisions = PATIENCE
    progress.dividing_before = progress.dividing
    progress.next_check = progress.narrow_divisions + _TURN


@shared
def make_room(state):
    """Give up what is not needed; return whether that leaves enough room to go on."""
    progress, waiting = state.progress[0], state.waiting
    pairs = waiting.pairs
    progress.dividing = rebuilt(pairs, progress.dividing, progress.limit)
    progress.aside = kept_aside(pairs, progress.aside, progress.limit)
    count, aside = progress.dividing, progress.aside
    for side in range(2):
        cells = waiting.cells_a if side == 0 else waiting.cells_b
        nets = waiting.nets_a if side == 0 else waiting.nets_b
        roots = waiting.roots_a if side == 0 else waiting.roots_b
        used = progress.cells_a if side == 0 else progress.cells_b
        used = _compacted(cells, nets, roots, used, pairs, count, aside, side)
        if side == 0:
            progress.cells_a = used
        else:
            progress.cells_b = used
    used = _share(progress.cells_a, waiting.cells_a), _share(progress.cells_b, waiting.cells_b)
    progress.narrow = 1 if max(used[0], used[1]) > _SHORT else 0
    fits = max(max(used[0], used[1]), _share(count + aside, pairs)) <= _FULL
    return fits and progress.narrow_divisions < PATIENCE


@inlined
def _share(used, room):
    """Return the share of a room that is in use."""
    return used / len(room) if len(room) > 0 else 0.0


@kernel
def _compacted(cells, nets, roots, used, pairs, count, aside, side):
    """Keep the cells of one model that pairs name, moved together; return how many.

    A cell's parts are dropped. If they are needed again, they are made again.
    """
    if used == 0:  # nothing of this model is divided: its pairs name whole elements
        return used
    for i in range(used):
        cells[i].child, cells[i].children = NONE, 0
    for k in range(count + aside):
        pair = pairs[place(pairs, count, k)]
        cells[pair.a if side == 0 else pair.b].child = 0
    kept = 0
    for i in range(used):
        if cells[i].child != NONE:
            cells[i].children = kept  # its new index, for now
            kept += 1
    for k in range(count + aside):
        pair = pairs[place(pairs, count, k)]
        if side == 0:
            pair.a = cells[pair.a].children
        else:
            pair.b = cells[pair.b].children
    for element in range(len(roots)):
        at = roots[element]
        if at != NONE:
            roots[element] = cells[at].children if cells[at].child != NONE else NONE
    width = len(nets) // len(cells)
    for i in range(used):
        if cells[i].child != NONE:
            k = cells[i].children
            if k != i:
                cells[k] = cells[i]
                for j in range(width):
                    nets[k * width + j] = nets[i * width + j]
            cells[k].child, cells[k].children = NONE, 0
    return kept
