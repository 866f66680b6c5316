"""Filter sixteen triangle pairs at a time: which of them can still matter.

For each pair, float32 arithmetic on the nine pairs of edges finds a direction between two points
that are close to nearest. As with the volumes, the gap between the two triangles' projections on
*any* direction is a lower bound of their distance. The gap along either triangle's normal is one
too. At the true nearest points the best of the three *is* the distance. So pairs that cannot win
are pruned sixteen at a time. float32 or a degenerate triangle can only let too many pairs through.
"""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..base.jit import inlined, inlined16, loop16
from ..base.rounding import FILTER_LIMIT, FILTER_MARGIN, SINGLE_TINY

BATCH = 16
"""Pairs that are filtered together."""

CORNERS = 18 * BATCH
"""Numbers of a batch: coordinate c of pair k is at `c * BATCH + k`; a's triangle, then b's."""

_ZERO = float32(0.0)
_ONE = float32(1.0)
_TINY = float32(SINGLE_TINY)
_MARGIN = float32(FILTER_MARGIN)
_LIMIT = float32(FILTER_LIMIT)


@inlined
def gather(triangles_a, ta, triangles_b, tb, slot, corners):
    """Copy the corners of two triangles, each in its own frame, to a slot of a batch."""
    for i in range(9):
        corners[uint64(i * BATCH + slot)] = triangles_a[ta, i]
        corners[uint64((9 + i) * BATCH + slot)] = triangles_b[tb, i]


@loop16
def shift(corners, m, scale, local):
    """Write both triangles relative to a's first corner, in float32: a1, a2, b0, b1, b2.

    `m` moves b into a's frame; `scale` brings the numbers into the range of float32. The
    differences are computed in float64.
    """
    for k in range(BATCH):
        i = uint64(k)
        x, y, z = corners[i], corners[i + uint64(16)], corners[i + uint64(32)]
        local[i] = float32((corners[i + uint64(48)] - x) * scale)
        local[i + uint64(16)] = float32((corners[i + uint64(64)] - y) * scale)
        local[i + uint64(32)] = float32((corners[i + uint64(80)] - z) * scale)
        local[i + uint64(48)] = float32((corners[i + uint64(96)] - x) * scale)
        local[i + uint64(64)] = float32((corners[i + uint64(112)] - y) * scale)
        local[i + uint64(80)] = float32((corners[i + uint64(128)] - z) * scale)
        for corner in range(3):
            p = i + uint64(144 + 48 * corner)
            q = i + uint64(96 + 48 * corner)
            bx, by, bz = corners[p], corners[p + uint64(16)], corners[p + uint64(32)]
            local[q] = float32((m[0] * bx + m[1] * by + m[2] * bz + m[9] - x) * scale)
            local[q + uint64(16)] = float32((m[3] * bx + m[4] * by + m[5] * bz + m[10] - y) * scale)
            local[q + uint64(32)] = float32((m[6] * bx + m[7] * by + m[8] * bz + m[11] - z) * scale)


@inlined16
def _nearer(px, py, pz, dx, dy, dz, qx, qy, qz, ex, ey, ez, best, gx, gy, gz):
    """Return the shorter of the best difference so far and that of two segments' nearest points.

    Uses the clamped solution of Ericson 2005, section 5.1.9. Poor conditioning only makes the bound
    less tight.
    """
    rx, ry, rz = px - qx, py - qy, pz - qz
    a = dx * dx + dy * dy + dz * dz
    e = ex * ex + ey * ey + ez * ez
    b = dx * ex + dy * ey + dz * ez
    c = dx * rx + dy * ry + dz * rz
    f = ex * rx + ey * ry + ez * rz
    s = min(max((b * f - c * e) / max(a * e - b * b, _TINY), _ZERO), _ONE)
    t = min(max((b * s + f) / max(e, _TINY), _ZERO), _ONE)
    s = min(max((b * t - c) / max(a, _TINY), _ZERO), _ONE)
    hx, hy, hz = rx + s * dx - t * ex, ry + s * dy - t * ey, rz + s * dz - t * ez
    h = hx * hx + hy * hy + hz * hz
    shorter = h < best
    return (
        h if shorter else best,
        hx if shorter else gx,
        hy if shorter else gy,
        hz if shorter else gz,
    )


