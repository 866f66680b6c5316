"""The points of a model's surface nearest to many points, and the side on which each point lies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from threading import Event
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_count, as_reals, check_tolerance
from ..kernels.base.rounding import LARGEST_COORDINATE
from ..kernels.inside import closest as closest_kernel
from ..models.model import Model
from ..models.solid import sides_of
from ..models.surface import Surface
from ..poses import check_pose
from .closest_surface import PointsOnSurface, SurfacePoints
from .result import ClosestPoints
from .run import check_model
from .sharing import share
from .slices import deadline_of, slices_until

_POINTS = 4096
"""Points of a block that one thread answers; the number of threads does not change the answers."""


@dataclass(frozen=True, slots=True)
class Nearest:
    """What kernels wrote about k points; `ClosestPoints` makes each field from it when it is read.

    Finishing thousands of rows at once would take longer than a short budget lasts.
    """

    numbers: NDArray[np.int32]
    """(m,) the face, patch or curve of each element in tree order."""
    bounds: NDArray[np.float64]
    """(k, 2) metres; rows of points that are not done mean nothing, here and in what follows."""
    feet: NDArray[np.float64]
    """(k, 3) metres, world: the nearest points; valid where an element was found."""
    triangles: NDArray[np.int32]
    """(k,) the element of each foot in tree order, or NONE."""
    surface: PointsOnSurface | None
    """What else was written about the feet on a surface; None for a mesh."""
    directions: NDArray[np.float64] | None
    """(k, 3) normals of a mesh, valid as `feet`; None if not asked for, or for a surface."""
    ends: NDArray[np.int64]
    """For each block of _POINTS points, the number after its last point that is done."""
    nothing: float
    """The lower bound of a point that is not done, metres."""

    def done(self) -> NDArray[np.bool_]:
        """Return which points are done (k,)."""
        number = np.arange(len(self.bounds))
        return number < self.ends[number // _POINTS]

    def near(self) -> NDArray[np.bool_]:
        """Return for which points an element was found (k,)."""
        return self.done() & (self.triangles != closest_kernel.NONE)

    def lower(self) -> NDArray[np.float64]:
        """Return the lower bounds (k,), metres."""
        return np.where(self.done(), self.bounds[:, 0], self.nothing)

    def upper(self) -> NDArray[np.float64]:
        """Return the upper bounds (k,), metres."""
        return np.where(self.done(), self.bounds[:, 1], math.inf)

    def elements(self) -> NDArray[np.int32]:
        """Return the faces, patches or curves of the feet (k,), or -1."""
        near = self.near()
        return np.where(near, self.numbers[np.where(near, self.triangles, 0)], -1)

    def points(self) -> NDArray[np.float64]:
        """Return the feet that were found (k, 3), or NaN."""
        return self._found(self.feet)

    def parameters(self) -> NDArray[np.float64] | None:
        """Return the parameters of the feet on a surface (k, 2), or NaN; None for a mesh."""
        return None if self.surface is None else self._found(self.surface.places())

    def normals(self) -> NDArray[np.float64] | None:
        """Return the surface's normals at the feet (k, 3), or NaN; None if not asked for."""
        directions = self.directions
        if self.surface is not None:
            directions = self.surface.normals(self.elements())
        return None if directions is None else self._found(directions)

    def _found(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(self.near()[:, None], vectors, np.nan)


def closest_points(
    model: Model,
    pose: NDArray[np.float64],
    points: ArrayLike,
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    max_distance: float = math.inf,
    budget_s: float | None = None,
    threads: int = 1,
    normals: bool = False,
    signed: bool = False,
) -> ClosestPoints:
    """Find the point of a model's surface nearest to each of many points.

    Args:
        model: the model.
        pose: (4, 4) model to world, metres.
        points: (k, 3) metres, world.
        rel_err: a point that is found may be farther than the nearest one:
            upper <= (1 + rel_err) · true distance, up to rounding. The bounds tell how near it is.
        abs_err: metres; upper <= true distance + abs_err. The tolerance that allows more counts.
            With `signed`, a point nearer to the surface than abs_err may be given either side.
        max_distance: metres. Of points farther away, only this is found out, which is cheaper; with
            `signed` also the side on which they lie.
        budget_s: seconds. When the budget ends, the remaining points stay undone. None: no limit.
            Each call does at least some microseconds of work.
        threads: how many threads share the work; the answers do not depend on it.
        normals: whether to return the surface's normals at the nearest points.
        signed: whether distances are negative inside a solid (see `model.is_solid`, and
            `signed_distance` for what counts as inside). This takes a third longer, or with
            `solid="robust"` some 25 times as long. If rounding hides the side, as on the surface,
            the bounds have opposite signs. For a model swept by a ball, the signed distance is that
            of its core less the radius, so a point is as deep as it is in the deepest of the swept
            triangles. The first question about a mesh also finds out whether it is a solid, which
            takes some 15 ms for 100,000 triangles and which no budget cuts. If the model is no
            solid, this argument changes nothing.

    Raises:
        TypeError: `model` is no model; a distance, error or budget is no real number.
        ValueError: the pose is no rigid motion; the points have another shape, are not finite or
            lie beyond 1e45 m; a distance, error or budget is negative or NaN; there is less than
            one thread.
    """
    start = perf_counter()
    check_model(model, "model")
    pose = check_pose(pose)
    given = as_reals(points, "points")
    max_distance = check_tolerance("max_distance", max_distance)
    errors = check_tolerance("rel_err", rel_err), check_tolerance("abs_err", abs_err)
    threads = as_count(threads, "threads")
    deadline = deadline_of(start, budget_s)
    if given.ndim != 2 or given.shape[1] != 3:
        raise ValueError(f"points: shape {given.shape}, expected (k, 3)")
    if not (np.abs(given) <= LARGEST_COORDINATE).all():
        first = int(np.argwhere(~(np.abs(given) <= LARGEST_COORDINATE))[0, 0])
        raise ValueError(
            f"points[{first}] = {given[first].tolist()}: must be finite and at most "
            f"{LARGEST_COORDINATE:g} m"
        )
    k = len(given)
    hierarchy = model._hierarchy
    sides = sides_of(model) if signed and model.is_solid else None
    if sides is not None:  # a point nearer to the surface than abs_err may get either side
        errors = min(errors[0], 1.0), 0.5 * errors[1]
    bounds, nearest, triangles = np.empty((k, 2)), np.empty((k, 3)), np.empty(k, np.int32)
    ends = np.zeros(-(-k // _POINTS), np.int64)
    nothing = 0.0 if sides is None else -math.inf
    found_on = PointsOnSurface.of(model, pose, k, normals) if isinstance(model, Surface) else None
    of_mesh = normals and found_on is None
    directions = np.empty((k if of_mesh else 0, 3))
    answer_made = Nearest(
        hierarchy.numbers, bounds, nearest, triangles, found_on,
        directions if of_mesh else None, ends, nothing,
    )  # fmt: skip
    if isinstance(model, Surface):
        surface = SurfacePoints(model, pose, max_distance, errors, deadline, sides is not None)

        def answer_surface(first: int, stopped: Event) -> None:
            part = slice(first, first + _POINTS)
            ends[first // _POINTS] = first + surface.find(
                given[part], first, stopped, bounds[part], nearest[part], triangles[part],
                found_on.parameters[part],
            )  # fmt: skip

        share(answer_surface, range(0, k, _POINTS), threads)
        return ClosestPoints(answer_made)
    capacity = 1 + hierarchy.depth * 15

    def answer(first: int, stopped: Event) -> None:
        part = slice(first, first + _POINTS)
        stack, stacked = np.empty(capacity, np.int32), np.empty(capacity)
        around = np.empty(capacity, np.int32)  # the stack of `sides`
        going = np.zeros(3)  # the search for a point that a slice has cut: see the kernel
        count = len(given[part])
        found = at = 0  # so many points have a nearest point; so many of these have a side, too
        slices = slices_until(deadline)
        over = first > 0 and deadline is not None and perf_counter() >= deadline
        while at < count and not (over or stopped.is_set()):
            if at == found:
                found = closest_kernel.closest_points(
                    hierarchy.table, pose, given[part], max_distance, *errors, sides is not None,
                    at, slices.steps, stack, stacked, going, bounds[part], nearest[part],
                    triangles[part], directions[part],
                )  # fmt: skip
            if sides is None:
                at = found
            elif at < found:
                at = closest_kernel.sides(
                    sides.table, pose, given[part], at, found, slices.steps, around,
                    bounds[part], nearest[part], triangles[part], directions[part],
                )  # fmt: skip
            # Do at least one point, so that repeated calls come to an end.
            over = slices.over() and (first > 0 or at > 0)
        ends[first // _POINTS] = first + at

    share(answer, range(0, k, _POINTS), threads)
    return ClosestPoints(answer_made)
