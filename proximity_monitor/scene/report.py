"""Errors of a scene file, each with the line, the key and the way out."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping
from typing import Any, NoReturn

Keys = tuple[str | int, ...]
"""The path to a value: mapping keys and list indices from the file's root."""


class SceneError(ValueError):
    """A scene cannot be used; the message has one line for each problem."""


class Report:
    """Collects the problems of one file, to report them all at once."""

    def __init__(self, name: str) -> None:
        """Start without problems; `name` is the file's name as the user gave it."""
        self.name = name
        self.lines: dict[Keys, int] = {}
        self._problems: dict[tuple[int, str], Keys] = {}

    def add(self, keys: Keys, message: str) -> None:
        """Note a problem with the value at `keys`."""
        at = f"{spelled(keys)}: " if keys else ""
        self._problems[(self.line(keys), f"{at}{message}")] = keys

    def places(self) -> set[Keys]:
        """The values about which a problem was noted."""
        return set(self._problems.values())

    def line(self, keys: Keys) -> int:
        """The line of a value, or of the innermost mapping or list around a missing one."""
        while keys and keys not in self.lines:
            keys = keys[:-1]
        return self.lines.get(keys, 1)

    def place(self, keys: Keys) -> str:
        """Spell the place of a value, for problems that are found later."""
        return f"{self.name}:{self.line(keys)}: {spelled(keys)}"

    def check(self) -> None:
        """Raise a SceneError if anything was noted, its problems sorted by line."""
        if self._problems:
            raise SceneError(
                "\n".join(f"{self.name}:{line}: {text}" for line, text in sorted(self._problems))
            )

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
    return f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(known) or 'none'}"


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
