"""A NURBS patch as a model, and a curve as one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .nurbs import checked_net
from .surface import Surface
from .surface_mesh import unit_normals

if TYPE_CHECKING:
    from .trim import Trim


class Patch(Surface):
    """A NURBS patch, rational or not; without knots a Bezier patch.

    Args:
        control: (n_u, n_v, 3) metres, model frame; the control points.
        knots_u: those in u do not decrease. Their number less n_u less 1 is the degree in u, 1 to
            15. The parameter u lies between the knots `degree` and n_u; so the vector need not be
            clamped, and where a knot is repeated degree + 1 times the patch may tear. None: a
            Bezier patch of degree n_u - 1, u from 0 to 1.
        knots_v: the same in v.
        weights: (n_u, n_v) above 0, the smallest at least 1e-50 of the largest; None: all alike.
        name: what messages call it.
        deviation: metres; how far the surface may be from that of the thing it stands for.
        trim: what is left of it, of the patch's own rectangle of parameters; None: all.

    Raises:
        ModelError: another shape, a coordinate that is not finite or beyond 1e45 m, knots that
            decrease or do not fit the control points, a degree beyond 15, a weight that is not
            positive; a deviation that is no length; a trim of another rectangle. The message says
            which, and where.
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
            trim.check(net, name)
            net = replace(net, trim=None if trim.whole else trim)
        super().__init__([net], name, deviation)

    @property
    def control(self) -> NDArray[np.float64]:
        """(n_u, n_v, 3) metres; read-only. `deform` puts another array in its place."""
        return self.nets[0].control

    @property
    def weights(self) -> NDArray[np.float64] | None:
        """(n_u, n_v), times a power of two so that the largest is below 1; None: all alike."""
        return self.nets[0].weights

    @property
    def knots_u(self) -> NDArray[np.float64]:
        """(n,) read-only."""
        return self.nets[0].knots_u

    @property
    def knots_v(self) -> NDArray[np.float64]:
        """(n,) read-only."""
        return self.nets[0].knots_v

    @property
    def trim(self) -> Trim | None:
        """What is left of it; None: all."""
        return self.nets[0].trim

    @property
    def degrees(self) -> tuple[int, int]:
        """In u and in v."""
        return self.nets[0].degrees

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """From where to where u goes, and v."""
        u, v = self.nets[0].spans
        return (float(u.low[0]), float(u.high[-1])), (float(v.low[0]), float(v.high[-1]))

    def evaluate(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """The points (..., 3) at parameters, metres, model frame.

        Raises:
            ValueError: parameters that are no numbers, or outside of `domain`.
        """
        return self.derivatives(u, v, 0)[..., 0, 0, :]

    def derivatives(self, u: ArrayLike, v: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """The partial derivatives (..., order + 1, order + 1, 3) at parameters.

        [..., i, j, :] is the i-th in u of the j-th in v; it is 0 where i + j > order. Between two
        knot spans it is that of the second.

        Raises:
            ValueError: parameters that are no numbers, or outside of `domain`.
        """
        u, v = self._parameters(u, v)
        made = self.nets[0].derivatives(u.ravel(), v.ravel(), order)
        return made.reshape(*u.shape, *made.shape[1:])

    def normal(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """The unit normals (..., 3) at parameters, along the u derivative times that of v.

        Where this product vanishes, as at a pole, that of a point nearby; 0 if it vanishes there
        as well.

        Raises:
            ValueError: parameters that are no numbers, or outside of `domain`.
        """
        u, v = self._parameters(u, v)
        return unit_normals(self.nets[0], u.ravel(), v.ravel()).reshape(*u.shape, 3)


class Curve(Surface):
    """A NURBS curve, rational or not; without knots a Bezier curve.

    Args:
        control: (n, 3) metres, model frame; or (n, 2) in the plane z = 0. The control points.
        knots: as those of a `Patch` in u.
        weights: (n,) as those of a `Patch`.
        name: what messages call it.
        deviation: metres; how far the curve may be from that of the thing it stands for.

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
        """(n, 3) metres; read-only. `deform` puts another array in its place."""
        return self.nets[0].points

    @property
    def weights(self) -> NDArray[np.float64] | None:
        """(n,), times a power of two so that the largest is below 1; None: all alike."""
        weights = self.nets[0].weights
        return None if weights is None else weights[:, 0]

    @property
    def knots(self) -> NDArray[np.float64]:
        """(n,) read-only."""
        return self.nets[0].knots_u

    @property
    def degree(self) -> int:
        """Of its polynomials, or of those that it is the quotient of."""
        return self.nets[0].degrees[0]

    @property
    def domain(self) -> tuple[float, float]:
        """From where to where its parameter goes."""
        along, _ = self.nets[0].spans
        return float(along.low[0]), float(along.high[-1])

    def evaluate(self, t: ArrayLike) -> NDArray[np.float64]:
        """The points (..., 3) at parameters, metres, model frame.

        Raises:
            ValueError: parameters that are no numbers, or outside of `domain`.
        """
        return self.derivatives(t, 0)[..., 0, :]

    def derivatives(self, t: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """The derivatives (..., order + 1, 3) at parameters, from the 0th on.

        Raises:
            ValueError: parameters that are no numbers, or outside of `domain`.
        """
        (t,) = self._parameters(t)
        made = self.nets[0].derivatives(t.ravel(), np.zeros(t.size), order)[:, :, 0]
        return made.reshape(*t.shape, *made.shape[1:])
