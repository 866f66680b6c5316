"""The protocol of all kinds of models: everything that code outside of the engine may use."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .tree import weld

if TYPE_CHECKING:
    from .hierarchy import Hierarchy


@dataclass(frozen=True, slots=True)
class Feature:
    """Where a point lies on a model.

    Attributes:
        kind: what the point lies on, in the words of the model's kind: "vertex", "edge" or "face"
            of a mesh, "patch" or "curve" of a surface, "profile" of a solid of revolution.
        index: the number of the element of the model: a mesh's triangle, a patch, a profile curve.
        parameters: where on the element the point lies: (3,) barycentric weights of a triangle's
            corners; (2,) u and v of a patch; (1,) the parameter of a curve; (2,) t and theta, in
            radians, of the curve of a solid of revolution. If a patch is torn at a knot, points on
            both sides of the tear have the knot as parameter, which evaluates to one side only.
    """

    kind: str
    index: int
    parameters: NDArray[np.float64]


class DisplayMesh(NamedTuple):
    """Triangles that show a model."""

    vertices: NDArray[np.float64]
    """(n, 3) metres, model frame."""
    faces: NDArray[np.int32]
    """(m, 3) indices of vertices; seen from outside, corners are counter-clockwise."""
    normals: NDArray[np.float64] | None = None
    """(n, 3) unit normals of the surface at the vertices; None: each face is flat."""
    off: float = math.inf
    """Metres: no point of the triangles is farther from the surface than this, and no point of the
    surface is farther from the triangles; inf: unknown."""

    def corners(self) -> NDArray[np.float64]:
        """Return the corners of the faces (m, 3, 3), metres, model frame."""
        return self.vertices[self.faces]

    def corner_normals(self) -> NDArray[np.float64] | None:
        """Return unit normals of the surface at the faces' corners (m, 3, 3); None: all flat."""
        return None if self.normals is None else self.normals[self.faces]

    def welded(self) -> NDArray[np.int32]:
        """Return the faces (m, 3), with equal vertices replaced by the first of them.

        So the triangles of a soup, as in STL files, have neighbours too.
        """
        return weld(self.vertices)[self.faces]


class Model(ABC):
    """A shape whose distances can be asked for: the protocol of all kinds of models.

    A kind is a class with the methods below and a hierarchy. It may use the hierarchy of a model
    that it contains. A reader in `files`, or one that a package registers, makes a model from a
    file (see docs/models.md).

    Attributes:
        kind: how the model is stored: "mesh", "surface" or "solid of revolution".
        control_name: what `control_points` are called: "vertices" or "control points".
        name: what messages call this model.
    """

    __slots__ = ("__weakref__",)

    kind: ClassVar[str]
    control_name: ClassVar[str] = "control points"
    name: str

    _hierarchy: Hierarchy
    """What the kernels search; replaced by each `deform`. Only the engine uses it."""

    @property
    @abstractmethod
    def control_points(self) -> NDArray[np.float64]:
        """The points (n, 3) that `deform` moves, metres, model frame; read-only.

        A mesh's vertices, a surface's control points.
        """

    @abstractmethod
    def deform(self, points: ArrayLike) -> float:
        """Move the control points.

        Every `Pair` of this model sees the new shape from its next question on. No other thread may
        search the model meanwhile.

        Args:
            points: (n, 3) metres, model frame; as many as `control_points`. The array is copied.

        Returns:
            Metres, rounded up: no point of the model moved farther than this, so no distance
            changed by more.

        Raises:
            ModelError: the shape or the number of points is wrong; a point is not finite or beyond
                1e45 m; the model must be a solid and would be none. The model is unchanged then.
        """

    @abstractmethod
    def display_mesh(self, tolerance: float) -> DisplayMesh:
        """Return triangles that show the model.

        Args:
            tolerance: metres; no point of the triangles should be farther from the surface. Flat
                parts are exact. 0 asks for the finest triangles that the kind makes.

        Raises:
            TypeError: the tolerance is no real number.
            ValueError: the tolerance is negative or NaN.
        """

    @staticmethod
    @abstractmethod
    def feature(element: int, parameters: NDArray[np.float64]) -> Feature:
        """Return where a point of an answer lies.

        Args:
            element: the number of the element of the model, as in the answer.
            parameters: (3,) where on the element, as in the answer; unused ones are 0.
        """

    @abstractmethod
    def digest(self) -> str:
        """Return a checksum that tells this shape from others; the name does not count."""

    @abstractmethod
    def describe(self, length: Callable[[float], str]) -> str:
        """Return what the model is made of, for people.

        Examples are ``12 triangles`` and ``sphere of radius 50 mm``.

        Args:
            length: a function that formats a length in metres.
        """

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: centre of a sphere that holds the model."""
        return self._hierarchy.centre

    @property
    def radius(self) -> float:
        """Metres: radius of a sphere around `centre` that holds all that the model stands for."""
        return self._hierarchy.radius

    @property
    def deviation(self) -> float:
        """Metres: how far the surface may be from that of the part it stands for."""
        return self._hierarchy.deviation

    @property
    def revision(self) -> int:
        """How often the model was deformed. Results for an earlier revision are outdated."""
        return self._hierarchy.revision

    @property
    def is_solid(self) -> bool:
        """Whether the model has an inside, where `signed_distance` is negative."""
        return self._hierarchy.is_solid

    @property
    def not_solid(self) -> str:
        """Why the model has no inside, as text to follow its name; empty if it has one."""
        return self._hierarchy.sides().reason

    @property
    def has_area(self) -> bool:
        """Whether any element has an area; points and lines alone can never enclose anything."""
        return self._hierarchy.sides().proper

    def __repr__(self) -> str:
        """Return class, name and what the model is made of."""
        return f"{type(self).__name__}({self.name!r}, {self.describe('{:g} m'.format)})"
