"""The arrays of a hierarchy, as the kernels see them: one tree type for each kind of model."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

NONE = -1
"""No piece, arc or cell."""

MeshTree = namedtuple("MeshTree", "nodes centres children sizes triangles scale")
"""A hierarchy of swept spheres over triangles.

nodes (float32, flat): the volumes; centres (k, 4): each node's centre and reach, in node units;
children (int32, k × 16): a node, a leaf or EMPTY (see layout.py); sizes (float32, k × 16, 2): each
volume's extent and what opening it promises (see tree/promise.py), in node units; triangles (m, 9)
in tree order, metres; scale (6,): metres in a node unit, its inverse, the largest norm of a vertex
(m), how often the tree was refitted, the radius (m) of the ball that sweeps the triangles, and the
deviation (m) of the triangles from the part that they stand for.

Each kind of model has its own tree type, by which numba chooses kernels when it compiles (see
search/stubs.py). All kinds have children, sizes, centres and scale as here.
"""

BoxTree = namedtuple("BoxTree", MeshTree._fields)
"""A hierarchy of boxes over triangles: a box's half thickness replaces the radius of MeshTree.

A box lies inside its rectangle swept by a ball of this half thickness. So where boxes are of no
use, the same arrays serve as a MeshTree.
"""

MESHES = MeshTree, BoxTree
"""The trees over triangles."""

Trims = namedtuple("Trims", "trims rows entries segments nets")
"""The trimming loops of all patches of a model.

trims (patches,) TRIM; rows (int32): where the list of each row of v begins in `entries`; entries
(int32): indices of segments; segments (k,) SEGMENT; nets (float64, flat): x w, y w, w of each
control point.
"""

TRIM = np.dtype(
    [
        ("low", np.float64, (2,)),  # the patch's rectangle in its u and v
        ("extent", np.float64, (2,)),
        ("tangent", np.float64, (2,)),  # of a quarter of an arc's angle
        ("arcs", np.int32, (2,)),  # number of equal arcs along each axis; 0: the map is linear
        ("rows", np.int32),  # number of rows of v; 0: the whole rectangle belongs to the model
        ("first_row", np.int32),
        ("first", np.int32),  # first of the trim's segments, and the one after the last
        ("end", np.int32),
        ("slack", np.float64),  # rounding allowance of a point in the unit square
    ],
    align=True,
)
"""The trim of a patch. If `arcs` is not 0, the surface runs along that axis in equal circular arcs,
each a rational quadratic, and trimming curves are given in terms of the angle."""

SEGMENT = np.dtype(
    [
        ("a", np.float64, (2,)),  # its ends, equal to its neighbours' ends to the last bit
        ("b", np.float64, (2,)),
        ("band", np.float64),  # how far the curve may be from the chord; or FRAME
        ("begin", np.float64),  # parameters of its ends on the Bezier curve
        ("end", np.float64),
        ("net", np.int32),  # where the control points begin in `nets`
        ("degree", np.int32),
    ],
    align=True,
)
"""A piece of a trimming loop, in the unit square."""

FRAME = -1.0
"""Band of a segment that lies along a side of the unit square."""

SurfaceTree = namedtuple("SurfaceTree", "nodes centres children sizes pieces nets scale trims")
"""A hierarchy of swept spheres over pieces of parametric surfaces and curves, one piece per leaf.

