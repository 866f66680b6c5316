"""Checks a scene file's data against `schema.json`, and reports what the user can do about it."""

from __future__ import annotations

import difflib
import functools
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator, ValidationError
from jsonschema.validators import extend

from proximity_monitor.scene.description import UNITS, Unit
from proximity_monitor.scene.report import Keys, Report, shown

_TYPES = {
    "array": "a list",
    "boolean": "true or false",
    "integer": "a whole number",
    "number": "a number",
    "object": "a mapping",
    "string": "text",
}
_LIMITS = {
    "minimum": "must be at least {}",
    "maximum": "must be at most {}",
    "exclusiveMinimum": "must be greater than {}",
}


@functools.cache
def _schema() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("schema.json").read_text(encoding="utf-8"))


def bounds(key: str) -> tuple[float, float]:
    """Return the smallest and the largest number that a key allows; for a length, in metres.

    Args:
        key: a key of the file or of a schema definition, as ``rate_hz`` or ``thresholds.warn``.
    """
    found = {"properties": _schema()["$defs"] | _schema()["properties"]}
    for name in key.split("."):
        found = found["properties"][name]
        found = _schema()["$defs"][found["$ref"].rpartition("/")[2]] if "$ref" in found else found
    most = found.get("x-metres", found.get("maximum", math.inf))
    return found.get("minimum", -most), most


def _validator(unit: Unit | None) -> Draft202012Validator:
    """Return a validator that also checks limits of lengths, which the schema has in metres.

    Without a `unit`, because the file's own is not known, it checks no lengths.
    """

    def within(
        validator: Draft202012Validator, most: float, got: Any, _: Any
    ) -> Iterator[ValidationError]:
        number = unit is not None and validator.is_type(got, "number")
        if number and abs(got) * unit.to_metre > most:
            limit = f"at most {most:g} m" if got > 0 else f"at least {-most:g} m"
            yield ValidationError(f"must be {limit} (got {got:g} {unit.symbol})")

    return extend(Draft202012Validator, {"x-metres": within})(_schema())


def check(data: Any, report: Report) -> None:
    """Report everything in the data that the schema forbids."""
    unreadable = report.places()
    unit = data.get("unit") if isinstance(data, dict) else None
    known = UNITS.get(unit) if isinstance(unit, str) else None
    for error in _validator(known).iter_errors(data):
        for keys, message in _problems(error):
            if keys not in unreadable:
                report.add(keys, message)


def _problems(error: ValidationError) -> Iterator[tuple[Keys, str]]:
    """Translate one finding of the validator; a finding may hold several unknown keys."""
    keys, got = tuple(error.absolute_path), error.instance
    rule, value = error.validator, error.validator_value
    if "propertyNames" in error.absolute_schema_path:
        keys = (*keys, got)
    if rule == "additionalProperties":
        known = list(error.schema["properties"])
        for key in got:
            if key not in known:
                yield (*keys, key), f"unknown key{_meant(key, known)}"
    elif rule == "required":
        for key in value:
            if key not in got:
                yield keys, f"needs the key '{key}'"
    elif rule == "oneOf":
        if isinstance(got, dict):  # if not, another finding reports the type
            choices = [branch["required"][0] for branch in value]
            given = [f"'{key}'" for key in choices if key in got]
            names = ", ".join(f"'{key}'" for key in choices)
            yield keys, f"needs exactly one of {names} (got {' and '.join(given) or 'none'})"
    elif rule == "anyOf":
        choices = " or ".join(f"'{branch['required'][0]}'" for branch in value)
        yield keys, f"needs the key {choices}"
    elif rule == "not":  # keys that stand for the same thing
        if isinstance(got, dict):  # if not, another finding reports the type
            yield keys, f"can have only one of {', '.join(map(repr, value['required']))}"
    elif rule == "type":
        kinds = [value] if isinstance(value, str) else value
        way_out = ""
        if "string" in kinds and isinstance(got, bool | int | float):
            way_out = "; if it is text, put it in quotes"
        wanted = " or ".join(_TYPES[kind] for kind in kinds)
        yield keys, f"must be {wanted} (got {shown(got)}){way_out}"
    elif rule in _LIMITS:
        yield keys, f"{_LIMITS[rule].format(value)} (got {shown(got)})"
    elif rule == "enum":
        yield keys, f"must be one of {', '.join(map(shown, value))} (got {shown(got)})"
    elif rule == "const":
        yield keys, f"must be {shown(value)} (got {shown(got)})"
    elif rule == "pattern":
        yield keys, f"must {error.schema['x-must']} (got {shown(got)})"
    elif rule in ("minItems", "maxItems"):
        yield keys, f"must have {_count(error.schema, 'Items')} (got {len(got)})"
    elif rule in ("minProperties", "maxProperties"):
        known = ", ".join(error.schema.get("properties", ()))
        among = f" of {known}" if known else ""
        yield keys, f"must have {_count(error.schema, 'Properties')}{among} (got {len(got)})"
    elif rule == "minLength":
        yield keys, "must not be empty"
    elif rule == "uniqueItems":
        yield keys, "must not contain anything twice"
    else:
        yield keys, error.message


def _count(schema: dict[str, Any], what: str) -> str:
    noun = {"Items": ("entry", "entries"), "Properties": ("key", "keys")}[what]
    low, high = schema.get(f"min{what}"), schema.get(f"max{what}")
    if low == high:
        return f"exactly {low} {noun[low != 1]}"
    if high is None:
        return f"at least {low} {noun[low != 1]}"
    return f"{low} to {high} {noun[1]}"


def _meant(key: str, known: list[str]) -> str:
    """Suggest the nearest known key, or name them all."""
    near = difflib.get_close_matches(key, known, n=1)
    if near:
        return f"; did you mean '{near[0]}'?"
    return f"; known: {', '.join(known)}" if known else ""
