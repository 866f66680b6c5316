"""The hierarchy of a solid of revolution: that of its patches, and fat arcs around its profile.

A fat arc is an arc of a circle in the half-plane (rho, z), with how far the profile is from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.tables import model_table
from ..kernels.base.trees import CURVE_PIECE, RevolutionTree, SurfaceTree
from ..kernels.revolution.build import MOST, build_arcs
from ..kernels.revolution.guess import take_samples
from ..kernels.revolution.reach import take_reaches
from .nurbs import frozen
from .parts import even_parts
from .surface_hierarchy import SurfaceHierarchy
from .tube import tube_of

if TYPE_CHECKING:
    from .closed import Joints
    from .nurbs import Net
    from .parts import Parts
    from .profile import Profile

PRECISION = 1e-5
"""The error of the stored arcs, as a share of the profile's largest coordinate. Searches make
thinner arcs when they need them."""

_BEYOND = 1e13
"""Bounds assume that no point is beyond the axis, but `checked_profile` allows points there within
rounding. Arcs err by a share of 2.3e-13 of a length, to which each metre beyond adds so many."""


_STRAIGHT = 1e-9
"""Steps shorter than this share of a profile's size, and turns less than this share of its square,
do not count."""

_HALVINGS = 24
"""After so many halvings control points are as near to a curve as rounding allows."""


_FAR, _CUTS = 2.0, 5
"""Control points are far away if they are so many times as far as any end of a piece. Then each
piece is halved so often; so many halvings suffice in `build_arcs`, too."""

_QUARTERS = 4
"""How many spans each patch has around the axis."""

_OWN = "arcs", "curves", "places", "frame", "samples", "reaches"
"""The attributes that describe the profile, as in RevolutionTree."""


class RevolutionHierarchy(SurfaceHierarchy):
    """Volumes around the pieces of the patches, and fat arcs around the pieces of the profile."""

    KEPT = (*SurfaceHierarchy.KEPT, *_OWN)

    __slots__ = _OWN

    parts_of = staticmethod(even_parts)
    """Equal for all spans, because kernels find the parts of patches from those of the profile."""

    arcs: NDArray
    """(k,) ARC."""
    curves: NDArray
    """(c,) CURVE_PIECE."""
    places: NDArray[np.int32]
    """For each part of a patch, its piece in tree order: see CURVE_PIECE."""
    frame: NDArray[np.float64]
    """(6, 3) the frame's axes and origin, and more: see RevolutionTree."""
    samples: NDArray[np.float64]
    """(m, 3) points of the profile from which searches begin."""
    reaches: NDArray[np.float64]
    """(p, q) metres; how far the largest parts of the profile reach along q vectors."""

    @classmethod
    def around(cls, patches: SurfaceHierarchy, profile: Profile, frame: NDArray) -> Self:
        """Build the hierarchy from that of the patches and the profile, which turns about frame z.

        The frame (4, 4) is that of the profile in the model frame, metres.
        """
        places = np.empty(len(patches.order), np.int32)
        places[patches.order] = np.arange(len(places))
        kept = {name: getattr(patches, name) for name in SurfaceHierarchy.KEPT}
        kept["places"] = frozen(places)
        return cls._made(kept | _around(_curves(patches.parts, profile), profile, frame))

    def deformed(
        self, patches: Sequence[Net], joints: Joints, profile: Profile, frame: NDArray
    ) -> Self:
        """Return a hierarchy of the same structure for a profile whose control points moved.

        The revision increases by one.

        Args:
            patches: what the curves of the profile sweep.
            joints: how the patches close up.
            profile: the moved profile.
            frame: (4, 4) as for `around`.
        """
        curves = self.curves.copy()
        curves["control"] = _controls(profile)
        return self._moved(patches, joints, _around(curves, profile, frame))

    @property
    def tree_kind(self) -> type:
        """The type for solids of revolution; against other kinds the patches are used instead."""
        return RevolutionTree

    def _table(self, tree: SurfaceTree) -> NDArray[np.int64]:
        return model_table(self.numbers, tree, *(getattr(self, name) for name in _OWN))

    @staticmethod
    def _frozen(state: dict[str, Any]) -> tuple[NDArray, ...]:
        own = tuple(state[name] for name in _OWN)
        return *own, *SurfaceHierarchy._frozen(state)


def _around(curves: NDArray, profile: Profile, frame: NDArray) -> dict[str, NDArray]:
    """Return what changes of the attributes `_OWN` when the pieces (c,) of a profile move."""
    rows = np.zeros((6, 3))
    beyond = _BEYOND * max(_beyond(pieces) for pieces in profile.pieces)
    size = _extent(profile)
    extent = size + beyond
    rows[:3], rows[3] = frame[:3, :3].T, frame[:3, 3]
    rows[4, :2] = extent, _is_convex(profile)
    rows[5] = tube_of(profile)
    arcs = build_arcs(curves, extent, PRECISION * size)
    made = {
        "arcs": arcs, "curves": curves, "frame": rows, "samples": take_samples(curves),
        "reaches": take_reaches(arcs, profile.size + beyond),
    }  # fmt: skip
    return {name: frozen(array) for name, array in made.items()}


