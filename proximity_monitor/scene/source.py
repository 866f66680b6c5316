"""Reads the text of a scene file into plain data, and notes the line of each value."""

from __future__ import annotations

import math
import os
import re
import unicodedata
from typing import Any

import yaml

from proximity_monitor.scene.report import Keys, Report

# Ten thousand bodies fit; PyYAML would need minutes to read anything larger.
_MAX_BYTES = 4 * 1024 * 1024
# YAML aliases can stand for exponentially many values, or for themselves.
_MAX_VALUES = 200_000
_MAX_DEPTH = 32

_YAML = "tag:yaml.org,2002:"
_NUMBERS = {_YAML + kind for kind in ("int", "float")}
_ODD = re.compile(r"[-+]?0[0-7_]+$|[^:]+:")
"""Numbers that YAML 1.1 reads as octal (010) or in base 60 (1:30 is 90)."""
_SCALARS = {_YAML + kind for kind in ("null", "bool", "int", "float", "str")}


class _Loader(yaml.SafeLoader):
    """Loads YAML 1.1, and also reads 1e-3 as a number, although the standard requires a dot."""


_Loader.add_implicit_resolver(
    _YAML + "float",
    re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


def read(path: str | os.PathLike[str]) -> tuple[Any, Report]:
    """Read a YAML file without executing anything that it names.

    Returns:
        The data as dicts, lists and scalars, and a report that knows their lines. The report may
        hold problems already: repeated keys, values that are not plain or not finite.

    Raises:
        SceneError: the file cannot be read, or is not one YAML document.
    """
    report = Report(os.fspath(path))
    text = _text(path, report)
    try:
        loader = _Loader(text)
        try:
            root = loader.get_single_node()
            if root is None:
                report.fail("is empty; a scene file begins with 'version: 1'")
            return _Reader(loader, report).value(root, ()), report
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = " ".join(part for part in (error.context, error.problem) if part)
        report.fail(f"is not valid YAML: {what}", mark.line + 1 if mark else None)
    except yaml.reader.ReaderError as error:
        report.fail(
            f"is not text: it contains the character {error.character:#x}",
            text.count("\n", 0, error.position) + 1,
        )
    except RecursionError:
        report.fail(f"is nested deeper than {_MAX_DEPTH} levels")


def _text(path: str | os.PathLike[str], report: Report) -> str:
    try:
        with open(path, "rb") as file:
            raw = file.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        report.fail(f"cannot be read: {getattr(error, 'strerror', None) or error}")
    if len(raw) > _MAX_BYTES:
        report.fail(f"is larger than {_MAX_BYTES >> 20} MiB, too large for a scene file")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        report.fail("is not UTF-8 text", raw.count(b"\n", 0, error.start) + 1)


class _Reader:
    """Turns YAML's nodes into data and notes their lines."""

    def __init__(self, loader: _Loader, report: Report) -> None:
        self._loader = loader
        self._report = report
        self._count = 0

    def value(self, node: yaml.Node, keys: Keys) -> Any:
        self._report.lines.setdefault(keys, node.start_mark.line + 1)
        self._count += 1
        if self._count > _MAX_VALUES:
            self._report.fail(f"has more than {_MAX_VALUES} values")
        if len(keys) > _MAX_DEPTH:
            self._report.fail(f"is nested deeper than {_MAX_DEPTH} levels", self._report.line(keys))
        if isinstance(node, yaml.MappingNode) and node.tag == _YAML + "map":
            return self._mapping(node, keys)
        if isinstance(node, yaml.SequenceNode) and node.tag == _YAML + "seq":
            return [self.value(item, (*keys, index)) for index, item in enumerate(node.value)]
        return self._scalar(node, keys)

    def _mapping(self, node: yaml.MappingNode, keys: Keys) -> dict[str, Any]:
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                self._report.fail("a key must be a plain word, not a list or a mapping", line)
            key = key_node.value
            if key_node.tag == _YAML + "merge":
                self._report.add(
                    (*keys, key), "merge keys are not supported; write the keys out here"
                )
                continue
            if not _printable(key):
                self._report.fail("a key must not contain control characters", line)
            at = (*keys, key)
            if key in data:
                first = self._report.line(at)
                self._report.lines[at] = line
                self._report.add(at, f"appears twice, first on line {first}; keep one of them")
            self._report.lines[at] = line
            data[key] = self.value(value_node, at)
        return data

    def _scalar(self, node: yaml.Node, keys: Keys) -> Any:
        if node.tag not in _SCALARS or not isinstance(node, yaml.ScalarNode):
            kind = node.tag.removeprefix(_YAML)
            self._report.add(keys, f"is a YAML {kind}; if it is text, put it in quotes")
            return None
        if node.tag in _NUMBERS and _ODD.match(node.value):
            self._report.add(
                keys,
                f"{node.value[:40]} is a different number in YAML 1.1; write it without a "
                "leading zero and without colons, or put it in quotes if it is text",
            )
            return None
        try:
            value = self._loader.construct_object(node)
            if isinstance(value, int | float) and not math.isfinite(value):
                raise OverflowError
        except OverflowError:
            self._report.add(keys, f"must be a finite number (got {node.value[:40]})")
            return None
        except (ValueError, LookupError, yaml.YAMLError):
            self._report.add(
                keys, f"cannot be read as {node.tag.removeprefix(_YAML)}: {node.value[:40]!r}"
            )
            return None
        self._report.texts[keys] = node.value
        if isinstance(value, str) and not _printable(value):
            self._report.add(keys, "must not contain control characters")
            return None
        return value


def _printable(text: str) -> bool:
    """Return whether the text can be part of a file name, a topic or a message."""
    return not any(unicodedata.category(char) in ("Cc", "Cs") for char in text)
