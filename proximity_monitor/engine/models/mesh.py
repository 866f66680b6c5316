"""Triangle meshes."""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import check_tolerance
from ..kernels.base.cache import KERNELS
from .checks import ModelError, checked_faces, checked_length, checked_vertices
from .hierarchy import Solid
from .mesh_hierarchy import MeshHierarchy
from .model import DisplayMesh, Feature, Model
from .tessellate import tessellated
from .tree import VOLUMES

_WAY_OUT = (
    "repair it (close holes, orient faces consistently), or set solid='robust', which bridges "
    "holes, or solid=False, which makes it a surface"
)
_LIES_ON = ("vertex", "edge", "face")
"""What a point lies on, by the number of its barycentric weights that are not 0, less one."""


class TriangleMesh(Model):
    """A triangle mesh with its bounding volume hierarchy, ready for queries.

    The arrays are copied, checked and made read-only. Degenerate triangles (segments, points) are
    kept and take part like any others. The kind of bounding volume changes no answer, only the time
    it takes.

    Args:
        vertices: (n, 3) metres, model frame.
        faces: (m, 3) integers, indices of vertices; m >= 1.
        name: what messages call this mesh.
        radius: metres; radius of a ball that sweeps the triangles. The model is then all points
            within this radius of them: a point is exactly a sphere, a segment a capsule.
        deviation: metres; how far the surface may be from that of the part it stands for, as in a
            tessellation. Every bound is widened by it.
        volume: the kind of bounding volume, for the study of hierarchies. The default suits nearly
            every use. "rss", "lss" or "pss": rectangle, line or point swept spheres. "hybrid": in
            each node the one that its dimensions suggest (Larsen et al. 1999, section 4.2). For
            comparison "obb" or "aabb": boxes along the principal axes of what they hold, or along
            those of the model frame, with distances by GJK (Johnson and Cohen 1997, section 3.1.1).
        solid: whether the mesh has an inside, where `signed_distance` is negative. None: it has one
            if it encloses one; this is found out when first needed, in some 15 ms for 100,000
            triangles. True: it must enclose one, which is checked here and at every `deform`.
            False: it is a surface, whatever it encloses. "robust": if it encloses nothing because
            faces are missing or turned, its inside is where its generalised winding number is above
            one half or below minus one half (Jacobson et al. 2013), within the sphere of radius
            `core_radius` around `centre` and within the axis-aligned box, in the model frame,
            around all corners of its faces.

    Raises:
        ModelError: an array has a wrong shape; there are no faces; a vertex is not finite or beyond
            1e45 m; a face names no vertex; a radius or deviation is no number from 0 to 1e45 m;
            `volume` or `solid` is unknown; the mesh must be a solid and is none. The message says
            which.
    """

    __slots__ = ("_hierarchy", "name")

    kind = "mesh"
    control_name = "vertices"

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
        radius = checked_length(radius, name, "radius")
        deviation = checked_length(deviation, name, "deviation")
        points = checked_vertices(vertices, name)
        self._take(MeshHierarchy.of(
            points, checked_faces(faces, len(points), name),
            volume=volume, swept_radius=radius, deviation=deviation, solid=solid,
        ))  # fmt: skip

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(n, 3) metres, model frame; read-only. `deform` replaces the array."""
        return self._hierarchy.vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """(m, 3) indices of vertices; read-only."""
        return self._hierarchy.faces

    @property
    def core_radius(self) -> float:
        """Metres: radius of a sphere around `centre` that holds every used vertex."""
        return self._hierarchy.core_radius

    @property
    def swept_radius(self) -> float:
        """Metres: radius of the ball that sweeps the triangles."""
        return self._hierarchy.swept_radius

    @property
    def volume(self) -> str:
        """The kind of bounding volume."""
        return self._hierarchy.volume

    @property
    def depth(self) -> int:
        """The number of levels of the hierarchy."""
        return self._hierarchy.depth

    @property
    def solid(self) -> Solid:
        """The argument `solid`; `is_solid` tells what the mesh is."""
        return self._hierarchy.solid

    @property
    def control_points(self) -> NDArray[np.float64]:
        """The vertices (n, 3), metres, model frame; read-only."""
        return self.vertices

    def deform(self, points: ArrayLike) -> float:
        """Move the vertices to points (n, 3), metres, model frame; the faces stay.

        The hierarchy keeps its structure, which is far cheaper than a new mesh. Answers are as
        exact as those of a new mesh. They are as fast if triangles that were neighbours stay
        neighbours, as in a body that bends. The nearest triangles that a `Pair` remembers stay
        useful. For the result and the errors see `Model.deform`.
        """
        moved, before = checked_vertices(points, self.name), self.vertices
        if len(moved) != len(before):
            raise ModelError(
                f"{self.name}: vertices: {len(moved)} given, expected {len(before)}; to change the "
                "topology, build a new TriangleMesh"
            )
        self._take(self._hierarchy.refitted(moved))
        # The motion of a point of a face is a mean of the motions of the face's corners.
        return largest_norm(moved - before)

    def _take(self, hierarchy: MeshHierarchy) -> None:
        """Adopt a hierarchy; raise ModelError if the mesh must be a solid and is none."""
        if hierarchy.solid is True and (reason := hierarchy.sides().reason):
            raise ModelError(f"{self.name}: not a solid: {reason}; {_WAY_OUT}")
        self._hierarchy = hierarchy

    def display_mesh(self, tolerance: float) -> DisplayMesh:
        """Return the mesh's own triangles or, if a ball sweeps them, a tessellation of the surface.

        The corners of the tessellation lie on the surface and its faces inside. It is coarser than
        the tolerance if there are many balls: it has some 60,000 triangles at most.
        """
        tolerance = check_tolerance("tolerance", tolerance)
        if not self.swept_radius > 0.0:
            return DisplayMesh(self.vertices, self.faces, off=0.0)
        *shown, within = tessellated(self.vertices, self.faces, self.swept_radius, tolerance)
        # An upper bound of the rounding of the corners.
        rounding = 1e-14 * (self.radius + float(np.abs(self.centre).max()))
        return DisplayMesh(*shown, off=self.swept_radius - within + rounding)

    @staticmethod
    def feature(element: int, parameters: NDArray[np.float64]) -> Feature:
        """Return the triangle, and barycentric weights (3,), not negative, whose sum is 1."""
        return Feature(_LIES_ON[int(np.count_nonzero(parameters)) - 1], element, parameters)

    def digest(self) -> str:
        """Return a checksum, 16 hexadecimal digits.

        It covers the triangles, the swept radius, the deviation and `solid` as given.
        """
        found = hashlib.blake2b(self.kind.encode(), digest_size=8)
        found.update(struct.pack("<2d", self.swept_radius, self.deviation))
        found.update(repr(self._hierarchy.solid).encode())
        for array in (self.vertices, self.faces):
            found.update(struct.pack("<q", len(array)))
            found.update(array)
        return found.hexdigest()

    def describe(self, length: Callable[[float], str]) -> str:
        """Return the number of triangles, or of spheres, capsules or swept triangles, as text."""
        count = len(self.faces)
        what = "triangle"
        if self.swept_radius > 0.0:
            corners = max(len(set(face)) for face in self.faces[:2].tolist())
            what = {1: "sphere", 2: "capsule"}.get(corners, "swept triangle")
        many = f"{count} {what}s" if count > 1 else what if self.swept_radius else f"1 {what}"
        return f"{many} of radius {length(self.swept_radius)}" if self.swept_radius else many

    def __getstate__(self) -> dict[str, Any]:
        """Return all but addresses, with the version of the kernels that built the hierarchy."""
        return {"kernels": KERNELS, "name": self.name, "hierarchy": self._hierarchy.__getstate__()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the mesh from a pickle.

        Raises:
            ModelError: another version pickled it, whose hierarchies may differ.
        """
        if state["kernels"] != KERNELS:
            raise ModelError(
                f"{state['name']}: pickled by another version of proximity_monitor; make it again "
                "from its file, or from vertices and faces"
            )
        self.name = state["name"]
        self._hierarchy = MeshHierarchy.__new__(MeshHierarchy)
        self._hierarchy.__setstate__(state["hierarchy"])

    def __repr__(self) -> str:
        """Return name and size."""
        size = f"{len(self.vertices)} vertices, {len(self.faces)} faces"
        return f"TriangleMesh({self.name!r}, {size})"


def largest_norm(vectors: NDArray[np.float64]) -> float:
    """Return the largest length of vectors (n, 3) that are rounded differences, rounded up.

    The vectors are scaled by a power of two, which is exact: no square overflows, and none that
    matters underflows. The differences, squares, sums, root and product err by less than 4 u of
    the length in all, u = eps / 2. The last step up covers a result too small to be exact.
    """
    largest = float(np.abs(vectors).max(initial=0.0))
    if largest == 0.0:
        return 0.0
    exponent = min(max(math.frexp(largest)[1], -1000), 1000)
    squares = ((vectors * math.ldexp(1.0, -exponent)) ** 2).sum(axis=1)
    length = math.sqrt(float(squares.max())) * (1.0 + 4.0 * np.finfo(np.float64).eps)
    return math.nextafter(math.ldexp(length, exponent), math.inf)
