"""Every answer is held against the exact one: a certificate that is broken ends the study."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .timing import Timed


class BrokenCertificateError(Exception):
    """An answer contradicts the exact one, or errs by more than was asked for."""


def check(where: str, answers: Timed, exact: Timed, rel_err: float | None = None) -> None:
    """Raise unless every answer agrees with the exact one to the same question.

    The true distance lies between the bounds of both answers, so they must overlap. An upper bound
    above (1 + rel_err) times the exact answer's upper bound is above that of the true distance for
    certain; with no error asked for, the bounds must meet to rounding, which `Status.EXACT` says.

    Args:
        where: what is asked, for the message.
        answers: what was found.
        exact: what was found with no error allowed, query by query.
        rel_err: what was asked for; None: a budget, which promises nothing but bounds that hold.

    Raises:
        BrokenCertificateError: naming the first query that breaks its promise.
    """
    lower, upper = answers.of("lower"), answers.of("upper")
    true_lower, true_upper = exact.of("lower"), exact.of("upper")
    broken = ~((lower <= true_upper) & (true_lower <= upper))  # NaN breaks it, too
    if rel_err:
        broken |= ~(upper <= (1.0 + rel_err) * true_upper)
    if rel_err == 0.0:
        broken |= np.array(
            [a.status.value not in ("exact", "intersecting") for a in answers.answers]
        )
    if broken.any():
        i = int(np.flatnonzero(broken)[0])
        raise BrokenCertificateError(
            f"{where}: query {i}: [{lower[i]!r}, {upper[i]!r}] m against the exact "
            f"[{true_lower[i]!r}, {true_upper[i]!r}] m, relative error asked for: {rel_err}; "
            f"{int(broken.sum())} of {len(broken)} queries"
        )


def relative_errors(answers: Timed, exact: Timed, kept: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(kept,) by which share of the exact distance the upper bounds are too large."""
    true = exact.of("upper")[kept]
    return np.maximum(answers.of("upper")[kept] - true, 0.0) / true