@inlined16
def _gap_along(nx, ny, nz, px, py, pz, qx, qy, qz, ax, ay, az, bx, by, bz, cx, cy, cz):
    """Return the gap of triangles (0, p, q) and (a, b, c), projected on n, divided by |n|."""
    p = nx * px + ny * py + nz * pz
    q = nx * qx + ny * qy + nz * qz
    a = nx * ax + ny * ay + nz * az
    b = nx * bx + ny * by + nz * bz
    c = nx * cx + ny * cy + nz * cz
    first_below = min(min(a, b), c) - max(max(p, q), _ZERO)
    first_above = min(min(p, q), _ZERO) - max(max(a, b), c)
    length = np.sqrt(max(nx * nx + ny * ny + nz * nz, _TINY))
    return max(first_below, first_above) / length


@loop16
def gaps(local, slack, bounds):
    """Write lower bounds of sixteen triangle pairs' distances, in the scale of `local`.

    `slack` covers the error of the motion; FILTER_MARGIN covers the rounding of a gap.
    """
    for k in range(BATCH):
        i = uint64(k)
        px, py, pz = local[i], local[i + uint64(16)], local[i + uint64(32)]
        qx, qy, qz = local[i + uint64(48)], local[i + uint64(64)], local[i + uint64(80)]
        ax, ay, az = local[i + uint64(96)], local[i + uint64(112)], local[i + uint64(128)]
        bx, by, bz = local[i + uint64(144)], local[i + uint64(160)], local[i + uint64(176)]
        cx, cy, cz = local[i + uint64(192)], local[i + uint64(208)], local[i + uint64(224)]
        ex, ey, ez = qx - px, qy - py, qz - pz
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - bx, cy - by, cz - bz
        wx, wy, wz = ax - cx, ay - cy, az - cz
        o = _ZERO
        h, gx, gy, gz = float32(3e38), o, o, o
        h, gx, gy, gz = _nearer(o, o, o, px, py, pz, ax, ay, az, ux, uy, uz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(o, o, o, px, py, pz, bx, by, bz, vx, vy, vz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(o, o, o, px, py, pz, cx, cy, cz, wx, wy, wz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(px, py, pz, ex, ey, ez, ax, ay, az, ux, uy, uz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(px, py, pz, ex, ey, ez, bx, by, bz, vx, vy, vz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(px, py, pz, ex, ey, ez, cx, cy, cz, wx, wy, wz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(o, o, o, qx, qy, qz, ax, ay, az, ux, uy, uz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(o, o, o, qx, qy, qz, bx, by, bz, vx, vy, vz, h, gx, gy, gz)
        h, gx, gy, gz = _nearer(o, o, o, qx, qy, qz, cx, cy, cz, wx, wy, wz, h, gx, gy, gz)
        bound = _gap_along(gx, gy, gz, px, py, pz, qx, qy, qz, ax, ay, az, bx, by, bz, cx, cy, cz)
        nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        bound = max(bound, _gap_along(
            nx, ny, nz, px, py, pz, qx, qy, qz, ax, ay, az, bx, by, bz, cx, cy, cz
        ))  # fmt: skip
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        bound = max(bound, _gap_along(
            nx, ny, nz, px, py, pz, qx, qy, qz, ax, ay, az, bx, by, bz, cx, cy, cz
        ))  # fmt: skip
        size = max(abs(px) + abs(py) + abs(pz), abs(qx) + abs(qy) + abs(qz)) + max(
            max(abs(ax) + abs(ay) + abs(az), abs(bx) + abs(by) + abs(bz)),
            abs(cx) + abs(cy) + abs(cz),
        )
        # Beyond the limit, products overflow (and NaN compares as false): then return no bound.
        bounds[k] = bound - size * _MARGIN - slack if size < _LIMIT else -_ONE
