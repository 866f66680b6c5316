"""Reader for COLLADA (.dae), a common format of robot meshes: the triangles of the static scene.

The reader applies the file's unit. It ignores `up_axis`, as RViz and Gazebo do, because robot
descriptions are written for these two. It also ignores materials: the images they refer to are
often missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .polygons import cut_polygons
from .triangles import (
    FormatError,
    Ints,
    Part,
    Parts,
    Reals,
    Triangles,
    Where,
    check_finite,
    fans,
    spans,
    strips,
)
from .xml import Element, need, parsed, real_list, whole_list

_CURVES = ("lines", "linestrips")
_CUTTERS: dict[str, Callable[[Reals, Ints, Ints, Where], Ints]] = {
    "triangles": cut_polygons,
    "polylist": cut_polygons,
    "polygons": cut_polygons,
    "tristrips": lambda points, corners, sizes, where: strips(corners, sizes, len(points), where),
    "trifans": lambda points, corners, sizes, where: fans(corners, sizes, len(points), where),
}
"""The function that cuts each kind of primitive into triangles."""
_INSTANCES = ("instance_geometry", "instance_node", "instance_controller")


def read_dae(data: bytes, _: Path) -> Triangles:
    """Read a COLLADA file."""
    root = parsed(data)
    if root.tag != "COLLADA":
        raise FormatError(f"not a COLLADA file: its root element is <{root.tag}>")
    return _Document(root).triangles()


class _Document:
    def __init__(self, root: Element) -> None:
        self._root = root
        self._meshes: dict[Element, list[Part]] = {}
        self._parts = Parts()

    def triangles(self) -> Triangles:
        """Return all triangles, in the frame of the scene."""
        stated = self._root.find("asset/unit")
        unit = 1.0 if stated is None else real_list(stated.get("meter", "1"), "<unit meter>", 1)[0]
        if not 0.0 < unit < math.inf:
            raise FormatError(f"<unit meter> is {unit:g}: must be finite and above 0")
        foreign = {*self._root.findall(".//extra//unit")}
        for nested in self._root.iter("unit"):
            if nested in foreign:
                continue
            other = real_list(nested.get("meter", "1"), "<unit meter>", 1)[0]
            if other != unit:
                raise FormatError(f"mixes units of {unit:g} m and {other:g} m: use a single unit")
        if self._root.find("library_animations//channel") is not None:
            raise FormatError("has animations, which are not supported: export a static scene")
        for shown in self._root.findall("scene/instance_visual_scene"):
            for node in self._named("visual_scene", shown).findall("node"):
                self._place(node, np.eye(4), ())
        return self._parts.joined(float(unit))

    def _named(self, kind: str, link: Element) -> Element:
        """Return the one element of a kind that an instance refers to by its url."""
        url = need(link, "url")
        found = [each for each in self._root.iter(kind) if f"#{each.get('id')}" == url]
        if len(found) != 1:
            raise FormatError(
                f"<{link.tag}> refers to {url!r}: expected one <{kind}> with that id, "
                f"found {len(found)}"
            )
        return found[0]

    def _place(self, node: Element, above: Reals, within: tuple) -> None:
        """Add the geometry of a node and of all nodes below it."""
        if node in within:
            raise FormatError(f"node {node.get('id')!r} contains itself")
        if all(node.find(f".//{kind}") is None for kind in _INSTANCES):
            return  # a node of a camera, a light or a joint
        within = (*within, node)
        matrix = above
        for element in node:
            match element.tag:
                case "node":
                    self._place(element, matrix, within)
                case "instance_node":
                    self._place(self._named("node", element), matrix, within)
                case "instance_geometry":
                    for mesh in self._geometry(self._named("geometry", element)):
                        self._parts.add(*mesh, matrix)
                case "instance_controller":
                    raise FormatError(
                        f"<instance_controller> {need(element, 'url')!r}: skins and morph targets "
                        "are not supported: apply them before export"
                    )
                case _:
                    matrix = matrix @ _motion(element)

    def _geometry(self, geometry: Element) -> list[Part]:
        if geometry not in self._meshes:
            self._meshes[geometry] = _geometry(geometry)
        return self._meshes[geometry]


def _motion(element: Element) -> Reals:
    """Return the matrix (4, 4) of a transformation; the identity for any other child of a node."""
    matrix, kind = np.eye(4), element.tag
    if kind == "matrix":
        matrix = real_list(element.text, "<matrix>", 16).reshape(4, 4)
    elif kind == "translate":
        matrix[:3, 3] = real_list(element.text, "<translate>", 3)
    elif kind == "scale":
        matrix[:3, :3] = np.diag(real_list(element.text, "<scale>", 3))
    elif kind == "rotate":
        *axis, degrees = real_list(element.text, "<rotate>", 4)
        length, angle = math.hypot(*axis), math.radians(degrees)
        if length > 0.0:
            x, y, z = np.array(axis) / length
            cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            turned = math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
            matrix[:3, :3] += turned
    elif kind in ("lookat", "skew"):
        raise FormatError(f"a node has <{kind}>, which is not supported: write it as a <matrix>")
    return matrix


def _geometry(geometry: Element) -> list[Part]:
    """Return the vertices and faces of each primitive of a geometry."""
    name = f"geometry {geometry.get('id')!r}"
    mesh = geometry.find("mesh")
    if mesh is None and geometry.find("spline") is not None:
        return []
    if mesh is None:
        kinds = ", ".join(f"<{each.tag}>" for each in geometry) or "nothing"
        raise FormatError(f"{name}: expected <mesh>, found {kinds}")
    found, positions = [], {}
    for element in mesh:
        kind = element.tag
        if kind in ("source", "vertices", "extra", *_CURVES):
            continue
        if element.find("ph") is not None:
            raise FormatError(
                f"{name}: <{kind}> has polygons with holes, which are not supported: "
                "export triangles instead"
            )
        inputs = element.findall("input")
        offsets = [int(whole_list(need(each, "offset"), "offset", 1)[0]) for each in inputs]
        which = [i for i, each in enumerate(inputs) if need(each, "semantic") == "VERTEX"]
        if len(which) != 1 or min(offsets) < 0:
            raise FormatError(
                f"{name}: <{kind}> must have exactly one VERTEX input and no negative offset"
            )
        source = need(inputs[which[0]], "source")
        if source not in positions:
            positions[source] = _positions(mesh, source, name)
        vertices = positions[source]
        width, column = max(offsets) + 1, offsets[which[0]]
        runs = []
        for p in element.findall("p"):
            numbers = whole_list(p.text, f"{name}: <p>")
            if len(numbers) % width:
                raise FormatError(
                    f"{name}: <p> has {len(numbers)} numbers, which is not a multiple of "
                    f"the {width} of each corner"
                )
            runs.append(numbers[column::width])
        corners = np.concatenate([np.empty(0, dtype=np.int64), *runs])
        sizes = np.array([len(run) for run in runs], dtype=np.int64)
        if kind == "triangles":
            sizes = np.full(-(-len(corners) // 3), 3)
        elif kind == "polylist":
            sizes = whole_list(element.findtext("vcount"), f"{name}: <vcount>")
        elif kind not in _CUTTERS:
            raise FormatError(f"{name} has <{kind}>, which is not supported")
        if (sizes < 0).any():
            raise FormatError(f"{name}: <vcount> has negative numbers")
        if sizes.sum() != len(corners):
            raise FormatError(
                f"{name}: <{kind}> has {len(corners)} corners, but needs {sizes.sum()}"
            )
        _check_count(element, sizes, name)

        def where(i: int, kind: str = kind) -> str:
            return f"{name}: <{kind}>[{i}]: "

        found.append((vertices, _CUTTERS[kind](vertices, corners, sizes, where)))
    return found


def _check_count(element: Element, sizes: Ints, name: str) -> None:
    """Refuse a primitive whose number of items differs from the number it announces."""
    count = whole_list(element.get("count", str(len(sizes))), "count", 1)[0]
    if count != len(sizes):
        raise FormatError(f"{name}: <{element.tag}> declares {count} items, but has {len(sizes)}")


def _positions(mesh: Element, source: str, name: str) -> Reals:
    """Return the positions (n, 3) that a VERTEX input refers to."""
    for vertices in mesh.findall("vertices"):
        for each in vertices.findall("input"):
            if f"#{vertices.get('id')}" == source and each.get("semantic") == "POSITION":
                found = [
                    s for s in mesh.findall("source") if f"#{s.get('id')}" == each.get("source")
                ]
                if len(found) == 1:
                    return _source(found[0], name)
    raise FormatError(f"{name}: its positions {source!r} are missing")


def _source(source: Element, name: str) -> Reals:
    array = source.find("float_array")
    accessor = source.find("technique_common/accessor")
    if array is None or accessor is None:
        raise FormatError(f"{name}: source {source.get('id')!r} has no numbers")
    if accessor.get("source") != f"#{array.get('id')}":
        raise FormatError(
            f"{name}: <accessor source={accessor.get('source')!r}> does not refer to "
            "its <float_array>"
        )
    names = [param.get("name", "").upper() for param in accessor.findall("param")]
    if names and names[:3] != ["X", "Y", "Z"]:
        raise FormatError(f"{name}: <accessor> has params {names}, expected X, Y and Z first")
    what = f"{name}: <float_array>"
    announced = array.get("count")
    count = None if announced is None else int(whole_list(announced, f"{what} count", 1)[0])
    numbers = real_list(array.text, what, count)
    count, stride, offset = (
        int(whole_list(accessor.get(key, default), f"{name}: <accessor> {key}", 1)[0])
        for key, default in (("count", "0"), ("stride", "1"), ("offset", "0"))
    )
    if count < 0 or stride < 3 or offset < 0 or offset + count * stride > len(numbers):
        raise FormatError(
            f"{name}: <accessor> has count {count}, stride {stride} and offset {offset}; they must "
            f"not be negative, the stride at least 3, and fit the {len(numbers)} numbers"
        )
    starts = offset + stride * np.arange(count)
    points = numbers[spans(starts, np.full(count, 3))].reshape(-1, 3)
    check_finite(points)
    return points
