"""When poses may call for a tick."""

from __future__ import annotations


class Pace:
    """Lets ticks through at a limited rate, steady on average, each a little early if need be.

    Poses that come at the very rate tremble about its period; half a period of credit lets each of
    them have its tick at once, and still no flood of them has more ticks than the rate. (In the
    terms of networks: a generic cell rate algorithm with half a period's tolerance.)
    """

    def __init__(self, rate_hz: float) -> None:
        """Begin with the first tick allowed."""
        self._due_s = float("-inf")
        self.limit(rate_hz)

    def limit(self, rate_hz: float) -> None:
        """Allow so many ticks a second from now on."""
        self._period_s = 1.0 / rate_hz

    def allows(self, now_s: float) -> bool:
        """Return whether a tick may be now, and take note that it is."""
        if now_s < self._due_s - 0.5 * self._period_s:
            return False
        self._due_s = max(self._due_s, now_s) + self._period_s
        return True
