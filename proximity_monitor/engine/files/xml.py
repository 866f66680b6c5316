"""XML helpers for the readers of COLLADA and 3MF."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from numpy.typing import NDArray

from .text import reals, wholes
from .triangles import FormatError, Ints, Reals

Element = ElementTree.Element


def parsed(data: bytes) -> Element:
    """Parse a document and return its root; the tags of all elements lose their namespaces."""
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise FormatError(f"invalid XML: {error}") from None
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    return root


def need(element: Element, key: str) -> str:
    """Return a required attribute."""
    value = element.get(key)
    if value is None:
        raise FormatError(f"<{element.tag}> has no {key}")
    return value


def real_list(text: str | None, what: str, count: int | None = None) -> Reals:
    """Parse the numbers of a text; `count` is how many there must be."""
    return _counted(reals((text or "").encode().split(), lambda _: f"{what}: "), what, count)


def whole_list(text: str | None, what: str, count: int | None = None) -> Ints:
    """Parse the whole numbers of a text; `count` is how many there must be."""
    return _counted(wholes((text or "").encode().split(), lambda _: f"{what}: "), what, count)


def attributes(elements: Sequence[Element], keys: Sequence[str]) -> str:
    """Return the values of the given attributes of all elements, joined, element by element."""
    try:
        return " ".join([element.attrib[key] for element in elements for key in keys])
    except KeyError as error:
        raise FormatError(f"<{elements[0].tag}> has no {error.args[0]}") from None


def _counted(numbers: NDArray, what: str, count: int | None) -> NDArray:
    if count is not None and len(numbers) != count:
        raise FormatError(f"{what} has {len(numbers)} numbers, expected {count}")
    return numbers
