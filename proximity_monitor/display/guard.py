"""A drag that ends where a clearance may end: at `stop`, or at contact.

A clearance shrinks by no more than a body moves. So from the pose of the last tick a body may move
by as much as its smallest certified lower bound is above the limit. Each tick allows the next move,
and no pose that is published comes nearer than the limit, as long as the other bodies rest.
"""

from __future__ import annotations

import math

import numpy as np

from proximity_monitor.display.geometry import between, rotate
from proximity_monitor.display.state import UNKNOWN, Frame, SceneInfo

FREE, AT_STOP, AT_CONTACT = "nowhere", "at stop", "at contact"

_HALVINGS = 30


def slack(name: str, frame: Frame, scene: SceneInfo, where: str) -> float:
    """Return how far a body may move from where it is in a tick, in metres.

    Not positive: it is at the limit, or nearer. Pairs that are not listed are beyond their range,
    which is never smaller than warn.
    """
    pairs, found = frame.pairs, math.inf
    for i, pair in enumerate(pairs.names):
        if name in pair:
            limit = scene.thresholds_of(pair).stop if where == AT_STOP else 0.0
            known = pairs.status[i] != UNKNOWN
            found = min(found, float(pairs.lower[i]) - limit if known else 0.0)
    if len(pairs) < scene.pairs:
        every = [scene.thresholds, *scene.own_thresholds.values()]
        found = min(found, *(x.warn - (x.stop if where == AT_STOP else 0.0) for x in every))
    return found


def reach(before: np.ndarray, after: np.ndarray, centre: np.ndarray, radius: float) -> float:
    """Return how far any point of a body moves at most between two poses (7,).

    Args:
        before: x y z in metres, quaternion w x y z.
        after: the same.
        centre: (3,) in the body's frame, metres.
        radius: of a ball about it that contains the body, metres.
    """
    shift = after[:3] - before[:3] + rotate(after[3:], centre) - rotate(before[3:], centre)
    cosine = min(1.0, abs(float(before[3:] @ after[3:])))  # of half the angle between them
    return float(np.linalg.norm(shift)) + 2.0 * math.sqrt(1.0 - cosine * cosine) * radius


def farthest(
    seen: np.ndarray,
    now: np.ndarray,
    target: np.ndarray,
    centre: np.ndarray,
    radius: float,
    slack_m: float,
) -> np.ndarray:
    """Return the pose (7,) between `now` and `target`, as near to it as the slack allows.

    Args:
        seen: the pose in the tick.
        now: where the body is held.
        target: where the hand wants it.
        centre: see `reach`.
        radius: see `reach`.
        slack_m: how far it may be from `seen`, in metres.
    """
    if reach(seen, target, centre, radius) < slack_m:
        return target
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (low + high) / 2.0
        fits = reach(seen, between(now, target, share), centre, radius) < slack_m
        low, high = (share, high) if fits else (low, share)
    return between(now, target, low) if low > 0.0 else now
