"""Find out where a model has an inside, what searches need of it, or why it has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.trees import SurfaceTree
from ..kernels.inside import solids
from ..kernels.inside.angles import MOMENTS, moments_of
from ..kernels.inside.contain import Insides
from ..kernels.inside.solid_table import solid_table
from ..kernels.inside.solids import HALF, NOWHERE, WHOLE, Region
from ..kernels.surface.contain import MixedInsides
from .tree import build, weld

if TYPE_CHECKING:
    from .hierarchy import Hierarchy
    from .mesh_hierarchy import MeshHierarchy
    from .model import Model
    from .tree import Tree

_AS_TOLD = "it is declared a surface (solid=False)"
_NO_MOMENTS = np.empty((0, MOMENTS))


@dataclass(slots=True)
class Sides:
    """What is known of a model's inside."""

    first: NDArray[np.int32]
    """(n,) for each vertex the first one at the same place; empty for a model without vertices."""
    part: NDArray[np.int32]
    """(m,) for each triangle, in tree order, the number of its connected part."""
    proper: bool
    """Whether any element has an area."""
    opening: tuple[str, int, int] | None
    """Why the edges bound no solid, and the two vertices of the first bad edge; None: they do."""
    rim: float
    """Metres: the total length of the open edges."""
    region: Region
    extent: NDArray[np.float64]
    """(2,) `region.inside` and `region.rim`, as the table needs them."""
    table: NDArray[np.int64]
    """The addresses of the hierarchy of all triangles and of the region; see solid_table.py."""
    reason: str
    """Why the model is no solid; empty if it is one."""


def sides_of(model: Model) -> Sides:
    """Return where a model has an inside; found once for each shape."""
    return model._hierarchy.sides()


def insides_of(models: Sequence[Model]) -> Insides | MixedInsides:
    """Return the insides of bodies with these models, for the kernels; bodies may share a model."""
    shapes = tuple({id(model): model for model in models}.values())
    regions = [sides_of(model).region for model in shapes]
    starts = np.cumsum([0, *(len(each.samples) for each in regions)])
    place = {id(model): k for k, model in enumerate(shapes)}
    of = np.array([place[id(model)] for model in models])
    insides = Insides(
        np.array([each.inside for each in regions], np.int8)[of],
        np.stack((starts[of], starts[of + 1]), axis=1),
        np.concatenate([each.samples for each in regions]),
        np.stack([model._hierarchy.sampled() for model in models]),
    )
    divided = np.array([isinstance(model._hierarchy.tree, SurfaceTree) for model in models])
    if not (divided & (insides.where == WHOLE)).any():
        return insides
    holders = np.stack([model._hierarchy.table_of_all for model in models])
    return MixedInsides(*insides, holders, divided)


def find_sides(mesh: MeshHierarchy, known: Sides | None) -> Sides:
    """Find out where triangles have an inside.

    Vertices of equal coordinates count as one, so a soup of triangles, as in STL files, can be a
    solid. Each edge must be passed as often one way as the other: by two faces, or by four and more
    if parts touch along it. Then every point off the surface has an integer winding number. Faces
    that repeat a vertex enclose nothing and are ignored.

    Args:
        mesh: the triangles.
        known: the result for the same faces before their vertices moved. Unless vertices have come
            together or apart, it is used again, and little more than the volume is computed.
    """
    robust = mesh.solid == "robust"
    first = weld(mesh.vertices)
    same = known is not None and np.array_equal(first, known.first)
    if same and not (robust and known.opening):  # lengths of open edges must be computed again
        part, proper, opening = known.part, known.proper, known.opening
        rim, samples = known.rim, known.region.samples
    else:
        faces = first[mesh.faces[mesh.numbers]]
        proper, opening, rim = _edges(mesh, faces)
        part, samples = solids.connected_parts(faces, len(first))
    inside, reason, moments, rim_tree = NOWHERE, "", _NO_MOMENTS, _no_rim()
    if mesh.solid is False:
        reason = _AS_TOLD
    elif not proper:
        reason = "none of its faces has an area"
    elif opening is None:
        reason = _no_volume(mesh, part, samples)
        inside = NOWHERE if reason else WHOLE
    elif robust:
        inside = HALF
        rim_tree = _rim_tree(mesh.vertices, faces)
        moments = moments_of(mesh.tree.triangles, mesh.tree.children, mesh.ranges())
    else:
        text, i, j = opening
        reason = f"{text} {mesh.vertices[i].tolist()} and {mesh.vertices[j].tolist()}"
    if mesh.solid is not False and mesh.swept_radius > 0.0:
        reason = ""  # all points within the radius of the core are inside
    ball = np.array([*mesh.centre, mesh.core_radius])
    corners = mesh.tree.triangles.reshape(-1, 3)
    box = np.stack((corners.min(axis=0), corners.max(axis=0)))
    region = Region(inside, samples, ball, box, rim, rim_tree, moments)
    return _sides(mesh, first, part, proper, opening, region, reason)


