"""Checks on the text of a STEP file: no part of it may get lost, and its units must be known.

OpenCASCADE skips what it cannot read, or substitutes something for it, without an error. So this
module follows the references from statement to statement, and finds what makes up the parts.
"""

from __future__ import annotations

import re
from functools import cached_property

import numpy as np

from .step_text import StepText
from .triangles import FormatError

_WITH_FACES = {
    "MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP", "SHELL_BASED_SURFACE_MODEL",
    "FACE_BASED_SURFACE_MODEL", "OPEN_SHELL", "CLOSED_SHELL", "CONNECTED_FACE_SET",
    "ADVANCED_FACE", "FACE_SURFACE", "MAPPED_ITEM",
}  # fmt: skip
"""Types of items whose faces are read."""
_WITHOUT_SURFACE = re.compile(
    r"(.*_)?(PLACEMENT(_[23]D)?|POINT|DIRECTION|VECTOR|VERTEX|EDGE|CURVE|CURVE_SET|LINE|POLYLINE|"
    r"CIRCLE|ELLIPSE|PARABOLA|HYPERBOLA|WIREFRAME_MODEL|PATH|LOOP|CURVE_WITH_KNOTS|"
    r"PLANE|CYLINDRICAL_SURFACE|CONICAL_SURFACE|"
    r"(MEASURE|VALUE|DESCRIPTIVE|INTEGER|REAL)_REPRESENTATION_ITEM)"
)
"""Types of items that bound nothing: curves and points, which every reader skips, and unbounded
surfaces, which serve construction."""
_ROOTS = (
    "SHAPE_DEFINITION_REPRESENTATION", "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION",
    "SHAPE_REPRESENTATION_RELATIONSHIP", "NEXT_ASSEMBLY_USAGE_OCCURRENCE",
)  # fmt: skip
_OPERATOR = "CARTESIAN_TRANSFORMATION_OPERATOR_3D"
_AXES = np.eye(3)


