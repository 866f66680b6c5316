"""The result of a tick: the state of every listed pair, in metres and world coordinates."""

from __future__ import annotations

import enum
import operator
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar, overload

import numpy as np

from proximity_monitor import engine
from proximity_monitor.engine.models.model import Feature

Item = TypeVar("Item")


class PairStatus(enum.Enum):
    """What the numbers of a pair mean."""

    EXACT = "exact"
    WITHIN_TOLERANCE = "within tolerance"
    BOUNDED = "bounded"
    """Certified bounds that are wider than the tolerance: the time ran out, or the question was
    only on which side of a threshold the distance lies."""
    INTERSECTING = "intersecting"
    """The surfaces touch or cross. If both are solids, they touch, or it is not known yet whether
    they overlap."""
    OVERLAPPING = "overlapping"
    """Two solids overlap, perhaps one wholly inside the other: even the upper bound is negative."""
    UNKNOWN = "unknown pose"
    """A body of the pair has no pose yet: there are no numbers."""


_UNKNOWN_POINTS = np.full((2, 3), np.nan)

NO_POSE_YET, NO_RECENT_POSE = "no pose yet", "no recent pose"
"""Why a body is silent, unless a more specific reason is known."""


def silence(
    names: Iterable[str],
    reasons: Mapping[str, str],
    otherwise: str = NO_RECENT_POSE,
    listed: Callable[[Sequence[str]], str] = " and ".join,
) -> str:
    """Return a line that says why bodies are silent: each reason with its bodies.

    Args:
        names: the silent bodies.
        reasons: such as "no recent pose", by body name.
        otherwise: the reason for bodies without one.
        listed: joins the names of the bodies that share a reason.
    """
    found: dict[str, list[str]] = {}
    for name in names:
        found.setdefault(reasons.get(name, otherwise), []).append(name)
    return "; ".join(f"{reason} of {listed(of)}" for reason, of in found.items())


STATUSES = tuple(PairStatus)
"""Statuses by their codes in `PairStates.status`, which the engine's `Schedule.report` gives."""


class PoseSample(NamedTuple):
    """The last good pose of a moving body."""

    pose: np.ndarray
    """(4, 4) model to world."""
    stale: bool = False
    """Whether the pose is too old to be relied on; it still is the best known pose."""


@dataclass(frozen=True, slots=True)
class PairState:
    """One listed pair at the end of a tick. Lengths in metres, points in the world frame."""

    a: str
    b: str
    lower: float
    """Certified for the poses of this tick: lower <= true distance <= upper. NaN if unknown. The
    distance of two solids is signed: negative if they overlap."""
    upper: float
    point_a: np.ndarray
    """(3,) witness point on A. An `upper` that is not negative is the distance of the two points,
    plus rounding and, in an answer from an earlier tick, plus deformation."""
    point_b: np.ndarray
    status: PairStatus
    age_s: float
    """Seconds since the pair's numbers answered the poses of that tick. 0 if the pair was searched
    in this tick, or if its numbers still answer the present poses; inf if it was never searched."""
    silent: tuple[str, ...]
    """The bodies of the pair whose pose or shape is stale or was never given."""
    session_min: float
    """The smallest `upper` of the session: the pair was certainly that near. inf at first."""
    session_min_lower: float
    """The smallest `lower` of the session: the pair was never nearer than this at a tick."""
    index: int = 0
    """The pair's position among the scene's pairs."""
    kinds: tuple[type[engine.Model], ...] = ()
    """Classes of A's and B's models; empty if the places of the points on them are not known."""
    elements: tuple[int, ...] = (-1, -1)
    """The elements of the models on which the points lie; -1: not known."""
    parameters: np.ndarray | None = None
    """(2, 3) the points' parameters on these elements; `features` interprets them."""

    @property
    def stale(self) -> bool:
        """Whether a body is silent, so that nothing is certain about the present."""
        return bool(self.silent)

    @property
    def features(self) -> tuple[Feature, ...]:
        """Where the points lie on A's and on B's model; empty if not known."""
        if not self.kinds:
            return ()
        sides = zip(self.kinds, self.elements, self.parameters, strict=True)
        return tuple(kind.feature(element, where) for kind, element, where in sides)


class LazySequence(Sequence[Item]):
    """A sequence whose items are made when they are read."""

    __slots__ = ()

    @abstractmethod
    def _made(self, places: range) -> Iterator[Item]:
        """Yield the items at these places, which all exist."""

    @overload
    def __getitem__(self, at: int) -> Item: ...

    @overload
    def __getitem__(self, at: slice) -> tuple[Item, ...]: ...

    def __getitem__(self, at: int | slice) -> Item | tuple[Item, ...]:
        """Return one item, or the items of a slice."""
        if isinstance(at, slice):
            return tuple(self._made(range(*at.indices(len(self)))))
        place, count = operator.index(at), len(self)
        if not -count <= place < count:
            raise IndexError(f"{place} of {count}")
        (item,) = self._made(range(place % count, place % count + 1))
        return item

    def __iter__(self) -> Iterator[Item]:
        """Yield all items, one by one."""
        return self._made(range(len(self)))


