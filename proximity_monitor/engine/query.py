"""The questions, asked once; `Pair` asks them again and again."""

from __future__ import annotations

import math
from threading import Event
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arguments import as_count, as_reals, check_tolerance
from .assembly import Assembly
from .kernels import closest as closest_kernel
from .mesh import TriangleMesh
from .pair import Pair
from .poses import as_poses, check_pose
from .result import Clearance, ClosestPoints, Collision, Distance, Distances
from .rows import distances_of, no_answers
from .run import LONG_SLICE, SLICE, Order, Search, check_model
from .sharing import share
from .solid import sides_of

_CHUNK = 256
"""Poses that one thread answers in a row. Each chunk starts without a remembered pair, so the
answers are the same however many threads there are."""

_POINTS = 4096
"""Points of which the same is true."""


def distance(
    a: TriangleMesh,
    pose_a: NDArray[np.float64],
    b: TriangleMesh,
    pose_b: NDArray[np.float64],
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    budget_s: float | None = None,
    order: Order = "depth_first",
    manifold: bool = False,
) -> Distance:
    """Minimum distance between two surfaces, with certified bounds and witness points.

    Zero where the surfaces touch or cross. A search goes on until the bounds meet to rounding, or
    a tolerance or the budget allows it to stop (Larsen et al. 1999, sections 3 and 5.3, eq. 4).

    Args:
        a: first model.
        pose_a: (4, 4) model to world, metres.
        b: second model.
        pose_b: (4, 4) model to world, metres.
        rel_err: stop when upper <= (1 + rel_err) · true distance.
        abs_err: metres; stop when upper <= true distance + abs_err, whichever is reached first.
        budget_s: seconds; stop with certified bounds when they are over. None: no limit. Some
            microseconds' work is done at least, so a `Pair` that is asked again and again comes to
            an end with any budget.
        order: "depth_first" takes the nearer child first, with the least bookkeeping; "priority"
            the nearest of all pairs that are left (section 6.1), which makes fewer tests where no
            good answer is known beforehand; "breadth_first" bounds all pairs of one level of the
            hierarchies before the next (Johnson and Cohen 1997, section 3.1.1), so its lower bound
            rises, and a manifold shrinks, everywhere alike. Its first question about a mesh chooses
            some vertices beforehand, 5 ms for 100,000 triangles, which no budget cuts.
        manifold: give every pair of triangles that may hold the minimum, all ties and, where
            surfaces intersect, all contacts: `Distance.manifold`. Where the search is cut, or a
            tolerance has it leave pairs of volumes alone that cannot improve the answer by more,
            those stand in it as well.

    Returns:
        The bounds, in metres, witness points and why the search stopped.

    Raises:
        TypeError: a model that is none, a tolerance or budget that is no real number.
        ValueError: a pose that is no rigid motion, a tolerance or budget that is negative or NaN.
    """
    return Pair(a, b).distance(
        pose_a, pose_b,
        rel_err=rel_err, abs_err=abs_err, budget_s=budget_s, order=order, manifold=manifold,
    )  # fmt: skip


def within(
    a: TriangleMesh,
    pose_a: NDArray[np.float64],
    b: TriangleMesh,
    pose_b: NDArray[np.float64],
    clearance: float,
) -> Clearance:
    """Whether two surfaces may be as near as `clearance` metres (a tolerance query).

    Cheaper than `distance`: the first witness ends the search. False is certain; True where a
    witness is as near, or rounding cannot exclude it.

    Raises:
        ValueError: a pose that is no rigid motion, a clearance that is negative or NaN.
    """
    return Pair(a, b).within(pose_a, pose_b, clearance)


def collide(
    a: TriangleMesh,
    pose_a: NDArray[np.float64],
    b: TriangleMesh,
    pose_b: NDArray[np.float64],
    *,
    all_contacts: bool = False,
) -> Collision:
    """Whether two surfaces touch or cross, and which triangles do.

    False is certain. With `all_contacts` every pair of touching triangles is returned, else one.

    Raises:
        ValueError: a pose that is no rigid motion.
    """
    return Pair(a, b).collide(pose_a, pose_b, all_contacts=all_contacts)


