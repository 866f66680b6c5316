"""The control net of a NURBS patch or curve: its checks, and how it is evaluated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_reals
from ..kernels.base.rounding import LARGEST_COORDINATE
from .bezier import NO_DIRECTION, Spans, basis, conversion_error, cut, spans
from .checks import ModelError

if TYPE_CHECKING:
    from .trim import Trim

HIGHEST_DEGREE = 15
"""The highest degree of a patch, in either direction."""

SMALLEST_WEIGHT = 1e-50
"""The smallest weight, as a share of the largest: no product of weights and coordinates underflows.
"""

ONE = 1, 1
"""Number of parts in u and in v if spans are not cut."""


@dataclass(frozen=True, slots=True, eq=False)
class Net:
    """A checked control net with read-only arrays. A curve has one column and no knots in v."""

    control: NDArray[np.float64]
    """(n_u, n_v, 3) metres, model frame."""
    weights: NDArray[np.float64] | None
    """(n_u, n_v) the given weights times a power of two: the largest is at least 1/2 and below 1.
    None: all are equal."""
    knots_u: NDArray[np.float64]
    knots_v: NDArray[np.float64]
    is_curve: bool
    trim: Trim | None = None
    """What is left of a patch; None: all of it."""

    @property
    def degrees(self) -> tuple[int, int]:
        """The degrees in u and in v; a curve has 0 in v."""
        n_u, n_v, _ = self.control.shape
        return len(self.knots_u) - n_u - 1, 0 if self.is_curve else len(self.knots_v) - n_v - 1

    @property
    def spans(self) -> tuple[Spans, Spans]:
        """The polynomial spans in u and in v."""
        return self.parts(ONE)

    def parts(self, count: tuple[int, int]) -> tuple[Spans, Spans]:
        """Return the spans in u and v, each cut into `count` parts; a curve has one span in v."""
        p, q = self.degrees
        along_v = NO_DIRECTION if self.is_curve else spans(self.knots_v, q, count[1])
        return spans(self.knots_u, p, count[0]), along_v

    @property
    def points(self) -> NDArray[np.float64]:
        """The control points (n, 3), metres, v fastest."""
        return self.control.reshape(-1, 3)

    def moved(self, points: NDArray[np.float64]) -> Self:
        """Return the same net with other control points (n, 3), metres."""
        return replace(self, control=frozen(points.reshape(self.control.shape)))

    def swapped(self) -> Self:
        """Return the patch with u and v exchanged, which turns its normals; a curve unchanged."""
        if self.is_curve:
            return self
        weights = None if self.weights is None else frozen(self.weights.T.copy())
        control = frozen(self.control.transpose(1, 0, 2).copy())
        trim = None if self.trim is None else self.trim.swapped()
        return Net(control, weights, self.knots_v, self.knots_u, False, trim)

    def homogeneous(self) -> NDArray[np.float64]:
        """Return the control net (n_u, n_v, 4) in homogeneous coordinates x w, y w, z w and w."""
        made = np.empty((*self.control.shape[:2], 4))
        made[..., :3] = self.control
        made[..., 3] = 1.0
        if self.weights is not None:
            made *= self.weights[..., None]
        return made

    def pieces(self, parts: tuple[int, int] = ONE) -> NDArray[np.float64]:
        """Return the control nets (s_u, s_v, degree_u + 1, degree_v + 1, 4) of the Bezier pieces.

        They are homogeneous. Each span is cut into `parts` in u and in v.
        """
        made = cut(self.homogeneous(), *self.parts(parts))
        if self.weights is None:
            made[..., 3] = 1.0
        return made

    def error(self, parts: tuple[int, int] = ONE) -> float:
        """Return how far, in metres, rounding may move a point of `pieces`."""
        largest = float(np.linalg.norm(self.points, axis=1).max())
        return conversion_error(*self.parts(parts), self.weights is not None, largest)

    def derivatives(
        self, u: NDArray[np.float64], v: NDArray[np.float64], order: int
    ) -> NDArray[np.float64]:
        """Return the partial derivatives (k, order + 1, order + 1, 3) at u and v (k,), metres.

        [:, i, j] is the derivative of order i in u and j in v; it is 0 if i + j > order. Piegl
        and Tiller, The NURBS Book, 1997, equation 4.20.
        """
        along_u, along_v = self.spans
        first_u, in_u = basis(along_u, u, order)
        first_v, in_v = basis(along_v, v, order)
        rows = (first_u[:, None] + np.arange(along_u.degree + 1))[:, :, None]
        columns = (first_v[:, None] + np.arange(along_v.degree + 1))[:, None, :]
        points = self.homogeneous()[rows, columns]
        found = np.einsum("kdi,kej,kijc->kdec", in_u, in_v, points, optimize=True)
        made = np.zeros((len(u), order + 1, order + 1, 3))
        for i in range(order + 1):
            for j in range(order + 1 - i):
                value = found[:, i, j, :3].copy()
                for a in range(i + 1):
                    for b in range(j + 1):
                        if a or b:
                            times = math.comb(i, a) * math.comb(j, b)
                            value -= times * found[:, a, b, 3:] * made[:, i - a, j - b]
                made[:, i, j] = value / found[:, 0, 0, 3:]
        return made


def frozen(array: NDArray) -> NDArray:
    """Make an array read-only and return it."""
    array.setflags(write=False)
    return array


def checked_net(
    control: ArrayLike,
    knots: tuple[ArrayLike | None, ...],
    weights: ArrayLike | None,
    name: str,
) -> Net:
    """Return the net of a patch, if two knot vectors are given, or of a curve, if one is given.

    Args:
        control: (n_u, n_v, 3) metres; for a curve (n, 3), or (n, 2) with z = 0.
        knots: the knot vectors in u and v, or in u alone; None: those of a Bezier patch or curve.
        weights: (n_u, n_v) or (n,); None: all equal.
        name: what messages call the model.

    Raises:
        ModelError: an argument is refused; the message says which, where and why.
    """
    directions = len(knots)
    given = as_reals(control, f"{name}: control", error=ModelError).copy()
    wanted = "(n_u, n_v, 3)" if directions == 2 else "(n, 3) or (n, 2)"
    columns = (3,) if directions == 2 else (2, 3)
    if given.ndim != directions + 1 or given.shape[-1] not in columns:
        raise ModelError(f"{name}: control: shape {given.shape}, expected {wanted}")
    bad = ~(np.abs(given) <= LARGEST_COORDINATE).all(axis=-1)
    _refuse(
        bad, given, f"{name}: control",
        f"every coordinate must be finite and at most {LARGEST_COORDINATE:g} m",
    )  # fmt: skip
    shape = given.shape[:-1]
    if given.shape[-1] == 2:
        given = np.concatenate((given, np.zeros((*shape, 1))), axis=-1)
    letters = ("knots_u", "knots_v") if directions == 2 else ("knots",)
    checked = [
        _checked_knots(each, count, f"{name}: {letter}")
        for each, count, letter in zip(knots, shape, letters, strict=True)
    ]
    if directions == 1:
        checked.append(np.empty(0))
    made = None if weights is None else _checked_weights(weights, shape, f"{name}: weights")
    net_shape = (*shape, 1) if directions == 1 else shape
    return Net(
        frozen(given.reshape(*net_shape, 3)),
        None if made is None else frozen(made.reshape(net_shape)),
        *map(frozen, checked),
        directions == 1,
    )


def _checked_knots(knots: ArrayLike | None, count: int, what: str) -> NDArray[np.float64]:
    """Return a checked copy of a knot vector for `count` control points; None: a Bezier patch's."""
    if knots is None:
        if not 2 <= count <= HIGHEST_DEGREE + 1:
            raise ModelError(
                f"{what}: None means a single Bezier piece, which has 2 to {HIGHEST_DEGREE + 1} "
                f"control points, not {count}"
            )
        return np.repeat([0.0, 1.0], count)
    given = as_reals(knots, what, error=ModelError).copy()
    if given.ndim != 1:
        raise ModelError(f"{what}: shape {given.shape}, expected (n,)")
    degree = len(given) - count - 1
    if not 1 <= degree <= HIGHEST_DEGREE:
        raise ModelError(
            f"{what}: {len(given)} knots for {count} control points give degree {degree} "
            f"(knots - control points - 1); it must be 1 to {HIGHEST_DEGREE}"
        )
    if count <= degree:
        raise ModelError(
            f"{what}: {len(given)} knots for {count} control points give degree {degree}, which "
            f"needs at least {degree + 1} control points"
        )
    _refuse(~np.isfinite(given), given, what, "every knot must be finite")
    _refuse(
        np.diff(given, prepend=given[0]) < 0.0, given, what,
        "is less than the knot before it; knots must not decrease",
    )  # fmt: skip
    low, high = float(given[degree]), float(given[count])
    if not low < high:
        raise ModelError(
            f"{what}: knots {degree} and {count}, the ends of the parameter's range, are both {low}"
        )
    _refuse(
        given == np.append(given[degree + 1 :], np.full(degree + 1, np.inf)), given, what,
        f"repeated more than {degree + 1} times (the degree plus 1); a control point would have "
        "no effect",
    )  # fmt: skip
    if not math.isfinite(float(given[-1]) - float(given[0])):
        raise ModelError(f"{what}: the range from {given[0]} to {given[-1]} overflows a float")
    return given