def _is_convex(profile: Profile) -> bool:
    """Tell whether a solid is convex because its control points turn to one side only.

    A convex solid that is not recognised costs only time: it is searched like any other.
    """
    points = np.concatenate(
        [(own[..., :2] / own[..., 2:]).reshape(-1, 2) for own in profile.pieces]
    )
    steps = np.diff(points, axis=0)
    steps = steps[np.linalg.norm(steps, axis=1) > _STRAIGHT * profile.size]
    x, z = steps.T
    turns = x[:-1] * z[1:] - z[:-1] * x[1:]
    side = 1.0 if profile.leftward else -1.0
    return not profile.closed and bool((side * turns >= -_STRAIGHT * profile.size**2).all())


def _beyond(pieces: NDArray[np.float64]) -> float:
    """Return how far the pieces (s, degree + 1, 3) of a curve are beyond the axis at most, metres.

    A piece is no farther beyond it than its control points. If control points are beyond it, the
    piece is halved. A halving takes the mean of neighbours degree times, each of which errs by a
    unit of the largest coordinate.
    """
    count = pieces.shape[1]
    left = pieces[(pieces[..., 0] < 0.0).any(axis=1)][..., [0, 2]]
    if not len(left):
        return 0.0
    largest = np.abs(left[..., 0]).max(axis=1) / left[..., 1].min(axis=1)
    rounding = _HALVINGS * count * DOUBLE_EPS * float(largest.max())
    for _ in range(_HALVINGS):
        below, above = np.empty_like(left), np.empty_like(left)
        for k in range(count):
            below[:, k], above[:, -1 - k] = left[:, 0], left[:, -1]
            left = 0.5 * (left[:, :-1] + left[:, 1:])
        left = np.concatenate((below, above))
        left = left[(left[..., 0] < 0.0).any(axis=1)]
        if not len(left):
            return rounding
    return rounding + float((-left[..., 0] / left[..., 1]).max())


def _extent(profile: Profile) -> float:
    """Return a length, metres, of which rounding errors of a profile's points are shares.

    They are shares of the largest coordinates that the points would have if all coordinates of the
    control points were positive. Usually that is the profile's size. If control points of small
    weights are much farther away than any end of a piece, the pieces are halved a few times.
    """
    ends = [np.abs(own[:, [0, -1], :2] / own[:, [0, -1], 2:]).max() for own in profile.pieces]
    count = sum(map(len, profile.pieces))
    if profile.size <= _FAR * max(ends) or count << _CUTS > MOST // 4:
        return profile.size
    most = 0.0
    for pieces in profile.pieces:
        left = np.concatenate((np.abs(pieces[..., :2]), pieces[..., 2:]), axis=-1)
        for _ in range(_CUTS):
            below, above = np.empty_like(left), np.empty_like(left)
            for k in range(pieces.shape[1]):
                below[:, k], above[:, -1 - k] = left[:, 0], left[:, -1]
                left = 0.5 * (left[:, :-1] + left[:, 1:])
            left = np.concatenate((below, above))
        most = max(most, float((left[..., :2] / left[..., 2:]).max()))
    return min(profile.size, most * (1.0 + 1e-9))


def _curves(all_parts: Parts, profile: Profile) -> NDArray:
    """Return the pieces (c,) of a profile, CURVE_PIECE; their spans are cut into `parts`."""
    parts = all_parts[0][0]
    made = []
    first = 0
    for k, net in enumerate(profile.nets):
        along, _ = net.spans
        own = np.zeros(len(along.low), CURVE_PIECE)
        own["degree"], own["patch"], own["parts"] = along.degree, k, parts
        own["around"] = _QUARTERS * parts
        own["low"], own["high"] = along.low, along.high
        own["first"] = first + np.arange(len(own)) * own["around"] * parts
        first += int((own["around"] * parts).sum())
        made.append(own)
    curves = np.concatenate(made)
    curves["control"] = _controls(profile)
    return curves


def _controls(profile: Profile) -> NDArray[np.float64]:
    """Return the control points (c, 48) of the pieces of a profile; see CURVE_PIECE."""
    count = sum(map(len, profile.pieces))
    made, end = np.zeros((count, CURVE_PIECE["control"].shape[0])), 0
    for pieces in profile.pieces:
        end += len(pieces)
        made[end - len(pieces) : end, : 3 * pieces.shape[1]] = pieces.reshape(len(pieces), -1)
    return made
