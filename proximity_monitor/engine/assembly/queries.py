"""Queries of pairs of bodies as the kernels take them, and the rows of those without an answer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index


def no_answers(signed: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Rows (k, ANSWER) of pairs that no search has begun, of signed distances where `signed`."""
    rows = np.full((len(signed), index.ANSWER), np.nan)
    rows[:, index.LOWER], rows[:, index.UPPER] = 0.0, np.inf
    rows[signed, index.LOWER] = -np.inf
    return rows


def queries_of(
    pairs: NDArray[np.int32], wanted: NDArray[np.float64], hints: NDArray[np.int32] | None
) -> NDArray:
    """Queries (k,) of pairs (k, 2) of bodies; `wanted` and `hints` as for `Assembly.rows`."""
    made = np.zeros(len(pairs), index.QUERY)
    made["bodies"] = made["poses"] = pairs
    made["nearest"] = index.UNKNOWN
    if hints is not None:
        known = (hints >= 0).all(axis=1)
        made["nearest"][known] = hints[known]
    made["rel_err"], made["abs_err"], clearances = wanted.T
    made["stop"] = np.where(clearances < np.inf, clearances, 0.0)
    made["limit"] = np.nextafter(clearances, np.inf)
    return made
