"""The bounding volume hierarchy of surfaces and curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import NET_POINT
from ..kernels.base.tables import model_table
from ..kernels.base.trees import CONVERSION, JOINTS, NONE
from ..kernels.inside.solids import connected_parts
from ..kernels.surface.trim import CROSSING
from ..kernels.surface.trim_entries import nearest_trim_points
from .hierarchy import Hierarchy
from .nurbs import frozen
from .parts import parts_of
from .solid import plain_sides
from .surface_tree import build_surface, in_threes, projected, refit_surface
from .tree import weld
from .trim import joined

if TYPE_CHECKING:
    from ..kernels.base.trees import SurfaceTree
    from .closed import Joints
    from .nurbs import Net
    from .parts import Parts
    from .solid import Sides

_ROWS, _RATIONAL_ROWS = 3, 7
"""Rows of a cell's control points: x, y and z; of a rational cell four homogeneous rows as well."""


class SurfaceHierarchy(Hierarchy):
    """Volumes around the Bezier pieces of patches and curves."""

    KEPT = (*Hierarchy.KEPT, "joints", "nets", "order", "parts")

    __slots__ = ("cell_width", "joints", "nets", "order", "parts")

    parts_of = staticmethod(parts_of)
    """The function that says into how many parts the spans of nets are cut."""

    joints: Joints
    """The gap with which the patches close up, or why there is no inside."""

    nets: tuple[Net, ...]
    """The control nets of the patches and curves."""
    order: NDArray[np.int32]
    """(m,) the number, counted patch by patch, of each piece in tree order."""
    parts: Parts
    """Into how many parts the spans are cut; unchanged while the structure is kept."""

    @classmethod
    def of(
        cls,
        nets: Sequence[Net],
        parts: Parts,
        *,
        deviation: float,
        solid: bool | None,
        joints: Joints,
    ) -> Self:
        """Build the hierarchy of checked nets, cut into `parts`, which close up as `joints` says.

        Raises:
            ModelError: a trimming loop leaves the rectangle of its patch.
        """
        trims = joined([net.trim for net in nets])
        tree, order, depth = build_surface(nets, parts, trims, deviation, joints.gap)
        return cls._made({
            "joints": joints, "nets": tuple(nets), "swept_radius": 0.0, "deviation": deviation,
            "solid": solid, "tree": tree, "distinct": tree, "depth": depth, "order": order,
            "numbers": np.ascontiguousarray(tree.pieces["patch"]), "parts": parts,
        })  # fmt: skip

    def refitted(self, nets: Sequence[Net], joints: Joints) -> Self:
        """Return a hierarchy of the same structure for nets whose control points moved.

        The revision increases by one.
        """
        return self._moved(nets, joints, {})

    def _moved(self, nets: Sequence[Net], joints: Joints, own: dict[str, Any]) -> Self:
        """Do what `refitted` does; `own` are attributes that a subclass has changed."""
        tree, corners = refit_surface(self.tree, self.order, nets, self.parts, joints.gap)
        changed = {"joints": joints, "nets": tuple(nets), "tree": tree, "distinct": tree}
        made = self._made(self._kept() | changed | own, corners)
        made._ranges = self._ranges
        return made

    def _table(self, tree: SurfaceTree) -> NDArray[np.int64]:
        return model_table(self.numbers, tree)

    def _take(self, kept: dict[str, Any]) -> None:
        super()._take(kept)
        pieces = self.tree.pieces
        rows = np.where(pieces["rational"] != 0, _RATIONAL_ROWS, _ROWS)
        self.cell_width = int((rows * pieces["room"]).max())

    def _measure(self, corners: NDArray[np.float64], error: float = 0.0) -> None:
        super()._measure(corners, error + float(self.tree.scale[CONVERSION]))

    def _corners(self) -> NDArray[np.float64]:
        return in_threes(projected(self.tree)[0])

    def _samples(self) -> NDArray[np.float64]:
        """Return three corners of each piece: with u and v low, with u high and v low, both high.

        For an edge they are its ends. A piece that loops cross has one point instead: an end of an
        edge on the piece; without one its middle, if this is left; else an end of another edge of
        its patch.
        """
        pieces = self.tree.pieces
        points, starts = projected(self.tree)
        last = starts[1:] - 1
        places = np.stack((starts[:-1], last - pieces["degree_v"], last), axis=1)
        made = points[places]
        crossed = np.flatnonzero(pieces["side"] == CROSSING)
        edges = np.flatnonzero(pieces["edge"] != NONE)
        if len(crossed):
            made[crossed] = points[starts[pieces["face"][crossed]], None]
            for i in crossed[pieces["face"][crossed] == crossed]:
                middle = 0.5 * (pieces["low"][i] + pieces["high"][i])
                net = self.nets[pieces["patch"][i]]
                made[i] = net.derivatives(middle[:1], middle[1:], 0)[0, 0, 0]
            made[pieces["face"][edges]] = points[starts[edges], None]
        return frozen(made.reshape(-1, 9))

    @property
    def some_point(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: the corner of lowest u and v of an untrimmed patch, if any.

        If all patches are trimmed, it is a point that the loops of the first one leave.
        """
        patch, u, v = self._somewhere()
        if self.nets[patch].trim is not None:
            return self.nets[patch].derivatives(np.array([u]), np.array([v]), 0)[0, 0, 0]
        own = self.tree.pieces[self.tree.pieces["patch"] == patch]
        piece = own[(own["low"] == (u, v)).all(axis=1)][0]
        x, y, z, w = self.tree.nets[piece["net"] + np.arange(4) * piece["room"]]
        return np.array([x, y, z]) / w

    @property
    def some_feature(self) -> tuple[float, float, float, float]:
        """u, v, 0 on a patch or 1 on a curve (as for `Surface.feature`), and the patch's number."""
        patch, u, v = self._somewhere()
        return u, v, float(self.nets[patch].is_curve), float(patch)

    def _somewhere(self) -> tuple[int, float, float]:
        """Return a patch or curve, and u and v of a point of it that no loop cuts off.

        It is one without a trim, if there is any.
        """
        for patch, net in enumerate(self.nets):
            if net.trim is None:
                along_u, along_v = net.spans
                return patch, float(along_u.low[0]), float(along_v.low[0])
        middle = self.nets[0].trim.record["low"] + 0.5 * self.nets[0].trim.record["extent"]
        found = np.empty((1, 2))
        nearest_trim_points(self.tree.trims, 0, middle[None], 1.0, 1.0, found)
        return 0, float(found[0, 0]), float(found[0, 1])

    @property
    def error(self) -> float:
        """See `Hierarchy.error`."""
        scale = self.tree.scale
        return float(NET_POINT * scale[2] + scale[CONVERSION] + scale[JOINTS])

    def _find_sides(self) -> Sides:
        proper = not all(net.is_curve for net in self.nets)
        return plain_sides(self, proper, self.joints.reason, self._parts())

    def _parts(self) -> NDArray[np.int32]:
        """Return one piece of each connected part, for `Region.samples`.

        Pieces that share a corner are connected. Parts that touch elsewhere count separately.
        """
        points = self._samples().reshape(-1, 3)
        corners = weld(points).reshape(-1, 3)
        return connected_parts(corners, len(points))[1]

    @staticmethod
    def _frozen(state: dict[str, Any]) -> tuple[NDArray, ...]:
        own = [(net.control, net.weights, net.knots_u, net.knots_v) for net in state["nets"]]
        arrays = (array for each in own for array in each if array is not None)
        return *arrays, *Hierarchy._frozen(state)
