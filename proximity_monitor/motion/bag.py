"""Poses from a ROS 2 bag, as they were recorded."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from proximity_monitor.motion.bag_file import Track, read_tracks
from proximity_monitor.motion.motion import Motion, within_period
from proximity_monitor.scene.naming import counted
from proximity_monitor.scene.poses import pose_matrices


class Bag(Motion):
    """Bodies at their last recorded poses, as a subscriber would have seen them.

    The time of a pose is the time when the recorder received it, as for ``ros2 bag play``. The
    motion begins `seek_s` after the start of the bag and ends with the bag. A body has no pose
    before its first message.
    """

    def __init__(
        self,
        path: Path,
        topics: Mapping[str, str | tuple[str, ...]],
        frame: str,
        rate: float,
        seek_s: float,
        loop: bool,
    ) -> None:
        """Read the recorded poses.

        Reading a million poses takes some ten seconds, and meanwhile half a GB of memory.

        Args:
            path: the bag's folder, or its .mcap or .db3 file.
            topics: by topic, the body that its PoseStamped messages move, or the bodies that the
                poses of its PoseArray messages move.
            frame: the only accepted frame_id.
            rate: seconds of the recording per second of motion.
            seek_s: seconds to skip at the beginning of the recording.
            loop: whether the motion begins again at the end.

        Raises:
            ValueError: the bag cannot be read or does not match `topics`, or the package rosbags is
                missing. The message names the file and the topic.
        """
        recorded = read_tracks(path, topics, frame)
        self._tracks = recorded.tracks
        self._duration_s = recorded.duration_s
        self._length_s = recorded.duration_s - seek_s
        if self._length_s < 0.0:
            raise ValueError(
                f"{path}: lasts {recorded.duration_s:g} s, so nothing is left to play after "
                f"seek_s, {seek_s:g} s"
            )
        self._path, self._rate, self._seek_s, self._loop = path, rate, seek_s, loop

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies of all topics, in the order of the topics."""
        return tuple(name for track in self._tracks for name in track.bodies)

    @property
    def period_s(self) -> float | None:
        """Seconds of motion until the bag's end; None if it holds a single moment."""
        return self._length_s / self._rate or None

    @property
    def repeats(self) -> bool:
        """Whether the bag plays in a loop."""
        return self._loop

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return the latest poses (4, 4), model to world in metres, at t seconds.

        Raises:
            ValueError: t is not finite.
        """
        if not math.isfinite(t):
            raise ValueError(f"t: must be finite (got {t})")
        end_s = self.period_s
        if end_s is None:
            return _held(self._tracks, t * self._rate + self._seek_s)
        if self._loop:
            t = within_period(t, end_s)
        # At the end, use the bag's own duration, so that rounding does not miss the last pose.
        now = t * self._rate + self._seek_s if t < end_s else self._duration_s
        return _held(self._tracks, now)

    def describe(self) -> str:
        """Return e.g. ``bag: 5 bodies, recording.mcap, 12.5 s in a loop``."""
        faster = "" if self._rate == 1.0 else f" at rate {self._rate:g}"
        return (
            f"bag: {counted(len(self.bodies), 'body', 'bodies')}, {self._path.name}, "
            f"{self._length_s:g} s{faster} {'in a loop' if self._loop else 'once'}"
        )


def _held(tracks: Iterable[Track], now: float) -> dict[str, np.ndarray]:
    names: list[str] = []
    rows: list[np.ndarray] = []
    for track in tracks:
        last = bisect_right(track.times, now) - 1
        if last >= 0:
            names += track.bodies
            rows.append(track.poses[last])
    if not rows:
        return {}
    held = np.concatenate(rows)
    return dict(zip(names, pose_matrices(held[:, :3], held[:, 3:]), strict=True))
