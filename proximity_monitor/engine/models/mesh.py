"""Triangle meshes: the model that the hierarchy is built for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_real, as_reals
from ..kernels.base.cache import KERNELS
from ..kernels.base.rounding import DOUBLE_EPS, LARGEST_COORDINATE
from ..kernels.base.tables import table
from ..kernels.search.spread import spread_corners
from ..kernels.tree.measure import measure
from ..kernels.tree.ranges import node_ranges
from .solid import sides_of
from .tessellate import tessellated
from .tree import VOLUMES, build, refit

if TYPE_CHECKING:
    from ..kernels.base.state import Tree

Solid = bool | Literal["robust"] | None
"""Whether a model is to be a solid; see `TriangleMesh`."""


_WAY_OUT = (
    "repair it (close holes, orient faces alike), or give it solid='robust', which bridges holes, "
    "or solid=False, which takes it for a surface"
)


class ModelError(ValueError):
    """A model's file or arrays are not what they should be; the message names which and where."""


class TriangleMesh:
    """A triangle mesh with its bounding volume hierarchy, ready for queries.

    The arrays are copied, checked and frozen; degenerate triangles (segments, points) are kept and
    take part like any others. What kind of volume the hierarchy consists of changes no answer, only
    the time it takes.

    Args:
        vertices: (n, 3) metres, model frame.
        faces: (m, 3) integers, indices of vertices; m >= 1.
        name: what messages call this mesh.
        radius: metres; the ball that sweeps the triangles: the model is all points as near to them,
            so that a point is a sphere and a segment a capsule, exactly.
        deviation: metres; how far the surface may be from that of the thing it stands for, as a
            tessellation's is. Every bound is widened by as much.
        volume: the bounding volumes: "rss", "lss" or "pss" (rectangle, line and point swept
            spheres), "hybrid" (of each node the one that its dimensions suggest; Larsen et al.
            1999, section 4.2), or, for comparison, "obb" or "aabb" (boxes along the principal axes
            of what they hold or along the model frame's, with their distances by GJK; Johnson and
            Cohen 1997, section 3.1.1).
        solid: whether it has an inside, of which `signed_distance` knows. None: if it encloses
            one, which is found out when first asked, some 15 ms for 100,000 triangles. True: it
            must, which is checked here and at every `refit`. False: it is a surface, whatever it
            encloses. "robust": if it encloses none because faces are missing or turned, its
            inside is where its generalised winding number is more than one half either way
            (Jacobson et al. 2013), within the sphere `centre`, `core_radius`.

    Raises:
        ModelError: wrong shapes, no faces, a vertex that is not finite or beyond 1e45 m, a face
            that names no vertex, a radius or deviation that is not a number from 0 to 1e45 m, an
            unknown volume or `solid`, no solid though it must be one; the message says which.
    """

    __slots__ = (
        "__weakref__",
        "_coincident",
        "_distinct",
        "_face_of",
        "_node_ranges",
        "_spread",
        "_table",
        "_table_of_all",
        "_tree",
        "centre",
        "core_radius",
        "depth",
        "deviation",
        "faces",
        "name",
        "radius",
        "revision",
        "solid",
        "swept_radius",
        "vertices",
        "volume",
    )

    vertices: NDArray[np.float64]
    """(n, 3) metres, model frame; read-only. `refit` puts another array in its place."""
    faces: NDArray[np.int32]
    """(m, 3) indices of vertices; read-only."""
    centre: NDArray[np.float64]
    """(3,) metres, model frame: centre of a sphere that holds every used vertex."""
    core_radius: float
    """Metres: radius of that sphere, rounding included."""
    radius: float
    """Metres: radius of a sphere around `centre` that holds all the model stands for."""
    swept_radius: float
    """Metres: the ball that sweeps the triangles."""
    deviation: float
    """Metres: how far the surface may be from that of the thing it stands for."""
    revision: int
    """How often `refit` moved the vertices: what was computed before is outdated."""
    volume: str
    """The kind of bounding volume."""
    solid: Solid
    """What was asked for; `is_solid` is what it is."""

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        name: str = "mesh",
        radius: float = 0.0,
        deviation: float = 0.0,
        volume: str = "rss",
        solid: Solid = None,
    ) -> None:
        if volume not in VOLUMES:
            known = ", ".join(VOLUMES)
            raise ModelError(f"{name}: volume = {volume!r}: unknown; choose one of {known}")
        if not (solid is None or isinstance(solid, bool) or solid == "robust"):
            raise ModelError(f"{name}: solid = {solid!r}: must be True, False, 'robust' or None")
        self.name = name
        self.volume = volume
        self.swept_radius = _checked_length(radius, name, "radius")
        self.deviation = _checked_length(deviation, name, "deviation")
        self.solid = solid
        self.vertices = _checked_vertices(vertices, name)
        self.faces = _checked_faces(faces, len(self.vertices), name)
        corners = np.ascontiguousarray(self.vertices[self.faces].reshape(-1, 9))
        tree, distinct, self._face_of, self.depth, self._coincident = build(
            corners, self.vertices, self.faces, volume, self.swept_radius, self.deviation
        )
        self._take(self.vertices, _bounding_sphere(corners), (tree, distinct))
        self._node_ranges: NDArray[np.int32] | None = None
        self._spread: NDArray[np.int32] | None = None
        self._check_solid()

    def refit(self, vertices: ArrayLike) -> None:
        """Move the vertices: the same faces, and a hierarchy of the same structure, fitted anew.

        Far cheaper than a new mesh. Answers are as right as from a new mesh; they come as fast
        while triangles that were neighbours stay neighbours, as in a body that bends. Every `Pair`
        of this mesh sees the new shape from its next question on, and the nearest triangles that it
        remembers stay useful. No search over this mesh may run in another thread meanwhile.

        Args:
            vertices: (n, 3) metres, model frame; as many as there are. The array is copied.

        Raises:
            ModelError: wrong shape, another number of vertices, a vertex that is not finite or
                beyond 1e45 m; no solid any more though it must be one. The mesh is then as it was.
        """
        moved = _checked_vertices(vertices, self.name)
        if len(moved) != len(self.vertices):
            raise ModelError(
                f"{self.name}: vertices: {len(moved)} given, but the faces are over "
                f"{len(self.vertices)}; build a new TriangleMesh for another topology"
            )
        faces = self.faces.take(self._face_of, axis=0)
        corners = moved.take(faces, axis=0).reshape(-1, 9)
        sphere = _bounding_sphere(corners)
        tree, distinct = refit(self._tree, self._coincident, corners, moved, faces, self.volume)
        before = self.vertices, (self.centre, self.core_radius), (self._tree, self._distinct)
        self._take(moved, sphere, (tree, distinct))
        try:
            self._check_solid()
        except ModelError:
            self._take(*before)
            raise
        self._spread = None

    @property
    def is_solid(self) -> bool:
        """Whether it has an inside, of which `signed_distance` knows."""
        swept = self.swept_radius > 0.0 and self.solid is not False  # known without a look
        return swept or not self.not_solid

    @property
    def not_solid(self) -> str:
        """Why it has no inside, in words that follow its name; empty where it has one."""
        return sides_of(self).reason

    def _check_solid(self) -> None:
        """Raise ModelError where it must be a solid and is none."""
        if self.solid is True and self.not_solid:
            raise ModelError(f"{self.name}: no solid: {self.not_solid}; {_WAY_OUT}")

    def tessellated(self) -> TriangleMesh:
        """A mesh of the surface that nothing sweeps: this one, where nothing does.

        Its corners lie on the surface and its faces inside, so it is there to be drawn, not to be
        measured. Where there are many points it is a rough one.
        """
        if self.swept_radius == 0.0:
            return self
        surface = tessellated(self.vertices, self.faces, self.swept_radius)
        return TriangleMesh(*surface, name=self.name, volume=self.volume)

    def _take(
        self,
        vertices: NDArray[np.float64],
        sphere: tuple[NDArray[np.float64], float],
        trees: tuple[Tree, Tree],
    ) -> None:
        """Take vertices, the centre and radius of the sphere around them, and the hierarchies."""
        self.vertices = vertices
        self.centre, self.core_radius = sphere
        radius = self.core_radius + self.swept_radius + self.deviation
        self.radius = radius * (1.0 + 4.0 * DOUBLE_EPS)
        self._keep(*trees)

    def _keep(self, tree: Tree, distinct: Tree) -> None:
        """Take a hierarchy, and make the tables by which kernels find it.

        Who looks for the nearest needs one of those triangles that lie on each other (`_table`);
        who lists or counts them needs all (`_table_of_all`, and `_tree` itself).
        """
        # The new tables are there before the old arrays are gone: Ctrl-C may come at any moment.
        addresses = addresses_of_all = table((*tree, self._face_of))
        if distinct is not tree:
            addresses = table((*distinct, self._face_of))
        self._tree, self._distinct = tree, distinct
        self.revision = int(tree.scale[4])
        self._table, self._table_of_all = addresses, addresses_of_all

    def _ranges(self) -> NDArray[np.int32]:
        """Which triangles, in tree order, stand under each node (k, 2); made when first needed."""
        if self._node_ranges is None:
            self._node_ranges = node_ranges(self._tree.children)
        return self._node_ranges

    def _spread_corners(self) -> NDArray[np.int32]:
        """A few vertices of each node, far apart (k, 4); made when first needed."""
        if self._spread is None:
            self._spread = spread_corners(self._tree.triangles, self._tree.children)
        return self._spread

    def __getstate__(self) -> dict[str, Any]:
        """Everything but addresses, and for which kernels the hierarchy was built."""
        left_out = ("__weakref__", "_table", "_table_of_all")
        kept = (name for name in self.__slots__ if name not in left_out)
        return {"kernels": KERNELS, **{name: getattr(self, name) for name in kept}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Freeze what pickle thawed: of other arrays the kernels would be compiled once more.

        Raises:
            ModelError: another version pickled it, whose hierarchies are other ones.
        """
        if state.pop("kernels") != KERNELS:
            raise ModelError(
                f"{state['name']}: pickled by another version of proximity_monitor; make it anew "
                "from its file, or from vertices and faces"
            )
        for name, value in state.items():
            setattr(self, name, value)
        for array in (self.vertices, self.faces, self.centre, *self._tree, *self._distinct):
            array.setflags(write=False)
        self._keep(self._tree, self._distinct)  # which lie elsewhere now

    def __repr__(self) -> str:
        """Name and size."""
        size = f"{len(self.vertices)} vertices, {len(self.faces)} faces"
        return f"TriangleMesh({self.name!r}, {size})"


def _checked_vertices(vertices: ArrayLike, name: str) -> NDArray[np.float64]:
    array = as_reals(vertices, f"{name}: vertices", error=ModelError).copy()
    if array.ndim != 2 or array.shape[1] != 3:
        raise ModelError(f"{name}: vertices: shape {array.shape}, expected (n, 3)")
    if len(array) == 0:
        raise ModelError(f"{name}: vertices: there are none")
    bad = ~(np.abs(array) <= LARGEST_COORDINATE).all(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise ModelError(
            f"{name}: vertices[{first}] = {array[first].tolist()}: every coordinate must be finite "
            f"and at most {LARGEST_COORDINATE:g} m ({int(bad.sum())} such vertices)"
        )
    array.setflags(write=False)
    return array


def _checked_length(value: float, name: str, what: str) -> float:
    try:
        length = as_real(value, what)
    except TypeError:
        length = math.nan
    if not 0.0 <= length <= LARGEST_COORDINATE:
        raise ModelError(
            f"{name}: {what} = {value!r}: must be a number of metres from 0 to "
            f"{LARGEST_COORDINATE:g}"
        )
    return length


def _checked_faces(faces: ArrayLike, vertex_count: int, name: str) -> NDArray[np.int32]:
    try:
        given = np.asarray(faces)
    except ValueError as error:
        raise ModelError(f"{name}: faces: not an array: {error}") from None
    if given.size == 0:
        raise ModelError(f"{name}: faces: there are none; a model needs at least one triangle")
    if given.ndim != 2 or given.shape[1] != 3:
        raise ModelError(f"{name}: faces: shape {given.shape}, expected (m, 3)")
    if given.dtype.kind not in "iu":
        raise ModelError(f"{name}: faces: dtype {given.dtype}, expected integers")
    bad = ((given < 0) | (given >= vertex_count)).any(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise ModelError(
            f"{name}: faces[{first}] = {given[first].tolist()}: names no vertex; there are "
            f"{vertex_count}, numbered from 0 ({int(bad.sum())} such faces)"
        )
    array = np.array(given, dtype=np.int32, order="C")
    array.setflags(write=False)
    return array


def _bounding_sphere(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre of the bounding box and the largest distance from it, rounded up."""
    centre = np.empty(3)
    radius, _, _ = measure(corners, centre)
    centre.setflags(write=False)
    rounding = 8.0 * DOUBLE_EPS * (radius + float(np.abs(centre).sum()))
    return centre, radius + rounding


def points(
    coordinates: ArrayLike, *, radius: float = 0.0, name: str = "points", volume: str = "rss"
) -> TriangleMesh:
    """Points, or with a radius spheres, as a model: each is a degenerate triangle.

    Args:
        coordinates: (n, 3) metres, model frame; n >= 1.
        radius: metres; of the spheres around them.
        name: what messages call it.
        volume: the bounding volumes, as for TriangleMesh.

    Raises:
        ModelError: as for TriangleMesh.
    """
    array = _checked_vertices(coordinates, name)
    index = np.arange(len(array), dtype=np.int32)
    faces = np.stack((index, index, index), axis=1)
    return TriangleMesh(array, faces, name=name, radius=radius, volume=volume)


def polyline(
    coordinates: ArrayLike, *, radius: float = 0.0, name: str = "polyline", volume: str = "rss"
) -> TriangleMesh:
    """A polyline, or with a radius a chain of capsules, as a model of degenerate triangles.

    Args:
        coordinates: (n, 3) metres, model frame; n >= 2; repeat the first point to close it.
        radius: metres; of the capsules.
        name: what messages call it.
        volume: the bounding volumes, as for TriangleMesh.

    Raises:
        ModelError: fewer than two points; else as for TriangleMesh.
    """
    array = _checked_vertices(coordinates, name)
    if len(array) < 2:
        raise ModelError(f"{name}: a polyline needs at least two points, got {len(array)}")
    index = np.arange(len(array) - 1, dtype=np.int32)
    faces = np.stack((index, index + 1, index + 1), axis=1)
    return TriangleMesh(array, faces, name=name, radius=radius, volume=volume)
