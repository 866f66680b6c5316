"""The contact of two models of which one at least is a parametric surface.

The rule is that of triangles (kernels/elements/contacts.py), with the surface's own normal where it
touches, and the control points of its piece in place of a triangle's corners.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.state import SurfaceTree
from ..models.hierarchy import Hierarchy
from ..models.surface_hierarchy import SurfaceHierarchy
from ..models.surface_mesh import unit_normals
from .witness import witness_points

Reals = NDArray[np.float64]

_NOISE = 8.0
"""As in kernels/elements/contacts.py."""


def are_divided(*hierarchies: Hierarchy) -> bool:
    """Whether the elements of any are pieces of surfaces."""
    return any(isinstance(each.tree, SurfaceTree) for each in hierarchies)


def contact_of(
    row: Reals, hierarchies: tuple[Hierarchy, Hierarchy], poses: tuple[Reals, Reals], slack: float
) -> tuple[NDArray[np.int32], Reals, Reals]:
    """The contact (1, 2), its point (1, 3) and its normal (1, 3), as in `Collision`.

    Args:
        row: (ANSWER,) whose nearest points touch.
        hierarchies: of both models.
        poses: two (4, 4), model to world.
        slack: metres; what rounding may do to the distance of these points.
    """
    found = [
        _Side(hierarchy, pose, row, side)
        for side, (hierarchy, pose) in enumerate(zip(hierarchies, poses, strict=True))
    ]
    way = row[index.POINT_B : index.POINT_B + 3] - row[index.POINT_A : index.POINT_A + 3]
    length = float(np.linalg.norm(way))
    normal = way / length if length > _NOISE * slack else _parting(*found)
    numbers = np.array([[each.number for each in found]], np.int32)
    return numbers, witness_points(row)[0][None].copy(), normal[None]


class _Side:
    """An element in the world, at the point that an answer names."""

    __slots__ = ("hull", "normal", "number", "tangent")

    hull: Reals
    """(k, 3) points in whose convex hull it lies."""
    number: int
    normal: Reals
    """(3,) unit; 0 where there is none."""
    tangent: Reals
    """(3,) along it, of any length."""

    def __init__(self, hierarchy: Hierarchy, pose: Reals, row: Reals, side: int) -> None:
        element = int(row[(index.TREE_A, index.TREE_B)[side]])
        feature = (index.FEATURE_A, index.FEATURE_B)[side]
        self.number = int(hierarchy.numbers[element])
        tree = hierarchy.tree
        if isinstance(hierarchy, SurfaceHierarchy):
            piece = tree.pieces[element]
            rows = tree.nets[piece["net"] :][: 4 * piece["room"]].reshape(4, -1)
            hull = (rows[:3] / rows[3]).T[: piece["points"]]
            net, (u, v) = hierarchy.nets[self.number], row[feature : feature + 2, None]
            normal, tangent = unit_normals(net, u, v)[0], net.derivatives(u, v, 1)[0, 1, 0]
        else:
            hull = tree.triangles[element].reshape(3, 3)
            edges = np.roll(hull, -1, axis=0) - hull
            normal, tangent = np.cross(edges[0], edges[1]), max(edges, key=np.linalg.norm)
        turn = pose[:3, :3].T
        self.hull = hull @ turn + pose[:3, 3]
        self.normal, self.tangent = _unit(normal) @ turn, tangent @ turn


def _unit(vector: Reals) -> Reals:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.zeros(3)


def _parting(a: _Side, b: _Side) -> Reals:
    """The direction along which b has to go less far until the elements are apart."""
    ways = [each for each in (a.normal, -b.normal) if each.any()]
    if not ways:
        across = _unit(np.cross(a.tangent, b.tangent))
        ways = [across, -across]
    return min(ways, key=lambda n: (a.hull @ n).max() - (b.hull @ n).min())
