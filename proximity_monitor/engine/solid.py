"""Whether a mesh encloses a solid: the check, what it finds for the search, and its refusals."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from .kernels.solids import Solid, parts_and_owners
from .mesh import ModelError, TriangleMesh
from .tolerances import DOUBLE_EPS

_WAY_OUT = "repair it (close holes, orient faces alike), or ask `distance`, which takes any surface"

_known: WeakKeyDictionary[TriangleMesh, tuple[NDArray[np.float64], Solid]] = WeakKeyDictionary()
"""Solids of meshes that were checked, each with the vertices that it was checked with."""


def as_solid(mesh: TriangleMesh) -> Solid:
    """The solid that a mesh encloses; checked once a mesh and remembered.

    Vertices of equal coordinates count as one, so a soup of triangles, as STL files hold it, can
    be a solid. Each edge must be passed as often one way as the other: by two faces, or by four
    and more where parts touch along an edge. Then every point off the surface has a whole winding
    number. Faces that repeat a vertex enclose nothing and are passed over.

    Raises:
        ModelError: naming the mesh and its open edges, its faces of unlike orientation, or that it
            encloses no volume.
    """
    known = _known.get(mesh)
    if known is not None and known[0] is mesh.vertices:
        return known[1]
    merged, places = _merged(mesh)
    _check_edges(mesh, merged, places)
    in_tree_order = np.ascontiguousarray(merged[mesh._face_of])
    part, owned, samples = parts_and_owners(in_tree_order, len(places))
    _check_volume(mesh, part)
    ball = np.array([*mesh.centre, mesh.radius])
    solid = Solid(owned, samples, ball)
    for array in solid:
        array.setflags(write=False)
    _known[mesh] = mesh.vertices, solid
    return solid


def _merged(mesh: TriangleMesh) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Faces (m, 3) that name vertices of equal coordinates alike, and those coordinates (n, 3)."""
    used = mesh.vertices[mesh.faces.reshape(-1)] + 0.0  # -0.0 becomes 0.0
    order = np.lexsort(used.T)
    in_order = used[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    number = np.empty(len(order), np.int32)
    number[order] = np.cumsum(first) - 1
    return number.reshape(-1, 3), in_order[first]


def _check_edges(mesh: TriangleMesh, faces: NDArray[np.int32], places: NDArray[np.float64]) -> None:
    """Every edge is passed as often one way as the other."""
    a, b, c = faces.T
    start, end = np.concatenate((a, b, c)).astype(np.int64), np.concatenate((b, c, a))
    proper = np.tile((a != b) & (b != c) & (c != a), 3)
    if not proper.any():
        raise ModelError(f"{mesh.name}: no solid: none of its faces has an area; {_WAY_OUT}")
    start, end = start[proper], end[proper]
    key = np.minimum(start, end) * len(places) + np.maximum(start, end)
    edges, which, uses = np.unique(key, return_inverse=True, return_counts=True)
    forth = np.bincount(which.reshape(-1), weights=start < end)
    odd, unlike = uses % 2 == 1, 2 * forth != uses
    for bad, text in (
        (odd, "not watertight: {} open edges (of an odd number of faces)"),
        (unlike, "faces of unlike orientation at {} edges"),
    ):
        if bad.any():
            i, j = divmod(int(edges[np.flatnonzero(bad)[0]]), len(places))
            what = text.format(int(bad.sum()))
            raise ModelError(
                f"{mesh.name}: no solid: {what}, the first between the vertices "
                f"{places[i].tolist()} and {places[j].tolist()}; {_WAY_OUT}"
            )


def _check_volume(mesh: TriangleMesh, part: NDArray[np.int32]) -> None:
    """At least one connected part encloses a volume that is more than rounding.

    A part that does not is a folded sheet, around which no point has a winding number but 0. The
    determinant of a tetrahedron errs by less than 8 u of its terms (Shewchuk 1997, section 4.3).
    """
    faces = mesh.faces[mesh._face_of]
    a, b, c = np.moveaxis(mesh.vertices[faces] / mesh._tree.scale[0], 1, 0)
    _, first = np.unique(part, return_index=True)
    origin = a[first][part]
    a, b, c = a - origin, b - origin, c - origin
    left, right = np.roll(b, -1, 1) * np.roll(c, -2, 1), np.roll(b, -2, 1) * np.roll(c, -1, 1)
    volumes = np.bincount(part, weights=(a * (left - right)).sum(axis=1))
    terms = np.bincount(part, weights=(np.abs(a) * (np.abs(left) + np.abs(right))).sum(axis=1))
    if not (np.abs(volumes) > 32.0 * DOUBLE_EPS * terms).any():
        raise ModelError(f"{mesh.name}: no solid: it encloses no volume; {_WAY_OUT}")
