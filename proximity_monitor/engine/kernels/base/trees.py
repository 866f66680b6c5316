"""What a hierarchy consists of, as the kernels see it: one type for each kind of model."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

NONE = -1
"""No piece, arc or cell."""

MeshTree = namedtuple("MeshTree", "nodes centres children sizes triangles scale")
"""A hierarchy of swept spheres over triangles, as the kernels see it.

nodes (float32, flat) the volumes; centres (k, 4) each node's centre and reach in node units;
children (int32, k × 16) a node, a leaf or EMPTY (see layout.py); sizes (float32, k × 16, 2) each
volume's extent and what opening it promises (see tree/promise.py), in node units; triangles (m, 9)
in tree order, metres; scale (6,) metres in a node unit, its inverse, the largest norm of a vertex
in metres, how often it was refitted, the radius of the ball that sweeps the triangles, and how far
they may deviate from what they stand for, both in metres.

Each kind of model has a tree of a type of its own, by which kernels are chosen when they are
compiled (see search/stubs.py). All kinds have children, sizes, centres and scale as here.
"""

BoxTree = namedtuple("BoxTree", MeshTree._fields)
"""A hierarchy of boxes over triangles: what is a radius of MeshTree is a box's half thickness here.

A box lies inside its rectangle swept by that, so wherever boxes are of no use the same arrays may
be taken for a MeshTree.
"""

MESHES = MeshTree, BoxTree
"""The trees over triangles."""

Trims = namedtuple("Trims", "trims rows entries segments nets")
"""The trimming loops of all patches of a model, as the kernels see them.

trims (patches,) TRIM; rows (int32) where the list of each row of v begins in entries, which are
(int32) indices of segments (k,) SEGMENT; nets (float64, flat) x w, y w, w of each control point.
"""

TRIM = np.dtype(
    [
        ("low", np.float64, (2,)),  # the patch's rectangle in its u and v
        ("extent", np.float64, (2,)),
        ("tangent", np.float64, (2,)),  # of a quarter of an arc's angle
        ("arcs", np.int32, (2,)),  # equal arcs along that axis; 0: the map is linear
        ("rows", np.int32),  # rows of v; 0: the whole rectangle belongs to the model
        ("first_row", np.int32),
        ("first", np.int32),  # its segments
        ("end", np.int32),
        ("slack", np.float64),  # what rounding may do to a point of the unit square
    ],
    align=True,
)
"""The trim of a patch. An axis of arcs is one along which the surface runs in equal circular arcs,
each a rational quadratic, and trimming curves are given by the angle."""

SEGMENT = np.dtype(
    [
        ("a", np.float64, (2,)),  # its ends, those of its neighbours to the last bit
        ("b", np.float64, (2,)),
        ("band", np.float64),  # how far the curve may be from the chord; FRAME
        ("begin", np.float64),  # where on the Bezier curve it begins and ends
        ("end", np.float64),
        ("net", np.int32),  # where the control points begin in `nets`
        ("degree", np.int32),
    ],
    align=True,
)
"""A piece of a loop, in the unit square."""

FRAME = -1.0
"""The band of what lies along a side."""

SurfaceTree = namedtuple("SurfaceTree", "nodes centres children sizes pieces nets scale trims")
"""A hierarchy of swept spheres over pieces of parametric surfaces and curves; each leaf is one.