def plain_sides(
    hierarchy: Hierarchy, proper: bool, reason: str, samples: NDArray[np.int32]
) -> Sides:  # fmt: skip
    """Return the sides of a model without vertices: it is a solid unless `reason` says why not."""
    nothing = np.empty(0, np.int32)
    ball = np.array([*hierarchy.centre, hierarchy.core_radius])
    inside = NOWHERE if reason else WHOLE
    region = Region(inside, samples, ball, np.zeros((2, 3)), 0.0, _no_rim(), _NO_MOMENTS)
    return _sides(hierarchy, nothing, nothing, proper, None, region, reason)


def _sides(
    hierarchy: Hierarchy, first: NDArray[np.int32], part: NDArray[np.int32], proper: bool,
    opening: tuple[str, int, int] | None, region: Region, reason: str,
) -> Sides:  # fmt: skip
    for array in (region.samples, region.ball, region.box, region.moments):
        array.setflags(write=False)
    extent = np.array([region.inside, region.rim], np.float64)
    table = solid_table(hierarchy.table_of_all, region, extent)
    return Sides(first, part, proper, opening, region.rim, region, extent, table, reason)


def _edges(
    mesh: MeshHierarchy, faces: NDArray[np.int32]
) -> tuple[bool, tuple[str, int, int] | None, float]:
    """Return whether any face has an area, `Sides.opening`, and the open edges' length, metres."""
    proper, odd, unlike, firsts, rim = solids.unpaired_edges(faces, mesh.vertices)
    for count, (i, j), text in (
        (odd, firsts[0], "not watertight: {} open edges (of an odd number of faces)"),
        (unlike, firsts[1], "faces with opposite orientations at {} edges"),
    ):
        if count:
            text = f"{text.format(count)}, the first between the vertices"
            return True, (text, int(i), int(j)), rim * (1.0 + 1e-6)
    return proper > 0, None, 0.0


def _rim_tree(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> Tree:
    """Build the hierarchy of the edges that are not passed as often one way as the other."""
    ends = np.concatenate((faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]))
    repeats = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    ends = ends[~np.tile(repeats, 3)]
    edges, of = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    over = np.bincount(of.ravel(), np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0), len(edges))
    return _tree(vertices, edges[over != 0.0][:, [0, 1, 1]])


@cache
def _no_rim() -> Tree:
    """Return a hierarchy of one point, a placeholder for models without open edges."""
    return _tree(np.zeros((1, 3)), np.zeros((1, 3)))


def _tree(vertices: NDArray[np.float64], triangles: NDArray) -> Tree:
    faces = np.ascontiguousarray(triangles, np.int32)
    for array in (vertices, faces):
        array.setflags(write=False)  # else kernels would be compiled for writable arrays too
    return build(np.ascontiguousarray(vertices[faces].reshape(-1, 9)), vertices, faces).tree


def _no_volume(mesh: MeshHierarchy, part: NDArray[np.int32], samples: NDArray[np.int32]) -> str:
    """Return why a mesh encloses no volume; empty if a connected part encloses one beyond rounding.

    Any other part is a folded sheet: all points off it have the winding number 0.
    """
    tree = mesh.tree
    volumes, terms = solids.part_volumes(tree.triangles, tree.scale[0], part, samples).T
    enclosed = (np.abs(volumes) > 32.0 * DOUBLE_EPS * terms).any()
    return "" if enclosed else "it encloses no volume"
