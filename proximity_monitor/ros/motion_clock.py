"""Keeps the moment of a motion; its speed and moment can change while it runs."""

from __future__ import annotations

import json


class MotionClock:
    """Converts the time of a node's clock, in nanoseconds, to the moment of the motion, in seconds.

    A node's clock may be at 0 until its first time comes, as with `use_sim_time`. The motion waits
    until then.
    """

    def __init__(self, speed: float, seek_s: float) -> None:
        """Begin at the first reading, `seek_s` into the motion."""
        self._begin_s = self._from_s = seek_s
        self._from_ns: int | None = None
        self.speed = speed

    def read(self, now_ns: int) -> float:
        """Return the moment; if the node's clock went back, the motion begins again."""
        if self._from_ns is None or now_ns < self._from_ns:
            self.seek(now_ns, self._begin_s)
        return self._from_s + (now_ns - (self._from_ns or now_ns)) * 1e-9 * self.speed

    def go_on(self, now_ns: int, speed: float) -> None:
        """Go on from the present moment at another speed; 0 stands still."""
        self._from_s, self._from_ns = self.read(now_ns), now_ns or None
        self.speed = speed

    def seek(self, now_ns: int, moment_s: float) -> None:
        """Go on from another moment, at which the motion also begins from now on."""
        self._begin_s = self._from_s = moment_s
        self._from_ns = now_ns or None

    def told(self, now_ns: int, period_s: float | None, repeats: bool) -> str:
        """Return JSON for ``~/motion``, which gives the moment at any later time.

        ``moment_s`` is the moment at the node's time ``stamp_s``, and ``speed`` the seconds of
        motion per second from then on. ``period_s`` is the time after which the motion repeats or
        rests, null if it does neither, and ``repeats`` says whether it repeats.
        """
        self.read(now_ns)
        stamp_s = (self._from_ns or now_ns) * 1e-9
        told = {"moment_s": self._from_s, "stamp_s": stamp_s, "speed": self.speed}
        return json.dumps(told | {"period_s": period_s, "repeats": repeats})
