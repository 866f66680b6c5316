"""The bounding volume hierarchy of a model, as the kernels find it: what every model has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.state import DEVIATION, REVISION, SWEPT
from ..kernels.base.tables import mesh_table
from ..kernels.tree.measure import measure
from ..kernels.tree.ranges import node_ranges
from ..kernels.tree.spread import spread_corners
from .solid import Sides, find_sides
from .tree import build, refit

if TYPE_CHECKING:
    from .tree import Coincident, Tree

Solid = bool | Literal["robust"] | None
"""Whether a model is to be a solid; see `TriangleMesh`."""

_KEPT = (
    "coincident", "deviation", "depth", "distinct", "faces", "numbers", "solid", "swept_radius",
    "tree", "vertices", "volume",
)  # fmt: skip
"""What a hierarchy cannot be made again without."""


class Hierarchy:
    """Volumes around triangles, perhaps swept by a ball. It never changes; `refitted` makes others.

    Questions ask a model for it (`Model._hierarchy`) and hand its trees or tables to the kernels.
    A table holds addresses: whoever uses one keeps the hierarchy.
    """

    __slots__ = (*_KEPT, "_before", "_ranges", "_sides", "_spread", "centre", "core_radius",
                 "radius", "table", "table_of_all")  # fmt: skip

    vertices: NDArray[np.float64]
    """(n, 3) metres, model frame; read-only."""
    faces: NDArray[np.int32]
    """(m, 3) indices of vertices; read-only."""
    swept_radius: float
    """Metres: the ball that sweeps the triangles."""
    deviation: float
    """Metres: how far the surface may be from that of the thing that the model stands for."""
    volume: str
    """The kind of bounding volume, a key of VOLUMES."""
    solid: Solid
    """What was asked for; `is_solid` is what it is."""
    numbers: NDArray[np.int32]
    """(m,) which face stands where in tree order."""
    depth: int
    """The number of levels."""
    coincident: Coincident
    """Which vertices and triangles lay on each other when it was built."""
    tree: Tree
    """All volumes and triangles, as the kernels see them."""
    distinct: Tree
    """The same without the volumes that hold nothing but twins; `tree` itself where none do."""
    table: NDArray[np.int64]
    """The addresses of `distinct`: who looks for the nearest needs one of several that coincide."""
    table_of_all: NDArray[np.int64]
    """The addresses of `tree`: who lists or counts triangles needs all."""
    centre: NDArray[np.float64]
    """(3,) metres, model frame: centre of a sphere that holds every used vertex."""
    core_radius: float
    """Metres: radius of that sphere, rounding included."""
    radius: float
    """Metres: radius of a sphere around `centre` that holds all the model stands for."""

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
        """The hierarchy of checked triangles."""
        corners = np.ascontiguousarray(vertices[faces].reshape(-1, 9))
        built = build(corners, vertices, faces, volume, swept_radius, deviation)
        made = cls.__new__(cls)
        made._take({
            "vertices": vertices, "faces": faces, "volume": volume, "swept_radius": swept_radius,
            "deviation": deviation, "solid": solid, "tree": built.tree, "distinct": built.distinct,
            "numbers": built.order, "depth": built.depth, "coincident": built.coincident,
        })  # fmt: skip
        made._measure(corners)
        return made

    def refitted(self, vertices: NDArray[np.float64]) -> Self:
        """A hierarchy of the same structure over the same faces, whose checked vertices moved.

        Far cheaper than a new one. Its revision is one more, and what is known of the solid's edges
        is used again.
        """
        faces = self.faces.take(self.numbers, axis=0)
        corners = vertices.take(faces, axis=0).reshape(-1, 9)
        tree, distinct = refit(self.tree, self.coincident, corners, vertices, faces, self.volume)
        made = type(self).__new__(type(self))
        kept = {name: getattr(self, name) for name in _KEPT}
        made._take(kept | {"vertices": vertices, "tree": tree, "distinct": distinct})
        made._measure(corners)
        made._ranges, made._before = self._ranges, self._sides or self._before
        return made

    def core(self) -> Self:
        """The hierarchy of what the ball sweeps: the same volumes, swept by nothing.

        It does not deviate from anything, either.
        """
        scale = self.tree.scale.copy()
        scale[[SWEPT, DEVIATION]] = 0.0
        scale.setflags(write=False)
        tree = self.tree._replace(scale=scale)
        distinct = tree if self.distinct is self.tree else self.distinct._replace(scale=scale)
        made = type(self).__new__(type(self))
        kept = {name: getattr(self, name) for name in _KEPT}
        changed = {"tree": tree, "distinct": distinct, "swept_radius": 0.0, "deviation": 0.0}
        made._take(kept | changed)
        made._measure(tree.triangles)
        return made

    def _take(self, kept: dict[str, Any]) -> None:
        """Take what is kept, and make the tables by which kernels find it."""
        for name, value in kept.items():
            setattr(self, name, value)
        self.table_of_all = self.table = mesh_table(self.tree, self.numbers)
        if self.distinct is not self.tree:
            self.table = mesh_table(self.distinct, self.numbers)
        self._ranges: NDArray[np.int32] | None = None
        self._spread: NDArray[np.int32] | None = None
        self._sides: Sides | None = None
        self._before: Sides | None = None

    def _measure(self, corners: NDArray[np.float64]) -> None:
        """Find the sphere: the centre of the bounding box and the largest distance, rounded up."""
        centre = np.empty(3)
        radius, _, _ = measure(corners, centre)
        centre.setflags(write=False)
        self.centre = centre
        self.core_radius = radius + 8.0 * DOUBLE_EPS * (radius + float(np.abs(centre).sum()))
        whole = self.core_radius + self.swept_radius + self.deviation
        self.radius = whole * (1.0 + 4.0 * DOUBLE_EPS)

    @property
    def some_point(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: one point of what is swept, the first corner of its faces."""
        return self.vertices[self.faces[0, 0]]

    @property
    def revision(self) -> int:
        """How often it was refitted."""
        return int(self.tree.scale[REVISION])

    @property
    def is_solid(self) -> bool:
        """Whether it has an inside."""
        swept = self.swept_radius > 0.0 and self.solid is not False  # known without a look
        return swept or not self.sides().reason

    def sides(self) -> Sides:
        """Where it has an inside; found when first asked."""
        if self._sides is None:
            self._sides, self._before = find_sides(self, self._before), None
        return self._sides

    def ranges(self) -> NDArray[np.int32]:
        """Which triangles, in tree order, stand under each node (k, 2); made when first needed."""
        if self._ranges is None:
            self._ranges = node_ranges(self.tree.children)
        return self._ranges

    def spread_corners(self) -> NDArray[np.int32]:
        """A few vertices of each node, far apart (k, 4); made when first needed."""
        if self._spread is None:
            self._spread = spread_corners(self.tree.triangles, self.tree.children)
        return self._spread

    def __getstate__(self) -> dict[str, Any]:
        """Everything but addresses and what can be found again."""
        return {name: getattr(self, name) for name in _KEPT}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Freeze what pickle thawed: of other arrays the kernels would be compiled once more."""
        for array in (state["vertices"], state["faces"], *state["tree"], *state["distinct"]):
            array.setflags(write=False)
        self._take(state)
        self._measure(self.tree.triangles)
