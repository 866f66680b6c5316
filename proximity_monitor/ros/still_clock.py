"""A watchdog on simulated time.

The age of an input is a difference of two times of the node's clock. Where that is /clock and
/clock stands still, nothing grows old any more, so it is watched by steady time. Whether the
simulation is paused, slow or dead cannot be told apart; the bodies may be anywhere in all cases.
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
        self.still = False
        """What the last `look` found."""

    def look(self, now_ns: int, timeout_s: float) -> bool:
        """Look at the clock, which says `now_ns`; return whether that began or ended to be still.

        It is still when it said the same for longer than `timeout_s` seconds of steady time.
        """
        steady_s = time.monotonic()
        if now_ns != self._now_ns:
            self._now_ns, self._since_s = now_ns, steady_s
        before, self.still = self.still, False
        if self._clock.ros_time_is_active:
            self.still = steady_s - self._since_s > timeout_s
        return self.still is not before

    def pardon(self, seconds: float) -> None:
        """Leave out a time in which the node was busy and could not hear /clock."""
        self._since_s += seconds
