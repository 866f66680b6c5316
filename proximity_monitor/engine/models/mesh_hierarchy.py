"""The bounding volume hierarchy of a mesh: volumes around triangles, perhaps swept by a ball."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import ahead
from ..kernels.base.tables import model_table
from .hierarchy import Hierarchy, Solid
from .solid import find_sides
from .tree import build, refit

if TYPE_CHECKING:
    from .solid import Sides
    from .tree import Coincident, Tree


class MeshHierarchy(Hierarchy):
    """Volumes around triangles, which a ball may sweep."""

    KEPT = (*Hierarchy.KEPT, "coincident", "faces", "vertices", "volume")

    __slots__ = ("_before", "coincident", "faces", "vertices", "volume")

    vertices: NDArray[np.float64]
    """(n, 3) metres, model frame; read-only."""
    faces: NDArray[np.int32]
    """(m, 3) indices of vertices; read-only."""
    volume: str
    """The kind of bounding volume, a key of VOLUMES."""
    coincident: Coincident
    """Which vertices and triangles coincided when the hierarchy was built."""

    @classmethod
    def of(
        cls,
        vertices: NDArray[np.float64],
        faces: NDArray[np.int32],
        *,
        volume: str,
        swept_radius: float,
        deviation: float,
        solid: Solid,
    ) -> Self:
        """Build the hierarchy of checked triangles."""
        ahead.want("mesh")
        corners = np.ascontiguousarray(vertices[faces].reshape(-1, 9))
        built = build(corners, vertices, faces, volume, swept_radius, deviation)
        return cls._made({
            "vertices": vertices, "faces": faces, "volume": volume, "swept_radius": swept_radius,
            "deviation": deviation, "solid": solid, "tree": built.tree, "distinct": built.distinct,
            "numbers": built.order, "depth": built.depth, "coincident": built.coincident,
        })  # fmt: skip

    def refitted(self, vertices: NDArray[np.float64]) -> Self:
        """Return a hierarchy of the same structure and faces for moved vertices, already checked.

        This is far cheaper than a new one. The revision increases by one. What is known of the
        edges of the solid is used again.
        """
        faces = self.faces.take(self.numbers, axis=0)
        corners = vertices.take(faces, axis=0).reshape(-1, 9)
        tree, distinct = refit(self.tree, self.coincident, corners, vertices, faces, self.volume)
        made = self._made(self._kept() | {"vertices": vertices, "tree": tree, "distinct": distinct})
        made._ranges, made._before = self._ranges, self._sides or self._before
        return made

    def _take(self, kept: dict[str, Any]) -> None:
        super()._take(kept)
        self._before: Sides | None = None

    def _table(self, tree: Tree) -> NDArray[np.int64]:
        return model_table(self.numbers, tree)

    def _corners(self) -> NDArray[np.float64]:
        return self.tree.triangles

    @property
    def some_point(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: the first corner of its faces."""
        return self.vertices[self.faces[0, 0]]

    @property
    def some_feature(self) -> tuple[float, float, float, float]:
        """The barycentric weights of that corner, and its face."""
        return 1.0, 0.0, 0.0, 0.0

    def _find_sides(self) -> Sides:
        sides, self._before = find_sides(self, self._before), None
        return sides

    def _samples(self) -> NDArray[np.float64]:
        return self.tree.triangles

    @staticmethod
    def _frozen(state: dict[str, Any]) -> tuple[NDArray, ...]:
        return state["vertices"], state["faces"], *Hierarchy._frozen(state)
