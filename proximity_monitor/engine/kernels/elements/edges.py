"""All nine pairs of two triangles' edges at a time, in float64.

The formulas, and so their rounding errors, are those of `segments` (triangles.py). They have no
branch, so LLVM vectorises them, which takes less than half the time.
"""

from __future__ import annotations

from numba import uint64

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.precise import difference_of_products
from ..base.rounding import TOUCHING
from ..base.vectors import clamped

LANES = 16
"""Length of the arrays for the nine pairs: edge i of the first triangle and edge j of the second
are at index 3 i + j."""

_TABLE = 9 * LANES
_L = uint64(LANES)


@inlined
def _put(table, k, p, d, q, e):
    """Write the difference of two edges' beginnings p and q, and both edges, to lane k."""
    i = uint64(k)
    table[i], table[i + _L], table[i + uint64(2) * _L] = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    table[i + uint64(3) * _L], table[i + uint64(4) * _L] = d[0], d[1]
    table[i + uint64(5) * _L], table[i + uint64(6) * _L] = d[2], e[0]
    table[i + uint64(7) * _L], table[i + uint64(8) * _L] = e[1], e[2]


@inlined
def _put_row(table, k, p, d, b, eb):
    """Write one edge with each of the other triangle's, to lanes k to k + 2."""
    _put(table, k, p, d, b[0], eb[0])
    _put(table, k + 1, p, d, b[1], eb[1])
    _put(table, k + 2, p, d, b[2], eb[2])


@kernel
def edge_pairs(a, ea, b, eb, s, t, squared, touching):
    """Find the nearest points of nine pairs of segments; every output array is (LANES,).

    `a` and `b` are corners, `ea` and `eb` the edges that begin there. Writes the parameters `s` on
    the first triangle's edge and `t` on the second's, and the squared distance `squared`. If
    `squared` is below `touching`, recompute the pair with `segments`. Lanes from nine on mean
    nothing.
    """
    table = on_stack(_TABLE, 0.0)
    for i in range(_TABLE):
        table[uint64(i)] = 0.0
    _put_row(table, 0, a[0], ea[0], b, eb)
    _put_row(table, 3, a[1], ea[1], b, eb)
    _put_row(table, 6, a[2], ea[2], b, eb)
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
