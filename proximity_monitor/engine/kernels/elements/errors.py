"""What rounding may have done to a point of an element, before it is moved."""

from __future__ import annotations

from ..base.jit import implements, inlined
from ..base.rounding import NET_POINT
from ..base.trees import CONVERSION, JOINTS, MeshTree, RevolutionTree, SurfaceTree


def points_err(tree):
    """What a point of an element errs by, metres."""


def joints_err(tree):
    """How far from the elements that may be which closes a solid where they do not meet, metres."""


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
