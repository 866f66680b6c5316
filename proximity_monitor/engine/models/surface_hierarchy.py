"""The bounding volume hierarchy of surfaces and curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.state import CONVERSION
from ..kernels.base.tables import surface_table
from ..kernels.inside.solids import connected_parts
from .closed import find_opening
from .hierarchy import Hierarchy
from .nurbs import frozen
from .solid import no_sides
from .surface_tree import build_surface, in_threes, projected, refit_surface
from .tree import weld

if TYPE_CHECKING:
    from ..kernels.base.state import SurfaceTree
    from .nurbs import Net
    from .solid import Sides

_AS_TOLD = "it is to be taken for a surface (solid=False)"
# A closed surface passes the check that `solid=True` demands, but no kernel tells its sides yet.
_UNTOLD = "it is a surface that closes up, whose sides are not told apart yet"


class SurfaceHierarchy(Hierarchy):
    """Volumes around the Bezier pieces of patches and curves."""

    KEPT = (*Hierarchy.KEPT, "nets", "order")

    __slots__ = ("nets", "order")

    nets: tuple[Net, ...]
    """Of the patches and curves."""
    order: NDArray[np.int32]
    """(m,) which piece, counted patch by patch, stands where in tree order."""

    @classmethod
    def of(cls, nets: Sequence[Net], *, deviation: float, solid: bool) -> Self:
        """The hierarchy of checked nets."""
        tree, order, depth = build_surface(nets, deviation)
        return cls._made({
            "nets": tuple(nets), "swept_radius": 0.0, "deviation": deviation, "solid": solid,
            "tree": tree, "distinct": tree, "depth": depth, "order": order,
            "numbers": np.ascontiguousarray(tree.pieces["patch"]),
        })  # fmt: skip

    def refitted(self, nets: Sequence[Net]) -> Self:
        """A hierarchy of the same structure over the same nets, whose control points moved.

        Its revision is one more.
        """
        tree = refit_surface(self.tree, self.order, nets)
        made = self._made(self._kept() | {"nets": tuple(nets), "tree": tree, "distinct": tree})
        made._ranges = self._ranges
        return made

    def _table(self, tree: SurfaceTree) -> NDArray[np.int64]:
        return surface_table(tree, self.numbers)

    def _measure(self, error: float = 0.0) -> None:
        super()._measure(error + float(self.tree.scale[CONVERSION]))

    def _corners(self) -> NDArray[np.float64]:
        return in_threes(projected(self.tree)[0])

    def _samples(self) -> NDArray[np.float64]:
        """Three corners of each piece: where both u and v are low, v alone, and neither."""
        points, starts = projected(self.tree)
        n_v = self.tree.pieces["degree_v"] + 1
        last = starts[1:] - 1
        places = np.stack((starts[:-1], last - n_v + 1, last), axis=1)
        return frozen(points[places].reshape(-1, 9))

    @property
    def some_point(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: the corner of the first patch where both parameters begin."""
        piece = self.tree.pieces[np.flatnonzero(self.order == 0)[0]]
        x, y, z, w = self.tree.nets[piece["net"] + np.arange(4) * piece["room"]]
        return np.array([x, y, z]) / w

    @property
    def some_feature(self) -> tuple[float, float, float, float]:
        """The parameters of that corner; the third is 1 on a curve, as `Surface.feature` has it."""
        along_u, along_v = self.nets[0].spans
        return float(along_u.low[0]), float(along_v.low[0]), float(self.nets[0].is_curve), 0.0

    def _find_sides(self) -> Sides:
        proper = not all(net.is_curve for net in self.nets)
        reason = find_opening(self.nets, self.deviation) if self.solid else _AS_TOLD
        return no_sides(self, proper, reason or _UNTOLD, self._parts())

    def _parts(self) -> NDArray[np.int32]:
        """One piece of each connected part, as `Region.samples`.

        Pieces that share a corner are connected; where others touch, the part counts as two.
        """
        points = self._samples().reshape(-1, 3)
        corners = weld(points).reshape(-1, 3)
        return connected_parts(corners, len(points))[1]

    @staticmethod
    def _frozen(state: dict[str, Any]) -> tuple[NDArray, ...]:
        own = [(net.control, net.weights, net.knots_u, net.knots_v) for net in state["nets"]]
        arrays = (array for each in own for array in each if array is not None)
        return *arrays, *Hierarchy._frozen(state)
