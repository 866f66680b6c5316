"""What is known of every model, whatever its kind: all that other rooms than the engine may use."""

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
        kind: what it lies on, in words of the model's kind; of a mesh "vertex", "edge" or "face",
            of a surface "patch" or "curve".
        index: which element of the model: a mesh's triangle, a patch, a profile curve.
        parameters: where on it: (3,) barycentric weights of a triangle's corners; (2,) u and v of a
            patch; (1,) that of a curve; t and theta of a curve that is revolved. Where a patch is
            torn apart at a knot, that of either side is the knot, which evaluates to one of them.
    """

    kind: str
    index: int
    parameters: NDArray[np.float64]


class DisplayMesh(NamedTuple):
    """Triangles that look like a model."""

    vertices: NDArray[np.float64]
    """(n, 3) metres, model frame."""
    faces: NDArray[np.int32]
    """(m, 3) indices of vertices; outward faces have their corners counter-clockwise."""
    normals: NDArray[np.float64] | None = None
    """(n, 3) unit normals of the surface at the vertices; None: each face is flat."""
    off: float = math.inf
    """Metres: no point of the triangles is farther from the surface, and none of the surface from
    them; inf: it is not known."""

    def corners(self) -> NDArray[np.float64]:
        """The corners of the faces (m, 3, 3), metres."""
        return self.vertices[self.faces]

    def corner_normals(self) -> NDArray[np.float64] | None:
        """The surface's unit normals at the corners of the faces (m, 3, 3); None: each is flat."""
        return None if self.normals is None else self.normals[self.faces]

    def welded(self) -> NDArray[np.int32]:
        """The faces (m, 3), where vertices of equal coordinates have the first one's number.

        So a soup of triangles, as STL files hold it, has neighbours too.
        """
        return weld(self.vertices)[self.faces]


class Model(ABC):
    """A shape that can be asked about: the protocol of all kinds of models.

    A kind is a class with the methods below and a hierarchy. It may take its hierarchy from a model
    that it consists of, as a ball does from `points`. A reader in `files`, or one that a package
    registers, makes it from a file (see docs/models.md).

    Attributes:
        kind: what the kind is called.
        control_name: what the points that give it its shape are called.
        name: what messages call this model.
    """

    __slots__ = ("__weakref__",)

    kind: ClassVar[str]
    control_name: ClassVar[str] = "control points"
    name: str

    _hierarchy: Hierarchy
    """What the kernels search; another one after each `deform`. Nobody but the engine uses it."""

    @property
    @abstractmethod
    def control_points(self) -> NDArray[np.float64]:
        """The points (n, 3) that `deform` moves, metres, model frame; read-only.

        A mesh's vertices, a surface's control points.
        """

    @abstractmethod
    def deform(self, points: ArrayLike) -> float:
        """Move the control points.

        Every `Pair` of this model sees the new shape from its next question on. No search over it
        may run in another thread meanwhile.

        Args:
            points: (n, 3) metres, model frame; as many as there are. The array is copied.

        Returns:
            Metres, rounded up: no point of the model moved farther, so no distance changed by more.

        Raises:
            ModelError: wrong shape, another number of points, one that is not finite or beyond
                1e45 m; no solid any more though it must be one. The model is then as it was.
        """

    @abstractmethod
    def display_mesh(self, tolerance: float) -> DisplayMesh:
        """Triangles to show.

        Args:
            tolerance: metres; no point of them should be farther from the surface. What is flat is
                exact. 0 asks for the finest there is.
        """

    @staticmethod
    @abstractmethod
    def feature(element: int, parameters: NDArray[np.float64]) -> Feature:
        """Where a point of an answer lies.

        Args:
            element: which element of the model a search found, as answers have it.
            parameters: (3,) where on it; what a kind does not need is 0.
        """

    @abstractmethod
    def digest(self) -> str:
        """Tells this shape from others: of all that makes it up, its name left out."""

    @abstractmethod
    def describe(self, length: Callable[[float], str]) -> str:
        """What it is made of, for people: ``12 triangles``, ``sphere of radius 50 mm``.

        Args:
            length: a length in metres as text.
        """

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) metres, model frame: centre of a sphere that holds the model."""
        return self._hierarchy.centre

    @property
    def radius(self) -> float:
        """Metres: radius of a sphere around `centre` that holds all the model stands for."""
        return self._hierarchy.radius

    @property
    def deviation(self) -> float:
        """Metres: how far the surface may be from that of the thing it stands for."""
        return self._hierarchy.deviation

    @property
    def revision(self) -> int:
        """How often it was deformed: what was computed before is outdated."""
        return self._hierarchy.revision

    @property
    def is_solid(self) -> bool:
        """Whether it has an inside, of which `signed_distance` knows."""
        return self._hierarchy.is_solid

    @property
    def not_solid(self) -> str:
        """Why it has no inside, in words that follow its name; empty where it has one."""
        return self._hierarchy.sides().reason

    @property
    def has_area(self) -> bool:
        """Whether any of it is a surface; points and lines could hold nothing in any case."""
        return self._hierarchy.sides().proper

    def __repr__(self) -> str:
        """Kind, name and what it is made of."""
        return f"{type(self).__name__}({self.name!r}, {self.describe('{:g} m'.format)})"
