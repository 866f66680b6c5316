"""Tests of one part as seen from the origin: how far it is, and whether only its edges count."""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.vectors import add, along, cross, dot, norm, scaled, sub
from .facing import closest_in
from .parts import EACH, LOW_U, LOW_V, corner_of, least_along, lines_of


@kernel
def away_from(piece, parts, at, margin):
    """Return a lower bound of a part's distance from the origin, and about where it is nearest.

    The place is from -1 to 1 along the half axes of the parallelogram that stands for the part.
    """
    p, q = corner_of(piece, parts, at, 0), corner_of(piece, parts, at, 1)
    r, s = corner_of(piece, parts, at, 2), corner_of(piece, parts, at, 3)
    low, high, right, left = add(p, q), add(r, s), add(q, s), add(p, r)
    centre = scaled(add(low, high), 0.25)
    e, f = scaled(sub(high, low), 0.25), scaled(sub(right, left), 0.25)
    a, b = closest_in(centre, e, f, (0.0, 0.0, 0.0))
    way = along(along(centre, e, a), f, b)
    size = norm(way)
    bound = 0.0
    for attempt in range(2):
        if attempt == 1:  # if the origin is beside the part, the normal may do better
            way = cross(e, f)
            if dot(way, centre) < 0.0:
                way = scaled(way, -1.0)
        length = norm(way)
        if length > 0.0:
            n = scaled(way, 1.0 / length)
            bound = max(bound, least_along(piece, parts, at, n) - margin)
        if bound > 0.5 * size:
            break
    return bound, a, b


@kernel
def leads_to_edges(piece, parts, at, row, margin):
    """Tell whether every point of a part can move on its piece so that it comes nearer.

    If so, no inner point of what loops leave of the part is the nearest (see falling.py). As there,
    w r' = N' - w' (r - c) about the part's centre c, with N = w (P - c).
    """
    centre = (0.0, 0.0, 0.0)
    for i in range(4):
        centre = along(centre, corner_of(piece, parts, at, i), 0.25)
    square, heavy = 0.0, 0.0
    for i in range(np.int64(piece.points)):
        k = at + EACH * i
        w = parts[k + 3]
        d = sub((parts[k] / w, parts[k + 1] / w, parts[k + 2] / w), centre)
        square, heavy = max(square, dot(d, d)), max(heavy, w)
    radius = np.sqrt(square) * (1.0 + 1e-12) + margin
    length = norm(centre) + radius
    for parameter in range(2):
        lines, apart, step, count = lines_of(piece, parameter == 0)
        low, high, turn = np.inf, -np.inf, 0.0
        for line in range(lines):
            for i in range(count - 1):
                k = at + line * apart + i * step
                of_w = parts[k + step + 3] - parts[k + 3]
                d = (
                    parts[k + step] - parts[k] - of_w * centre[0],
                    parts[k + step + 1] - parts[k + 1] - of_w * centre[1],
                    parts[k + step + 2] - parts[k + 2] - of_w * centre[2],
                )
                loss = norm(d) * (radius + 1e-12 * length) + 4.0 * heavy * margin * length
                product = dot(d, centre)
                low, high = min(low, product - loss), max(high, product + loss)
                turn = max(turn, abs(of_w))
        loss = turn * radius * length * (1.0 + 1e-9)
        first = LOW_U if parameter == 0 else LOW_V
        if low > loss and row[first] > 0.0:
            return True
        if high < -loss and row[first + 1] < 1.0:
            return True
    return False
