"""Solids of revolution: a profile in the half-plane (rho, z) that turns about an axis."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
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
from .profile import QUARTERS, Profile, checked_profile, profile_of, revolved, without_axis
from .revolution_hierarchy import RevolutionHierarchy
from .surface import Surface

_ROUNDING = 16.0 * DOUBLE_EPS
"""How far a patch may be from the revolved profile, as a share of the largest coordinate. A control
point is a sum of three products, each of which errs by some units; for the weights see `revolved`.
"""


class SolidOfRevolution(Surface):
    """A solid whose boundary is a profile that turns about an axis.

    The boundary is also stored as exact rational patches, one for each curve of the profile.
    Queries against models of other kinds use these.

    Args:
        curves: the curves of the profile. Each is a `Curve` with control points (n, 2), rho and z
            in metres: the distance from the axis and the height along it. Each begins where the one
            before it ends. They run from the axis to the axis, or around in a loop off it. They may
            have corners and may touch the axis, but must not cross it or themselves. Parts along
            the axis, from corner to corner, bound nothing and are left out, as where they close a
            loop. Curves and control points are then counted from where the profile leaves the axis.
        origin: (3,) metres, model frame: the point of the axis where z is 0.
        axis: (3,) model frame: the direction in which z grows; of any length but 0.
        name: what messages call the model.
        deviation: metres; how far the boundary may be from that of the part it stands for. If a
            curve has a larger one, that counts.

    Raises:
        ModelError: there are no curves, or one is no `Curve`; the profile is torn, has open ends
            off the axis, crosses the axis or itself, or holds no area; the axis has no length; the
            deviation is no number from 0 to 1e45 m. The message says which, and where.
    """

    __slots__ = ("_frame", "profile")

    kind = "solid of revolution"
    _hierarchy_kind = RevolutionHierarchy

    profile: Profile
    """The checked curves; `deform` replaces them."""

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
        given = _checked_curves(curves, name)
        self._frame = _frame(origin, axis, name)
        deviation = checked_length(deviation, name, "deviation")
        deviation = max(deviation, *(curve.deviation for curve in given))
        self.profile = profile_of([curve.nets[0] for curve in given], name)
        nets = [revolved(net, self._frame) for net in self.profile.nets]
        size = max(float(np.abs(net.points).max()) for net in nets)
        super().__init__(nets, name, deviation + _ROUNDING * size, solid=True)

    def _checked(self, nets: Sequence[Net]) -> Joints:
        return _joints(nets, self.profile)

    @property
    def _hierarchy(self) -> RevolutionHierarchy:
        # Return at once if it exists: a short question needs it several times.
        if not isinstance(self._made, RevolutionHierarchy):
            patches = super()._hierarchy
            self._made = RevolutionHierarchy.around(patches, self.profile, self._frame)
        return self._made

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: the point of the axis where z is 0."""
        return self._frame[:3, 3]

    @property
    def axis(self) -> NDArray[np.float64]:
        """(3,) model frame: the unit vector along which z grows."""
        return self._frame[:3, 2]

    @property
    def control_points(self) -> NDArray[np.float64]:
        """The profile's control points (n, 3) at theta = 0, metres, model frame; read-only."""
        points = np.concatenate([net.points for net in self.profile.nets])
        rho, z = points[:, :1], points[:, 1:2]
        return frozen(self.origin + rho * self._frame[:3, 0] + z * self.axis)

    def deform(self, points: ArrayLike | Sequence[Curve]) -> float:
        """Move the profile's control points; weights and knots stay.

        For the result and the errors see `Model.deform`; the profile is checked as a new one is.

        Args:
            points: (n, 3) metres, model frame, in the half-plane theta = 0, like `control_points`;
                or (n, 2) rho and z, metres; or curves, as for a new solid. Without their parts
                along the axis they must be as many as those of `profile`, with the same weights
                and knots, and with no larger deviation than the solid.
        """
        nets, numbers = self._nets_at(points)
        profile = checked_profile(nets, self.name, numbers)
        before = np.concatenate([net.points for net in self.profile.nets])
        moved = np.concatenate([net.points for net in nets])
        patches = tuple(revolved(net, self._frame) for net in nets)
        joints = _joints(patches, profile)
        self._made = self._hierarchy.deformed(patches, joints, profile, self._frame)
        self.nets, self.profile, self._joints = patches, profile, joints
        return largest_norm(moved - before)

    def _nets_at(
        self, points: ArrayLike | Sequence[Curve]
    ) -> tuple[Sequence[Net], Sequence[int] | None]:
        """Return the curves that `deform` is given, and the numbers by which messages call them."""
        if isinstance(points, Iterator):
            points = tuple(points)
        many = points if isinstance(points, Sequence) else (points,)
        if any(isinstance(each, Curve) for each in many):
            return self._alike(_checked_curves(points, self.name))
        given = as_reals(points, f"{self.name}: control_points", error=ModelError)
        if given.ndim == 2 and given.shape[1] == 3:
            given = self._in_plane(checked_vertices(given, self.name, "control_points"))
        made = np.column_stack((given, np.zeros(len(given)))) if given.ndim == 2 else given
        moved = checked_vertices(made, self.name, "control_points")
        ends = np.cumsum([len(net.points) for net in self.profile.nets])
        if len(moved) != ends[-1]:
            raise ModelError(
                f"{self.name}: control_points: {len(moved)} given, expected {ends[-1]}"
            )
        parts = np.split(moved, ends[:-1])
        nets = [net.moved(part) for net, part in zip(self.profile.nets, parts, strict=True)]
        return nets, None

    def _alike(self, curves: Sequence[Curve]) -> tuple[Sequence[Net], Sequence[int]]:
        """Return curves without their parts along the axis; refuse those of another structure."""
        for i, curve in enumerate(curves):
            if curve.deviation > self._deviation:
                raise ModelError(
                    f"{self.name}: curves[{i}]: deviation {curve.deviation:g} m: larger than the "
                    f"solid's, {self._deviation:g} m; make a new solid"
                )
        nets, numbers = without_axis([curve.nets[0] for curve in curves], self.name)
        if len(nets) != len(self.profile.nets):
            raise ModelError(
                f"{self.name}: curves: {len(nets)} given that do not lie along the axis, expected "
                f"{len(self.profile.nets)}; make a new solid"
            )
        for k, net, own in zip(numbers, nets, self.profile.nets, strict=True):
            if not np.array_equal(net.knots_u, own.knots_u):
                what = "knots", net.knots_u, own.knots_u
            elif not _are_equal(net.weights, own.weights):
                what = "weights", net.weights, own.weights
            else:
                continue
            given, expected = (
                "equal" if each is None else each.ravel().tolist() for each in what[1:]
            )
            raise ModelError(
                f"{self.name}: curves[{k}]: {what[0]} {given}: expected {expected}, as before; "
                "otherwise make a new solid"
            )
        return nets, numbers

    def _in_plane(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return rho and z (n, 2) of points (n, 3) in the half-plane theta = 0; refuse others."""
        placed = (points - self.origin) @ self._frame[:3, :3]
        off = np.abs(placed[:, 1])
        # Far from the model's origin coordinates are this coarse. Points on the axis stay there.
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
        """Return the curve of the profile, and (2,) its parameter t and theta, 0 to 2 pi rad."""
        return Feature("profile", element, np.array([parameters[0], angle(parameters[1])]))

    def display_mesh(self, tolerance: float) -> DisplayMesh:
        """Return a tessellation as of any surface, with normals that point outward."""
        made = super().display_mesh(tolerance)
        if not self.profile.leftward:
            return made
        faces = np.ascontiguousarray(made.faces[:, ::-1])
        return made._replace(faces=faces, normals=-made.normals)

    def describe(self, length: Callable[[float], str]) -> str:
        """Return the numbers of curves and control points, and the largest rho, as text."""
        nets = self.profile.nets
        count = sum(len(net.points) for net in nets)
        curves = "1 curve" if len(nets) == 1 else f"{len(nets)} curves"
        rho = max(float(net.points[:, 0].max()) for net in nets)
        return f"a profile of {curves}, {count} control points up to {length(rho)} from the axis"

    def __getstate__(self) -> dict[str, Any]:
        """Return all but addresses, with the version of the kernels that built the hierarchy."""
        return super().__getstate__() | {"profile": tuple(self.profile), "frame": self._frame}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the solid from a pickle; see `Surface`."""
        super().__setstate__(state)
        self.profile, self._frame = Profile(*state["profile"]), frozen(state["frame"])


def _joints(nets: Sequence[Net], profile: Profile) -> Joints:
    """Return the gap with which the patches close up, as the profile does: `checked_profile`.

    The two rings where curves meet have the same weights up to a factor, so the distance of
    their control points bounds that of the rings. A ring on the axis counts as a point; its
    width is its gap.
    """
    ends = [(net.control[0], net.control[-1]) for net in nets]
    gaps = [before[1] - after[0] for before, after in pairwise(ends)]
    first, last = ends[0][0], ends[-1][1]
    if profile.closed:
        gaps.append(last - first)
    else:
        gaps += [first - first[0], last - last[0]]
    widest = max(float(np.linalg.norm(gap, axis=1).max()) for gap in gaps)
    size = max(float(np.abs(net.points).max()) for net in nets)
    return Joints("", 2.0 * widest + GAP_ROUNDING * size)


def _checked_curves(curves: Sequence[Curve], name: str) -> tuple[Curve, ...]:
    """Return the curves of a profile; raise ModelError if these are none."""
    if isinstance(curves, Curve) or not isinstance(curves, Iterable):
        raise ModelError(f"{name}: curves: expected a list of curves, got {curves!r}")
    given = tuple(curves)
    for i, curve in enumerate(given):
        if not isinstance(curve, Curve):
            raise ModelError(f"{name}: curves[{i}]: expected Curve, got {type(curve).__name__}")
    if not given:
        raise ModelError(f"{name}: curves: must not be empty")
    return given


def _are_equal(one: NDArray[np.float64] | None, other: NDArray[np.float64] | None) -> bool:
    """Return whether weights are equal; None: all are."""
    return one is other if one is None or other is None else np.array_equal(one, other)


def angle(v: ArrayLike) -> NDArray[np.float64]:
    """Return the angles about the axis, radians, at a patch's second parameter; see `QUARTERS`.

    A quarter turn is a rational quadratic of weights 1, w = sqrt(1/2) and 1. Its point at s is
    ((1 - s)^2 + 2 w s (1 - s), s^2 + 2 w s (1 - s)) / ((1 - s)^2 + 2 w s (1 - s) + s^2).
    """
    turn = np.clip(np.floor(v), 0.0, QUARTERS[-1] - 1.0)
    s = v - turn
    both = 2.0 * math.sqrt(0.5) * s * (1.0 - s)
    return 0.5 * math.pi * turn + np.arctan2(s * s + both, (1.0 - s) ** 2 + both)


def _frame(origin: ArrayLike, axis: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return the frame (4, 4) whose z is the axis; x is the model's x (or y), made perpendicular.

    It is the model's y if the axis is nearly along x. Raises ModelError: a vector is not finite or
    beyond 1e45 m, or the axis has no length.
    """
    made = np.eye(4)
    for what, given in (("origin", origin), ("axis", axis)):
        array = as_reals(given, f"{name}: {what}", error=ModelError)
        if array.shape != (3,) or not (np.abs(array) <= LARGEST_COORDINATE).all():
            raise ModelError(
                f"{name}: {what} = {given!r}: expected three finite numbers of at most "
                f"{LARGEST_COORDINATE:g}"
            )
        made[:3, 3 if what == "origin" else 2] = array
    largest = float(np.abs(made[:3, 2]).max())
    if not largest > 0.0:
        raise ModelError(f"{name}: axis = {axis!r}: must not be the zero vector")
    # Scale by a power of two first, because squares of tiny or huge numbers are lost.
    z = np.ldexp(made[:3, 2], -math.frexp(largest)[1])
    z /= np.linalg.norm(z)
    x = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    made[:3, 0], made[:3, 1], made[:3, 2] = x, np.cross(z, x), z
    return frozen(made)
