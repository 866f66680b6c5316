"""Write docs/scene_keys.md: every key of a scene file, from the schema that checks such files.

    python tools/write_scene_keys.py

The texts are the schema's own descriptions: change them there.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
SCHEMA = ROOT / "proximity_monitor" / "scene" / "schema.json"
PAGE = ROOT / "docs" / "scene_keys.md"

HEAD = """\
# Keys of a scene file

<!-- Written by tools/write_scene_keys.py from proximity_monitor/scene/schema.json: change that. -->

{description}
`proximity_monitor scene check FILE` checks a file against this list and names every wrong key by
its line. [Scenes](scenes.md) explains how the keys work together."""

Schema = dict[str, Any]


class _Page:
    """The sections, one for each mapping; a mapping that has a name in the schema comes once."""

    def __init__(self, schema: Schema) -> None:
        self.named = schema["$defs"]
        self.sections: list[str] = []
        self.done: set[str] = set()

    def _title(self, key: str, parent: str) -> str:
        """Return an unnamed mapping's title, with its parent because keys like `bodies` recur."""
        parent = parent.partition(" of ")[0]
        return key if parent in ("scene", "motion", "primitive") else f"{key} of {parent}"

    def section(self, title: str, mapping: Schema) -> None:
        """Add a mapping with a row for each key, then the mappings inside it."""
        if title in self.done:
            return
        self.done.add(title)
        required = mapping.get("required", ())
        lines = [f"## {title}", ""]
        if said := mapping.get("description"):
            lines += [said, ""]
        for of, rule in (("anyOf", "At least"), ("oneOf", "Exactly")):
            for branches in (mapping, *mapping.get("allOf", ())):
                if choices := _choices(branches.get(of, ())):
                    lines += [f"{rule} one of {choices}.", ""]
        lines += ["| key | value | meaning |", "| --- | --- | --- |"]
        inside: list[tuple[str, Schema]] = []
        for key, value in mapping["properties"].items():
            shape, text = self._value(title, key, value, inside)
            needed = " **Required.**" if key in required else ""
            lines.append(f"| `{key}` | {shape} | {_cell(text)}{needed} |".replace("|  **", "| **"))
        self.sections.append("\n".join(lines))
        for name, found in inside:
            self.section(name, found)

    def _value(
        self, parent: str, key: str, schema: Schema, inside: list[tuple[str, Schema]]
    ) -> tuple[str, str]:
        """Return what a value looks like and what it means; add mappings in it to `inside`."""
        name, text = self._title(key, parent), schema.get("description", "")
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            schema = self.named[name]
            text = text or schema.get("description", "")
        if schema.get("properties"):
            inside.append((name, schema))
            link = f"[{name}](#{name.replace(' ', '-')})"
            return (f"text, or {link}" if "string" in schema["type"] else link), text
        if schema.get("type") == "array" and isinstance(schema.get("items"), dict):
            return self._items(parent, key, schema, inside), text
        values = schema.get("additionalProperties")
        if isinstance(values, dict):
            shape, more = self._value(parent, key, values, inside)
            return f"by name: {shape}", text or more
        return _scalar(schema), text

    def _items(
        self, parent: str, key: str, schema: Schema, inside: list[tuple[str, Schema]]
    ) -> str:
        item, _ = self._value(parent, key, schema["items"], inside)
        low, high = schema.get("minItems"), schema.get("maxItems")
        if low == high and low is not None:
            return f"list of {low}: {item}"
        return f"list of {low} to {high}: {item}" if high else f"list: {item}"


def page(schema: Schema) -> str:
    """Return the page about a schema, as Markdown."""
    made = _Page(schema)
    made.section("scene", schema | {"description": ""})
    return "\n\n".join([HEAD.format(description=schema["description"]), *made.sections]) + "\n"


def _choices(branches: list[Schema]) -> str:
    keys = [f"`{branch['required'][0]}`" for branch in branches if "required" in branch]
    return ", ".join(keys)


def _scalar(schema: Schema) -> str:
    """Return the type and limits of a value that is neither a mapping nor a list."""
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{value if isinstance(value, str) else json.dumps(value)}`"
                         for value in schema["enum"])  # fmt: skip
    kinds = schema.get("type", "any")
    kinds = [kinds] if isinstance(kinds, str) else kinds
    words = {"string": "text", "object": "mapping", "array": "list", "boolean": "true or false",
             "integer": "whole number"}  # fmt: skip
    text = " or ".join(words.get(kind, kind) for kind in kinds)
    if "exclusiveMinimum" in schema:
        text += f" above {schema['exclusiveMinimum']:g}"
    if "minimum" in schema and "maximum" in schema:
        return f"{text}, {schema['minimum']:g} to {schema['maximum']:g}"
    if "minimum" in schema:
        text += f", at least {schema['minimum']:g}"
    if "x-metres" in schema:
        text += f", at most {schema['x-metres']:g} m"
    return text + (f", at most {schema['maximum']:g}" if "maximum" in schema else "")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def main() -> None:
    """Write the page."""
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    PAGE.write_text(page(schema), encoding="utf-8")


if __name__ == "__main__":
    main()
