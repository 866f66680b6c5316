"""Numbers and tables for readers."""

from __future__ import annotations

import math
from collections.abc import Sequence


def number(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits, and commas between thousands."""
    if not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    power = math.floor(math.log10(abs(value)))
    if not -4 <= power < 9:
        return f"{value:.{digits - 1}e}"
    return f"{value:,.{max(digits - 1 - power, 0)}f}"


def percent(share: float) -> str:
    """Return a share in whole per cent."""
    return f"{100.0 * share:.0f} %"


def asked(rel_err: float) -> str:
    """Return a relative error as readers write it: 0, 1e-6, 0.1, 1."""
    return f"{rel_err:.0e}".replace("e-0", "e-") if 0.0 < rel_err < 0.01 else f"{rel_err:g}"


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], names: int = 1) -> str:
    """Return a table in Markdown; all columns but the first `names` are aligned to the right."""
    rule = ["---"] * names + ["---:"] * (len(headings) - names)
    lines = [headings, rule, *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def folded(title: str, text: str) -> str:
    """Return text that opens when its title is clicked."""
    return f'<details markdown="1"><summary>{title}</summary>\n\n{text}\n</details>\n'


def listed(names: Sequence[str]) -> str:
    """Return `a`, `a and b`, or `a, b and c`."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
