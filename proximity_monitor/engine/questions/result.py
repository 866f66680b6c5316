"""The answers. Every one is certified: its bounds hold whatever stopped the search."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kernels.base import state as index
from ..models.model import Feature, Model
from .witness import witness_points

if TYPE_CHECKING:
    from .closest import Nearest
    from .manifold import Candidates, Manifold


class Status(Enum):
    """Why a distance search stopped."""

    EXACT = "exact"
    """The bounds differ only by rounding and by the models' deviations."""
    WITHIN_TOLERANCE = "within tolerance"
    """upper <= (1 + rel_err) · true, or upper <= true + abs_err, without the deviations."""
    OUT_OF_TIME = "out of time"
    """The budget ended first. The bounds hold, and the same Pair can go on."""
    INTERSECTING = "intersecting"
    """The models cross or touch, or are so close that rounding or deviations hide whether they do:
    lower is 0, or of a signed distance the least value that it can have."""


STATUSES = tuple(Status)
"""The members of Status, by the numbers that kernels use for them."""


@dataclass(frozen=True, eq=False, repr=False)
class Distance:
    """Minimum distance of two surfaces: lower <= true distance <= upper.

    Attributes:
        row: (ANSWER,) the numbers of the answer, as a search writes them.
        elapsed_s: seconds the search took.
        candidates: the pairs that the `manifold` is made from, if it was asked for.
        kinds: the kinds of the two models, which know their features.
    """

    # Fields are made when they are read: a call takes a few microseconds, and all fields take one.
    row: NDArray[np.float64]
    elapsed_s: float
    candidates: Candidates | None
    kinds: tuple[type[Model], type[Model]]

    @cached_property
    def manifold(self) -> Manifold | None:
        """Every pair that may hold the minimum; None if they were not asked for.

        It is made when it is first read, outside any budget: a millisecond for 20,000 pairs.
        """
        return None if self.candidates is None else self.candidates.manifold()

    @cached_property
    def solution_set(self) -> tuple[Manifold, ...] | None:
        """The manifold in groups: one for each nearest pair that stands alone, and each continuum.

        Two pairs are in one group if, on both models, their parts are about as near to each other
        in space as they are long. So pairs of different groups are certainly apart, but a group may
        not be connected. The group with the least bound is first. None if no manifold was asked
        for. It is made when it is first read.
        """
        if self.candidates is None or self.manifold is None:
            return None
        return self.candidates.solution_set(self.manifold)

    @property
    def lower(self) -> float:
        """Metres; certified lower bound; negative only in answers of `signed_distance`."""
        return float(self.row[index.LOWER])

    @property
    def upper(self) -> float:
        """Metres; certified upper bound: the distance of the witness points, and its rounding.

        Negative only in answers of `signed_distance`.
        """
        return float(self.row[index.UPPER])

    @property
    def status(self) -> Status:
        """Why the search stopped."""
        return STATUSES[int(self.row[index.STATUS])]

    @property
    def bound_tests(self) -> int:
        """Bounding volumes tested against others, or against single points (search/approach.py)."""
        return int(self.row[index.TESTS])

    @property
    def primitive_tests(self) -> int:
        """Pairs of elements tested, such as triangles."""
        return int(self.row[index.TESTS + 1])

    @property
    def point_a(self) -> NDArray[np.float64]:
        """(3,) metres, world; the witness point on a."""
        return witness_points(self.row)[0]

    @property
    def point_b(self) -> NDArray[np.float64]:
        """(3,) metres, world; the witness point on b."""
        return witness_points(self.row)[1]

    @property
    def feature_a(self) -> Feature:
        """Where point_a lies on a."""
        return self._feature(0, index.FEATURE_A)

    @property
    def feature_b(self) -> Feature:
        """Where point_b lies on b."""
        return self._feature(1, index.FEATURE_B)

    def _feature(self, side: int, at: int) -> Feature:
        return self.kinds[side].feature(int(self.row[at + 3]), self.row[at : at + 3])

    def __repr__(self) -> str:
        """The bounds, points and status."""
        points = ", ".join(str(point.tolist()) for point in (self.point_a, self.point_b))
        return (
            f"Distance(lower={self.lower!r}, upper={self.upper!r}, {self.status}, points {points})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ClosestPoints:
    """The point of a surface nearest to each of many points.

    A point beyond the `max_distance` of the question has that or more as its lower bound. A point
    that the budget did not suffice for has 0. The upper bound of both is infinite. If signs were
    asked for, a point deeper inside than `max_distance` has -`max_distance` or less as its upper
    bound, and unknown lower bounds are -infinity. The nearest points and normals of all these are
    NaN, and their elements are -1.

    Attributes:
        found: what the search wrote; each field is made from it when it is first read.
    """

    found: Nearest

    def __len__(self) -> int:
        """How many points there are."""
        return len(self.found.bounds)

    @cached_property
    def lower(self) -> NDArray[np.float64]:
        """(k,) metres; certified lower bounds of the distances, or of the signed distances."""
        return self.found.lower()

    @cached_property
    def upper(self) -> NDArray[np.float64]:
        """(k,) metres; certified upper bounds. A point is certainly inside if its is below 0."""
        return self.found.upper()

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(k, 3) metres, world; the nearest points of the surface."""
        return self.found.points()

    @cached_property
    def elements(self) -> NDArray[np.int32]:
        """(k,) int32; the elements on which these points lie: triangles, patches or curves."""
        return self.found.elements()

    @cached_property
    def parameters(self) -> NDArray[np.float64] | None:
        """(k, 2) where each point lies on its element; None for a mesh, whose points suffice.

        On a patch, u and v, within its knots; on a curve, its parameter, and 0; on a solid of
        revolution, t on the curve of its profile, and theta, radians from 0 to 2 pi.

        They belong to the point that was found, and have no error bound. The distance changes with
        their square, so they differ from those of the nearest point by about the square root of the
        difference of the bounds. For certain parameters, `distance` has `param_err`.
        """
        return self.found.parameters()

    @cached_property
    def done(self) -> NDArray[np.bool_]:
        """(k,) bool; False where the budget ended first: ask again about `points[~done]`."""
        return self.found.done()

    @cached_property
    def normals(self) -> NDArray[np.float64] | None:
        """(k, 3) unit vectors, world; the surface's normals at these points, if asked for.

        The normal of a triangle points outward as the order of its corners says; it is zero if the
        triangle has no area. For a model swept by a ball, it is the normal of the swept surface.
        """
        return self.found.normals()


@dataclass(frozen=True, eq=False)
class Distances:
    """Minimum or signed distances, one row for each pose or pair of bodies; see `Distance`.

    Attributes:
        rows: (k, ANSWER) the numbers of the answers, as searches write them. The status is NaN
            where nothing was searched.
    """

    # As in `Distance`, fields are made when they are read: for thousands of rows, making them takes
    # longer than a short budget lasts.
    rows: NDArray[np.float64]

    def __len__(self) -> int:
        """How many there are."""
        return len(self.rows)

    @property
    def lower(self) -> NDArray[np.float64]:
        """(k,) metres; 0 where nothing was searched.

        For a signed distance it is -infinity there, and may be so if `upper` decided the clearance.
        """
        return self.rows[:, index.LOWER]

    @property
    def upper(self) -> NDArray[np.float64]:
        """(k,) metres; infinity where nothing was searched."""
        return self.rows[:, index.UPPER]

    @property
    def points_a(self) -> NDArray[np.float64]:
        """(k, 3) metres, world; NaN where nothing was searched."""
        return self._points[0]

    @property
    def points_b(self) -> NDArray[np.float64]:
        """(k, 3) metres, world; NaN where nothing was searched."""
        return self._points[1]

    @cached_property
    def elements(self) -> NDArray[np.int32]:
        """(k, 2); the elements of the models on which the witness points lie, such as triangles.

        -1 where nothing was searched.
        """
        return self._integers((index.FEATURE_A + 3, index.FEATURE_B + 3), -1).astype(np.int32)

    @property
    def parameters(self) -> NDArray[np.float64]:
        """(k, 2, 3) where the witness points lie on these elements; see `Model.feature`."""
        a, b = index.FEATURE_A, index.FEATURE_B
        return self.rows[:, [*range(a, a + 3), *range(b, b + 3)]].reshape(-1, 2, 3)

    @cached_property
    def hints(self) -> NDArray[np.int32]:
        """(k, 2); elements from which the next question to an `Assembly` may start; -1: none."""
        return self._integers((index.TREE_A, index.TREE_B), -1).astype(np.int32)

    @cached_property
    def status(self) -> NDArray[np.int32]:
        """(k,) positions in `tuple(Status)`."""
        return self._integers(index.STATUS, index.OUT_OF_TIME).astype(np.int32)

    @cached_property
    def bound_tests(self) -> NDArray[np.int64]:
        """(k,) bounding volume pairs tested."""
        return self._integers(index.TESTS, 0)

    @cached_property
    def primitive_tests(self) -> NDArray[np.int64]:
        """(k,) pairs of elements tested, such as triangles."""
        return self._integers(index.TESTS + 1, 0)

    @cached_property
    def searched(self) -> NDArray[np.bool_]:
        """(k,) whether the budget sufficed to begin a search for the pair."""
        return ~np.isnan(self.rows[:, index.STATUS])

    @cached_property
    def _points(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return witness_points(self.rows)

    def _integers(self, columns: int | tuple[int, ...], otherwise: int) -> NDArray[np.int64]:
        """Return columns of whole numbers; `otherwise` where nothing was searched."""
        chosen = self.rows[:, columns].copy()
        chosen[~self.searched] = otherwise
        return chosen.astype(np.int64)

    def within(self, clearance: ArrayLike) -> NDArray[np.bool_]:
        """Return (k,) whether the models may be as near as `clearance` metres, a number or (k,).

        False is certain. If the question had this clearance, the answer is decided unless the
        budget ended first. So with clearance 0 it says whether the models touch or cross.
        """
        return self.lower <= np.asarray(clearance)