def signed_distance(
    a: TriangleMesh,
    pose_a: ArrayLike,
    b: TriangleMesh,
    pose_b: ArrayLike,
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    budget_s: float | None = None,
) -> Distance:
    """Signed distance where a model is solid: positive apart, negative where they overlap.

    Where nothing of one lies inside the other it is the minimum distance of their surfaces, as
    `distance` has it. Where they overlap, also where one lies wholly inside the other, it is minus
    the **depth of the deepest vertex**: the largest distance to the other model's surface of any
    vertex of one that lies inside the other. Where surfaces cross although no vertex of either lies
    inside the other, as with crossed bars, the depth and the signed distance are 0. The depth is
    not the shortest motion that would separate the models.

    Which models are solid their `solid` says, by default those that enclose one; `is_solid` tells,
    and `not_solid` why not. Of a solid and a surface, only vertices of the surface can lie inside;
    of two surfaces none can, and this is `distance`.

    A point is inside a solid where the surface's winding number around it is not 0 (Jacobson et al.
    2013, section 3, "Robust inside-outside segmentation using generalized winding numbers"). So
    faces may all point outward or all inward, overlapping parts make a union, and a part turned
    the other way inside another is a cavity. The depth is measured to the surface as it is given:
    to faces within a union as well.

    Of a mesh with holes, `solid="robust"`, a point is inside where the winding number is more than
    one half either way, and within the sphere `centre`, `core_radius`. The surface is still
    the triangles': nothing is there across a hole but that what passes it changes sides, and the
    signed distance jumps. A triangle that reaches in through a hole is seen by its vertices alone.

    Args:
        a: first model.
        pose_a: (4, 4) model to world, metres.
        b: second model.
        pose_b: (4, 4) model to world, metres.
        rel_err: stop when the bounds differ by at most rel_err · true distance or depth.
        abs_err: metres; stop when the bounds differ by at most abs_err, whichever is first.
        budget_s: seconds; stop with certified bounds when they are over. None: no limit. The first
            question about a mesh finds out besides whether it is a solid, some 15 ms for 100,000
            triangles, which no budget cuts.

    Returns:
        The bounds, in metres: `lower <= signed distance <= upper`, whatever stopped the search.
        Apart is certain where `lower > 0`, overlap where `upper < 0`; then -upper and -lower bound
        the depth, one witness point is the deepest vertex found and the other its nearest point on
        the other surface. Else they are those of `distance`, and their distance bounds the signed
        one from above.
        `bound_tests` and `primitive_tests` are those of `distance`; every point whose depth was
        tested counts as one of either.
        Status INTERSECTING: the surfaces touch, cross without a vertex inside, or are so close that
        rounding cannot tell, as it cannot where a winding number is one half; a depth that is known
        to differ from 0 comes as EXACT, WITHIN_TOLERANCE or OUT_OF_TIME.

    Raises:
        ValueError: a pose that is no rigid motion, a tolerance or budget that is negative or NaN.
    """
    return Pair(a, b).signed_distance(
        pose_a, pose_b, rel_err=rel_err, abs_err=abs_err, budget_s=budget_s
    )