@dataclass(frozen=True, slots=True, eq=False)
class PairStates(LazySequence[PairState]):
    """The listed pairs of a tick as arrays, in the scene's order; a `PairState` is made on demand.

    Attributes:
        names: the names of all bodies.
        positions: (k,) the pairs' positions among the scene's pairs.
        bodies: (k, 2) indices of the pairs' bodies.
        lower: (k,) metres; NaN if a pose is unknown.
        upper: (k,) metres.
        points: (k, 2, 3) metres, world.
        status: (k,) codes, positions in STATUSES.
        age_s: (k,) seconds.
        silent: (k, 2) whether the pose or shape of either body is stale or unknown.
        session_min: (k,) metres.
        session_min_lower: (k,) metres.
        kinds: the classes of the bodies' models.
        elements: (k, 2) the elements of the models on which the points lie; -1: not known.
        parameters: (k, 2, 3) the points' parameters on these elements.
    """

    names: tuple[str, ...]
    positions: np.ndarray
    bodies: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    points: np.ndarray
    status: np.ndarray
    age_s: np.ndarray
    silent: np.ndarray
    session_min: np.ndarray
    session_min_lower: np.ndarray
    kinds: tuple[type[engine.Model], ...]
    elements: np.ndarray
    parameters: np.ndarray

    def __len__(self) -> int:
        """Return the number of listed pairs."""
        return len(self.positions)

    def _made(self, places: range) -> Iterator[PairState]:
        for k in places:
            first, second = self.bodies[k].tolist()
            a, b = self.names[first], self.names[second]
            elements = tuple(self.elements[k].tolist())
            known = elements[0] >= 0
            silent = self.silent[k].tolist()
            yield PairState(
                a=a,
                b=b,
                lower=float(self.lower[k]),
                upper=float(self.upper[k]),
                point_a=self.points[k, 0],
                point_b=self.points[k, 1],
                status=STATUSES[self.status[k]],
                age_s=float(self.age_s[k]),
                silent=tuple(name for name, is_so in zip((a, b), silent, strict=True) if is_so),
                session_min=float(self.session_min[k]),
                session_min_lower=float(self.session_min_lower[k]),
                index=int(self.positions[k]),
                kinds=(self.kinds[first], self.kinds[second]) if known else (),
                elements=elements,
                parameters=self.parameters[k] if known else None,
            )

    @property
    def stale(self) -> np.ndarray:
        """(k,) whether either body's pose or shape is stale or unknown."""
        return self.silent[:, 0] | self.silent[:, 1]  # `any` takes ten times as long

    def clearance(self) -> float:
        """Return what `Tick.clearance` returns, but for the listed pairs alone."""
        # A silent pair's bound counts as at most 0, and as 0 if it is NaN (a pose is unknown).
        lowest = np.where(self.stale, np.fmin(self.lower, 0.0), self.lower)
        return float(lowest.min(initial=np.inf))


def as_arrays(pairs: Sequence[PairState]) -> PairStates:
    """Return pairs as arrays: unchanged if a monitor made them, else packed one by one."""
    if isinstance(pairs, PairStates):
        return pairs
    names = tuple(dict.fromkeys(name for pair in pairs for name in (pair.a, pair.b)))
    place = {name: i for i, name in enumerate(names)}
    kinds: dict[str, type[engine.Model]] = {}
    for pair in pairs:
        kinds |= zip((pair.a, pair.b), pair.kinds, strict=False)
    return PairStates(
        names=names,
        positions=np.array([pair.index for pair in pairs], dtype=np.int64),
        bodies=np.array([(place[p.a], place[p.b]) for p in pairs], np.int64).reshape(-1, 2),
        lower=np.array([pair.lower for pair in pairs]),
        upper=np.array([pair.upper for pair in pairs]),
        points=np.array([(pair.point_a, pair.point_b) for pair in pairs]).reshape(-1, 2, 3),
        status=np.array([STATUSES.index(pair.status) for pair in pairs], dtype=np.int8),
        age_s=np.array([pair.age_s for pair in pairs]),
        silent=np.array([(p.a in p.silent, p.b in p.silent) for p in pairs], bool).reshape(-1, 2),
        session_min=np.array([pair.session_min for pair in pairs]),
        session_min_lower=np.array([pair.session_min_lower for pair in pairs]),
        kinds=tuple(kinds.get(name, engine.Model) for name in names),
        elements=np.array([pair.elements for pair in pairs], np.int32).reshape(-1, 2),
        parameters=np.array(
            [_UNKNOWN_POINTS if p.parameters is None else p.parameters for p in pairs], np.float64
        ).reshape(-1, 2, 3),
    )


@dataclass(frozen=True, slots=True)
class Tick:
    """What one tick certifies about every watched pair."""

    pairs: Sequence[PairState]
    """The listed pairs in the scene's order: all pairs of infinite range, and the pairs of finite
    range that may be within their range or are kept."""
    elapsed_s: float
    budget_s: float
    searched: tuple[int, ...]
    """Indices, in the scene, of the pairs that were searched, in the order of the searches."""
    left: int
    """How many pairs wanted a search and got none, or had a search that ran out of time."""
    far: int = 0
    """How many pairs are certainly farther apart than their range, and so not listed."""
    beyond: float = float("inf")
    """Metres; all `far` pairs are farther apart than this."""
    unsure: int = 0
    """How many pairs of silent bodies are not listed because there are too many. Nothing is certain
    about them."""

    def clearance(self) -> float:
        """Return the smallest lower bound, metres; at most 0 if a pair's pose is stale or unknown.

        Nothing is certain about such a pair. Its bound counts as 0, which always holds for
        surfaces, so a comparison with a threshold never takes silence for clearance. The result is
        negative if solids overlap, and inf if there are no pairs.
        """
        if isinstance(self.pairs, PairStates):
            lowest = self.pairs.clearance()
        else:
            lowest = min(
                (min(0.0, p.lower) if p.stale else p.lower for p in self.pairs),  # 0 for NaN
                default=float("inf"),
            )
        if self.unsure:
            return min(lowest, 0.0)
        return min(lowest, self.beyond) if self.far else lowest
