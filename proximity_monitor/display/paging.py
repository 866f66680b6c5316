"""Long lists are shown a page at a time: every row can be reached, and a browser gets few rows."""

from __future__ import annotations

from collections.abc import Callable

from proximity_monitor.display.bridge import word

ROWS = 40
"""Rows of a page."""


def pager(turn: str, first: int, total: int, mark: Callable[[int], str] = str) -> str:
    """Return HTML that says which rows are shown, with links to other pages.

    Args:
        turn: the word that a press sends, followed by the mark of the page.
        first: the first row of the page.
        total: how many rows there are.
        mark: returns the mark of the page that begins with a given row.
    """
    if total <= ROWS:
        return ""
    before = {"first": 0, "previous": max(first - ROWS, 0)} if first > 0 else {}
    after = {"next": first + ROWS, "last": total - ROWS} if first + ROWS < total else {}
    presses = (
        f"<span class=pm-press {word(f'{turn}:{mark(to)}')}>{name}</span>"
        for name, to in (before | after).items()
    )
    shown = f"{first + 1} to {min(first + ROWS, total)} of {total}"
    return f"<div class=pm-small id=pm-{turn}>{shown}: {' '.join(presses)}</div>"


def page_of(first: int, total: int) -> slice:
    """Return the rows of the page that begins with a row, or of the last page if there is none."""
    if first >= total:
        first = max(total - ROWS, 0)
    return slice(first, first + ROWS)
