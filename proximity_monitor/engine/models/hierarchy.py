"""The bounding volume hierarchy of a model, as the kernels find it: what every model has."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.tables import arrays_of, model_table
from ..kernels.base.trees import DEVIATION, REVISION, SWEPT, MeshTree
from ..kernels.tree.measure import measure
from ..kernels.tree.ranges import node_ranges
from ..kernels.tree.spread import spread_corners

if TYPE_CHECKING:
    from ..kernels.base.trees import SurfaceTree
    from .solid import Sides
    from .tree import Tree

Solid = bool | Literal["robust"] | None
"""Whether a model is to be a solid; see `TriangleMesh`."""


class Hierarchy(ABC):
    """Volumes around elements, perhaps swept by a ball. It never changes; `refitted` makes others.

    Questions ask a model for it (`Model._hierarchy`) and hand its trees or tables to the kernels.
    A table holds addresses: whoever uses one keeps the hierarchy. Each kind of elements derives a
    class of its own.
    """

    KEPT: ClassVar[tuple[str, ...]] = (
        "deviation", "depth", "distinct", "numbers", "solid", "swept_radius", "tree",
    )  # fmt: skip
    """What a hierarchy cannot be made again without."""

    __slots__ = (
        "_ranges", "_sampled", "_sides", "_spread", "centre", "core_radius", "depth", "deviation",
        "distinct", "numbers", "radius", "solid", "swept_radius", "table", "table_of_all", "tree",
    )  # fmt: skip

    swept_radius: float
    """Metres: the ball that sweeps the elements."""
    deviation: float
    """Metres: how far the surface may be from that of the thing that the model stands for."""
    solid: Solid
    """What was asked for; `is_solid` is what it is."""
    numbers: NDArray[np.int32]
    """(m,) what each element, in tree order, is called outside: a triangle's face, a piece's patch.
    """
    depth: int
    """The number of levels."""
    tree: Tree | SurfaceTree
    """All volumes and elements, as the kernels see them."""
    distinct: Tree | SurfaceTree
    """The same without the volumes that hold nothing but twins; `tree` itself where none do."""
    table: NDArray[np.int64]
    """The addresses of `distinct`: who looks for the nearest needs one of several that coincide."""
    table_of_all: NDArray[np.int64]
    """The addresses of `tree`: who lists or counts elements needs all."""
    centre: NDArray[np.float64]
    """(3,) metres, model frame: centre of a sphere that holds every used vertex."""
    core_radius: float
    """Metres: radius of that sphere, rounding included."""
    radius: float
    """Metres: radius of a sphere around `centre` that holds all the model stands for."""

    cell_width: int = 0
    """Numbers that the control points of a part of an element take; 0: none is ever divided."""

    @property
    def tree_kind(self) -> type:
        """By what type of tree kernels find it; they may take it for that of `tree` as well."""
        return type(self.tree)

    @classmethod
    def _made(cls, kept: dict[str, Any]) -> Self:
        """A hierarchy of what is kept."""
        made = cls.__new__(cls)
        made._take(kept)
        made._measure()
        return made

    def _kept(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.KEPT}

    def core(self) -> Self:
        """The hierarchy of what the ball sweeps: the same volumes, swept by nothing.

        It does not deviate from anything, either.
        """
        scale = self.tree.scale.copy()
        scale[[SWEPT, DEVIATION]] = 0.0
        scale.setflags(write=False)
        tree = self.tree._replace(scale=scale)
        distinct = tree if self.distinct is self.tree else self.distinct._replace(scale=scale)
        changed = {"tree": tree, "distinct": distinct, "swept_radius": 0.0, "deviation": 0.0}
        return self._made(self._kept() | changed)

    def _take(self, kept: dict[str, Any]) -> None:
        """Take what is kept, and make the tables by which kernels find it."""
        for name, value in kept.items():
            setattr(self, name, value)
        self.table_of_all = self.table = self._table(self.tree)
        if self.distinct is not self.tree:
            self.table = self._table(self.distinct)
        self._ranges: NDArray[np.int32] | None = None
        self._spread: NDArray[np.int32] | None = None
        self._sides: Sides | None = None
        self._sampled: tuple[MeshTree, NDArray[np.int64]] | None = None

    @abstractmethod
    def _table(self, tree: Tree | SurfaceTree) -> NDArray[np.int64]:
        """The addresses of a tree and of `numbers`."""

    @abstractmethod
    def _corners(self) -> NDArray[np.float64]:
        """Points (k, 9), three in a row, metres, whose convex hull holds every element."""

    def _measure(self, error: float = 0.0) -> None:
        """Find the sphere: the centre of the bounding box and the largest distance, rounded up.

        `error` metres is what the points may be wrong by.
        """
        centre = np.empty(3)
        radius, _, _ = measure(self._corners(), centre)
        centre.setflags(write=False)
        self.centre = centre
        rounding = 8.0 * DOUBLE_EPS * (radius + float(np.abs(centre).sum()))
        self.core_radius = radius + rounding + error
        whole = self.core_radius + self.swept_radius + self.deviation
        self.radius = whole * (1.0 + 4.0 * DOUBLE_EPS)

    @property
    @abstractmethod
    def some_point(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: one point of what is swept."""

    @property
    @abstractmethod
    def some_feature(self) -> tuple[float, float, float, float]:
        """Where that point lies: three parameters and the number of an element."""

    @property
    def error(self) -> float:
        """Metres: what points of its elements err by, and what closes the gaps of a solid."""
        return 0.0

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
            self._sides = self._find_sides()
        return self._sides

    @abstractmethod
    def _find_sides(self) -> Sides:
        """Find where it has an inside."""

    def ranges(self) -> NDArray[np.int32]:
        """Which elements, in tree order, stand under each node (k, 2); made when first needed."""
        if self._ranges is None:
            self._ranges = node_ranges(self.tree.children)
        return self._ranges

    def spread_corners(self) -> NDArray[np.int32]:
        """A few points of each node, far apart, as 3 element + point (k, 4); made when needed."""
        if self._spread is None:
            self._spread = spread_corners(self._samples(), self.tree.children)
        return self._spread

    @abstractmethod
    def _samples(self) -> NDArray[np.float64]:
        """Three points of each element, in tree order (m, 9), metres."""

    def sampled(self) -> NDArray[np.int64]:
        """The table of the same volumes over triangles of three points of each element.

        It tells where points of every element are, whatever its kind. Of a mesh all triangles.
        """
        if self._sampled is None:
            tree = self.tree
            volumes = tree.nodes, tree.centres, tree.children, tree.sizes
            made = MeshTree(*volumes, self._samples(), tree.scale)
            self._sampled = made, model_table(self.numbers, made)
        return self._sampled[1]

    def __getstate__(self) -> dict[str, Any]:
        """Everything but addresses and what can be found again."""
        return self._kept()

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Freeze what pickle thawed: of other arrays the kernels would be compiled once more."""
        for array in self._frozen(state):
            array.setflags(write=False)
        self._take(state)
        self._measure()

    @staticmethod
    def _frozen(state: dict[str, Any]) -> tuple[NDArray, ...]:
        """The read-only arrays of what is kept."""
        return *arrays_of(state["tree"]), *arrays_of(state["distinct"])
