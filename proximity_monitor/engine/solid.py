"""Whether a mesh encloses a solid: the check, what it finds for the search, and its refusals."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from .kernels import solids
from .kernels.solids import Solid
from .mesh import ModelError, TriangleMesh
from .tolerances import DOUBLE_EPS

_WAY_OUT = "repair it (close holes, orient faces alike), or ask `distance`, which takes any surface"


@dataclass(slots=True)
class _Checked:
    """A mesh that passed the check of its edges, and the solid that it was last."""

    first: NDArray[np.int32]  # (n,) of each vertex the first one at the same place
    part: NDArray[np.int32]  # (m,) of each triangle, in tree order
    vertices: NDArray[np.float64]  # with which it was that solid
    solid: Solid


_known: WeakKeyDictionary[TriangleMesh, _Checked] = WeakKeyDictionary()


def as_solid(mesh: TriangleMesh) -> Solid:
    """The solid that a mesh encloses; checked once a mesh and remembered.

    Vertices of equal coordinates count as one, so a soup of triangles, as STL files hold it, can
    be a solid. Each edge must be passed as often one way as the other: by two faces, or by four
    and more where parts touch along an edge. Then every point off the surface has a whole winding
    number. Faces that repeat a vertex enclose nothing and are passed over.

    A mesh whose vertices were moved keeps its edges, unless vertices that only had equal
    coordinates came apart; so after `refit` its volume alone is computed again.

    Raises:
        ModelError: naming the mesh and its open edges, its faces of unlike orientation, or that it
            encloses no volume.
    """
    known = _known.get(mesh)
    if known is not None and known.vertices is mesh.vertices:
        return known.solid
    if known is not None and (mesh.vertices == mesh.vertices[known.first]).all():
        first, part = known.first, known.part
        owned, samples = known.solid.owned, known.solid.samples
    else:
        first = solids.first_of_place((mesh.vertices + 0.0).view(np.int64))  # -0.0 becomes 0.0
        faces = first[mesh.faces[mesh._face_of]]
        _check_edges(mesh, faces)
        part, owned, samples = solids.parts_and_owners(faces, len(first))
    _check_volume(mesh, part, samples)
    solid = Solid(owned, samples, np.array([*mesh.centre, mesh.core_radius]))
    for array in solid:
        array.setflags(write=False)
    _known[mesh] = _Checked(first, part, mesh.vertices, solid)
    return solid


def _check_edges(mesh: TriangleMesh, faces: NDArray[np.int32]) -> None:
    """Every edge is passed as often one way as the other."""
    proper, odd, unlike, firsts = solids.unpaired_edges(faces, len(mesh.vertices))
    if not proper:
        raise ModelError(f"{mesh.name}: no solid: none of its faces has an area; {_WAY_OUT}")
    for count, (i, j), text in (
        (odd, firsts[0], "not watertight: {} open edges (of an odd number of faces)"),
        (unlike, firsts[1], "faces of unlike orientation at {} edges"),
    ):
        if count:
            raise ModelError(
                f"{mesh.name}: no solid: {text.format(count)}, the first between the vertices "
                f"{mesh.vertices[i].tolist()} and {mesh.vertices[j].tolist()}; {_WAY_OUT}"
            )


def _check_volume(mesh: TriangleMesh, part: NDArray[np.int32], samples: NDArray[np.int32]) -> None:
    """At least one connected part encloses a volume that is more than rounding.

    A part that does not is a folded sheet, around which no point has a winding number but 0.
    """
    tree = mesh._tree
    volumes, terms = solids.part_volumes(tree.triangles, tree.scale[0], part, samples).T
    if not (np.abs(volumes) > 32.0 * DOUBLE_EPS * terms).any():
        raise ModelError(f"{mesh.name}: no solid: it encloses no volume; {_WAY_OUT}")
