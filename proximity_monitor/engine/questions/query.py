"""The questions, for a single call; use `Pair` to ask them repeatedly."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import check_tolerance
from ..models.model import Model
from .decision import Clearance, Collision
from .pair import Pair
from .result import Distance
from .run import Order


def distance(
    a: Model,
    pose_a: NDArray[np.float64],
    b: Model,
    pose_b: NDArray[np.float64],
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    budget_s: float | None = None,
    order: Order = "depth_first",
    manifold: bool = False,
    param_err: float | None = None,
) -> Distance:
    """Find the minimum distance between two surfaces, with certified bounds and witness points.

    It is zero if the surfaces touch or cross. The search goes on until the bounds agree up to
    rounding, or a tolerance or the budget lets it stop (Larsen et al. 1999, sections 3 and 5.3,
    eq. 4).

    Args:
        a: first model.
        pose_a: (4, 4) model to world, metres.
        b: second model.
        pose_b: (4, 4) model to world, metres.
        rel_err: stop when upper <= (1 + rel_err) · true distance.
        abs_err: metres; stop when upper <= true distance + abs_err, whichever is reached first.
        budget_s: seconds; stop with certified bounds when the budget ends. None: no limit. Each
            call does at least some microseconds of work, so repeated calls to a `Pair` come to an
            end with any budget.
        order: for the study of searches; the default suits nearly every use. "depth_first" takes
            the nearer child first, with the least bookkeeping. "priority" takes the nearest of all
            pairs that are left (section 6.1), which needs fewer tests if no good answer is known
            beforehand. "breadth_first" bounds all pairs of one level of the hierarchies before the
            next (Johnson and Cohen 1997, section 3.1.1), so its lower bound rises, and a manifold
            shrinks, evenly everywhere. Its first question about a mesh chooses some vertices
            beforehand, which takes 5 ms for 100,000 triangles and which no budget cuts.
        manifold: collect every pair of triangles, or of parts of parametric surfaces, that may hold
            the minimum, with all ties and, if surfaces intersect, all contacts:
            `Distance.manifold`, and in groups `Distance.solution_set`. If the search is cut, or
            leaves pairs of volumes alone because of a tolerance, it contains these pairs as well.
        param_err: for parametric surfaces; implies `manifold`. Go on until no part in it is longer
            than `param_err` in u or v, in the units of its patch's knots. Nothing but such parts is
            left of both surfaces. So the parameters of a nearest pair that stands alone are known
            to a few times `param_err`, or to some dozens of times if a parameter moves the point
            little, as near a pole: `Manifold.extents` says how well. Parts of that size cover a
            continuum, as long as there is room for them.

    Returns:
        The bounds, in metres, witness points and why the search stopped.

    Raises:
        TypeError: `a` or `b` is no model; a tolerance or budget is no real number.
        ValueError: a pose is no rigid motion; a tolerance or budget is negative or NaN; `param_err`
            is given though neither model is a parametric surface.
    """
    start = perf_counter()
    pair = Pair(a, b, coherent=False)
    return pair.distance(
        pose_a, pose_b, rel_err=rel_err, abs_err=abs_err, budget_s=_left(budget_s, start),
        order=order, manifold=manifold, param_err=param_err,
    )  # fmt: skip


def within(
    a: Model,
    pose_a: NDArray[np.float64],
    b: Model,
    pose_b: NDArray[np.float64],
    clearance: float,
    *,
    budget_s: float | None = None,
) -> Clearance:
    """Find whether two surfaces may be as near as `clearance` metres (a tolerance query).

    This is cheaper than `distance`: the first witness ends the search. False is certain. True means
    that a witness is as near, or that rounding cannot exclude one.

    Args:
        a: first model.
        pose_a: (4, 4) model to world, metres.
        b: second model.
        pose_b: (4, 4) model to world, metres.
        clearance: metres.
        budget_s: as for `distance`. If it ends first, `Clearance.decided` is False and `within` is
            True, because nothing excludes it.

    Raises:
        TypeError: `a` or `b` is no model; the clearance or budget is no real number.
        ValueError: a pose is no rigid motion; the clearance or budget is negative or NaN.
    """
    start = perf_counter()
    pair = Pair(a, b, coherent=False)
    return pair.within(pose_a, pose_b, clearance, budget_s=_left(budget_s, start))


def collide(
    a: Model,
    pose_a: NDArray[np.float64],
    b: Model,
    pose_b: NDArray[np.float64],
    *,
    all_contacts: bool = False,
    budget_s: float | None = None,
) -> Collision:
    """Find whether two surfaces touch or cross, and which of their elements do.

    False is certain.

    Args:
        a: first model.
        pose_a: (4, 4) model to world, metres.
        b: second model.
        pose_b: (4, 4) model to world, metres.
        all_contacts: find every pair of touching triangles, or pieces of parametric surfaces;
            otherwise one pair. See `Collision.contacts`.
        budget_s: as for `distance`. If it ends before anything is known, `Collision.decided` is
            False and `colliding` is True; if it ends before all contacts are found, `complete` is
            False.

    Raises:
        TypeError: `a` or `b` is no model; the budget is no real number.
        ValueError: a pose is no rigid motion; the budget is negative or NaN.
    """
    start = perf_counter()
    pair = Pair(a, b, coherent=False)
    budget_s = _left(budget_s, start)
    return pair.collide(pose_a, pose_b, all_contacts=all_contacts, budget_s=budget_s)


def _left(budget_s: float | None, start: float) -> float | None:
    """Return the rest of a budget that began at `start` of perf_counter."""
    if budget_s is None:
        return None
    return max(check_tolerance("budget_s", budget_s) - (perf_counter() - start), 0.0)


def signed_distance(
    a: Model,
    pose_a: ArrayLike,
    b: Model,
    pose_b: ArrayLike,
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    depth_err: float = 0.01,
    budget_s: float | None = None,
) -> Distance:
    """Find the signed distance of two models: positive if apart, negative if a solid overlaps.

    If nothing of one model lies inside the other, it is the minimum distance of their surfaces, as
    from `distance`. If two solids overlap, even one wholly inside the other, it is minus the
    **diameter of the largest ball that fits into both**. That is how far faces, or spheres, are
    pushed into each other. It is the same for every tessellation of a shape. It changes by no more
    than the solids move. The depth is never more than the shortest translation that parts the
    solids: a ball inside both and its copy, moved by that translation, have no common interior.

    For a solid and a surface it is the least signed distance of the surface's points to the solid:
    minus the **depth of the deepest point** if the surface reaches in. For two surfaces it is
    `distance`. The argument `solid` of a model says whether it is a solid; by default it is one if
    it encloses a volume. `is_solid` tells whether it is, and `not_solid` says why not.

    A point is inside a solid if the surface's winding number around it is not 0 (Jacobson et al.
    2013, section 3, "Robust inside-outside segmentation using generalized winding numbers"). So
    faces may all point outward or all inward, overlapping parts make a union, and a part turned
    the other way inside another is a cavity. No ball crosses the surface as it is given, not even
    faces inside a union.

    For a mesh with holes, `solid="robust"`, a point is inside if it lies within the sphere
    `centre`, `core_radius` and the box around all corners of its faces along the model's axes, and
    its winding number is more than one half either way. The surface is still that of the triangles.
    There is none across a hole, but whatever passes through a hole changes sides, and its signed
    distance jumps.

    Args:
        a: first model.
        pose_a: (4, 4) model to world, metres.
        b: second model.
        pose_b: (4, 4) model to world, metres.
        rel_err: for models that are apart: stop when upper <= (1 + rel_err) · true distance.
        abs_err: metres; stop when the bounds differ by at most abs_err, whichever is first.
        depth_err: for models that overlap: stop when the bounds differ by at most depth_err ·
            depth. The depth of faces pushed into each other is found to rounding in any case. If
            the largest ball touches curved surfaces, a tenth of the error takes about twice as
            long. A large one, such as 1e3, asks only whether they overlap.
        budget_s: seconds; stop with certified bounds when the budget ends. None: no limit. The
            first question about a mesh also finds out whether it is a solid, which takes some 15 ms
            for 100,000 triangles and which no budget cuts.

    Returns:
        The bounds, in metres: `lower <= signed distance <= upper`, whatever stopped the search.
        The models are certainly apart if `lower > 0`, and certainly overlap if `upper < 0`. In the
        second case -upper and -lower bound the depth, and the witness points are the points of both
        surfaces nearest to the centre of the largest ball found; or the deepest point of a surface,
        and the solid's point nearest to it. Otherwise the witness points are those of `distance`,
        and their distance bounds the signed distance from above.
        `bound_tests` and `primitive_tests` are those of `distance`; every point whose depth was
        tested counts as one of each.
        Status INTERSECTING: the surfaces touch, or are so close that rounding or deviations hide
        whether they do; or the models overlap most next to a hole of a robust solid, or a whole
        region of a parametric surface is deepest, so that the bounds may stay wider than asked for.
        Any other depth has the status EXACT, WITHIN_TOLERANCE or OUT_OF_TIME.

    Raises:
        ValueError: a pose is no rigid motion; a tolerance or budget is negative or NaN.
    """
    start = perf_counter()
    pair = Pair(a, b, coherent=False)
    return pair.signed_distance(
        pose_a, pose_b,
        rel_err=rel_err, abs_err=abs_err, depth_err=depth_err, budget_s=_left(budget_s, start),
    )  # fmt: skip
