"""The statements of a STEP file and their references, parsed independently of OpenCASCADE."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cached_property

from .triangles import FormatError

_ASIDE = re.compile(rb"'(?:[^']|'')*'|/\*.*?\*/", re.DOTALL)
"""Strings and comments, which may contain any characters."""
_STATEMENT = re.compile(rb"#(\d+)\s*=\s*([^;]*);")
_NUMBER = re.compile(rb"#(\d+)")
_TYPE = re.compile(rb"([A-Z][A-Z0-9_]*)\s*\(")
_STRING = re.compile(rb"'(\d+)'")
_SHAPES = re.compile(r"\.(stp|step|stpz|stpx|p21|ifc|igs|iges)\Z", re.IGNORECASE)
"""Names of files that hold parts. Other documents (drawings, notes, standards) describe a part."""
_OWN_NAME = re.compile(rb"\bFILE_NAME\s*\(\s*'(\d+)'")
_FOLDERS = re.compile(r".*[/\\]")
_ELSEWHERE = re.compile(rb"\bREFERENCE\s*;")


class StepText:
    """The statements of a file by their number.

    Args:
        data: the file's bytes.
        name: the file's name; a file may refer to itself.

    Raises:
        FormatError: two statements have the same number, or parts are in other files.
    """

    def __init__(self, data: bytes, name: str = "") -> None:
        self._strings: list[bytes] = []
        text = _ASIDE.sub(self._kept, data).upper()
        if _ELSEWHERE.search(text):
            raise FormatError("includes parts of other files: save it as one file")
        self._bodies: dict[int, bytes] = {}
        for number, body in _STATEMENT.findall(text):
            if int(number) in self._bodies:
                raise FormatError(f"#{int(number)} is defined twice: the file is damaged")
            self._bodies[int(number)] = body
        header = _OWN_NAME.search(text)
        own = {_bare(name), _bare(self._string(header[1]) if header else name)}
        for number in self.of("DOCUMENT_FILE"):
            other = self.string(number)
            if _SHAPES.search(other) and _bare(other) not in own:
                raise FormatError(
                    f"refers to another file, {other!r}, which is not supported: "
                    "save the assembly as one file"
                )

    @cached_property
    def numbers(self) -> list[int]:
        """The numbers of all statements, in the file's order."""
        return list(self._bodies)

    def _kept(self, found: re.Match[bytes]) -> bytes:
        if found[0].startswith(b"/*"):
            return b" "
        self._strings.append(found[0][1:-1])
        return b"'%d'" % (len(self._strings) - 1)

    def body(self, number: int) -> str:
        """Return a statement without its number; each string is replaced by an index in quotes."""
        return self._bodies[number].decode("ascii", "replace")

    def types(self, number: int) -> set[str]:
        """Return the types of a statement and of the typed values in it."""
        return {each.decode() for each in _TYPE.findall(self._bodies[number])}

    def named(self, number: int) -> list[int]:
        """Return the statements that a statement refers to, in order."""
        return [int(each) for each in _NUMBER.findall(self._bodies[number])]

    def string(self, number: int, which: int = 0) -> str:
        """Return one string of a statement; empty if it has no such string."""
        found = _STRING.findall(self._bodies[number])
        return self._string(found[which]) if which < len(found) else ""

    def _string(self, which: bytes) -> str:
        return self._strings[int(which)].decode("utf-8", "replace").replace("''", "'")

    def value(self, number: int, depth: int = 4) -> str:
        """Return a statement with its strings, and with its references replaced by their values.

        References deeper than `depth` stay numbers. So a damaged file whose references form a
        cycle ends too.
        """
        if depth == 0 or number not in self._bodies:
            return f"#{number}"
        body = "".join(self.body(number).split())
        body = re.sub(r"'(\d+)'", lambda found: repr(self._string(found[1].encode())), body)
        return re.sub(r"#(\d+)", lambda found: f"({self.value(int(found[1]), depth - 1)})", body)

    @cached_property
    def _by_type(self) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for number in self._bodies:
            for each in self.types(number):
                found.setdefault(each, []).append(number)
        return found

    def of(self, *types: str) -> list[int]:
        """Return the statements of any of these types, each once."""
        return list(dict.fromkeys(n for each in types for n in self._by_type.get(each, ())))

    def below(self, numbers: Iterable[int]) -> set[int]:
        """Return statements and all that they refer to, directly or indirectly.

        Raises:
            FormatError: a statement refers to a missing one.
        """
        found, left = set(), list(numbers)
        while left:
            number = left.pop()
            if number not in found:
                found.add(number)
                for named in self.named(number):
                    if named not in self._bodies:
                        raise FormatError(
                            f"#{number} refers to #{named}, which is missing: the file is damaged"
                        )
                    left.append(named)
        return found


def _bare(name: str) -> str:
    """Return a file's name without its folders, in lower case."""
    return _FOLDERS.sub("", name).lower()
