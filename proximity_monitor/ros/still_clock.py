"""A watchdog on simulated time.

The age of an input is a difference of two times of the node's clock. If the node's clock is /clock
and stands still, no input ever grows old, so this watchdog measures /clock by steady time. It
cannot tell a paused simulation from a slow or a dead one; in each case the bodies may be anywhere.
"""

from __future__ import annotations

import time

from rclpy.clock import Clock

REASON = "no new time on /clock (a paused simulation?), so no recent pose"


class StillClock:
    """Tells whether a node's clock stands still."""

    def __init__(self, clock: Clock) -> None:
        """Watch a node's clock from now on; only simulated time can stand still."""
        self._clock = clock
        self._now_ns = -1
        self._since_s = time.monotonic()
        self._pardoned = False
        self.still = False
        """Whether the clock stood still at the last `update`."""

    def update(self, now_ns: int, timeout_s: float) -> bool:
        """Take the time `now_ns`; return whether the clock has just stopped or started again.

        It stands still if it has shown one time for more than `timeout_s` seconds of steady time.
        """
        steady_s = time.monotonic()
        if now_ns != self._now_ns:
            self._now_ns, self._since_s, self._pardoned = now_ns, steady_s, False
        before, self.still = self.still, False
        if self._clock.ros_time_is_active:
            self.still = steady_s - self._since_s > timeout_s
        return self.still is not before

    def pardon(self, seconds: float) -> None:
        """Do not count a time in which the node was busy and could not hear /clock.

        This applies once until /clock changes again, because the node can hear /clock between two
        ticks.
        """
        if not self._pardoned:
            self._since_s += seconds
            self._pardoned = True
