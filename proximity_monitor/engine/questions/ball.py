"""Searches for how deep two models overlap: their memory, their slices, and what they found.

Three kinds of search have the same methods: for the largest ball inside two solids, for the deepest
point of a surface in a solid, and for models whose only volume is swept by a ball (cores.py).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.state import CUT
from ..kernels.base.trees import MeshTree, RevolutionTree, SurfaceTree
from ..kernels.inside.ball_state import FULL, NONE, ball_table
from ..kernels.inside.solids import HALF
from ..kernels.pairs.balls import BALLS
from ..kernels.pairs.depths import DEPTHS
from ..models.model import Model
from .ball_memory import POINTS, SIZE, BallKind, BallMemory
from .contact_surface import are_divided
from .memory import give_back, take
from .slices import slices_until

if TYPE_CHECKING:
    from ..models.hierarchy import Hierarchy

_MOST_CELLS = 4096
"""The most cells that a search looks into if a solid has holes. Right behind a hole, a point counts
as deep as it is far from the faces, so no cell there gets a better bound, however small it is."""

_MOST_IN_SPACE = 1 << 16
"""The most cells that any search looks into. Where a rounded model touches a face, no bound may
come within rounding of 0, and cells would be divided without end."""

_MOST_PIECES = 1 << 15
"""The most pieces of patches and curves that a search looks into, or cells of space if a solid is
made of patches. If a whole region of a surface is deepest, or equally far from the centre of a
ball, nothing else would end a search for more digits than these pieces give."""

_NO_ROW = np.empty(0)

_SLACKS = 64.0
"""Rounding may widen the bounds of a depth by so many slacks of a radius."""

_KINDS = MeshTree, SurfaceTree, RevolutionTree
"""The kinds of solids. Of two unlike kinds, kernels take the one that stands later here first."""

_CHOSEN = {
    (a, b): (BALLS[(a, b) if i >= j else (b, a)], int(j > i))
    for i, a in enumerate(_KINDS)
    for j, b in enumerate(_KINDS)
}
"""The kernels for the kinds of both solids, and which solid they take first."""


def solid_kind(model: Model) -> type:
    """Return the kind of a solid's tree; it is the same for all meshes, whatever their volumes."""
    hierarchy = model._hierarchy
    return hierarchy.tree_kind if are_divided(hierarchy) else MeshTree


class Depth(NamedTuple):
    """What a search knows about a depth."""

    shallow: float
    """Metres; a certified lower bound."""
    deep: float
    """Metres; a certified upper bound."""
    exact: bool
    """Whether they differ by rounding alone."""
    close: bool
    """Whether they are as close as was asked for."""


