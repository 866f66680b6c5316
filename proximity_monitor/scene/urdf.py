"""Reads robot descriptions in URDF: links with their shapes, and the joints between them.

Only joints and shapes are read. Masses, materials, transmissions and the additions of other
programs are skipped, so a mistake there is no error. Mesh files are named, but not opened.

The format is in metres and radians (http://wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

import numpy as np

from proximity_monitor.scene import markup
from proximity_monitor.scene.description import Box, Capsule, Cylinder, Primitive, Sphere
from proximity_monitor.scene.kinematics import Joint, Kinematics, KinematicsError, Mimic
from proximity_monitor.scene.markup import NO_ARGUMENTS, MarkupError
from proximity_monitor.scene.poses import matrix_rpy, pose_matrix, rpy_matrix
from proximity_monitor.scene.report import meant, shown
from proximity_monitor.scene.schema import bounds

_VERSIONS = ("1", "1.0", "1.1", "1.2")
_PLACE = ("xyz", "rpy", "quat_xyzw")
"""The attributes of an origin."""
_KINDS = ("fixed", "revolute", "continuous", "prismatic")
# Metres or radians. Beyond this, the rounding of float64 exceeds a robot's clearances, and products
# of such numbers could overflow.
_, _LARGEST = bounds("coordinate")
_Vector = tuple[float, float, float]


class UrdfError(ValueError):
    """A robot description cannot be used; the message starts with its path or topic."""


@dataclass(frozen=True)
class Shape:
    """One `collision` or `visual` element of a link."""

    geometry: str | Primitive
    """A mesh file as the description names it, or a primitive in metres."""
    scale: _Vector
    """Factors on a mesh along its own axes; a negative factor mirrors it."""
    xyz: _Vector
    """Its origin in the link's frame, metres."""
    rpy: _Vector
    """Its orientation in the link's frame: turns about the fixed x, y and z axes in this order,
    radians."""


@dataclass(frozen=True)
class Link:
    """A rigid part of a robot."""

    name: str
    collision: tuple[Shape, ...]
    visual: tuple[Shape, ...]


@dataclass(frozen=True)
class Urdf:
    """A robot according to its description."""

    path: Path
    """The file, which need not exist; relative mesh paths start from its folder."""
    links: tuple[Link, ...]
    kinematics: Kinematics


def read_urdf(path: Path, arguments: Mapping[str, str] = NO_ARGUMENTS) -> Urdf:
    """Read a robot description; its meshes are not opened.

    Args:
        path: a name that ends in .xacro means a xacro file.
        arguments: of the xacro file, by name.

    Raises:
        UrdfError: the file is not readable or no robot description, a value is missing or makes no
            sense, a joint is of a kind without a single position (`floating`, `planar`), or the
            links form no tree. The message says where and what.
    """
    try:
        root = markup.read(path, arguments)
    except MarkupError as error:
        raise UrdfError(f"{path}: the file: {error}") from None
    return _Reader(root, str(path), path).robot()


def parse_urdf(text: str, name: str, folder: Path) -> Urdf:
    """Read a robot description from its text.

    Args:
        text: the description.
        name: how messages call the description.
        folder: where meshes with a relative path are found.

    Raises:
        UrdfError: as `read_urdf`.
    """
    try:
        root = markup.parse(text)
    except MarkupError as error:
        raise UrdfError(f"{name}: the text: {error}") from None
    return _Reader(root, name, folder / "robot_description").robot()


