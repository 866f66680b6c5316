"""Spheres around the volumes of a hierarchy."""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel
from ..base.vectors import add, scaled
from ..tree.layout import HALF_U, HALF_V, RADIUS, STRIDE, WIDTH, read_vector, row


@kernel
def sphere_of(tree, lane):
    """Return centre and radius, metres, of a sphere around one lane's volume."""
    node = lane // WIDTH
    base = uint64(node * STRIDE + lane % WIDTH)
    centre = scaled(add(read_vector(tree.nodes, base), row(tree.centres, node)), tree.scale[0])
    a = np.float64(tree.nodes[base + HALF_U])
    b = np.float64(tree.nodes[base + HALF_V])
    # Half the rectangle's diagonal. Its axes are perpendicular up to the rounding of float32.
    radius = np.sqrt(a * a + b * b) + tree.nodes[base + RADIUS]
    return centre, radius * tree.scale[0] * (1.0 + 1e-4)
