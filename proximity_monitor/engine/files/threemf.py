"""Reader for 3MF: the objects that the build lists, with the file's unit of length."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np

from .triangles import FormatError, Part, Parts, Reals, Triangles, check_finite, fans
from .xml import Element, attributes, need, parsed, real_list, whole_list

_UNITS = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip
_KNOWN = ("/material/", "/production/")
"""Substrings of the names of extensions that do not change the geometry, or that are read."""


def read_3mf(data: bytes, _: Path) -> Triangles:
    """Read a 3MF file."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return _Package(archive).triangles()
    except (zipfile.BadZipFile, EOFError, NotImplementedError) as error:
        raise FormatError(f"invalid ZIP archive: {error}") from None


class _Package:
    """The models of an archive, and the objects in them."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        self._names = {name.lower().strip("/"): name for name in archive.namelist()}
        self._objects: dict[str, dict[str, Element]] = {}
        self._meshes: dict[tuple[str, str], Part] = {}
        self._parts = Parts()
        self._unit: str | None = None

    def triangles(self) -> Triangles:
        """Return the triangles of all objects of the build, in the build's frame."""
        relations = parsed(self._read("_rels/.rels"))
        targets = [
            need(each, "Target")
            for each in relations.findall("Relationship")
            if need(each, "Type").endswith("/3dmodel")
        ]
        if not targets:
            raise FormatError("_rels/.rels names no model")
        model = self._model(targets[0])
        for item in model.findall("build/item"):
            self._place(targets[0], item, np.eye(4), ())
        return self._parts.joined(_UNITS[self._unit])

    def _read(self, path: str) -> bytes:
        key = path.lower().strip("/")
        if key not in self._names:
            raise FormatError(f"has no {path}")
        return self._archive.read(self._names[key])

    def _model(self, path: str) -> Element:
        """Return the root of a model file, and keep its objects by their id."""
        text = self._read(path)
        model = parsed(text)
        if model.tag != "model":
            raise FormatError(f"{path}: expected the root element <model>, found <{model.tag}>")
        unit = model.get("unit", "millimeter")
        if unit not in _UNITS:
            raise FormatError(f"{path}: unit = {unit!r}: must be one of {', '.join(_UNITS)}")
        self._unit = self._unit or unit
        if unit != self._unit:
            raise FormatError(
                f"{path} has the unit {unit!r}, but other parts have {self._unit!r}: use one unit"
            )
        for prefix in model.get("requiredextensions", "").split():
            name = text.partition(f"xmlns:{prefix}=".encode())[2][1:].split(b'"')[0].split(b"'")[0]
            if not any(known.encode() in name for known in _KNOWN):
                raise FormatError(
                    f"requires the extension {name.decode()!r}, which is not supported"
                )
        listed = model.findall("resources/object")
        self._objects[path] = {need(each, "id"): each for each in listed}
        if len(self._objects[path]) < len(listed):
            raise FormatError(f"{path} uses an object id twice")
        return model

    def _place(self, path: str, link: Element, above: Reals, within: tuple[str, ...]) -> None:
        """Add the object that a build item or a component names."""
        matrix = above @ _matrix(link)
        # Components may lie in another file of the archive.
        path = next((link.attrib[key] for key in link.attrib if key.endswith("}path")), path)
        if path not in self._objects:
            self._model(path)
        number = need(link, "objectid")
        if number not in self._objects[path]:
            raise FormatError(f"object {number} of {path} is used, but does not exist")
        key, name = f"{path} {number}", f"object {number}"
        if key in within:
            raise FormatError(f"{name} contains itself")
        element = self._objects[path][number]
        if element.get("type") == "other":
            raise FormatError(f"{name} has the type 'other', which is not allowed in a build")
        mesh, components = element.find("mesh"), element.find("components")
        if mesh is not None:
            if (path, number) not in self._meshes:
                self._meshes[path, number] = _mesh(mesh, name)
            self._parts.add(*self._meshes[path, number], matrix)
        elif components is not None:
            for each in components.findall("component"):
                self._place(path, each, matrix, (*within, key))
        else:
            raise FormatError(
                f"{name} has neither <mesh> nor <components>: nothing else is supported"
            )


def _mesh(mesh: Element, name: str) -> Part:
    """Return the vertices and faces of an object's mesh."""
    if mesh.find("beamlattice") is not None:
        raise FormatError(f"{name} has a beam lattice, which is not supported")
    points = mesh.findall("vertices/vertex")
    triangles = mesh.findall("triangles/triangle")
    text = attributes(points, "xyz")
    vertices = real_list(text, f"{name}: vertices", 3 * len(points)).reshape(-1, 3)
    check_finite(vertices)
    text = attributes(triangles, ("v1", "v2", "v3"))
    corners = whole_list(text, f"{name}: triangles", 3 * len(triangles))
    sizes = np.full(len(triangles), 3)
    return vertices, fans(corners, sizes, len(points), lambda i: f"{name}: triangles[{i}]: ")


def _matrix(link: Element) -> Reals:
    """Return the transform (4, 4) of an item or component; the file's rows are its columns."""
    matrix = np.eye(4)
    text = link.get("transform")
    if text is not None:
        matrix[:3] = real_list(text, "transform", 12).reshape(4, 3).T
    return matrix