class _Reader:
    def __init__(self, root: Element, name: str, path: Path) -> None:
        self._root, self._name, self._path = root, name, path
        if root.tag != "robot":
            self._fail(f"<{root.tag}>", "a robot description begins with <robot>")
        if (version := root.get("version", "1.0")) not in _VERSIONS:
            known = ", ".join(_VERSIONS[1:])
            self._fail("<robot>", f"version {shown(version)} is not supported; known: {known}")
        if _has_macros(root):
            self._fail(
                "the file",
                "contains xacro macros; rename it to end in .xacro, or expand them first: "
                "xacro IN.xacro > OUT.urdf",
            )

    def robot(self) -> Urdf:
        links = tuple(self._link(element) for element in self._root.findall("link"))
        joints = [self._joint(element) for element in self._root.findall("joint")]
        if not links:
            self._fail("<robot>", "has no link")
        try:
            kinematics = Kinematics([link.name for link in links], joints)
        except KinematicsError as error:
            raise UrdfError(f"{self._name}: {error}") from None
        return Urdf(self._path, links, kinematics)

    def _link(self, element: Element) -> Link:
        name = self._text(element, "name", "a link")
        at = f"link '{name}'"
        return Link(
            name,
            tuple(self._shapes(element, "collision", at)),
            tuple(self._shapes(element, "visual", at)),
        )

    def _shapes(self, link: Element, tag: str, at: str) -> Iterator[Shape]:
        for element in link.findall(tag):
            here = f"{at}, <{tag}>"
            geometry = self._child(element, "geometry", here)
            if len(geometry) != 1:
                self._fail(here, f"<geometry> must hold one shape (got {len(geometry)})")
            scale = (1.0, 1.0, 1.0)
            shape: str | Primitive
            kind, here = geometry[0], f"{here}, <{geometry[0].tag}>"
            if kind.tag == "mesh":
                shape = self._text(kind, "filename", here)
                scale = self._vector(kind, "scale", here, scale)
                if not all(scale):
                    self._fail(here, f"scale must not be 0 (got {kind.get('scale')!r})")
            elif kind.tag == "box":
                shape = Box(self._vector(kind, "size", here))
                self._positive(here, *shape.size)
            elif kind.tag == "cylinder":
                sizes = self._number(kind, "radius", here), self._number(kind, "length", here)
                self._positive(here, *sizes)
                shape = Cylinder(*sizes)
            elif kind.tag == "sphere":
                shape = Sphere(self._number(kind, "radius", here))
                self._positive(here, shape.radius)
            elif kind.tag == "capsule":
                sizes = self._number(kind, "radius", here), self._number(kind, "length", here)
                self._positive(here, *sizes)
                shape = Capsule(*sizes)
            else:
                self._fail(here, "unknown shape; known: mesh, box, cylinder, sphere, capsule")
            yield Shape(shape, scale, *self._origin(element, here))

    def _joint(self, element: Element) -> Joint:
        name = self._text(element, "name", "a joint")
        at = f"joint '{name}'"
        kind = self._text(element, "type", at)
        if kind not in _KINDS:
            self._fail(at, f"type must be {', '.join(_KINDS[:-1])} or {_KINDS[-1]} (got {kind!r})")
        parent, child = (
            self._text(self._child(element, tag, at), "link", f"{at}, <{tag}>")
            for tag in ("parent", "child")
        )
        xyz, rpy = self._origin(element, at)
        origin = np.eye(4)
        origin[:3, :3], origin[:3, 3] = rpy_matrix(rpy), xyz
        axis, lower, upper, mimic = (1.0, 0.0, 0.0), -math.inf, math.inf, None
        if kind != "fixed":
            if (found := element.find("axis")) is not None:
                axis = self._vector(found, "xyz", f"{at}, <axis>")
            if not any(axis):
                self._fail(f"{at}, <axis>", f"must be a direction (got {axis})")
            if kind != "continuous" and (found := element.find("limit")) is not None:
                here = f"{at}, <limit>"
                lower, upper = (
                    self._number(found, key, here, 0.0, most=math.inf) for key in ("lower", "upper")
                )
                if lower > upper:
                    self._fail(here, f"lower must not exceed upper (got {lower:g} and {upper:g})")
            if (found := element.find("mimic")) is not None:
                here = f"{at}, <mimic>"
                mimic = Mimic(
                    self._text(found, "joint", here),
                    self._number(found, "multiplier", here, 1.0),
                    self._number(found, "offset", here, 0.0),
                )
        return Joint(name, kind, parent, child, origin, axis, lower, upper, mimic)

    def _origin(self, element: Element, at: str) -> tuple[_Vector, _Vector]:
        found = element.find("origin")
        if found is None:
            found = Element("origin")
        here, zero = f"{at}, <origin>", (0.0, 0.0, 0.0)
        # An attribute with a colon belongs to another program.
        for key in found.attrib:
            if key not in _PLACE and ":" not in key:
                self._fail(here, f"unknown attribute '{key}'{meant(key, _PLACE)}")
        xyz = self._vector(found, "xyz", here, zero)
        if found.get("quat_xyzw") is None:
            return xyz, self._vector(found, "rpy", here, zero)
        if found.get("rpy") is not None:
            self._fail(here, "can have only one of rpy, quat_xyzw")
        quaternion = self._numbers(found, "quat_xyzw", here, 4, None)
        length = math.hypot(*quaternion)
        if length < sys.float_info.min:
            self._fail(here, "quat_xyzw must not be 0")
        turn = pose_matrix(xyz, [part / length for part in quaternion])  # as urdfdom does
        return xyz, matrix_rpy(turn[:3, :3])

    def _child(self, element: Element, tag: str, at: str) -> Element:
        found = element.find(tag)
        if found is None:
            self._fail(at, f"needs <{tag}>")
        return found

    def _text(self, element: Element, key: str, at: str) -> str:
        text = element.get(key, "")
        if not text:
            self._fail(at, f"needs the attribute '{key}'")
        return text

    def _number(
        self,
        element: Element,
        key: str,
        at: str,
        default: float | None = None,
        most: float = _LARGEST,
    ) -> float:
        given = None if default is None else (default,)
        (number,) = self._numbers(element, key, at, 1, given, most)
        return number

    def _vector(
        self, element: Element, key: str, at: str, default: _Vector | None = None
    ) -> _Vector:
        x, y, z = self._numbers(element, key, at, 3, default)
        return x, y, z

    def _numbers(
        self,
        element: Element,
        key: str,
        at: str,
        count: int,
        default: tuple[float, ...] | None,
        most: float = _LARGEST,
    ) -> tuple[float, ...]:
        if default is not None and element.get(key) is None:
            return default
        text = self._text(element, key, at)
        try:
            numbers = tuple(float(word) for word in text.split())
        except ValueError:
            numbers = ()
        if len(numbers) != count or not all(abs(number) <= most for number in numbers):
            wanted = "a number" if count == 1 else f"{count} numbers"
            size = "" if most > _LARGEST else f" of at most {_LARGEST:g}"
            self._fail(at, f"{key} must be {wanted}{size} (got {shown(text)})")
        return numbers

    def _positive(self, at: str, *sizes: float) -> None:
        if not all(size > 0.0 for size in sizes):
            self._fail(at, f"sizes must be greater than 0 (got {sizes})")

    def _fail(self, at: str, message: str) -> NoReturn:
        raise UrdfError(f"{self._name}: {at}: {message}")


def _has_macros(root: Element) -> bool:
    """Return whether any element belongs to xacro, by its prefix."""
    elements = list(root.iter())
    prefixes = {
        key.partition(":")[2]
        for element in elements
        for key, value in element.attrib.items()
        if key.startswith("xmlns:") and "xacro" in value
    }
    return any(
        colon and prefix in {"xacro", *prefixes}
        for prefix, colon, _ in (element.tag.partition(":") for element in elements)
    )
