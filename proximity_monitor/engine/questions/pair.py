"""Two models and the memory of their last answer: frame-to-frame coherence, resumable searches."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import check_tolerance
from ..kernels.base import state as index
from ..models.model import Model
from ..poses import as_pose, check_pose
from .contact_surface import are_divided
from .contacts import met
from .decision import Clearance, Collision
from .manifold import candidates
from .result import Distance
from .rows import distance_of
from .run import Order, Search, check_model
from .signed import SignedSearch
from .slices import deadline_of
from .touching import PieceSearch

_ANY = math.inf

_HAND_OVER_S = 4e-5
"""Seconds that a search takes to hand over a manifold. The search is told that it began earlier."""


class Pair:
    """Two models that are asked about repeatedly.

    Each call first tries the nearest triangles of the last call (Larsen et al. 1999, section 6.2),
    and the centre of the last largest ball inside both. A search that ran out of time goes on when
    the same question is asked again. Volumes that were too far apart are not opened again until the
    models may have moved far enough to matter.

    A Pair belongs to one thread at a time; the models may be shared. A copy of a Pair, pickled or
    not, starts from the nearest triangles that this one found, and has its own memory.

    Args:
        a: the first model.
        b: the second model.
        coherent: whether to remember volumes as well, which helps if successive poses are near
            each other, as along a path.

    Raises:
        TypeError: `a` or `b` is no model.
    """

    __slots__ = ("_asked", "_begin_with", "_pieces", "_search", "_signed", "a", "b")

    def __init__(self, a: Model, b: Model, *, coherent: bool = True) -> None:
        self._remember("depth_first", coherent)
        self.a, self.b = check_model(a, "a"), check_model(b, "b")

    def _remember(self, order: Order, coherent: bool, nearest: tuple[int, int] = (0, 0)) -> None:
        """Forget everything but how the first search begins; it is made when it is needed."""
        self._begin_with = order, coherent, nearest
        self._search: Search | None = None
        self._asked: tuple[object, ...] | None = None
        self._pieces: PieceSearch | None = None
        self._signed: SignedSearch | None = None

    def __reduce__(self) -> tuple[Callable[..., Pair], tuple[Any, ...]]:
        """Make another pair that begins with the nearest elements that this one found."""
        known = self._begin_with
        if self._search is not None:
            known = self._search.order, self._search.coherent, self._search.nearest
        return _pair_of, (type(self), self.a, self.b, known)

    def distance(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        *,
        rel_err: float = 0.0,
        abs_err: float = 0.0,
        budget_s: float | None = None,
        order: Order = "depth_first",
        manifold: bool = False,
        param_err: float | None = None,
    ) -> Distance:
        """Find the minimum distance at two poses; see `engine.distance`."""
        start = perf_counter()
        rel_err = check_tolerance("rel_err", rel_err)
        abs_err = check_tolerance("abs_err", abs_err)
        pose_a, pose_b = as_pose(pose_a, "pose_a"), as_pose(pose_b, "pose_b")
        most = _ANY
        if param_err is not None:
            most, manifold = self._checked_param_err(param_err), True
        search = self._search
        if search is None or search.order != order:
            search = self._begin_search(order)
        # Keyword arguments would take a tenth of a microsecond more, and a call as much again.
        if budget_s is None:
            self._asked = None
            search.run(pose_a, pose_b, rel_err, abs_err, 0.0, _ANY, None, True, manifold, most)
        else:
            begun = start - _HAND_OVER_S if manifold else start
            self._run(
                search, begun, budget_s, pose_a, pose_b, rel_err, abs_err, 0.0, _ANY, manifold, most
            )
        held = candidates(search) if manifold else None
        return distance_of(search.answer, start, held, search.kinds)

    def ideal(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        *,
        rel_err: float = 0.0,
        abs_err: float = 0.0,
    ) -> Distance:
        """Answer as `distance` does, by a search that is given the true distance beforehand.

        This is a diagnostic. Its `bound_tests` and `primitive_tests` are the fewest that can prove
        the answer with these hierarchies from these poses alone (Larsen et al. 1999, section 7).
        `elapsed_s` is the time of that search alone. It neither uses nor changes what this Pair
        remembers, which may spare some of the tests.

        Raises:
            ValueError: a pose is no rigid motion, or a tolerance is negative or NaN.
        """
        rel_err = check_tolerance("rel_err", rel_err)
        abs_err = check_tolerance("abs_err", abs_err)
        pose_a, pose_b = as_pose(pose_a, "pose_a"), as_pose(pose_b, "pose_b")
        search = Search(self.a, self.b, coherent=False)
        search.run(pose_a, pose_b)
        # The second run begins with the distance of the triangles that the first one found.
        start = perf_counter()
        search.run(pose_a, pose_b, rel_err=rel_err, abs_err=abs_err)
        return distance_of(search.answer, start, None, search.kinds)

    def signed_distance(
        self,
        pose_a: ArrayLike,
        pose_b: ArrayLike,
        *,
        rel_err: float = 0.0,
        abs_err: float = 0.0,
        depth_err: float = 0.01,
        budget_s: float | None = None,
    ) -> Distance:
        """Find the signed distance at two poses; see `engine.signed_distance`."""
        start = perf_counter()
        rel_err = check_tolerance("rel_err", rel_err)
        abs_err = check_tolerance("abs_err", abs_err)
        depth_err = check_tolerance("depth_err", depth_err)
        if budget_s is not None:
            budget_s = check_tolerance("budget_s", budget_s)
        pose_a, pose_b = check_pose(pose_a, "pose_a"), check_pose(pose_b, "pose_b")
        search = self.signed_search()
        return search.ask(start, pose_a, pose_b, rel_err, abs_err, depth_err, budget_s)

    def signed_search(self) -> SignedSearch:
        """Return the search for signed distances, with its memory; make it when first needed."""
        if self._signed is None:
            # It has its own Pair, so that signed and unsigned questions keep separate memories.
            _, coherent, _ = self._begin_with
            self._signed = SignedSearch(self.a, self.b, Pair(self.a, self.b, coherent=coherent))
        return self._signed

    def take_memory(self) -> bool:
        """Take the memory of a search before the first question; return whether there was none."""
        if self._search is not None:
            return False
        self._begin_search()
        return True

    def begin_at(self, nearest: tuple[int, int]) -> None:
        """Let the next search begin afresh, from two elements, in tree order."""
        self._asked = None
        if self._search is None:
            self._begin_with = *self._begin_with[:2], nearest
        else:
            self._search.begin_at(nearest)

    def within(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        clearance: float,
        *,
        budget_s: float | None = None,
    ) -> Clearance:
        """Find whether the surfaces may be as near as `clearance`; see `engine.within`."""
        start = perf_counter()
        clearance = check_tolerance("clearance", clearance)
        pose_a, pose_b = as_pose(pose_a, "pose_a"), as_pose(pose_b, "pose_b")
        beyond = math.nextafter(clearance, math.inf)
        search = self._search or self._begin_search()
        code = self._run(search, start, budget_s, pose_a, pose_b, stop=clearance, limit=beyond)
        return Clearance(search.answer, clearance, _is_whole(search, code))

    def collide(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        *,
        all_contacts: bool = False,
        budget_s: float | None = None,
    ) -> Collision:
        """Find whether the surfaces touch or cross; see `engine.collide`."""
        start = perf_counter()
        pose_a, pose_b = as_pose(pose_a, "pose_a"), as_pose(pose_b, "pose_b")
        limit = math.ulp(0.0)
        search = self._search or self._begin_search()
        code = self._run(search, start, budget_s, pose_a, pose_b, limit=limit, collect=all_contacts)
        first = met(search, pose_a)
        if not (all_contacts and search.answer[index.LOWER] == 0.0 and code != index.CUT):
            return Collision(search.answer, first, _is_whole(search, code))
        if not are_divided(self.a._hierarchy, self.b._hierarchy):
            return Collision(search.answer, first, _is_whole(search, code))
        pieces = self._pieces or PieceSearch(search, (pose_a, pose_b))
        self._pieces = None  # an interrupt may leave it half done
        deadline = None if budget_s is None else deadline_of(start, budget_s)
        ended = pieces.run(deadline)
        if not ended:
            self._pieces = pieces
        found = pieces.met(first)
        complete = ended and _is_whole(search, code) and found.decided
        return Collision(search.answer, found, complete)

    def _checked_param_err(self, param_err: float) -> float:
        if not are_divided(self.a._hierarchy, self.b._hierarchy):
            raise ValueError(
                f"param_err = {param_err!r}: neither {self.a.name!r} nor {self.b.name!r} is a "
                "parametric surface, so there are no parameters"
            )
        return check_tolerance("param_err", param_err)

    def _run(
        self,
        search: Search,
        start: float,
        budget_s: float | None,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float = 0.0,
        abs_err: float = 0.0,
        stop: float = 0.0,
        limit: float = math.inf,
        collect: bool = False,
        param_err: float = math.inf,
    ) -> int:
        """Search as `Search.run` does, within a budget that began at `start` of perf_counter.

        If the last search was cut and had exactly the same question, continue it.
        """
        fresh, asked, deadline = True, None, None
        if budget_s is not None:
            deadline = deadline_of(start, budget_s)
            shapes = self.a._hierarchy, self.b._hierarchy
            wanted = rel_err, abs_err, stop, limit, collect, param_err, search.order
            asked = (pose_a.tobytes(), pose_b.tobytes(), wanted, shapes)
            fresh = asked != self._asked
        self._asked = None
        if fresh:
            self._pieces = None  # it belongs to what the search has found so far
        code = search.run(
            pose_a, pose_b, rel_err, abs_err, stop, limit, deadline, fresh, collect, param_err
        )
        self._asked = asked
        return code

    def _begin_search(self, order: Order | None = None) -> Search:
        """Make a search in this order, which keeps the remembered nearest elements; return it."""
        last, coherent, nearest = self._begin_with
        if self._search is not None:
            coherent, nearest = self._search.coherent, self._search.nearest
        self._search = Search(self.a, self.b, order or last, coherent, nearest)
        return self._search


def _pair_of(
    kind: type[Pair], a: Model, b: Model, known: tuple[Order, bool, tuple[int, int]]
) -> Pair:
    """Make a pair with its own memory; `known` is how its first search begins."""
    pair = kind.__new__(kind)
    pair.a, pair.b = a, b
    pair._remember(*known)
    return pair


def _is_whole(search: Search, code: int) -> bool:
    """Return whether a search came to an end: no budget cut it, and its room for parts sufficed."""
    return bool(code == index.ENDED and search.answer[index.STATUS] != index.OUT_OF_TIME)
