"""Reads semantic robot descriptions (SRDF): the pairs of links that need not be watched.

Groups, states, end effectors and everything else in the file are skipped.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from proximity_monitor.scene import markup
from proximity_monitor.scene.markup import NO_ARGUMENTS, Lined, MarkupError

_RULES = {
    "disable_collisions": ("link1", "link2"),
    "disable_default_collisions": ("link",),
    "enable_collisions": ("link1", "link2"),
}
"""By element, the attributes that name its links."""


class SrdfError(ValueError):
    """A semantic robot description cannot be used; the message starts with its path."""


class Rule(NamedTuple):
    """One element about collisions."""

    kind: str
    links: tuple[str, ...]
    line: int
    """Its line in the file, or in the expanded text of a xacro file."""


class Srdf(NamedTuple):
    """What the file says about collisions."""

    path: Path
    rules: tuple[Rule, ...]

    def disabled(self, links: Collection[str]) -> Iterator[frozenset[str]]:
        """Return the pairs of the given links that are disabled.

        A pair is disabled by name, or because all pairs of one of its links are disabled and it is
        not enabled by name.
        """
        by_kind = {kind: [r.links for r in self.rules if r.kind == kind] for kind in _RULES}
        enabled = set(map(frozenset, by_kind["enable_collisions"]))
        for (link,) in by_kind["disable_default_collisions"]:
            yield from {frozenset((link, other)) for other in links} - enabled
        yield from map(frozenset, by_kind["disable_collisions"])


def read_srdf(path: Path, arguments: Mapping[str, str] = NO_ARGUMENTS) -> Srdf:
    """Read a semantic robot description.

    Args:
        path: a name that ends in .xacro means a xacro file.
        arguments: of the xacro file, by name.

    Raises:
        SrdfError: the file is not readable or no such description, or an element does not name its
            links.
    """
    try:
        root = markup.read(path, arguments)
    except MarkupError as error:
        raise SrdfError(f"{path}: {error}") from None
    if root.tag != "robot":
        raise SrdfError(f"{path}: <{root.tag}>: a semantic robot description begins with <robot>")
    return Srdf(path, tuple(_rule(each, path) for each in root if each.tag in _RULES))


def _rule(element: Lined, path: Path) -> Rule:
    wanted = _RULES[element.tag]
    links = tuple(element.get(key, "") for key in wanted)
    if not all(links):
        needed = " and ".join(f"'{key}'" for key in wanted)
        raise SrdfError(f"{path}:{element.line}: <{element.tag}>: needs {needed}")
    return Rule(element.tag, links, element.line)
