"""The hierarchy of a solid of revolution: fat arcs around its profile, beside its patches'."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.tables import model_table
from ..kernels.base.trees import CURVE_PIECE, RevolutionTree, SurfaceTree
from ..kernels.revolution.build import build_arcs
from ..kernels.revolution.guess import take_samples
from ..kernels.revolution.reach import take_reaches
from .nurbs import frozen
from .parts import even_parts
from .surface_hierarchy import SurfaceHierarchy
from .tube import tube_of

if TYPE_CHECKING:
    from .profile import Profile

PRECISION = 1e-5
"""Share of a profile's largest coordinate down to which arcs are as thin as that. A search makes
those that are thinner where it needs them."""

_BEYOND = 1e13
"""Bounds take it that no point is beyond the axis, and `checked_profile` allows for rounding there.
So much longer is the length of which arcs err by a share of 2.3e-13, for each metre beyond."""


_STRAIGHT = 1e-9
"""Share of a profile's size, or its square, that counts for nothing where it turns."""

_HALVINGS = 24
"""Until control points are as near to a curve as rounding would have them."""


_OWN = "arcs", "curves", "places", "frame", "samples", "reaches"
"""What it keeps of the profile, as RevolutionTree has it."""


class RevolutionHierarchy(SurfaceHierarchy):
    """Volumes around the pieces of the patches, and fat arcs around those of the profile."""

    KEPT = (*SurfaceHierarchy.KEPT, *_OWN)

    __slots__ = _OWN

    parts_of = staticmethod(even_parts)
    """As kernels count the parts of patches by those of the profile."""

    arcs: NDArray
    """(k,) ARC."""
    curves: NDArray
    """(c,) CURVE_PIECE."""
    places: NDArray[np.int32]
    """Which piece in tree order is which part of a patch."""
    frame: NDArray[np.float64]
    """(6, 3) the frame's axes and origin, and more: see RevolutionTree."""
    samples: NDArray[np.float64]
    """(m, 3) points of the profile, with which a search begins."""
    reaches: NDArray[np.float64]
    """(p, q) metres; what the largest parts of the profile reach along vectors."""

    @classmethod
    def around(cls, patches: SurfaceHierarchy, profile: Profile, frame: NDArray) -> Self:
        """The hierarchy of patches that a profile sweeps, turning about the z of a frame (4, 4)."""
        curves, places = _curves(patches, profile)
        rows = np.zeros((6, 3))
        extent = profile.size + _BEYOND * max(_beyond(pieces) for pieces in profile.pieces)
        rows[:3], rows[3] = frame[:3, :3].T, frame[:3, 3]
        rows[4, :2] = extent, _is_convex(profile)
        rows[5] = tube_of(profile)
        arcs = build_arcs(curves, extent, PRECISION * profile.size)
        kept = {name: getattr(patches, name) for name in SurfaceHierarchy.KEPT}
        own = {
            "arcs": arcs, "curves": curves, "places": places, "frame": rows,
            "samples": take_samples(curves), "reaches": take_reaches(arcs, extent),
        }  # fmt: skip
        return cls._made(kept | {name: frozen(array) for name, array in own.items()})

    @property
    def tree_kind(self) -> type:
        """That of solids of revolution: against others it is taken for its patches."""
        return RevolutionTree

    def _table(self, tree: SurfaceTree) -> NDArray[np.int64]:
        return model_table(self.numbers, tree, *(getattr(self, name) for name in _OWN))

    @staticmethod
    def _frozen(state: dict[str, Any]) -> tuple[NDArray, ...]:
        own = tuple(state[name] for name in _OWN)
        return *own, *SurfaceHierarchy._frozen(state)


def _is_convex(profile: Profile) -> bool:
    """Whether a solid is convex, as its control points tell: they turn to one side alone.

    A solid that is and is not found so is searched as any other: nothing but time depends on it.
    """
    points = np.concatenate([rows[:, :2] / rows[:, 2:] for own in profile.pieces for rows in own])
    steps = np.diff(points, axis=0)
    steps = steps[np.linalg.norm(steps, axis=1) > _STRAIGHT * profile.size]
    x, z = steps.T
    turns = x[:-1] * z[1:] - z[:-1] * x[1:]
    side = 1.0 if profile.leftward else -1.0
    return not profile.closed and bool((side * turns >= -_STRAIGHT * profile.size**2).all())


def _beyond(pieces: NDArray[np.float64]) -> float:
    """How far the pieces (s, degree + 1, 3) of a curve may be beyond the axis at most, metres.

    They are no farther than their control points. Where these are beyond it, pieces are halved.
    Each time the mean of neighbours is taken degree times, which errs by a unit of the largest.
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


def _curves(patches: SurfaceHierarchy, profile: Profile) -> tuple[NDArray, NDArray[np.int32]]:
    """The pieces of a profile, and which piece of the patches, in tree order, is which part."""
    parts = patches.parts[0][0]
    made = []
    first = 0
    for k, (net, patch) in enumerate(zip(profile.nets, patches.nets, strict=True)):
        pieces, (along, _) = profile.pieces[k], net.spans
        own = np.zeros(len(pieces), CURVE_PIECE)
        own["control"][:, : 3 * pieces.shape[1]] = pieces.reshape(len(pieces), -1)
        own["degree"], own["patch"], own["parts"] = pieces.shape[1] - 1, k, parts
        own["around"] = len(patch.spans[1].low) * parts
        own["low"], own["high"] = along.low, along.high
        own["first"] = first + np.arange(len(pieces)) * own["around"] * parts
        first += int((own["around"] * parts).sum())
        made.append(own)
    places = np.empty(len(patches.order), np.int32)
    places[patches.order] = np.arange(len(places))
    return np.concatenate(made), places