class BallSearch:
    """A search for the largest ball inside two solids, whose diameter is their depth.

    Args:
        a: first solid.
        b: second solid.
        surface: the one of them that is no solid but a surface in the other; None: both are solids.
    """

    __slots__ = (
        "_at", "_ball", "_counts", "_entries", "_first", "_hierarchies", "_models", "_more",
        "_most", "_numbers", "_own", "_poses", "_table", "_tables",
    )  # fmt: skip

    def __init__(self, a: Model, b: Model, surface: Model | None = None) -> None:
        self._models = a, b
        self._first = self._choose()  # which model the kernels take first
        self._hierarchies: tuple[Hierarchy, ...] = ()
        self._own = own = take(BallMemory, BallKind.of(a, b, surface))
        self._ball, self._more, self._table = own.ball, own.more, own.table
        self._at, self._numbers, self._counts = own.ball.at[0], own.numbers, own.counts
        self._tables, self._most = own.solids, math.inf

    def __del__(self, give_back: Callable[[BallMemory], None] = give_back) -> None:
        """Give the memory back, as a `Search` does."""
        if hasattr(self, "_own"):
            give_back(self._own)

    def _choose(self) -> int:
        """Choose the kernels for the kinds of both models; return which model they take first."""
        a, b = self._models
        self._entries, first = _CHOSEN[solid_kind(a), solid_kind(b)]
        return first

    def begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        depth_err: float,
        abs_err: float,
    ) -> None:
        """Start a search; the first seed is the centre of the ball that the last one found."""
        self._take(pose_a, pose_b)
        begin = self._entries.begin
        begin(self._tables, self._table, *self._poses, depth_err, 0.5 * abs_err)

    def _take(self, pose_a: NDArray[np.float64], pose_b: NDArray[np.float64]) -> None:
        """Take the poses, and the models as they are now."""
        a, b = self._models
        self._poses = pose_a, pose_b
        if self._first:
            a, b, self._poses = b, a, (pose_b, pose_a)
        hierarchies = a._hierarchy, b._hierarchy
        if hierarchies == self._hierarchies:
            return
        one, other = a._hierarchy.sides(), b._hierarchy.sides()
        self._tables[0], self._tables[1] = one.table, other.table
        holes = HALF in (one.region.inside, other.region.inside)
        self._most = _MOST_CELLS if holes else _MOST_IN_SPACE
        if are_divided(*hierarchies):
            self._most = min(self._most, _MOST_PIECES)
        # A table holds addresses only, so the hierarchies are kept for their arrays. They are set
        # last, because Ctrl-C may come at any moment.
        self._hierarchies = hierarchies

    def seed_contact(self, row: NDArray[np.float64]) -> None:
        """Add seeds around the nearest points of an answer (ANSWER,)."""
        self._entries.add_seeds(self._tables, self._table, row, self._first, 0, NONE)

    def seed_part(self, body: int, element: int) -> None:
        """Add seeds around an element of one model, `body`, that lies in the other model."""
        body = abs(body - self._first)
        self._entries.add_seeds(self._tables, self._table, _NO_ROW, self._first, body, element)

    def seek(self, deadline: float) -> bool:
        """Search to the end if a seed is the centre of a ball, otherwise give up.

        Returns False if the deadline came first.
        """
        return self._search(deadline, True)

    def search(self, deadline: float) -> bool:
        """Search to the end, one slice at least; return False if the deadline came first."""
        return self._search(deadline, False)

    def _search(self, deadline: float, tentative: bool) -> bool:
        slices = slices_until(deadline)
        while True:
            code = self._slice(tentative, slices.steps)
            if code == FULL:
                self._make_room()
            elif code != CUT or self._at["cells"] > self._most:
                return True
            if slices.over():
                return False

    def _slice(self, tentative: bool, steps: int) -> int:
        return self._entries.search(self._tables, self._table, tentative, steps)

    def _make_room(self) -> None:
        old = self._ball
        count = len(old.order)
        # Make the new table before the old arrays are gone: Ctrl-C may come at any moment.
        ball = old._replace(
            bounds=np.resize(old.bounds, 2 * count),
            order=np.concatenate((old.order, np.arange(count, 2 * count, dtype=np.int32))),
            cells=np.concatenate((old.cells, np.empty(count, old.cells.dtype))),
        )
        cells, nets, roots = self._more
        # The second half is written before it is read.
        more = np.resize(cells, 2 * len(cells)), np.resize(nets, 2 * len(nets)), roots
        made = ball_table(ball, more)
        self._ball, self._more, self._table = ball, more, made

    @property
    def found(self) -> bool:
        """Whether it is certain that the models overlap."""
        return bool(self._numbers[0] > 0.0)

    @property
    def points(self) -> int:
        """How many points were tested for their depth."""
        return int(self._counts[POINTS])

    def depth(self) -> Depth:
        """Return what is known about the depth."""
        radius, slack, joints, _, rel_err, abs_err, dropped = self._numbers.tolist()
        deep = max(dropped, 0.0)
        if radius > 0.0:
            deep = max(deep, radius + 2.0 * slack)
        if self._counts[SIZE]:
            deep = max(deep, float(self._ball.bounds[0]))
        deep = deep + joints if deep > 0.0 else 0.0
        shallow = max(radius - joints, 0.0)
        wanted = max(shallow * (1.0 + rel_err), shallow + abs_err)
        close = deep <= max(wanted * (1.0 + 1e-12), shallow + 0.5 * _SLACKS * slack)
        shallow, deep = self._as_depths(shallow, deep)
        return Depth(shallow, deep, deep - shallow <= _SLACKS * slack, close)

    def _as_depths(self, shallow: float, deep: float) -> tuple[float, float]:
        """Make bounds of the depth from those of a radius."""
        return 2.0 * shallow, 2.0 * deep

    def fill(self, row: NDArray[np.float64]) -> None:
        """Write into an answer (ANSWER,) both surfaces' points nearest to the ball's centre."""
        self._entries.write(self._tables, self._table, *self._poses, row, self._first)


class DeepestSearch(BallSearch):
    """A search for the deepest point of a surface in a solid.

    Args:
        a: first model.
        b: second model; one of the two is a solid.
    """

    __slots__ = ("_begin", "_go_on", "_write")

    def __init__(self, a: Model, b: Model) -> None:
        super().__init__(a, b, b if a.is_solid else a)

    def _choose(self) -> int:
        first = 0 if self._models[0].is_solid else 1  # the solid
        solid, surface = self._models[first], self._models[1 - first]
        kinds = are_divided(solid._hierarchy), are_divided(surface._hierarchy)
        self._begin, self._go_on, self._write = DEPTHS[kinds]
        return first

    def begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        depth_err: float,
        abs_err: float,
    ) -> None:
        """Start a search."""
        self._take(pose_a, pose_b)
        self._begin(self._tables, self._table, *self._poses, depth_err, abs_err)

    def seed_contact(self, row: NDArray[np.float64]) -> None:
        """Do nothing: seeds are points beside a surface, not on it."""

    def seed_part(self, body: int, element: int) -> None:
        """Do nothing, for the same reason."""

    def seek(self, deadline: float) -> bool:
        """Do nothing: there are no seeds."""
        return True

    def _slice(self, tentative: bool, steps: int) -> int:
        return self._go_on(self._tables, self._table, steps)

    def _as_depths(self, shallow: float, deep: float) -> tuple[float, float]:
        """Return both; a swept surface may be deeper by its radius."""
        return shallow, deep + self._hierarchies[1].swept_radius

    def fill(self, row: NDArray[np.float64]) -> None:
        """Write into an answer (ANSWER,) the deepest point and the solid's point nearest to it."""
        self._write(self._tables, self._table, self._first, *self._poses, row)
