"""All nine pairs of two triangles' edges at a time, in float64.

The formulas, and so their rounding errors, are those of `segments` (triangles.py). They have no
branch, so LLVM vectorises them, which takes less than half the time.
"""

from __future__ import annotations

from numba import uint64

from ..base.jit import kernel
from ..base.memory import on_stack
from ..base.precise import difference_of_products
from ..base.rounding import TOUCHING
from ..base.vectors import clamped

LANES = 16
"""Length of the arrays for the nine pairs: edge i of the first triangle and edge j of the second
are at index 3 i + j."""

_TABLE = 9 * LANES
_L = uint64(LANES)


@kernel
def edge_pairs(a, ea, b, eb, s, t, squared, touching):
    """Find the nearest points of nine pairs of segments; every output array is (LANES,).

    `a` and `b` are corners, `ea` and `eb` the edges that begin there. Writes the parameters `s` on
    the first triangle's edge and `t` on the second's, and the squared distance `squared`. If
    `squared` is below `touching`, recompute the pair with `segments`. Lanes from nine on mean
    nothing.
    """
    table = on_stack(_TABLE, 0.0)
    for k in range(LANES):
        pair = min(k, 8)
        i, j = pair // 3, pair % 3
        for c in range(3):
            table[uint64(LANES * c + k)] = b[j][c] - a[i][c]
            table[uint64(LANES * (3 + c) + k)] = ea[i][c]
            table[uint64(LANES * (6 + c) + k)] = eb[j][c]
    for lane in range(LANES):
        k = uint64(lane)
        rx, ry, rz = table[k], table[k + _L], table[k + uint64(2) * _L]
        dx, dy, dz = table[k + uint64(3) * _L], table[k + uint64(4) * _L], table[k + uint64(5) * _L]
        ex, ey, ez = table[k + uint64(6) * _L], table[k + uint64(7) * _L], table[k + uint64(8) * _L]
        dd = dx * dx + dy * dy + dz * dz
        ee = ex * ex + ey * ey + ez * ez
        nx = difference_of_products(dy, ez, dz, ey)
        ny = difference_of_products(dz, ex, dx, ez)
        nz = difference_of_products(dx, ey, dy, ex)
        nn = nx * nx + ny * ny + nz * nz
        cx, cy, cz = ry * ez - rz * ey, rz * ex - rx * ez, rx * ey - ry * ex
        x = clamped((cx * nx + cy * ny + cz * nz) / nn)
        x = x if nn > 0.0 else 0.0
        gx, gy, gz = rx - x * dx, ry - x * dy, rz - x * dz
        y = clamped(-(gx * ex + gy * ey + gz * ez) / ee)
        y = y if ee > 0.0 else 0.0
        gx, gy, gz = gx + y * ex, gy + y * ey, gz + y * ez
        z = clamped(x + (gx * dx + gy * dy + gz * dz) / dd)
        x = z if dd > 0.0 else x
        gx = (rx + y * ex) - x * dx
        gy = (ry + y * ey) - x * dy
        gz = (rz + y * ez) - x * dz
        s[k], t[k] = x, y
        squared[k] = gx * gx + gy * gy + gz * gz
        touching[k] = TOUCHING * (dd + ee)
