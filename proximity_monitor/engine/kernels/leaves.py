"""Rectangles around single triangles, sixteen at a time.

A triangle needs no statistics: its rectangle stands on its longest edge and is as high as it.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..tolerances import DOUBLE_EPS, SINGLE_EPS
from .jit import kernel
from .volumes import WIDTH

LEAVES = 13 * WIDTH
"""Numbers that `fit_leaves` writes: the fields of sixteen lanes, and their sizes."""

_W = uint64(WIDTH)
_SHORTEST = 1e-200
"""Square, in node units, of an edge that is divided by. Below it all products underflow."""

_NEEDLE = 1e-24
"""Square of a triangle's height, as a share of its longest edge, below which it is noise."""


@kernel
def fit_leaves(corners, centre, fitted):
    """Rectangles and radii of sixteen triangles, as `fit_lane` writes them, into `fitted`.

    Coordinate i of the triangle of lane k stands at corners[16 i + k], in node units; field f of
    lane k at fitted[16 f + k], its size at f = 12. Free of branches, so that LLVM vectorises it.
    """
    ox, oy, oz = centre[0], centre[1], centre[2]
    for lane in range(WIDTH):
        k = uint64(lane)
        px, py, pz = corners[k], corners[k + _W], corners[k + uint64(2) * _W]
        qx, qy, qz = (
            corners[k + uint64(3) * _W], corners[k + uint64(4) * _W], corners[k + uint64(5) * _W]
        )  # fmt: skip
        rx, ry, rz = (
            corners[k + uint64(6) * _W], corners[k + uint64(7) * _W], corners[k + uint64(8) * _W]
        )  # fmt: skip
        pq = (qx - px) * (qx - px) + (qy - py) * (qy - py) + (qz - pz) * (qz - pz)
        qr = (rx - qx) * (rx - qx) + (ry - qy) * (ry - qy) + (rz - qz) * (rz - qz)
        rp = (px - rx) * (px - rx) + (py - ry) * (py - ry) + (pz - rz) * (pz - rz)
        # The longest edge e starts at s; w leads from there to the third corner.
        second = qr > pq
        third = rp > max(pq, qr)
        sx = rx if third else (qx if second else px)
        sy = ry if third else (qy if second else py)
        sz = rz if third else (qz if second else pz)
        ex = (px if third else (rx if second else qx)) - sx
        ey = (py if third else (ry if second else qy)) - sy
        ez = (pz if third else (rz if second else qz)) - sz
        wx = (qx if third else (px if second else rx)) - sx
        wy = (qy if third else (py if second else ry)) - sy
        wz = (qz if third else (pz if second else rz)) - sz
        ee = ex * ex + ey * ey + ez * ez
        inverse = 1.0 / max(ee, _SHORTEST)
        # Its height, taken twice: the second time removes what rounding left along the edge.
        along = (wx * ex + wy * ey + wz * ez) * inverse
        hx, hy, hz = wx - along * ex, wy - along * ey, wz - along * ez
        along = (hx * ex + hy * ey + hz * ez) * inverse
        hx, hy, hz = hx - along * ex, hy - along * ey, hz - along * ez
        hh = hx * hx + hy * hy + hz * hz
        # A needle's or a point's axes are any: the first of Duff et al. 2017 (Building an
        # Orthonormal Basis, Revisited), which has no branch.
        pointed = ee <= _SHORTEST
        needle = pointed or hh <= _NEEDLE * ee
        length = np.sqrt(ee)
        stretch = 1.0 / max(length, _SHORTEST)
        ax = 1.0 if pointed else ex * stretch
        ay = 0.0 if pointed else ey * stretch
        az = 0.0 if pointed else ez * stretch
        sign = 1.0 if az >= 0.0 else -1.0
        slope = -1.0 / (sign + az)
        height = np.sqrt(hh)
        stretch = 1.0 / max(height, _SHORTEST)
        bx = 1.0 + sign * ax * ax * slope if needle else hx * stretch
        by = sign * ax * ay * slope if needle else hy * stretch
        bz = -sign * ax if needle else hz * stretch
        half = 0.0 if needle else 0.5
        ux, uy, uz = np.float32(ax), np.float32(ay), np.float32(az)
        vx, vy, vz = np.float32(bx), np.float32(by), np.float32(bz)
        a, b = np.float32(0.5 * length), np.float32(half * height)
        cx = np.float32(sx + 0.5 * ex + half * hx - ox)
        cy = np.float32(sy + 0.5 * ey + half * hy - oy)
        cz = np.float32(sz + 0.5 * ez + half * hz - oz)
        # The radius is measured from what was rounded, as in `enclosing_radius`.
        ax, ay, az = np.float64(ux), np.float64(uy), np.float64(uz)
        bx, by, bz = np.float64(vx), np.float64(vy), np.float64(vz)
        mx, my, mz = ox + np.float64(cx), oy + np.float64(cy), oz + np.float64(cz)
        reach_a, reach_b = np.float64(a), np.float64(b)
        worst = 0.0
        extent = 0.0
        for corner in range(3):
            i = k + uint64(3 * corner) * _W
            x, y, z = corners[i], corners[i + _W], corners[i + uint64(2) * _W]
            extent = max(extent, abs(x) + abs(y) + abs(z))
            x, y, z = x - mx, y - my, z - mz
            s = min(max(x * ax + y * ay + z * az, -reach_a), reach_a)
            t = min(max(x * bx + y * by + z * bz, -reach_b), reach_b)
            x = x - s * ax - t * bx
            y = y - s * ay - t * by
            z = z - s * az - t * bz
            worst = max(worst, x * x + y * y + z * z)
        rounding = 16.0 * DOUBLE_EPS * (extent + abs(mx) + abs(my) + abs(mz))
        radius = (np.sqrt(worst) + rounding) * (1.0 + 2.0 * SINGLE_EPS) + 1.2e-38
        rounded = np.float32(radius)
        fitted[k], fitted[k + _W], fitted[k + uint64(2) * _W] = cx, cy, cz
        fitted[k + uint64(3) * _W] = ux
        fitted[k + uint64(4) * _W] = uy
        fitted[k + uint64(5) * _W] = uz
        fitted[k + uint64(6) * _W] = vx
        fitted[k + uint64(7) * _W] = vy
        fitted[k + uint64(8) * _W] = vz
        fitted[k + uint64(9) * _W] = rounded
        fitted[k + uint64(10) * _W] = a
        fitted[k + uint64(11) * _W] = b
        fitted[k + uint64(12) * _W] = np.float32(
            np.sqrt(reach_a * reach_a + reach_b * reach_b) + np.float64(rounded)
        )