def _checked_weights(
    weights: ArrayLike, shape: tuple[int, ...], what: str
) -> NDArray[np.float64] | None:
    """Return a checked copy of the weights, times a power of two; None if all are equal."""
    given = as_reals(weights, what, error=ModelError).copy()
    if given.shape != shape:
        raise ModelError(f"{what}: shape {given.shape}, expected {shape}, like the control points")
    bad = ~((given > 0.0) & (given < math.inf))
    _refuse(bad, given, what, "every weight must be finite and above 0")
    largest = float(given.max())
    _refuse(
        given < SMALLEST_WEIGHT * largest, given, what,
        f"must be at least {SMALLEST_WEIGHT:g} of the largest, {largest}",
    )  # fmt: skip
    return scaled_weights(given)


def scaled_weights(given: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return weights times a power of two, so that the largest is in [1/2, 1); None: all equal."""
    if (given == given.flat[0]).all():
        return None
    return frozen(np.ldexp(given, -math.frexp(float(given.max()))[1]))


def _refuse(bad: NDArray[np.bool_], given: NDArray[np.float64], what: str, must: str) -> None:
    """Raise ModelError for the first bad element of an array, if there is any."""
    if bad.any():
        place = tuple(int(i) for i in np.argwhere(bad)[0])
        index = "".join(f"[{i}]" for i in place)
        count = int(bad.sum())
        more = f" ({count} such places)" if count > 1 else ""
        raise ModelError(f"{what}{index} = {given[place].tolist()}: {must}{more}")
