"""How high a solid of revolution reaches within a ball, over a plane: see `inside/ball_caps.py`.

Let o be the ball's centre, R its radius, and n the plane's normal. Its parts in the half-plane of o
are n_rho and n_z, the part perpendicular to the half-plane is n_t; rho_o is o's distance from the
axis. A point of the surface, (rho, z) turned by theta out of that half-plane, is at the height

    n . (y - o) = h + |n_rho| rho (1 - cos theta) + n_t rho sin theta     if n_rho < 0,

with h the height of (rho, z) in the half-plane; if n_rho >= 0, the second term is negative. With d
the distance in the half-plane, |y - o|² = d² + 2 rho rho_o (1 - cos theta) <= R². So d <= R,

    rho (1 - cos theta) <= min(2 rho, (R² - d²) / (2 rho_o)),

and |rho sin theta| <= R. It remains to bound what the profile does within a circle of radius R.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.trees import NONE
from ..base.vectors import dot
from ..inside.ball_caps import FINE_SPARE, FINE_TOP
from .meridian import axis_of, chord_of, from_chord, from_segment, place_in, thickness
from .reach import reach_from_middle

_STACK = 128
"""Room for arcs that wait, twice the depth of a tree, and for waiting parts of one arc."""

_PARTS, _HALVES = 128, 32
"""Parts that an arc is divided into, at most, and room for the halves that wait."""


@inlined
def _rise(square, distance, rho, most, steep):
    """Return how much higher a point turned out of the half-plane may be than in it, metres."""
    if not steep > 0.0:
        return 0.0
    left = max(square - distance * distance, 0.0)
    turned = 2.0 * most
    if left < 2.0 * rho * turned:
        turned = left / (2.0 * rho)
    return steep * turned


@kernel
def _height_of_arc(arc, rho, z, n, radius, steep, margin, answer, fine, top):
    """Return the height with an arc counted as well, the looks, and whether the arc sufficed.

    The arc is halved until the height of its part within the circle is known to `fine`. If the
    arc's error does not allow that, `_height_of_part` has to follow.
    """
    rows = table_on_stack(_HALVES, 6, 0.0)
    rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 3] = (
        arc.middle[0], arc.middle[1], arc.half[0], arc.half[1]
    )  # fmt: skip
    rows[0, 4], rows[0, 5] = arc.sine, arc.cosine
    count, looks, seen = 1, 0, answer
    square, error = radius * radius, arc.error
    while count > 0:
        count -= 1
        row = rows[count]
        mx, mz, hx, hz, sine, cosine = row[0], row[1], row[2], row[3], row[4], row[5]
        mx, mz = mx - rho, mz - z
        rise = np.sqrt(hx * hx + hz * hz) * sine / (1.0 + cosine)
        away = from_segment(0.0, 0.0, mx - hx, mz - hz, mx + hx, mz + hz) - abs(rise) - error
        away = max(away - margin, 0.0)
        if away >= radius:
            continue
        looks += 1
        most = n[0] * mx + n[1] * mz + reach_from_middle(hx, hz, sine, cosine, n[0], n[1])
        wide = rho + mx + abs(hx) + abs(rise) + error
        most += error + _rise(square, away, rho, wide, steep) + margin
        if most <= answer:
            continue
        for side in (-1.0, 1.0):
            x, y = mx + side * hx, mz + side * hz
            off = np.sqrt(x * x + y * y) + error
            if off < radius:
                turned = _rise(square, off, rho, max(rho + x - error, 0.0), steep)
                seen = max(seen, n[0] * x + n[1] * y - error + turned)
        if seen > top:
            return np.inf, looks, True
        if most <= seen + fine:
            answer = max(answer, most)
            continue
        if most - seen < 4.0 * error or count + 2 > _HALVES or looks > _PARTS:
            return answer, looks, False
        # The arc runs `rise` to the left of the middle of its chord.
        half = np.sqrt(hx * hx + hz * hz)
        ux, uz = (hx / half, hz / half) if half > 0.0 else (1.0, 0.0)
        px, pz = 0.5 * (hx - rise * uz), 0.5 * (hz + rise * ux)
        qx, qz = 0.5 * (hx + rise * uz), 0.5 * (hz - rise * ux)
        cosine = np.sqrt(0.5 * (1.0 + cosine))
        sine = 0.5 * sine / cosine
        for k in range(2):
            side = 1.0 if k else -1.0
            row = rows[count + k]
            row[2], row[3] = (qx, qz) if k else (px, pz)
            row[0], row[1] = (
                mx + rho + side * hx - side * row[2],
                mz + z + side * hz - side * row[3],
            )
            row[4], row[5] = sine, cosine
        count += 2
    return answer, looks, True


@kernel
def _height_of_part(curve, low, high, rho, z, n, radius, steep, margin, answer, fine, top):
    """Do the same for a part of a piece, by its control points; return the height and the looks."""
    rows = table_on_stack(16, 3, 0.0)
    lows, highs = on_stack(_STACK, 0.0), on_stack(_STACK, 0.0)
    lows[0], highs[0] = low, high
    count, looks, square, seen = 1, 0, radius * radius, answer
    while count > 0:
        count -= 1
        low, high = lows[count], highs[count]
        x0, z0, x1, z1, far = chord_of(curve, low, high, rows)
        away = from_segment(rho, z, x0, z0, x1, z1) - far - margin
        if away >= radius:
            continue
        away = max(away, 0.0)
        most, wide = -np.inf, 0.0
        for i in range(curve.degree + 1):
            x, y = rows[i, 0] / rows[i, 2], rows[i, 1] / rows[i, 2]
            most, wide = max(most, n[0] * (x - rho) + n[1] * (y - z)), max(wide, x)
        most += _rise(square, away, rho, wide, steep) + margin
        if most <= answer:
            continue
        looks += 1
        for x, y in ((x0, z0), (x1, z1)):
            wide, x, y = x, x - rho, y - z
            off = np.sqrt(x * x + y * y)
            if off < radius:
                turned = _rise(square, off, rho, max(wide, 0.0), steep)
                seen = max(seen, n[0] * x + n[1] * y + turned)
        if seen > top:
            return np.inf, looks
        middle = 0.5 * (low + high)
        if most <= seen + fine or looks > _PARTS or not low < middle < high:
            answer = max(answer, most)
            if answer > top:
                return np.inf, looks
            continue
        lows[count], highs[count] = low, middle
        lows[count + 1], highs[count + 1] = middle, high
        count += 2
    return answer, looks


@shared
def height_within(tree, o, n, radius, height, top):
    """Bound how high along n over o the surface reaches within `radius`, metres.

    Returns the bound and the looks. The bound is at least `height`, and infinity if it is above
    `top`.
    """
    at = place_in(tree, o, n)
    flat = (dot(n, at.across), dot(n, axis_of(tree)))
    margin = at.margin + abs(dot(n, at.along)) * radius
    fine = max(FINE_SPARE * height, FINE_TOP * top)
    return height_in_plane(
        tree, at.rho, at.z, flat, radius, max(-flat[0], 0.0), margin, height, fine, top
    )


@shared
def height_in_plane(tree, rho, z, n, radius, steep, margin, height, fine, top):
    """Do the same in the half-plane of (rho, z), for its vector n.

    The bound may be too high by `fine`. `steep` is -n_rho if points turned out of the half-plane
    count and are higher there. Else it is 0, and the result is the profile's height.
    """
    arcs = tree.arcs
    square = radius * radius
    stack = on_stack(_STACK, np.int32(0))
    stack[0] = 0
    count, looks, answer = 1, 0, height
    while count > 0:
        count -= 1
        arc = arcs[stack[count]]
        looks += 1
        thick = thickness(arc)
        away = from_chord(arc, rho, z) - thick - margin
        if away >= radius:
            continue
        x, y = arc.middle[0] - rho, arc.middle[1] - z
        most = n[0] * x + n[1] * y + abs(n[0] * arc.half[0] + n[1] * arc.half[1])
        wide = arc.middle[0] + abs(arc.half[0]) + thick
        most += thick + _rise(square, max(away, 0.0), rho, wide, steep) + margin
        if most <= answer:
            continue
        if arc.child != NONE and count + 2 <= _STACK:
            stack[count], stack[count + 1] = arc.child, arc.child + 1
            count += 2
            continue
        found, more, known = _height_of_arc(
            arc, rho, z, n, radius, steep, margin, answer, fine, top
        )
        looks += more
        if not known:
            found, more = _height_of_part(
                tree.curves[arc.curve], arc.low, arc.high, rho, z, n, radius, steep, margin,
                answer, fine, top,
            )  # fmt: skip
            looks += 4 * more
        answer = found
        if answer > top:
            return np.inf, looks
    return answer, looks
