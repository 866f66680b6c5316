"""Parametric surfaces: models of NURBS patches and curves."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_reals, check_tolerance
from ..kernels.base import ahead
from ..kernels.base.cache import KERNELS
from .checks import ModelError, checked_length, checked_vertices
from .closed import Joints, find_joints
from .mesh import largest_norm
from .model import DisplayMesh, Feature, Model
from .nurbs import Net
from .surface_hierarchy import SurfaceHierarchy
from .surface_mesh import tessellated_surface

_AS_TOLD = "it is declared a surface (solid=False)"


class Surface(Model):
    """Base class of models of patches and curves.

    The bounding volume hierarchy is made when it is first needed.
    """

    __slots__ = ("_deviation", "_joints", "_made", "_solid", "name", "nets")

    nets: tuple[Net, ...]
    """Control points, weights and knots of the patches and curves; `deform` replaces them."""

    kind = "surface"
    _hierarchy_kind: ClassVar[type[SurfaceHierarchy]] = SurfaceHierarchy

    def __init__(
        self, nets: Sequence[Net], name: str, deviation: float, solid: bool | None = False
    ) -> None:
        self.name = name
        self._deviation = checked_length(deviation, name, "deviation")
        self._solid = solid
        self.nets = tuple(nets)
        self._joints = self._checked(nets) if solid else None
        self._made: SurfaceHierarchy | None = None

    def _checked(self, nets: Sequence[Net]) -> Joints:
        """Return how nets close up (see closed.py); raise ModelError if they must and do not."""
        if self._solid is False:
            return Joints(_AS_TOLD, 0.0)
        joints = find_joints(nets, self.deviation)
        if joints.reason and self._solid:
            raise ModelError(
                f"{self.name}: not a solid: {joints.reason}; close it, set a deviation as large as "
                "its gaps, or set solid=False, which makes it a surface"
            )
        return joints

    @property
    def _hierarchy(self) -> SurfaceHierarchy:
        if self._made is None:
            ahead.want(self.kind)
            if self._joints is None:
                self._joints = self._checked(self.nets)
            parts = self._hierarchy_kind.parts_of(self.nets)
            self._made = SurfaceHierarchy.of(
                self.nets, parts, deviation=self._deviation, solid=self._solid, joints=self._joints
            )
        return self._made

    @property
    def deviation(self) -> float:
        """Metres: how far the surface may be from that of the part it stands for."""
        return self._deviation

    @property
    def control_points(self) -> NDArray[np.float64]:
        """The control points (n, 3), metres, model frame; read-only.

        They are listed patch by patch, v fastest.
        """
        points = np.concatenate([net.points for net in self.nets])
        points.setflags(write=False)
        return points

    def deform(self, points: ArrayLike) -> float:
        """Move the control points to (n, 3), metres, model frame; weights and knots stay.

        The motion of a point of the surface is a weighted mean of the motions of control points,
        so it is no larger than the largest of these. For the result and the errors see
        `Model.deform`.
        """
        moved, before = checked_vertices(points, self.name, "control_points"), self.control_points
        if len(moved) != len(before):
            raise ModelError(
                f"{self.name}: control_points: {len(moved)} given, expected {len(before)}"
            )
        ends = np.cumsum([len(net.points) for net in self.nets])[:-1]
        parts = np.split(moved, ends)
        self._refit([net.moved(part) for net, part in zip(self.nets, parts, strict=True)])
        return largest_norm(moved - before)

    def _refit(self, moved: Sequence[Net]) -> None:
        """Adopt nets of the same structure whose control points moved, unless they are refused."""
        nets = tuple(moved)
        joints = self._checked(nets)
        self._made = self._hierarchy.refitted(nets, joints)
        self.nets, self._joints = nets, joints

    def display_mesh(self, tolerance: float) -> DisplayMesh:
        """Return a tessellation with the surface's own normals; curves are degenerate triangles.

        It is as fine as the tolerance demands, but has some 120,000 triangles at most.
        """
        return tessellated_surface(self.nets, check_tolerance("tolerance", tolerance))

    @staticmethod
    def feature(element: int, parameters: NDArray[np.float64]) -> Feature:
        """Return the patch and its u and v (2,), or the curve and its parameter (1,).

        The third of the given parameters is 0 on a patch and 1 on a curve.
        """
        if parameters[2] > 0.0:
            return Feature("curve", element, parameters[:1])
        return Feature("patch", element, parameters[:2])

    def digest(self) -> str:
        """Return a checksum, 16 hexadecimal digits.

        It covers control points, weights, knots, trims, the deviation and `solid` as given.
        """
        found = hashlib.blake2b(self.kind.encode(), digest_size=8)
        found.update(
            struct.pack("<db", self._deviation, -1 if self._solid is None else self._solid)
        )
        for net in self.nets:
            n_u, n_v, _ = net.control.shape
            found.update(struct.pack("<5q", n_u, n_v, *net.degrees, net.weights is not None))
            for array in (net.control, net.weights, net.knots_u, net.knots_v):
                found.update(b"" if array is None else array.tobytes())
            found.update(b"" if net.trim is None else net.trim.digest())
        return found.hexdigest()

    def describe(self, length: Callable[[float], str]) -> str:
        """Return the numbers of patches, curves and control points, and common degrees, as text."""
        parts = []
        for is_curve, one, more in ((False, "patch", "patches"), (True, "curve", "curves")):
            degrees = [net.degrees for net in self.nets if net.is_curve == is_curve]
            if degrees:
                p, q = degrees[0]
                degree = f" of degree {p}" if is_curve else f" of degree {p} x {q}"
                alike = len(set(degrees)) == 1
                what = one if len(degrees) == 1 else more
                parts.append(f"{len(degrees)} {what}{degree if alike else ''}")
        count = sum(len(net.points) for net in self.nets)
        return f"{' and '.join(parts)}, {count} control points"

    def __getstate__(self) -> dict[str, Any]:
        """Return all but addresses, with the version of the kernels that built the hierarchy."""
        made = self._hierarchy.__getstate__()
        return {"kernels": KERNELS, "name": self.name, "hierarchy": made}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the model from a pickle.

        Raises:
            ModelError: another version pickled it, whose hierarchies may differ.
        """
        if state["kernels"] != KERNELS:
            raise ModelError(
                f"{state['name']}: pickled by another version of proximity_monitor; make it again "
                "from its file, or from its control points"
            )
        self.name = state["name"]
        self._made = self._hierarchy_kind.__new__(self._hierarchy_kind)
        self._made.__setstate__(state["hierarchy"])
        self.nets, self._deviation = self._made.nets, self._made.deviation
        self._solid, self._joints = self._made.solid, self._made.joints

    def _parameters(self, *given: ArrayLike) -> list[NDArray[np.float64]]:
        """Return parameters of the only patch or curve, checked and broadcast to one shape.

        Raises:
            ValueError: parameters are no numbers, or outside of the domain, or their shapes do not
                broadcast to one.
        """
        letters = "uv" if len(given) == 2 else "t"
        arrays = [as_reals(each, letter) for each, letter in zip(given, letters, strict=True)]
        for letter, array, along in zip(letters, arrays, self.nets[0].spans, strict=False):
            low, high = along.low[0], along.high[-1]
            bad = ~((array >= low) & (array <= high))
            if bad.any():
                place = "".join(f"[{i}]" for i in np.argwhere(bad)[0])
                raise ValueError(
                    f"{self.name}: {letter}{place} = {array[bad][0]}: must be from {low} to {high}"
                )
        try:
            return np.broadcast_arrays(*arrays)
        except ValueError:
            shapes = " and ".join(
                f"{letter} {array.shape}" for letter, array in zip(letters, arrays, strict=True)
            )
            raise ValueError(f"{self.name}: the shapes of {shapes} do not match") from None


