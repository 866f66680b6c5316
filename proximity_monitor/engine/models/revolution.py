"""Solids of revolution: a profile in the half-plane (rho, z) that turns about an axis."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_reals
from ..kernels.base import ahead
from ..kernels.base.rounding import DOUBLE_EPS, LARGEST_COORDINATE
from .checks import ModelError, checked_length, checked_vertices
from .closed import GAP_ROUNDING, Joints
from .mesh import largest_norm
from .model import DisplayMesh, Feature
from .nurbs import Net, frozen
from .patch import Curve
from .profile import QUARTERS, Profile, checked_profile, profile_of, revolved
from .revolution_hierarchy import RevolutionHierarchy
from .surface import Surface

_ROUNDING = 16.0 * DOUBLE_EPS
"""Share of the largest coordinate by which a patch may be off the profile that is revolved: a
control point is a sum of three products, each of which errs by some units, and see `revolved`."""


class SolidOfRevolution(Surface):
    """A solid whose boundary is a profile that turns about an axis.

    Its boundary is, besides, that of exact rational patches, one a curve of the profile. By these
    it is asked against models of other kinds.

    Args:
        curves: of the profile, each a `Curve` with control points (n, 2), rho and z in metres: the
            distance from the axis and the height along it. Each begins where the one before it
            ends. They run from the axis to the axis, or around in a loop off it; they may have
            corners, and may touch the axis, but not cross it or themselves. Whole curves along the
            axis, as they close a loop, are left out, for they bound nothing; curves and control
            points are then counted from where the axis is left.
        origin: (3,) metres, model frame: where on the axis z is 0.
        axis: (3,) along which z grows; of any length.
        name: what messages call it.
        deviation: metres; how far the boundary may be from that of the thing it stands for.

    Raises:
        ModelError: no curves, or what is none; open ends; a profile that crosses the axis or
            itself, or holds no area; an axis of no length. The message says which, and where.
    """

    __slots__ = ("_frame", "profile")

    kind = "solid of revolution"
    _hierarchy_kind = RevolutionHierarchy

    profile: Profile
    """Its curves; `deform` puts others in their place."""

    def __init__(
        self,
        curves: Sequence[Curve],
        origin: ArrayLike = (0.0, 0.0, 0.0),
        axis: ArrayLike = (0.0, 0.0, 1.0),
        *,
        name: str = "solid of revolution",
        deviation: float = 0.0,
    ) -> None:
        ahead.want(self.kind)
        if isinstance(curves, Curve) or not isinstance(curves, Iterable):
            raise ModelError(f"{name}: curves: expected a list of them, got {curves!r}")
        given = tuple(curves)
        for i, curve in enumerate(given):
            if not isinstance(curve, Curve):
                raise ModelError(f"{name}: curves[{i}]: expected Curve, got {type(curve).__name__}")
        if not given:
            raise ModelError(f"{name}: curves: there are none")
        self._frame = _frame(origin, axis, name)
        deviation = checked_length(deviation, name, "deviation")
        deviation = max(deviation, *(curve.deviation for curve in given))
        self.profile = profile_of([curve.nets[0] for curve in given], name)
        nets = [revolved(net, self._frame) for net in self.profile.nets]
        size = max(float(np.abs(net.points).max()) for net in nets)
        super().__init__(nets, name, deviation + _ROUNDING * size, solid=True)

    def _checked(self, nets: Sequence[Net]) -> Joints:
        """How the patches close up: they do, for the profile does; see `checked_profile`.

        Rings where two curves meet have the same weights but for a factor, so they are no farther
        apart than their control points. On the axis a ring is a point as far as it is narrow.
        """
        ends = [(net.control[0], net.control[-1]) for net in nets]
        gaps = [before[1] - after[0] for before, after in pairwise(ends)]
        first, last = ends[0][0], ends[-1][1]
        if self.profile.closed:
            gaps.append(last - first)
        else:
            gaps += [first - first[0], last - last[0]]
        widest = max(float(np.linalg.norm(gap, axis=1).max()) for gap in gaps)
        size = max(float(np.abs(net.points).max()) for net in nets)
        return Joints("", 2.0 * widest + GAP_ROUNDING * size)

    @property
    def _hierarchy(self) -> RevolutionHierarchy:
        # At once where it is made: a short question asks for it several times.
        if not isinstance(self._made, RevolutionHierarchy):
            patches = super()._hierarchy
            self._made = RevolutionHierarchy.around(patches, self.profile, self._frame)
        return self._made

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: where on the axis z is 0."""
        return self._frame[:3, 3]

    @property
    def axis(self) -> NDArray[np.float64]:
        """(3,) the unit vector along which z grows."""
        return self._frame[:3, 2]

    @property
    def control_points(self) -> NDArray[np.float64]:
        """The profile's control points (n, 3), metres, model frame, where theta is 0; read-only."""
        points = np.concatenate([net.points for net in self.profile.nets])
        rho, z = points[:, :1], points[:, 1:2]
        return frozen(self.origin + rho * self._frame[:3, 0] + z * self.axis)

    def deform(self, points: ArrayLike) -> float:
        """Move the profile's control points; weights and knots stay. See `Model.deform`.

        Args:
            points: (n, 3) metres, model frame, in the half-plane where theta is 0, as
                `control_points` has them; or (n, 2), rho and z.
        """
        given = as_reals(points, f"{self.name}: control_points", error=ModelError)
        if given.ndim == 2 and given.shape[1] == 3:
            given = self._in_plane(checked_vertices(given, self.name, "control_points"))
        made = np.column_stack((given, np.zeros(len(given)))) if given.ndim == 2 else given
        moved = checked_vertices(made, self.name, "control_points")
        before = np.concatenate([net.points for net in self.profile.nets])
        if len(moved) != len(before):
            raise ModelError(
                f"{self.name}: control_points: {len(moved)} given, but there are {len(before)}"
            )
        parts = np.split(moved, np.cumsum([len(net.points) for net in self.profile.nets])[:-1])
        nets = [net.moved(part) for net, part in zip(self.profile.nets, parts, strict=True)]
        profile = checked_profile(nets, self.name)
        self._refit([revolved(net, self._frame) for net in nets])
        self.profile = profile
        self._made = RevolutionHierarchy.around(self._made, profile, self._frame)
        return largest_norm(moved - before)

    def _in_plane(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The coordinates rho and z (n, 2) of points (n, 3) in the half-plane where theta is 0."""
        placed = (points - self.origin) @ self._frame[:3, :3]
        off = np.abs(placed[:, 1])
        # Far from the model's origin, coordinates have no finer places; what is on the axis stays.
        rounding = _ROUNDING * max(np.abs(points).max(initial=0.0), np.abs(self.origin).max())
        placed[np.abs(placed[:, 0]) <= rounding, 0] = 0.0
        if off.size and not off.max() <= 1e-9 * np.abs(placed).max() + rounding:
            worst = int(off.argmax())
            raise ModelError(
                f"{self.name}: control_points[{worst}] = {points[worst].tolist()}: {off[worst]:.3g}"
                " m off the half-plane of the profile, in which theta is 0"
            )
        return placed[:, [0, 2]]

    @staticmethod
    def feature(element: int, parameters: NDArray[np.float64]) -> Feature:
        """The curve of the profile, and on it t and theta (2,), radians from 0 to 2 pi."""
        return Feature("profile", element, np.array([parameters[0], angle(parameters[1])]))

    def display_mesh(self, tolerance: float) -> DisplayMesh:
        """As of any surface, with normals that point outward."""
        made = super().display_mesh(tolerance)
        if not self.profile.leftward:
            return made
        faces = np.ascontiguousarray(made.faces[:, ::-1])
        return made._replace(faces=faces, normals=-made.normals)

    def describe(self, length: Callable[[float], str]) -> str:
        """Its curves and control points, and how far these are from the axis."""
        nets = self.profile.nets
        count = sum(len(net.points) for net in nets)
        curves = "1 curve" if len(nets) == 1 else f"{len(nets)} curves"
        rho = max(float(net.points[:, 0].max()) for net in nets)
        return f"a profile of {curves}, {count} control points up to {length(rho)} from the axis"

    def __getstate__(self) -> dict[str, Any]:
        """All but addresses, and for which kernels the hierarchy was built."""
        return super().__getstate__() | {"profile": tuple(self.profile), "frame": self._frame}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what pickle thawed; see `Surface`."""
        super().__setstate__(state)
        self.profile, self._frame = Profile(*state["profile"]), frozen(state["frame"])


def angle(v: ArrayLike) -> NDArray[np.float64]:
    """The angles about the axis, radians, at a patch's second parameter; see `QUARTERS`.

    On a quarter turn, a rational quadratic with the weights 1, w and 1, the point at s is
    ((1 - s)^2 + 2 w s (1 - s), s^2 + 2 w s (1 - s)) / (1 - s)^2 + ... .
    """
    turn = np.clip(np.floor(v), 0.0, QUARTERS[-1] - 1.0)
    s = v - turn
    both = 2.0 * math.sqrt(0.5) * s * (1.0 - s)
    return 0.5 * math.pi * turn + np.arctan2(s * s + both, (1.0 - s) ** 2 + both)


def _frame(origin: ArrayLike, axis: ArrayLike, name: str) -> NDArray[np.float64]:
    """The frame (4, 4) whose z is the axis; its x is as near as may be to the model's x, or y."""
    made = np.eye(4)
    for what, given in (("origin", origin), ("axis", axis)):
        array = as_reals(given, f"{name}: {what}", error=ModelError)
        if array.shape != (3,) or not (np.abs(array) <= LARGEST_COORDINATE).all():
            raise ModelError(f"{name}: {what} = {given!r}: expected three finite metres")
        made[:3, 3 if what == "origin" else 2] = array
    largest = float(np.abs(made[:3, 2]).max())
    if not largest > 0.0:
        raise ModelError(f"{name}: axis = {axis!r}: has no length")
    # Without its power of two, for squares of what is tiny or huge are lost.
    z = np.ldexp(made[:3, 2], -math.frexp(largest)[1])
    z /= np.linalg.norm(z)
    x = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    made[:3, 0], made[:3, 1], made[:3, 2] = x, np.cross(z, x), z
    return frozen(made)