class StepChecks:
    """The parts as a file states them.

    Raises:
        FormatError: something of a part is not read, or has no placement or no unit. The message
            says what.
    """

    def __init__(self, text: StepText) -> None:
        self._text = text
        self._counts: dict[int, int] = {}
        self.relevant = text.below(text.of(*_ROOTS))
        """The statements that make up shapes, their placements and their units."""
        self.faces = len(text.of("ADVANCED_FACE", "FACE_SURFACE"))
        """The number of faces in the file."""
        for representation in dict.fromkeys(r for made in self._shapes.values() for r in made):
            self._check_units(representation)
        for operator in self.relevant.intersection(text.of(_OPERATOR)):
            self._check_operator(operator)
        for part, made in self._shapes.items():
            for representation in made:
                self._check_items(part, representation)
        for occurrence in text.of("NEXT_ASSEMBLY_USAGE_OCCURRENCE"):
            part = self._part_of(occurrence)
            if part in self._documented and not self._count(part):
                raise FormatError(
                    f"part {self._called(part)!r} has a document instead of a shape: if its shape "
                    "is in another file, save the assembly as one file"
                )
            if occurrence not in self._placed and self._count(part):
                raise FormatError(
                    f"part {self._called(part)!r}: its occurrence "
                    f"{self._text.string(occurrence, 1)!r} (#{occurrence}) has no placement"
                )

    def statement(self, index: int) -> int | None:
        """Return the number of the statement at a position in the file, counted from 1."""
        numbers = self._text.numbers
        return numbers[index - 1] if 0 < index <= len(numbers) else None

    @cached_property
    def placed(self) -> int:
        """The least number of placed parts that the file must yield."""
        below = {self._part_of(each) for each in self._text.of("NEXT_ASSEMBLY_USAGE_OCCURRENCE")}
        return sum(self._count(part) for part in self._definitions if part not in below)

    @cached_property
    def _definitions(self) -> list[int]:
        return self._text.of("PRODUCT_DEFINITION", "PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS")

    @cached_property
    def _documented(self) -> set[int]:
        """The parts that have documents, such as a file with their shape."""
        links = self._text.of("APPLIED_DOCUMENT_REFERENCE", "CC_DESIGN_SPECIFICATION_REFERENCE")
        named = {each for link in links for each in self._text.named(link)}
        named |= {*self._text.of("PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS")}
        return named.intersection(self._definitions)

    @cached_property
    def _owners(self) -> dict[int, int]:
        """The owner of each shape: a part or an occurrence."""
        shapes = self._text.of("PRODUCT_DEFINITION_SHAPE")
        return {shape: self._text.named(shape)[0] for shape in shapes if self._text.named(shape)}

    @cached_property
    def _shapes(self) -> dict[int, list[int]]:
        """The representations of each part.

        They are the part's own, those related to them without a transformation, and those that any
        of these place as mapped items.
        """
        beside: dict[int, list[int]] = {}
        for link in self._text.of("SHAPE_REPRESENTATION_RELATIONSHIP"):
            if "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION" not in self._text.types(link):
                a, b = self._text.named(link)[:2]
                beside.setdefault(a, []).append(b)
                beside.setdefault(b, []).append(a)
        made: dict[int, list[int]] = {}
        for link in self._text.of("SHAPE_DEFINITION_REPRESENTATION"):
            shape, representation = self._text.named(link)[:2]
            owner, left = self._owners.get(shape), [representation]
            found = made.setdefault(owner, []) if owner in self._definitions else []
            while left:
                each = left.pop()
                if each not in found:
                    found.append(each)
                    left += beside.get(each, [])
                    left += [self._mapped(item) for item in self._items(each, "MAPPED_ITEM")]
        return made

    def _items(self, representation: int, kind: str | None = None) -> list[int]:
        """Return the items of a representation: all of them, or those of one type."""
        found = []
        for each in self._text.named(representation):
            types = self._text.types(each)
            if not any(name.endswith("REPRESENTATION_CONTEXT") for name in types):
                found += [each] if kind is None or kind in types else []
        return found

    def _mapped(self, item: int) -> int:
        """Return the representation that a mapped item places again."""
        return self._text.named(self._text.named(item)[0])[-1]

    @cached_property
    def _placed(self) -> set[int]:
        """The parts and occurrences whose shape has a representation or a placement."""
        links = self._text.of(
            "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION", "SHAPE_DEFINITION_REPRESENTATION"
        )
        return {
            self._owners[each]
            for link in links
            for each in self._text.named(link)
            if each in self._owners
        }

    def _part_of(self, occurrence: int) -> int:
        """Return the part that an occurrence is of."""
        return self._text.named(occurrence)[1]

    @cached_property
    def _components(self) -> dict[int, list[int]]:
        found: dict[int, list[int]] = {}
        for each in self._text.of("NEXT_ASSEMBLY_USAGE_OCCURRENCE"):
            found.setdefault(self._text.named(each)[0], []).append(self._part_of(each))
        return found

    def _count(self, part: int, above: tuple[int, ...] = ()) -> int:
        """Return the number of placed parts with faces in a part, itself included."""
        if part in above:
            raise FormatError(f"part {self._called(part)!r} contains itself")
        if part not in self._counts:
            own = any(
                not self._bounds_nothing(item)
                for representation in self._shapes.get(part, ())
                for item in self._items(representation)
            )
            below = self._components.get(part, ())
            self._counts[part] = own + sum(self._count(each, (*above, part)) for each in below)
        return self._counts[part]

    def _called(self, part: int) -> str:
        """Return the name of a part's product, or the part's number if it has no product."""
        version = next(iter(self._text.named(part)), None)
        product = None if version is None else next(iter(self._text.named(version)), None)
        return f"#{part}" if product is None else self._text.string(product, 1)

    def _bounds_nothing(self, item: int) -> bool:
        types = self._text.types(item)
        if "GEOMETRIC_SET" in types:
            return all(self._bounds_nothing(each) for each in self._text.named(item))
        return any(_WITHOUT_SURFACE.fullmatch(name) for name in types)

    def _check_items(self, part: int, representation: int) -> None:
        for item in self._items(representation):
            types = self._text.types(item)
            # A tessellated item that refers to an item with faces only repeats it, so skip it.
            again = any(_WITH_FACES & self._text.types(each) for each in self._text.named(item))
            double = again and any(name.startswith("TESSELLATED_") for name in types)
            if not (types & _WITH_FACES or self._bounds_nothing(item) or double):
                kind = self._text.body(item).split("(")[0].strip() or sorted(types)[0]
                raise FormatError(
                    f"part {self._called(part)!r}: {kind} (#{item}) has no faces with edges, and "
                    "nothing else is supported: save it as B-rep"
                )

    def _check_units(self, representation: int) -> None:
        items = self._items(representation)
        bounds = any(not self._bounds_nothing(item) for item in items)
        contexts = [
            each
            for each in self._text.named(representation)
            if any(name.endswith("REPRESENTATION_CONTEXT") for name in self._text.types(each))
        ]
        units = {unit for each in contexts for unit in self._text.named(each)}
        for kind, what, needed in (
            ("LENGTH_UNIT", "length", bounds or not self._between.isdisjoint(items)),
            ("PLANE_ANGLE_UNIT", "angle", bounds),
        ):
            own = {self._text.value(unit) for unit in units if kind in self._text.types(unit)}
            if needed and len(own) != 1:
                raise FormatError(
                    f"representation #{representation} has {len(own) or 'no'} units of {what}, "
                    "expected one: save the file again with one unit"
                )

    @cached_property
    def _between(self) -> set[int]:
        """The placements that transformations of parts refer to."""
        moves = self._text.of("ITEM_DEFINED_TRANSFORMATION", _OPERATOR)
        return {each for move in moves for each in self._text.named(move)}

    def _check_operator(self, operator: int) -> None:
        """Refuse a mirroring operator, which OpenCASCADE would take for a rotation."""
        body = self._text.body(operator)
        given = re.fullmatch(
            rf"{_OPERATOR}\s*\(('\d+'|\$),('\d+'|\$),('\d+'|\$),(.*)\)\s*", re.sub(r"\s+", "", body)
        )
        words = given[4].split(",") if given else []
        if len(words) != 5:
            raise FormatError(f"#{operator}: this form of {_OPERATOR} is not supported")
        axes = [
            _AXES[i] if word == "$" else self._direction(int(word[1:]))
            for i, word in enumerate([words[0], words[1], words[4]])
        ]
        if not np.linalg.det(axes) > 0.0:
            raise FormatError(
                f"#{operator} mirrors a part, which is not supported: save the mirrored part as "
                "a part of its own"
            )

    def _direction(self, number: int) -> list[float]:
        ratios = self._text.body(number).rpartition("(")[2].split(")")[0]
        return [float(each) for each in ratios.split(",")]
