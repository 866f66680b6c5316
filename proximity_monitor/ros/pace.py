"""The pace of ticks that new poses ask for."""

from __future__ import annotations


class Pace:
    """Lets ticks through at a limited average rate, each a little early if need be.

    Poses that come at just this rate tremble about its period. Half a period of credit lets each
    have its tick at once, and still a flood of poses gets no more ticks than the rate. (In
    networks: a generic cell rate algorithm with half a period's tolerance.)
    """

    def __init__(self, rate_hz: float) -> None:
        """Begin with the first tick allowed."""
        self.limit(rate_hz)

    def limit(self, rate_hz: float) -> None:
        """Allow so many ticks a second from now on; the first is allowed."""
        self._due_s = float("-inf")
        self._period_s = 1.0 / rate_hz

    def wait_s(self, now_s: float) -> float:
        """Return in how many seconds a tick may happen, 0 or less if it may now."""
        return self._due_s - 0.5 * self._period_s - now_s

    def allows(self, now_s: float) -> bool:
        """Return whether a tick may happen now; if so, it counts as done."""
        if self.wait_s(now_s) > 0.0:
            return False
        self._due_s = max(self._due_s, now_s) + self._period_s
        return True
