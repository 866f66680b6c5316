"""XML as the readers of COLLADA and 3MF take it: elements by their names without namespaces."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from numpy.typing import NDArray

from .text import reals, wholes
from .triangles import FormatError, Ints, Reals

Element = ElementTree.Element


def parsed(data: bytes) -> Element:
    """The root of a document."""
    try:
        return ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise FormatError(f"its XML is damaged: {error}") from None


def name_of(element: Element) -> str:
    """An element's name without its namespace."""
    return element.tag.rpartition("}")[2]


def children(element: Element | None, name: str) -> list[Element]:
    """The children of a name."""
    return [] if element is None else element.findall(f"{{*}}{name}")


def child(element: Element | None, name: str) -> Element | None:
    """The first child of a name."""
    return next(iter(children(element, name)), None)


def need(element: Element, key: str) -> str:
    """An attribute that must be there."""
    value = element.get(key)
    if value is None:
        raise FormatError(f"<{name_of(element)}> has no {key}")
    return value


def real_list(text: str | None, what: str, count: int | None = None) -> Reals:
    """The numbers of a text; `count` is how many there must be."""
    return _counted(reals((text or "").encode().split(), lambda _: f"{what}: "), what, count)


def whole_list(text: str | None, what: str, count: int | None = None) -> Ints:
    """The whole numbers of a text; `count` is how many there must be."""
    return _counted(wholes((text or "").encode().split(), lambda _: f"{what}: "), what, count)


def attributes(elements: Sequence[Element], keys: Sequence[str]) -> str:
    """The values of some attributes of all elements, one element after the other."""
    try:
        return " ".join([element.attrib[key] for element in elements for key in keys])
    except KeyError as error:
        raise FormatError(f"<{name_of(elements[0])}> has no {error.args[0]}") from None


def _counted(numbers: NDArray, what: str, count: int | None) -> NDArray:
    if count is not None and len(numbers) != count:
        raise FormatError(f"{what} holds {len(numbers)} numbers, not {count}")
    return numbers
