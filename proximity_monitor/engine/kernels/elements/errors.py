"""Errors of a model's elements in the model's frame: of their points, and of gaps between them."""

from __future__ import annotations

from ..base.jit import implements, inlined
from ..base.rounding import NET_POINT
from ..base.trees import CONVERSION, JOINTS, MeshTree, RevolutionTree, SurfaceTree


def points_err(tree):
    """Return the error of a point of an element before it is moved, metres. A stub."""


def joints_err(tree):
    """Return how far from the elements a solid's boundary may lie at their gaps, metres. A stub."""


@implements(points_err, MeshTree)
@inlined
def _corners_err(tree):
    return 0.0


@implements(points_err, (SurfaceTree, RevolutionTree))
@inlined
def _evaluation_errs(tree):
    return NET_POINT * tree.scale[2] + tree.scale[CONVERSION]


@implements(joints_err, MeshTree)
@inlined
def _they_meet(tree):
    return 0.0


@implements(joints_err, (SurfaceTree, RevolutionTree))
@inlined
def _gaps(tree):
    return tree.scale[JOINTS]