pieces (m,) PIECE in tree order; nets (float64, flat) their control nets; trims, Trims. The rest is
as in MeshTree; scale[2] is the largest norm of a control point, scale[6] how far rounding may have
moved points of the surface when it was cut into pieces, and scale[7], of a solid, how far from the
pieces that may be which closes the gaps between patches (see models/closed.py), both in metres.
"""

PIECE = np.dtype(
    [
        ("net", np.int64),  # where its control net begins in `nets`
        ("points", np.int32),  # its control points, (degree_u + 1) (degree_v + 1), v fastest
        ("room", np.int32),  # numbers of one coordinate in `nets`: a multiple of NET_WIDTH
        ("degree_u", np.int32),
        ("degree_v", np.int32),  # 0 of a curve
        ("rational", np.int32),  # 0: all weights are 1
        ("patch", np.int32),  # the patch or curve of the model that it is a piece of
        ("side", np.int32),  # INSIDE where nothing of it is cut off, else CROSSING
        ("face", np.int32),  # the piece to begin with; of an edge the one that it lies on
        ("edge", np.int32),  # the segment on whose curve an edge lies; NONE of what is no edge
        ("bend", np.float64),  # how far an edge may be from its chord, metres
        ("low", np.float64, (2,)),  # its rectangle in that patch's u and v; v is 0 on a curve
        ("high", np.float64, (2,)),
        ("centre", np.float64, (3,)),  # mean of its corners, metres
        ("along_u", np.float64, (3,)),  # from there to the middle of the side where u is largest
        ("along_v", np.float64, (3,)),
        ("limits", np.float64, (13,)),  # of its derivatives: see surface/limits.py
        ("slope", np.float64),  # how many times what a point errs by a derivative may err by, for
        # each degree; of edges nothing of all these is known
    ],
    align=True,
)
"""A rational Bezier piece. Its control net is four rows of `room` numbers: x w, y w, z w and w of
each control point, where the weights w are positive; the last point is repeated up to the end."""

RevolutionTree = namedtuple(
    "RevolutionTree",
    (*SurfaceTree._fields, "arcs", "curves", "places", "frame", "samples", "reaches"),
)
"""The same over the patches of a solid of revolution, and the fat arcs around its profile.

arcs (k,) ARC, the first of them around all; curves (c,) CURVE_PIECE, one after the other along the
profile; places (int32) which piece, in tree order, is which part of a patch: see CURVE_PIECE; frame
(6, 3) the frame of the profile in the model's: its x, y and z, the axis, and the origin, metres;
then the length of which arcs err by a share, metres, and whether the solid is about convex, 1 or 0;
and of what a ball sweeps along a circle the circle's z, the ball's radius, at least, and the
circle's, which is 0 of a sphere, metres, else 0; samples (m, 3) points of the profile: see
revolution/guess.py; reaches (p, VECTORS) metres, what parts of it reach: see
revolution/reach.py.
"""

VECTORS = 33
"""Vectors of the half-plane along which is kept what parts of a profile reach: the same number of
each side of a square, and the first one again."""

ARC = np.dtype(
    [
        ("middle", np.float64, (2,)),  # of the arc's chord: rho and z, metres
        ("half", np.float64, (2,)),  # from there to the chord's second end
        ("sine", np.float64),  # of half the arc's angle; negative where it bulges to the right of
        ("cosine", np.float64),  # the chord. 0: the chord itself, where only the error is known
        ("error", np.float64),  # how far the profile may be from the arc, metres
        ("length", np.float64),  # about that of the part, metres
        ("limits", np.float64, (3,)),  # of the first three derivatives by the piece's parameter,
        # over the part and half as much besides at both ends
        ("low", np.float64),  # the part of the piece, within 0 to 1
        ("high", np.float64),
        ("curve", np.int32),  # the piece; NONE: the arc holds several
        ("child", np.int32),  # the first of the two arcs of both halves, NONE where there are none
    ],
    align=True,
)
"""A fat arc: an arc of a circle in the half-plane (rho, z), as thick as the profile demands. What
it sweeps is a part of a torus, or of a cone where it is straight."""

CURVE_PIECE = np.dtype(
    [
        ("control", np.float64, (48,)),  # rho w, z w and w of each control point
        ("degree", np.int32),
        ("patch", np.int32),  # the curve of the profile, and the patch that it sweeps
        ("first", np.int32),  # where the places of its own parts begin
        ("parts", np.int32),  # equal parts of it, each with `around` pieces around the axis
        ("around", np.int32),
        ("low", np.float64),  # the piece of that curve
        ("high", np.float64),
    ],
    align=True,
)
"""A rational Bezier piece of a profile."""

NET_WIDTH = 16
"""Control points are bounded so many at a time."""

LARGEST, REVISION, SWEPT, DEVIATION, CONVERSION, JOINTS = 2, 3, 4, 5, 6, 7
"""Of a tree's `scale`; the last two of a SurfaceTree's alone."""