def closest_points(
    model: TriangleMesh,
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
    deadline = math.inf if budget_s is None else start + check_tolerance("budget_s", budget_s)
    if given.ndim != 2 or given.shape[1] != 3:
        raise ValueError(f"points: shape {given.shape}, expected (k, 3)")
    if not np.isfinite(given).all():
        first = int(np.argwhere(~np.isfinite(given))[0, 0])
        raise ValueError(f"points[{first}] = {given[first].tolist()}: must be finite")
    k = len(given)
    region = sides_of(model).region if signed and model.is_solid else None
    nothing = [0.0 if region is None else -math.inf, math.inf]
    bounds, done = np.tile(nothing, (k, 1)), np.zeros(k, np.bool_)
    nearest, triangles = np.full((k, 3), np.nan), np.full(k, closest_kernel.NONE, np.int32)
    directions = np.full((k if normals else 0, 3), np.nan)
    capacity = 1 + model.depth * 15
    steps = LONG_SLICE if budget_s is None else SLICE  # in slices, so that Ctrl-C is heard, too

    def answer(first: int, stopped: Event) -> None:
        part = slice(first, first + _POINTS)
        stack, stacked = np.empty(capacity, np.int32), np.empty(capacity)
        count = len(given[part])
        found = at = 0  # the surface was searched for the first ones, the sides were found of fewer
        while at < count and not stopped.is_set():
            if perf_counter() >= deadline and (first or at):
                break
            if at == found:
                found = closest_kernel.closest_points(
                    model._distinct, pose, given[part], max_distance, region is not None, at, steps,
                    stack, stacked, bounds[part], nearest[part], triangles[part], directions[part],
                )  # fmt: skip
            if region is None:
                at = found
            else:
                at = closest_kernel.sides(
                    model._tree, region, pose, given[part], at, found, steps, stack,
                    bounds[part], nearest[part], triangles[part], directions[part],
                )  # fmt: skip
        done[first : first + at] = True
        half_done = slice(first + at, first + found)
        bounds[half_done], triangles[half_done] = nothing, closest_kernel.NONE

    share(answer, range(0, k, _POINTS), threads)
    faces = np.where(triangles >= 0, model._face_of[triangles], np.int32(-1))
    return ClosestPoints(
        bounds[:, 0], bounds[:, 1], nearest, faces, done, directions if normals else None
    )


def distances(
    a: TriangleMesh,
    poses_a: ArrayLike,
    b: TriangleMesh,
    poses_b: ArrayLike,
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    clearance: float | None = None,
    signed: bool = False,
    budget_s: float | None = None,
    order: Order = "depth_first",
    threads: int = 1,
) -> Distances:
    """Minimum distances at many poses, in one call.

    Successive poses help each other, so a path is cheaper than the same poses shuffled.

    Args:
        a: first model.
        poses_a: (k, 4, 4) model to world, metres.
        b: second model.
        poses_b: (k, 4, 4) model to world, metres.
        rel_err: as for `distance`.
        abs_err: as for `distance`; metres.
        clearance: metres; as `within`, a search ends as soon as it is certain on which side of it
            the distance lies, and `Distances.within` tells. With 0, as `collide`, it ends when it
            is certain whether the models touch or cross. None: it goes on.
        signed: whether to give signed distances, as `signed_distance` does.
        budget_s: seconds; poses that are not reached stay without an answer, those that are cut
            have certified bounds, and the next call begins them anew (an `Assembly` goes on with
            them). None: no limit. Some microseconds' work is done at least.
        order: as for `distance`. Signed distances are searched depth first alone.
        threads: how many threads share the work; the answers do not depend on it, but for which of
            them a budget allows.

    Raises:
        TypeError: a model that is none, a tolerance, clearance or budget that is no real number.
        ValueError: other shapes, a pose that is no rigid motion (naming it), a tolerance, clearance
            or budget that is negative or NaN, another order of signed distances.
    """
    start = perf_counter()
    rel_err = check_tolerance("rel_err", rel_err)
    abs_err = check_tolerance("abs_err", abs_err)
    clearance = math.inf if clearance is None else check_tolerance("clearance", clearance)
    deadline = None if budget_s is None else start + check_tolerance("budget_s", budget_s)
    threads = as_count(threads, "threads")
    many_a, many_b = as_poses(poses_a, "poses_a"), as_poses(poses_b, "poses_b")
    count = len(many_a)
    if count != len(many_b):
        raise ValueError(f"{count} poses_a but {len(many_b)} poses_b")
    Search(a, b, order)  # refuses an order that there is not, before any thread starts
    if signed and order != "depth_first":
        raise ValueError(f"order = {order!r}: signed distances are searched 'depth_first' alone")
    if signed and count:
        return _Poses((a,) * count + (b,) * count).distances(
            np.concatenate((many_a, many_b)), np.arange(2 * count).reshape(2, -1).T,
            rel_err=rel_err, abs_err=abs_err, clearance=clearance, signed=True, budget_s=budget_s,
            threads=threads,
        )  # fmt: skip
    rows = no_answers(np.zeros(count, np.bool_))
    # As `within` and `collide` ask it.
    stop = 0.0 if clearance == math.inf else clearance
    limit = math.nextafter(clearance, math.inf)

    def answer(first: int, stopped: Event) -> None:
        if first and deadline is not None and perf_counter() >= deadline:
            return
        part = slice(first, first + _CHUNK)
        Search(a, b, order).run(
            many_a[part].reshape(-1, 4), many_b[part].reshape(-1, 4),
            rel_err=rel_err, abs_err=abs_err, stop=stop, limit=limit, deadline=deadline,
            first=first, stopped=stopped, answers=rows[part].reshape(-1),
        )  # fmt: skip

    share(answer, range(0, count, _CHUNK), threads)
    return distances_of(rows)


class _Poses(Assembly):
    """One body at k poses and then another one at as many: 2 k bodies."""

    def _pose_name(self, body: int) -> str:
        half = len(self.models) // 2
        return f"poses_{'ba'[body < half]}[{body % half}]"
