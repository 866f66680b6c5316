"""Many points at once: the nearest points of a model's surface, and the side."""

from __future__ import annotations

import math
from threading import Event
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_count, as_reals, check_tolerance
from ..kernels.base.state import MeshTree
from ..kernels.inside import closest as closest_kernel
from ..models.model import Model
from ..models.solid import sides_of
from ..poses import check_pose
from .result import ClosestPoints
from .run import check_model
from .sharing import share
from .slices import slices_until

_POINTS = 4096
"""Points that one thread answers in a row; the answers do not depend on the number of threads."""


def closest_points(
    model: Model,
    pose: NDArray[np.float64],
    points: ArrayLike,
    *,
    max_distance: float = math.inf,
    budget_s: float | None = None,
    threads: int = 1,
    normals: bool = False,
    signed: bool = False,
) -> ClosestPoints:
    """The points of a surface nearest to many given points.

    Args:
        model: the surface.
        pose: (4, 4) model to world, metres.
        points: (k, 3) metres, world.
        max_distance: metres; of points farther away only that is found out, and on which side they
            lie where `signed`, which is cheaper.
        budget_s: seconds; when they are over the points that are left stay undone. None: no limit.
            Some microseconds' work is done at least.
        threads: how many threads share the work; the answers do not depend on it.
        normals: whether to return the surface's normals at the nearest points.
        signed: whether distances count as negative inside a solid (`model.is_solid`; what is inside
            says `signed_distance`), which takes a third longer, or with `solid="robust"` some 25
            times as long. Where rounding hides the side, as upon the surface, the bounds have
            either sign. Of a model swept by a ball the signed distance is that of its core less the
            radius, so a point is as deep as it is in the deepest of the swept triangles. The first
            question about a mesh finds out besides
            whether it is a solid, some 15 ms for 100,000 triangles, which no budget cuts. For a
            surface this changes nothing.

    Raises:
        TypeError: a model that is none, a distance or budget that is no real number.
        ValueError: a pose that is no rigid motion; points of another shape or not finite; a
            distance or budget that is negative or NaN, less than one thread.
    """
    start = perf_counter()
    check_model(model, "model")
    pose = check_pose(pose)
    given = as_reals(points, "points")
    max_distance = check_tolerance("max_distance", max_distance)
    threads = as_count(threads, "threads")
    deadline = None if budget_s is None else start + check_tolerance("budget_s", budget_s)
    if given.ndim != 2 or given.shape[1] != 3:
        raise ValueError(f"points: shape {given.shape}, expected (k, 3)")
    if not np.isfinite(given).all():
        first = int(np.argwhere(~np.isfinite(given))[0, 0])
        raise ValueError(f"points[{first}] = {given[first].tolist()}: must be finite")
    k = len(given)
    hierarchy = model._hierarchy
    region = sides_of(model).region if signed and model.is_solid else None
    nothing = [0.0 if region is None else -math.inf, math.inf]
    bounds, done = np.tile(nothing, (k, 1)), np.zeros(k, np.bool_)
    nearest, triangles = np.full((k, 3), np.nan), np.full(k, closest_kernel.NONE, np.int32)
    directions = np.full((k if normals else 0, 3), np.nan)
    capacity = 1 + hierarchy.depth * 15
    # Of whatever volumes: boxes may be taken for swept spheres.
    tree, distinct = MeshTree(*hierarchy.tree), MeshTree(*hierarchy.distinct)

    def answer(first: int, stopped: Event) -> None:
        part = slice(first, first + _POINTS)
        stack, stacked = np.empty(capacity, np.int32), np.empty(capacity)
        around = np.empty(capacity, np.int32)  # of the nodes that `sides` looks at
        going = np.zeros(3)  # of the point whose search a slice has cut: see the kernel
        count = len(given[part])
        found = at = 0  # the surface was searched for the first ones, the sides were found of fewer
        slices = slices_until(deadline)
        over = first > 0 and deadline is not None and perf_counter() >= deadline
        while at < count and not (over or stopped.is_set()):
            if at == found:
                found = closest_kernel.closest_points(
                    distinct, pose, given[part], max_distance, region is not None, at,
                    slices.steps, stack, stacked, going, bounds[part], nearest[part],
                    triangles[part], directions[part],
                )  # fmt: skip
            if region is None:
                at = found
            elif at < found:
                at = closest_kernel.sides(
                    tree, region, pose, given[part], at, found, slices.steps, around,
                    bounds[part], nearest[part], triangles[part], directions[part],
                )  # fmt: skip
            # One point at least, so that whoever asks again and again comes to an end.
            over = slices.over() and (first > 0 or at > 0)
        done[first : first + at] = True
        half_done = slice(first + at, first + found)
        bounds[half_done], triangles[half_done] = nothing, closest_kernel.NONE

    share(answer, range(0, k, _POINTS), threads)
    faces = np.where(triangles >= 0, hierarchy.numbers[triangles], np.int32(-1))
    return ClosestPoints(
        bounds[:, 0], bounds[:, 1], nearest, faces, done, directions if normals else None
    )