class ParametricSurface(Surface):
    """Many patches and curves as one model.

    Args:
        patches: `Patch` and `Curve`, in the model frame; later changes to them have no effect.
        name: what messages call the model.
        deviation: metres; how far the surface may be from that of the part it stands for. If a
            patch has a larger one, that counts.
        solid: whether it is a solid, inside of which signed distances are negative. True: the
            patches must close up, which is checked here and at every `deform`. Each edge must lie
            on one or several edges of the opposite direction, no farther apart than the deviation
            plus 1e-12 of the largest coordinate. So all normals point outward, or all inward. Edges
            that are points, such as poles, are ignored. Neighbours may differ in knots and degrees,
            and several may meet at one edge. Edges of trimmed patches are those of their loops,
            which must not cross; with trimmed patches twice the deviation plus 1e-6 of the largest
            coordinate is allowed. None: it is a solid if the patches close up, which is found out
            with the hierarchy; `not_solid` says why it is none. False: it is a surface.

    Raises:
        ModelError: patches are no list, or empty, or one is no `Patch` or `Curve`; `solid` is not
            True, False or None; the deviation is no number from 0 to 1e45 m; the model must be a
            solid and has open edges. The message says which.
    """

    __slots__ = ()

    def __init__(
        self,
        patches: Sequence[Surface],
        *,
        name: str = "surface",
        deviation: float = 0.0,
        solid: bool | None = False,
    ) -> None:
        ahead.want(self.kind)
        if isinstance(patches, Model) or not isinstance(patches, Iterable):
            raise ModelError(
                f"{name}: patches: expected a list of Patch and Curve, got {type(patches).__name__}"
            )
        given = tuple(patches)
        for i, patch in enumerate(given):
            if not isinstance(patch, Surface) or len(patch.nets) != 1:
                raise ModelError(
                    f"{name}: patches[{i}]: expected Patch or Curve, got {type(patch).__name__}"
                )
        if not given:
            raise ModelError(f"{name}: patches: must not be empty")
        if not (solid is None or isinstance(solid, bool)):
            raise ModelError(f"{name}: solid = {solid!r}: must be True, False or None")
        deviation = checked_length(deviation, name, "deviation")
        deviation = max(deviation, *(patch.deviation for patch in given))
        super().__init__([patch.nets[0] for patch in given], name, deviation, solid)

    @classmethod
    def of(cls, nets: Sequence[Net], *, name: str, deviation: float, solid: bool | None) -> Self:
        """Make the surface of checked nets.

        Raises:
            ModelError: `solid` is True and the patches do not close up.
        """
        ahead.want(cls.kind)
        made = cls.__new__(cls)
        Surface.__init__(made, nets, name, deviation, solid)
        return made
