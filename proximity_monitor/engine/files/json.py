"""JSON for the readers: numbers are finite, and no object has a key twice."""

from __future__ import annotations

import json
from typing import Any

from .text import without_mark
from .triangles import FormatError


def json_of(data: bytes) -> Any:
    """Return what a JSON text holds.

    Python takes the last value of a key that appears twice. Other programs may take the first, and
    would show another model. So such a text is refused.

    Raises:
        FormatError: the text is no JSON, names no number, or has a key twice in an object.
    """
    try:
        return json.loads(
            without_mark(data), parse_constant=_no_number, object_pairs_hook=_with_unique_keys
        )
    except (ValueError, RecursionError) as error:
        raise FormatError(f"invalid JSON: {error}") from None


def _no_number(word: str) -> float:
    raise ValueError(f"{word} is not a number in JSON")


def _with_unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        keys = [key for key, _ in pairs]
        name = next(key for i, key in enumerate(keys) if key in keys[:i])
        raise ValueError(f"the key {name!r} appears twice in an object; keep one of them")
    return made
