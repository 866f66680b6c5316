"""Reads XML files that may come from anywhere, and expands xacro files.

The standard library parses XML. Nothing in it is executed or fetched, and a document type
declaration is refused, because it could make the text grow without bound or name other files. A
xacro file is different: `xacro` evaluates its expressions and reads the files that it includes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

NO_ARGUMENTS: Mapping[str, str] = MappingProxyType({})

_DECLARED = re.compile(rb"""<\?xml[^>]*\sencoding\s*=\s*["']([A-Za-z0-9._-]+)""")
"""Finds the encoding that a file declares. Expat handles a declaration that is not in ASCII."""


class MarkupError(ValueError):
    """A file is not XML that can be read; the message says why, without the file's name."""


class Arguments(dict[str, str]):
    """Arguments for xacro files by name; `asked` collects the names that a file asked for."""

    def __init__(self, given: Mapping[str, str], asked: set[str] | None = None) -> None:
        """Take the given arguments; names go to the set `asked`, or to a new set."""
        super().__init__(given)
        self.asked: set[str] = set() if asked is None else asked

    def __contains__(self, name: object) -> bool:
        """Return whether an argument is given or has a default, and note that a file asked."""
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        """Return an argument, and note that a file asked."""
        self.asked.add(name)
        return super().__getitem__(name)


class Lined(Element):
    """An element that knows its line."""

    line: int


def is_xacro(path: Path) -> bool:
    """Return whether a file's name says that xacro must expand it."""
    return path.suffix == ".xacro"


def read(path: Path, arguments: Mapping[str, str] = NO_ARGUMENTS) -> Lined:
    """Return the root of an XML file, or of the expanded xacro file.

    Args:
        path: a name that ends in .xacro means a xacro file.
        arguments: of the xacro file, by name.

    Raises:
        MarkupError: not readable, not XML, or xacro is missing or fails.
    """
    if is_xacro(path):
        return parse(_expanded(path, arguments))
    try:
        text = path.read_bytes()
    except OSError as error:
        raise MarkupError(f"cannot be read: {error.strerror}") from None
    return parse(text)


def parse(text: str | bytes) -> Lined:
    """Return the root of an XML text.

    Like the parsers of robot descriptions, it ignores empty lines at the beginning, and namespaces:
    a tag keeps its prefix, declared or not, and ``xmlns`` is an attribute like any other.

    Raises:
        MarkupError: the text is not XML, or has a document type declaration.
    """
    builder = TreeBuilder(element_factory=Lined)
    parser = expat.ParserCreate()
    front = text[: len(text) - len(text.lstrip())]
    skipped = front.count("\n" if isinstance(front, str) else b"\n")
    text = text.lstrip()

    def start(tag: str, attributes: dict[str, str]) -> None:
        builder.start(tag, attributes).line = parser.CurrentLineNumber + skipped

    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        if isinstance(text, bytes) and (declared := _DECLARED.match(text)):
            text = text.decode(declared[1].decode())  # expat knows only a few encodings
        parser.Parse(text, True)
    except expat.ExpatError as error:
        at = f"line {error.lineno + skipped}, column {error.offset}"
        what = expat.ErrorString(error.code)
        raise MarkupError(f"cannot be read as XML: {what}: {at}") from None
    except (ValueError, LookupError) as error:
        raise MarkupError(f"cannot be read as XML: {error}") from None
    return builder.close()


def _refuse_doctype(*_: object) -> NoReturn:
    raise ValueError("it has a document type declaration; remove the line <!DOCTYPE ...>")


def _expanded(path: Path, arguments: Mapping[str, str]) -> str:
    try:
        import xacro
    except ImportError:
        raise MarkupError(
            "needs xacro, which is not installed: pip install xacro (it is part of the extra "
            "'robots'), or sudo apt install ros-$ROS_DISTRO-xacro"
        ) from None
    asked = arguments.asked if isinstance(arguments, Arguments) else None
    try:
        # Passes a copy, because xacro adds the file's defaults to it.
        return xacro.process_file(str(path), mappings=Arguments(arguments, asked)).toxml()
    except Exception as error:  # the file's own expressions can raise anything
        raise MarkupError(f"cannot be expanded by xacro: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError) and error.name == "ament_index_python":
        return "$(find PACKAGE) needs ROS 2, which is not installed; write the path itself"
    return " ".join(str(error).split()) or repr(error)
