"""A NURBS patch as a model, and a NURBS curve as a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_count
from .checks import ModelError
from .nurbs import checked_net
from .surface import Surface
from .surface_mesh import unit_normals
from .trim import Trim


class Patch(Surface):
    """A NURBS patch, rational or not; without knots a Bezier patch.

    Args:
        control: (n_u, n_v, 3) metres, model frame; the control points.
        knots_u: (n_u + degree + 1,) the knots in u, which must not decrease. Their number less n_u
            less 1 is the degree in u, 1 to 15. The parameter u runs from knot number `degree` to
            knot number n_u, counted from 0. So the vector need not be clamped. If a knot is
            repeated degree + 1 times, the patch may tear there. None: a Bezier patch of degree
            n_u - 1, u from 0 to 1.
        knots_v: the same in v.
        weights: (n_u, n_v) above 0, the smallest at least 1e-50 of the largest; None: all equal.
        name: what messages call the patch.
        deviation: metres; how far the surface may be from that of the part it stands for.
        trim: which part of the patch's own rectangle of parameters is left; None: all.

    Raises:
        ModelError: an array has a wrong shape; a coordinate is not finite or beyond 1e45 m; knots
            are not finite, decrease, are repeated too often or do not fit the control points; a
            degree is not 1 to 15; a weight is not finite, not positive or too small; the deviation
            is no number from 0 to 1e45 m; the trim is none, or of another rectangle. The message
            says which, and where.
    """

    __slots__ = ()

    def __init__(
        self,
        control: ArrayLike,
        knots_u: ArrayLike | None = None,
        knots_v: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        *,
        name: str = "patch",
        deviation: float = 0.0,
        trim: Trim | None = None,
    ) -> None:
        net = checked_net(control, (knots_u, knots_v), weights, name)
        if trim is not None:
            if not isinstance(trim, Trim):
                raise ModelError(f"{name}: trim: expected a Trim, got {type(trim).__name__}")
            trim.check(net, name)
            net = replace(net, trim=None if trim.whole else trim)
        super().__init__([net], name, deviation)

    @property
    def control(self) -> NDArray[np.float64]:
        """(n_u, n_v, 3) metres, model frame; read-only. `deform` replaces the array."""
        return self.nets[0].control

    @property
    def weights(self) -> NDArray[np.float64] | None:
        """(n_u, n_v) times a power of two, so that the largest is below 1; None: all equal."""
        return self.nets[0].weights

    @property
    def knots_u(self) -> NDArray[np.float64]:
        """(n_u + degree + 1,) the knots in u; read-only."""
        return self.nets[0].knots_u

    @property
    def knots_v(self) -> NDArray[np.float64]:
        """(n_v + degree + 1,) the knots in v; read-only."""
        return self.nets[0].knots_v

    @property
    def trim(self) -> Trim | None:
        """Which part of the patch is left; None: all."""
        return self.nets[0].trim

    @property
    def degrees(self) -> tuple[int, int]:
        """The degrees in u and in v."""
        return self.nets[0].degrees

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The lowest and the highest u, and the same for v."""
        u, v = self.nets[0].spans
        return (float(u.low[0]), float(u.high[-1])), (float(v.low[0]), float(v.high[-1]))

    def evaluate(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Return the points (..., 3) at parameters u and v, metres, model frame.

        u and v may have any shapes that broadcast to (...).

        Raises:
            ValueError: parameters are no numbers, or outside of `domain`.
        """
        return self.derivatives(u, v, 0)[..., 0, 0, :]

    def derivatives(self, u: ArrayLike, v: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """Return the partial derivatives (..., order + 1, order + 1, 3) at parameters u and v.

        [..., i, j, :] is the derivative of order i in u and j in v, metres, model frame; it is 0 if
        i + j > order. At the joint of two knot spans it is that of the second span.

        Raises:
            TypeError: the order is no whole number.
            ValueError: the order is negative; parameters are no numbers, or outside of `domain`.
        """
        u, v = self._parameters(u, v)
        order = as_count(order, "order", 0)
        made = self.nets[0].derivatives(u.ravel(), v.ravel(), order)
        return made.reshape(*u.shape, *made.shape[1:])

    def normal(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Return the unit normals (..., 3) at parameters u and v, model frame.

        They point along the cross product of the u derivative and the v derivative. If this
        vanishes, as at a pole, the normal of a point nearby is returned; 0 if that vanishes too.

        Raises:
            ValueError: parameters are no numbers, or outside of `domain`.
        """
        u, v = self._parameters(u, v)
        return unit_normals(self.nets[0], u.ravel(), v.ravel()).reshape(*u.shape, 3)


class Curve(Surface):
    """A NURBS curve, rational or not; without knots a Bezier curve.

    Args:
        control: (n, 3) metres, model frame, or (n, 2) in the plane z = 0; the control points.
        knots: (n + degree + 1,) like those of a `Patch` in u.
        weights: (n,) like those of a `Patch`.
        name: what messages call the curve.
        deviation: metres; how far the curve may be from that of the part it stands for.

    Raises:
        ModelError: as for `Patch`.
    """

    __slots__ = ()

    def __init__(
        self,
        control: ArrayLike,
        knots: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        *,
        name: str = "curve",
        deviation: float = 0.0,
    ) -> None:
        super().__init__([checked_net(control, (knots,), weights, name)], name, deviation)

    @property
    def control(self) -> NDArray[np.float64]:
        """(n, 3) metres, model frame; read-only. `deform` replaces the array."""
        return self.nets[0].points

    @property
    def weights(self) -> NDArray[np.float64] | None:
        """(n,) times a power of two, so that the largest is below 1; None: all equal."""
        weights = self.nets[0].weights
        return None if weights is None else weights[:, 0]

    @property
    def knots(self) -> NDArray[np.float64]:
        """(n + degree + 1,) the knots; read-only."""
        return self.nets[0].knots_u

    @property
    def degree(self) -> int:
        """The degree of the polynomials, in a rational curve of numerator and denominator."""
        return self.nets[0].degrees[0]

    @property
    def domain(self) -> tuple[float, float]:
        """The lowest and the highest parameter."""
        along, _ = self.nets[0].spans
        return float(along.low[0]), float(along.high[-1])

    def evaluate(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the points (..., 3) at parameters t (...), metres, model frame.

        Raises:
            ValueError: parameters are no numbers, or outside of `domain`.
        """
        return self.derivatives(t, 0)[..., 0, :]

    def derivatives(self, t: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """Return the derivatives (..., order + 1, 3) at parameters t (...), from the 0th on.

        They are in metres, model frame. At the joint of two knot spans the second span counts.

        Raises:
            TypeError: the order is no whole number.
            ValueError: the order is negative; parameters are no numbers, or outside of `domain`.
        """
        (t,) = self._parameters(t)
        order = as_count(order, "order", 0)
        made = self.nets[0].derivatives(t.ravel(), np.zeros(t.size), order)[:, :, 0]
        return made.reshape(*t.shape, *made.shape[1:])
