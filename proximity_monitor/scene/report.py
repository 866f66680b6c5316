"""Collects the errors of a scene file, each with the line, the key and the remedy."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Collection, Mapping
from typing import Any, NoReturn

Keys = tuple[str | int, ...]
"""The path to a value: mapping keys and list indices from the file's root."""


class SceneError(ValueError):
    """A scene cannot be used; the message has one line for each problem."""


_TOLD = 20
"""How many problems a message reports, and how many names a list shows; more are of one kind."""

Unknown = tuple[str, Collection[str]]
"""An unknown name, and the names that are known in its place."""


class Report:
    """Collects the problems of one file, to report them all at once."""

    def __init__(self, name: str) -> None:
        """Start without problems; `name` is the file's name as the user gave it."""
        self.name = name
        self.lines: dict[Keys, int] = {}
        self.texts: dict[Keys, str] = {}
        """The text of each scalar, as the file writes it."""
        self._problems: dict[tuple[int, str], tuple[Keys, Unknown | None]] = {}
        self._warnings: dict[tuple[int, str], None] = {}

    def add(self, keys: Keys, message: str, unknown: Unknown | None = None) -> None:
        """Note a problem with the value at `keys`.

        If the value is an `unknown` name, the message ends with the likeliest known name, or all.
        `check` looks for that name, because the search takes long among thousands.
        """
        self._problems[self._at(keys, message)] = keys, unknown

    def warn(self, keys: Keys, message: str) -> None:
        """Note a warning about the value at `keys`; the scene can be used all the same."""
        self._warnings[self._at(keys, message)] = None

    def _at(self, keys: Keys, message: str) -> tuple[int, str]:
        return self.line(keys), f"{spelled(keys)}: {message}" if keys else message

    def places(self) -> set[Keys]:
        """Return the keys of all values with a problem."""
        return {keys for keys, _ in self._problems.values()}

    def warnings(self) -> tuple[str, ...]:
        """Return the warnings, each with the file and the line, sorted by line."""
        return tuple(f"{self.name}:{line}: {text}" for line, text in sorted(self._warnings))

    def line(self, keys: Keys) -> int:
        """Return the line of a value, or of the innermost mapping or list around a missing one."""
        while keys and keys not in self.lines:
            keys = keys[:-1]
        return self.lines.get(keys, 1)

    def place(self, keys: Keys) -> str:
        """Return the place of a value as text, for problems that are found later."""
        return f"{self.name}:{self.line(keys)}: {spelled(keys)}"

    def check(self) -> None:
        """Raise a SceneError if anything was noted, its problems sorted by line."""
        if not self._problems:
            return
        told = []
        for line, text in sorted(self._problems)[:_TOLD]:
            _, unknown = self._problems[line, text]
            told.append(f"{self.name}:{line}: {text}{meant(*unknown) if unknown else ''}")
        if (more := len(self._problems) - _TOLD) > 0:
            told.append(f"{self.name}: and {more} more")
        raise SceneError("\n".join(told))

    def fail(self, message: str, line: int | None = None) -> NoReturn:
        """Raise a SceneError about the file as a whole, or about one line of its text."""
        raise SceneError(f"{self.name}{'' if line is None else f':{line}'}: {message}")


def spelled(keys: Keys) -> str:
    """Spell a place as ``bodies[2].scale``."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys)
    return text.removeprefix(".")


def meant(name: str, known: Collection[str]) -> str:
    """Return the end of a sentence about an unknown name: the likeliest known one, or all."""
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{near[0]}'?" if near else f"; known: {listed(known)}"


def listed(names: Collection[str]) -> str:
    """Return names as a list; a long list is cut and ends with the number of names left out."""
    first = ", ".join(itertools.islice(names, _TOLD)) or "none"
    return first if len(names) <= _TOLD else f"{first} and {len(names) - _TOLD} more"


def shown(value: Any) -> str:
    """Show a value as it would stand in the file, shortened."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
