"""The bounding volume hierarchy that every model has, with the tables by which kernels find it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.lines import in_lines
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

_VOLUMES = ("nodes", "centres", "children", "sizes")
"""The arrays of a tree that a search reads in each step."""

Solid = bool | Literal["robust"] | None
"""Whether a model is to be a solid; see `TriangleMesh`."""


class Hierarchy(ABC):
    """Bounding volumes around elements, perhaps swept by a ball; immutable.

    `refitted` makes another hierarchy of the same structure. A question takes the hierarchy
    from the model (`Model._hierarchy`) and passes its trees or tables to the kernels. A table holds
    addresses of arrays, so its user must keep the hierarchy. Each kind of element has a subclass.
    """

    KEPT: ClassVar[tuple[str, ...]] = (
        "deviation", "depth", "distinct", "numbers", "solid", "swept_radius", "tree",
    )  # fmt: skip
    """The attributes from which a hierarchy can be made again."""

    __slots__ = (
        "_ranges", "_sampled", "_sides", "_spread", "_traits", "centre", "core_radius", "depth",
        "deviation", "distinct", "numbers", "radius", "solid", "swept_radius", "table",
        "table_of_all", "tree",
    )  # fmt: skip

    swept_radius: float
    """Metres: radius of the ball that sweeps the elements."""
    deviation: float
    """Metres: how far the surface may be from that of the part that the model stands for."""
    solid: Solid
    """What the caller asked for; `is_solid` tells what the model is."""
    numbers: NDArray[np.int32]
    """(m,) the number that answers give each element, in tree order: a triangle's face, a piece's
    patch."""
    depth: int
    """The number of levels."""
    tree: Tree | SurfaceTree
    """All volumes and elements, as the kernels see them."""
    distinct: Tree | SurfaceTree
    """The same without volumes that hold only twins, elements that coincide with another one. It
    is `tree` itself if there are no such volumes."""
    table: NDArray[np.int64]
    """The addresses of `distinct`, for searches of the nearest element, of which one is enough."""
    table_of_all: NDArray[np.int64]
    """The addresses of `tree`, for questions that list or count elements."""
    centre: NDArray[np.float64]
    """(3,) metres, model frame: centre of a sphere that holds every used vertex."""
    core_radius: float
    """Metres: radius of that sphere, rounding included."""
    radius: float
    """Metres: radius of a sphere around `centre` that holds all that the model stands for."""

    cell_width: int = 0
    """How many numbers the control points of a part of an element take; 0: elements are never
    divided."""

    @property
    def tree_kind(self) -> type:
        """The type of tree that selects its kernels; those for the type of `tree` work as well."""
        return type(self.tree)

    @property
    def traits(self) -> tuple[type, type, int, int, int]:
        """All of it that a search chooses its kernels and the room of its memory by."""
        if self._traits is None:  # it outlives many searches, so it is made once
            kinds = self.tree_kind, type(self.tree)
            self._traits = *kinds, self.depth, self.cell_width, len(self.numbers)
        return self._traits

    @classmethod
    def _made(cls, kept: dict[str, Any], corners: NDArray[np.float64] | None = None) -> Self:
        """Return a hierarchy made from the KEPT attributes, and from `_corners` if known."""
        made = cls.__new__(cls)
        made._take(kept)
        made._measure(made._corners() if corners is None else corners)
        return made

    def _kept(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.KEPT}

    def core(self) -> Self:
        """Return the hierarchy of the core: the same volumes with swept radius and deviation 0."""
        scale = self.tree.scale.copy()
        scale[[SWEPT, DEVIATION]] = 0.0
        scale.setflags(write=False)
        tree = self.tree._replace(scale=scale)
        distinct = tree if self.distinct is self.tree else self.distinct._replace(scale=scale)
        changed = {"tree": tree, "distinct": distinct, "swept_radius": 0.0, "deviation": 0.0}
        return self._made(self._kept() | changed)

    def _take(self, kept: dict[str, Any]) -> None:
        """Set the KEPT attributes, and make the tables by which kernels find the trees."""
        for name, value in kept.items():
            setattr(self, name, value)
        tree, distinct = self.tree, self.distinct
        self.tree = tree._replace(**{name: in_lines(getattr(tree, name)) for name in _VOLUMES})
        self.distinct = self.tree
        if distinct is not tree:  # the two differ in nothing else
            self.distinct = self.tree._replace(nodes=in_lines(distinct.nodes))
        self.table_of_all = self.table = self._table(self.tree)
        if self.distinct is not self.tree:
            self.table = self._table(self.distinct)
        self._traits: tuple[type, type, int, int, int] | None = None
        self._ranges: NDArray[np.int32] | None = None
        self._spread: NDArray[np.int32] | None = None
        self._sides: Sides | None = None
        self._sampled: tuple[MeshTree, NDArray[np.int64]] | None = None

    @abstractmethod
    def _table(self, tree: Tree | SurfaceTree) -> NDArray[np.int64]:
        """Return the addresses of a tree and of `numbers`."""

    @abstractmethod
    def _corners(self) -> NDArray[np.float64]:
        """Return points (k, 9), three per row, metres, whose convex hull holds every element."""

    def _measure(self, corners: NDArray[np.float64], error: float = 0.0) -> None:
        """Find the sphere: the centre of the bounding box and the largest distance, rounded up.

        The `corners`, as of `_corners`, may be wrong by `error` metres.
        """
        centre = np.empty(3)
        radius, _, _ = measure(corners, centre)
        centre.setflags(write=False)
        self.centre = centre
        rounding = 8.0 * DOUBLE_EPS * (radius + float(np.abs(centre).sum()))
        self.core_radius = radius + rounding + error
        whole = self.core_radius + self.swept_radius + self.deviation
        self.radius = whole * (1.0 + 4.0 * DOUBLE_EPS)

    @property
    @abstractmethod
    def some_point(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: one point of the core."""

    @property
    @abstractmethod
    def some_feature(self) -> tuple[float, float, float, float]:
        """Where `some_point` lies: three parameters and the number of an element."""

    @property
    def error(self) -> float:
        """Metres: the error of points of elements, plus the distance that closes a solid's gaps."""
        return 0.0

    @property
    def revision(self) -> int:
        """How often it was refitted."""
        return int(self.tree.scale[REVISION])

    @property
    def is_solid(self) -> bool:
        """Whether it has an inside."""
        swept = self.swept_radius > 0.0 and self.solid is not False  # needs no examination
        return swept or not self.sides().reason

    def sides(self) -> Sides:
        """Return where the model has an inside; found at the first call."""
        if self._sides is None:
            self._sides = self._find_sides()
        return self._sides

    @abstractmethod
    def _find_sides(self) -> Sides:
        """Find out where the model has an inside."""

    def ranges(self) -> NDArray[np.int32]:
        """Return (k, 2) the range of elements, in tree order, under each node; made when needed."""
        if self._ranges is None:
            self._ranges = node_ranges(self.tree.children)
        return self._ranges

    def spread_corners(self) -> NDArray[np.int32]:
        """Return four points under each node, far apart (k, 4), as 3 element + point.

        They are found at the first call.
        """
        if self._spread is None:
            self._spread = spread_corners(self._samples(), self.tree.children)
        return self._spread

    @abstractmethod
    def _samples(self) -> NDArray[np.float64]:
        """Return three points of each element, in tree order (m, 9), metres."""

    def sampled(self) -> NDArray[np.int64]:
        """Return the table of the same volumes over triangles, one of three points per element.

        It gives points of every element of any kind of model. For a mesh they are its triangles.
        """
        if self._sampled is None:
            tree = self.tree
            volumes = tree.nodes, tree.centres, tree.children, tree.sizes
            made = MeshTree(*volumes, self._samples(), tree.scale)
            self._sampled = made, model_table(self.numbers, made)
        return self._sampled[1]

    def __getstate__(self) -> dict[str, Any]:
        """Return the KEPT attributes; addresses and everything else can be found again."""
        return self._kept()

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore from a pickle, with read-only arrays: kernels are compiled for these alone."""
        for array in self._frozen(state):
            array.setflags(write=False)
        self._take(state)
        self._measure(self._corners())

    @staticmethod
    def _frozen(state: dict[str, Any]) -> tuple[NDArray, ...]:
        """Return the arrays among the KEPT attributes that must be read-only."""
        return *arrays_of(state["tree"]), *arrays_of(state["distinct"])
