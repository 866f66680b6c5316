"""Contacts of two models of which at least one is a parametric surface: points and normals.

The rule is that of triangles (kernels/elements/contacts.py), but the surface's own normal at the
touching point replaces a face normal, and the control points of its piece replace the corners.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.trees import SurfaceTree
from ..models.hierarchy import Hierarchy
from ..models.surface_hierarchy import SurfaceHierarchy
from ..models.surface_mesh import unit_normals
from .witness import witness_points

Reals = NDArray[np.float64]

_NOISE = 8.0
"""As in kernels/elements/contacts.py."""


def are_divided(*hierarchies: Hierarchy) -> bool:
    """Return whether the elements of any of these hierarchies are pieces of surfaces."""
    return any([isinstance(each.tree, SurfaceTree) for each in hierarchies])


def contacts_of(
    rows: Reals, hierarchies: tuple[Hierarchy, Hierarchy], poses: tuple[Reals, Reals], slack: float
) -> tuple[NDArray[np.int32], Reals, Reals]:
    """Return contacts (k, 2), their points (k, 3) and normals (k, 3), as in `Collision`.

    Args:
        rows: (k, ANSWER) answers; the nearest points of each touch.
        hierarchies: of both models.
        poses: two (4, 4), model to world.
        slack: metres; what rounding may do to the distance of these points.
    """
    a, b = (
        (_Pieces if isinstance(hierarchy, SurfaceHierarchy) else _Triangles)(
            hierarchy, pose, rows, side
        )
        for side, (hierarchy, pose) in enumerate(zip(hierarchies, poses, strict=True))
    )
    way = rows[:, index.POINT_B : index.POINT_B + 3] - rows[:, index.POINT_A : index.POINT_A + 3]
    length = np.linalg.norm(way, axis=1)
    apart = length > _NOISE * slack
    normals = np.where(apart[:, None], _unit(way), _parting(a, b))
    return np.stack((a.numbers, b.numbers), axis=1), witness_points(rows)[0].copy(), normals


class _Side(ABC):
    """The touching elements of one model, at the points that the answers name, in the world."""

    __slots__ = ("_elements", "_hierarchy", "_pose", "normals", "numbers", "tangents")

    numbers: NDArray[np.int32]
    normals: Reals
    """(k, 3) unit; 0 for an element without a normal."""
    tangents: Reals
    """(k, 3) along each element, of any length."""

    def __init__(self, hierarchy: Hierarchy, pose: Reals, rows: Reals, side: int) -> None:
        self._hierarchy, self._pose = hierarchy, pose
        self._elements = rows[:, (index.TREE_A, index.TREE_B)[side]].astype(np.int64)
        self.numbers = hierarchy.numbers[self._elements]
        first = (index.FEATURE_A, index.FEATURE_B)[side]
        normals, tangents = self._directions(rows[:, first : first + 2])
        self.normals = _unit(normals) @ pose[:3, :3].T
        self.tangents = tangents @ pose[:3, :3].T

    @abstractmethod
    def _directions(self, parameters: Reals) -> tuple[Reals, Reals]:
        """Return normals and tangents (k, 3) at parameters (k, 2) of the elements, model frame."""

    @abstractmethod
    def _products(self, n: Reals) -> Iterator[tuple[NDArray[np.int64], Reals]]:
        """Yield, for some contacts at a time, their numbers and products of n (k, 3) with points.

        The convex hull of the points of a contact holds its element.
        """

    def ends(self, n: Reals) -> tuple[Reals, Reals]:
        """Bound where each element begins and ends along directions (k, 3) of the world, metres."""
        begins, ends = np.empty(len(n)), np.empty(len(n))
        for contacts, products in self._products(n @ self._pose[:3, :3]):
            begins[contacts], ends[contacts] = products.min(axis=1), products.max(axis=1)
        offset = n @ self._pose[:3, 3]
        return begins + offset, ends + offset


class _Triangles(_Side):
    """Elements of a mesh."""

    __slots__ = ()

    def _corners(self) -> Reals:
        return self._hierarchy.tree.triangles[self._elements].reshape(-1, 3, 3)

    def _directions(self, parameters: Reals) -> tuple[Reals, Reals]:
        corners = self._corners()
        edges = np.roll(corners, -1, axis=1) - corners
        longest = np.linalg.norm(edges, axis=2).argmax(axis=1)
        return np.cross(edges[:, 0], edges[:, 1]), edges[np.arange(len(edges)), longest]

    def _products(self, n: Reals) -> Iterator[tuple[NDArray[np.int64], Reals]]:
        yield np.arange(len(n)), np.einsum("kij,kj->ki", self._corners(), n)


class _Pieces(_Side):
    """Elements of a surface: Bezier pieces, each within the hull of its control points."""

    __slots__ = ()

    def _directions(self, parameters: Reals) -> tuple[Reals, Reals]:
        normals, tangents = np.empty((2, len(parameters), 3))
        for patch in np.unique(self.numbers):
            own = np.flatnonzero(self.numbers == patch)
            net, (u, v) = self._hierarchy.nets[patch], parameters[own].T
            normals[own] = unit_normals(net, u, v)
            tangents[own] = net.derivatives(u, v, 1)[:, 1, 0]
        return normals, tangents

    def _products(self, n: Reals) -> Iterator[tuple[NDArray[np.int64], Reals]]:
        tree = self._hierarchy.tree
        pieces = tree.pieces[self._elements]
        sizes = pieces["points"] * 2**16 + pieces["room"]
        for size in np.unique(sizes):
            own = np.flatnonzero(sizes == size)
            count, room = int(pieces["points"][own[0]]), int(pieces["room"][own[0]])
            places = np.arange(4)[:, None] * room + np.arange(count)
            rows = tree.nets[pieces["net"][own, None, None] + places]
            yield own, np.einsum("kip,ki->kp", rows[:, :3] / rows[:, 3:], n[own])


def _unit(vectors: Reals) -> Reals:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)


def _parting(a: _Side, b: _Side) -> Reals:
    """Return directions (k, 3) along which b has the shorter way until the elements are apart.

    The two candidates are the normal of a and that of b reversed; or, if neither has a normal, both
    directions perpendicular to both tangents.
    """
    across = _unit(np.cross(a.tangents, b.tangents))
    neither = ~(a.normals.any(axis=1) | b.normals.any(axis=1))[:, None]
    one, other = np.where(neither, across, a.normals), np.where(neither, -across, -b.normals)
    overlaps = []
    for n in (one, other):
        none = ~n.any(axis=1) & ~neither[:, 0]
        overlaps.append(np.where(none, np.inf, a.ends(n)[1] - b.ends(n)[0]))
    return np.where((overlaps[0] <= overlaps[1])[:, None], one, other)
