"""Which points of two turning profiles may well be the nearest: samples of both are compared.

If b's half-plane is at one angle about b's axis, its samples have places in a's plane, and each is
compared with all of a's samples. The nearest two samples give the next angles of the half-planes:
that of a's sample about b's axis, and that of b's sample about a's. The first angle is the one at
which the axes are nearest. The result is a place to begin at; it proves nothing.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import allocating_entry, inlined, kernel
from ..base.memory import on_stack
from .newton import to_a
from .profile import jet_of

_MOST, _ENOUGH = 64, 24
"""Samples of a profile, at most; and about how many if its pieces are fewer."""

_LANES = 16
"""Single-precision lanes of a register. Beyond the samples there are copies of the last one."""

_ZERO, _ONE, _TWO, _FAR = (np.float32(x) for x in (0.0, 1.0, 2.0, np.inf))

_ROUNDS, _TURNS = 2, 1
"""How often all samples are compared, and how often the half-planes are then turned to the nearest
two."""


@allocating_entry
def take_samples(curves):
    """Return points of a profile (k, 3): rho and z, metres, and the piece's number plus t.

    Args:
        curves: (c,) CURVE_PIECE.
    """
    count = len(curves)
    each, every = max(_ENOUGH // count, 1), -(-count // _MOST)
    made = np.empty((each * -(-count // every), 3))
    for i in range(len(made)):
        piece = i // each * every
        t = (i % each + 0.5) / each
        (made[i, 0], made[i, 1]), _, _ = jet_of(curves[piece], t)
        made[i, 2] = piece + t
    return made


@inlined
def _unit(x, y):
    length = np.sqrt(x * x + y * y)
    return (x / length, y / length) if length > 0.0 else (1.0, 0.0)


@inlined
def _seen_from_b(motion, x, y, z):
    """Return the cosine and sine of the angle about b's axis at which a point of a's frame lies."""
    x, y, z = x - motion[9], y - motion[10], z - motion[11]
    return _unit(
        motion[0] * x + motion[3] * y + motion[6] * z, motion[1] * x + motion[4] * y + motion[7] * z
    )


@inlined
def _seen_from_a(motion, at, rho, z):
    """Return where b's sample lies in a's frame, with b's half-plane at an angle."""
    x, y, z = to_a(motion, rho * at[0], rho * at[1], z)
    return x + motion[9], y + motion[10], z + motion[11]


@inlined
def _extent(samples):
    low, high = samples[0, 1], samples[0, 1]
    for i in range(len(samples)):
        low, high = min(low, samples[i, 1]), max(high, samples[i, 1])
    return low, high


@inlined
def _between_axes(samples_a, samples_b, motion):
    """Estimate the angle about b's axis of the point of a's axis that is nearest to b's."""
    low_a, high_a = _extent(samples_a)
    low_b, high_b = _extent(samples_b)
    q = 0.5 * (low_b + high_b)
    p = 0.5 * (low_a + high_a)
    for _ in range(2):
        p = min(max(motion[11] + motion[8] * q, low_a), high_a)
        q = (p - motion[11]) * motion[8] - motion[9] * motion[2] - motion[10] * motion[5]
        q = min(max(q, low_b), high_b)
    return _seen_from_b(motion, 0.0, 0.0, p)


@inlined
def _nearer(rho, height, far, high, j, number):
    """Return the squared distance of a place from the nearer of two b samples, and its number."""
    across, along = rho - far[j], height - high[j]
    one = across * across + along * along
    across, along = rho - far[j + 1], height - high[j + 1]
    two = across * across + along * along
    return one if one <= two else two, number if one <= two else number + _ONE


@kernel
def near_samples(samples_a, samples_b, motion):
    """Return a sample of each profile, and the angle about b's axis at which both are near."""
    # Single precision suffices, because nothing is proven; a register holds twice as many lanes.
    rho, height = on_stack(64, _ZERO), on_stack(64, _ZERO)
    far, high = on_stack(64, _ZERO), on_stack(64, _ZERO)
    least, which = on_stack(64, _ZERO), on_stack(64, _ZERO)
    count, others = len(samples_a), len(samples_b)
    lanes = _LANES * ((count + _LANES - 1) // _LANES)
    for i in range(lanes):
        k = min(i, count - 1)
        rho[i], height[i] = np.float32(samples_a[k, 0]), np.float32(samples_a[k, 1])
    x0, y0, z0 = np.float32(motion[9]), np.float32(motion[10]), np.float32(motion[11])
    x2, y2, z2 = np.float32(motion[2]), np.float32(motion[5]), np.float32(motion[8])
    at = _between_axes(samples_a, samples_b, motion)
    a = b = 0
    for _ in range(_ROUNDS):
        x1, y1, z1 = to_a(motion, at[0], at[1], 0.0)
        x1, y1, z1 = np.float32(x1), np.float32(y1), np.float32(z1)
        for j in range(4 * ((others + 3) // 4)):
            k = min(j, others - 1)
            r, h = np.float32(samples_b[k, 0]), np.float32(samples_b[k, 1])
            x, y = x0 + r * x1 + h * x2, y0 + r * y1 + h * y2
            far[j], high[j] = np.sqrt(x * x + y * y), z0 + r * z1 + h * z2
        for i in range(lanes):
            least[i], which[i] = _FAR, _ZERO
        # Four samples of b at once: else the result of each lane would be stored and loaded for
        # each one.
        for j in range(0, others, 4):
            number = np.float32(j)
            for i in range(lanes):
                one, first = _nearer(rho[i], height[i], far, high, j, number)
                two, second = _nearer(rho[i], height[i], far, high, j + 2, number + _TWO)
                first = first if one <= two else second
                one = one if one <= two else two
                nearer = one < least[i]
                least[i] = one if nearer else least[i]
                which[i] = first if nearer else which[i]
        a = 0
        for i in range(1, count):
            if least[i] < least[a]:
                a = i
        b = min(int(which[a]), others - 1)
        for _ in range(_TURNS):
            x, y, _ = _seen_from_a(motion, at, samples_b[b, 0], samples_b[b, 1])
            ex, ey = _unit(x, y)
            r = samples_a[a, 0]
            at = _seen_from_b(motion, r * ex, r * ey, samples_a[a, 1])
    return a, b, math.atan2(at[1], at[0])
