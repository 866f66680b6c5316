"""Decides when to tick: regularly, and at once if new poses ask for it."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.pace import Pace


class Ticking:
    """A timer of the steady clock, and a pace for the ticks that poses ask for.

    Attributes:
        on_pose: whether poses may ask for ticks.
        paused: whether there are no ticks for now.
    """

    def __init__(
        self, node: Node, rate_hz: float, inputs: Inputs, tick: Callable[[], None]
    ) -> None:
        """Create the timer, which does not run yet; it will call `tick`."""
        self.on_pose = True
        self.paused = False
        self._node = node
        self._rate_hz = rate_hz
        self._inputs = inputs
        self._tick = tick
        self._pace = Pace(rate_hz)
        self._irregular = False  # the timer rings earlier or later once: see `take_poses`
        self._timer = node.create_timer(
            1.0 / rate_hz,
            self._on_timer,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
            autostart=False,
        )

    @property
    def stopped(self) -> bool:
        """Whether the timer does not run."""
        return self._timer.is_canceled()

    def start(self) -> None:
        """Start the timer."""
        self._ring(1.0)

    def stop(self) -> None:
        """End the ticks."""
        self._timer.cancel()

    def destroy(self) -> None:
        """Destroy the timer."""
        self._node.destroy_timer(self._timer)

    def limit(self, rate_hz: float) -> None:
        """Tick `rate_hz` times a second from now on."""
        if rate_hz != self._rate_hz:
            self._rate_hz = rate_hz
            self._pace.limit(rate_hz)
            if not self.stopped:
                self._ring(1.0)  # else the old period has to end first

    def take_poses(self) -> None:
        """Tick at once if all bodies have new poses, or if a body that rested has moved.

        The timer then waits half a period longer for the next poses. If poses come at just the tick
        rate, the timer would otherwise ring just before them, and its tick, which finds nothing
        new, would keep them waiting.

        The pace may not allow a tick yet. If a body has moved from rest, as when a user drags it,
        the tick then follows as soon as it is allowed, because the user waits for it. If not, the
        tick waits for the next poses of all bodies, so that its poses are as new as possible even
        after an irregular tick.
        """
        inputs = self._inputs
        if not self.on_pose or self.paused or self.stopped:
            return
        if not (inputs.complete or inputs.woken):
            return
        now_s = time.perf_counter()
        if self._pace.allows(now_s):
            self._tick()
            self._ring(1.5)
        elif inputs.woken:
            wait_s = self._pace.wait_s(now_s)
            if self._timer.time_until_next_call() > 1e9 * wait_s:
                self._ring(wait_s * self._rate_hz)
        else:
            inputs.renew()

    def _ring(self, periods: float) -> None:
        """Let the timer ring after `periods` periods, and then every period."""
        self._irregular = periods != 1.0
        self._timer.timer_period_ns = max(int(1e9 * periods / self._rate_hz), 1)
        self._timer.reset()

    def _on_timer(self) -> None:
        if self._irregular:
            self._ring(1.0)
        if self.on_pose and self._inputs.woken:
            self.take_poses()  # the timer was set for this; the tick counts for the pace
        elif not self.paused:
            self._tick()
