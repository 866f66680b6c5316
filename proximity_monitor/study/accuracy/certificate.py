"""Check every answer against the exact one; a broken certificate ends the study."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .timing import Timed


class BrokenCertificateError(Exception):
    """An answer contradicts the exact one, or errs by more than was asked for."""


def check(where: str, answers: Timed, exact: Timed, rel_err: float | None = None) -> None:
    """Raise unless every answer agrees with the exact one to the same question.

    The true distance lies between the bounds of both answers, so the two intervals must overlap. If
    an upper bound exceeds (1 + rel_err) times the exact answer's upper bound, it certainly exceeds
    (1 + rel_err) times the true distance. If no error is allowed (`rel_err` is 0), the bounds must
    meet to rounding, which `Status.EXACT` says.

    Args:
        where: names the question, for the message.
        answers: the answers to check.
        exact: the answers with no error allowed, query by query.
        rel_err: the relative error asked for; None: a budget, which promises only that bounds hold.

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
            f"{where}: query {i}: [{lower[i]!r}, {upper[i]!r}] m contradicts the exact "
            f"[{true_lower[i]!r}, {true_upper[i]!r}] m (requested relative error: {rel_err}); "
            f"{int(broken.sum())} of {len(broken)} queries"
        )


def relative_errors(answers: Timed, exact: Timed, kept: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return (n,) errors of the upper bounds of kept queries, as shares of the exact distance."""
    true = exact.of("upper")[kept]
    return np.maximum(answers.of("upper")[kept] - true, 0.0) / true