pieces (m,) PIECE in tree order; nets (float64, flat): their control nets; trims: Trims. The rest is
as in MeshTree, but scale[2] is the largest norm of a control point. scale[6] is how far (m)
rounding may have moved points of the surface when it was cut into pieces. scale[7], for a solid, is
how far (m) the surface that closes the gaps between patches may be from the pieces (see
models/closed.py).
"""

PIECE = np.dtype(
    [
        ("net", np.int64),  # where its control net begins in `nets`
        ("points", np.int32),  # number of control points, (degree_u + 1) (degree_v + 1), v fastest
        ("room", np.int32),  # length of a coordinate's row in `nets`: a multiple of NET_WIDTH
        ("degree_u", np.int32),
        ("degree_v", np.int32),  # 0 for a curve
        ("rational", np.int32),  # 0: all weights are 1
        ("patch", np.int32),  # the patch or curve of the model that it is a piece of
        ("side", np.int32),  # INSIDE if nothing of it is cut off, else CROSSING
        ("face", np.int32),  # the piece or edge to begin with; for an edge, the piece it lies on
        ("edge", np.int32),  # for an edge, the segment on whose curve it lies; else NONE
        ("bend", np.float64),  # how far an edge may be from its chord, metres
        ("low", np.float64, (2,)),  # its rectangle in the patch's u and v; v is 0 on a curve
        ("high", np.float64, (2,)),
        ("centre", np.float64, (3,)),  # mean of its corners, metres
        ("along_u", np.float64, (3,)),  # from the centre to the middle of the side of largest u
        ("along_v", np.float64, (3,)),
        ("limits", np.float64, (13,)),  # of its derivatives: see surface/limits.py; not for edges
        ("slope", np.float64),  # error of a derivative per degree, as a multiple of the error of a
        # point; not for edges
    ],
    align=True,
)
"""A rational Bezier piece. Its control net is four rows of `room` numbers: x w, y w, z w and w of
each control point. The weights w are positive. Copies of the last point fill each row.

An edge is a piece of a trimming curve, where a surface piece is cut off."""

RevolutionTree = namedtuple(
    "RevolutionTree",
    (*SurfaceTree._fields, "arcs", "curves", "places", "frame", "samples", "reaches"),
)
"""A SurfaceTree over the patches of a solid of revolution, and the fat arcs around its profile.

arcs (k,) ARC: arc 0 is around the whole profile; curves (c,) CURVE_PIECE: in their order along the
profile; places (int32): which piece, in tree order, is which part of a patch (see CURVE_PIECE);
samples (m, 3): points of the profile (see revolution/guess.py); reaches (p, VECTORS), metres: how
far parts of the profile reach along vectors (see revolution/reach.py).

frame (6, 3): rows 0 to 3 are the profile's frame in the model's frame: its x, y and z (the axis)
and its origin (m). Row 4: the length (m) of which errors of arcs are shares; whether the solid is
about convex, 1 or 0. Row 5, for what a ball sweeps along a circle (m): the circle's z, a lower
bound of the ball's radius, and the circle's radius, 0 for a sphere; for other solids all are 0.
"""

VECTORS = 33
"""Number of vectors of the half-plane for which `reaches` holds how far parts of a profile reach:
the same number for each side of a square, and the first vector again."""

ARC = np.dtype(
    [
        ("middle", np.float64, (2,)),  # of the arc's chord: rho and z, metres
        ("half", np.float64, (2,)),  # from the middle to the chord's second end
        ("sine", np.float64),  # of half the arc's angle; negative if the arc bulges to the right of
        ("cosine", np.float64),  # the chord. 0: the arc is its chord, and only the error is known
        ("error", np.float64),  # how far the profile may be from the arc, metres
        ("length", np.float64),  # approximate length of the part of the profile, metres
        ("limits", np.float64, (3,)),  # of the first three derivatives by the piece's parameter,
        # over the part and half its length beyond each end
        ("low", np.float64),  # the part of the piece, within 0 to 1
        ("high", np.float64),
        ("curve", np.int32),  # the piece; NONE: the arc holds several
        ("child", np.int32),  # the first of the two arcs of its halves; NONE if there are none
    ],
    align=True,
)
"""A fat arc: an arc of a circle in the half-plane (rho, z), thick enough to hold its part of the
profile. It sweeps a part of a torus, or of a cone if it is straight."""

CURVE_PIECE = np.dtype(
    [
        ("control", np.float64, (48,)),  # rho w, z w and w of each control point
        ("degree", np.int32),
        ("patch", np.int32),  # the curve of the profile, and the patch that it sweeps
        ("first", np.int32),  # where its entries in `places` begin
        ("parts", np.int32),  # number of equal parts, each with `around` pieces around the axis
        ("around", np.int32),
        ("low", np.float64),  # its range in the parameter of that curve
        ("high", np.float64),
    ],
    align=True,
)
"""A rational Bezier piece of a profile."""

NET_WIDTH = 16
"""How many control points are bounded at a time."""

LARGEST, REVISION, SWEPT, DEVIATION, CONVERSION, JOINTS = 2, 3, 4, 5, 6, 7
"""Indices in a tree's `scale`; only a SurfaceTree and a RevolutionTree have the last two."""
