"""Limits the rate of the ticks that new poses ask for."""

from __future__ import annotations


class Pace:
    """Lets ticks through at a limited average rate, each up to half a period early.

    The intervals of poses that come at just this rate vary about its period. With half a period of
    credit, each pose gets its tick at once, but a flood of poses still gets no more ticks than the
    rate. (In networks: a generic cell rate algorithm with a tolerance of half a period.)
    """

    def __init__(self, rate_hz: float) -> None:
        """Begin with the first tick allowed."""
        self.limit(rate_hz)

    def limit(self, rate_hz: float) -> None:
        """Allow `rate_hz` ticks a second from now on, the first one at once."""
        self._due_s = float("-inf")
        self._period_s = 1.0 / rate_hz

    def wait_s(self, now_s: float) -> float:
        """Return the seconds until a tick may happen; 0 or less if it may happen now."""
        return self._due_s - 0.5 * self._period_s - now_s

    def allows(self, now_s: float) -> bool:
        """Return whether a tick may happen now; if so, it counts as done."""
        if self.wait_s(now_s) > 0.0:
            return False
        self._due_s = max(self._due_s, now_s) + self._period_s
        return True
