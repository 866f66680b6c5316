"""Nothing is read or written beyond an array: numba's own check watches a few questions."""

from __future__ import annotations


def test_every_index_is_in_bounds(bounds_checked):
    cache, process = bounds_checked
    output, errors = process.communicate()
    assert process.returncode == 0, errors
    assert output.strip() == "every index was in bounds"
    # All was compiled for this run, as it said, once.
    said = [line for line in errors.splitlines() if "compiling" in line]
    assert len(said) == 1
    assert str(cache) in said[0]
