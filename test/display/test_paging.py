"""Which rows of a long list a page shows."""

from __future__ import annotations

import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.display.paging import ROWS, page_of


@pytest.mark.parametrize(
    ("first", "total", "begin"),
    [
        (0, 3 * ROWS, 0),
        (2 * ROWS, 2 * ROWS + 5, 2 * ROWS),  # the last page may have few rows
        (2 * ROWS, ROWS + 5, 5),  # the list became shorter: its last page, whole
        (ROWS, 5, 0),
        (ROWS, 0, 0),
    ],
)
def test_a_page_beyond_the_end_is_the_whole_last_one(first, total, begin):
    assert page_of(first, total) == slice(begin, begin + ROWS)
