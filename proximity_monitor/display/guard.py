"""A drag that ends where a clearance may end: at `stop`, or at contact.

A clearance shrinks by no more than a body moves. So from the pose of the last tick a body may move
by as much as its smallest certified lower bound is above the limit. Each tick allows the next move,
and no pose that is published comes nearer than the limit, as long as the other bodies rest. What is
attached to a body moves with it, so its bounds count as well, and how far it reaches.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from proximity_monitor.display.geometry import between, conjugate, moved, multiply, rotate
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.state import STALE, UNKNOWN, Frame, SceneInfo

FREE, AT_STOP, AT_CONTACT = "nowhere", "at stop", "at contact"

SURELY = 1.02
"""The triangles that are shown are rounded: they reach as far but for less than this."""

_HALVINGS = 40


def carried(name: str, held: Mapping[str, str]) -> frozenset[str]:
    """Return a body with all that move with it, by the parent's name of each that is held."""
    found, new = frozenset(), frozenset({name})
    while new:
        found |= new
        new = frozenset(child for child, parent in held.items() if parent in new) - found
    return found


def slack(group: Collection[str], frame: Frame, scene: SceneInfo, where: str) -> float:
    """Return how far bodies that move together may move from where they are in a tick, in metres.

    Not positive: they are at the limit, or nearer, or a body that they could meet is silent. Pairs
    that are not listed are beyond their range, which counts as `warn` and the hysteresis at least.
    """

    def limit(pair: tuple[str, str]) -> float:
        return scene.thresholds_of(pair).stop if where == AT_STOP else 0.0

    def meets(pair: tuple[str, str]) -> bool:
        return (pair[0] in group) != (pair[1] in group)

    pairs, found = frame.pairs, math.inf
    for i, pair in enumerate(pairs.names):
        if meets(pair):
            silent = pairs.level[i] == STALE or pairs.status[i] == UNKNOWN
            found = min(found, 0.0 if silent else float(pairs.lower[i]) - limit(pair))
    beyond = min((body.range for body in scene.bodies if body.name in group), default=math.inf)
    if len(pairs) < scene.pairs and beyond < math.inf:
        if not pairs.all_silent:
            return min(found, 0.0)
        own = [pair for pair in scene.own_thresholds.keys() - pairs.places.keys() if meets(pair)]
        for limits in (scene.thresholds, *map(scene.thresholds_of, own)):
            stop = limits.stop if where == AT_STOP else 0.0
            found = min(found, max(beyond, limits.warn + limits.hysteresis) - stop)
    return found


def radius_of(
    name: str, group: Collection[str], frame: Frame, scene: SceneInfo, parts: Parts
) -> float | None:
    """Return that of a ball about a body's centre that holds all that move with it, in metres.

    None: the pose of one of them is not known. Infinite: nor is how far one of them reaches.
    """
    poses = {each: frame.pose(scene.moving.index(each)) for each in group}
    if any(pose is None for pose in poses.values()):
        return None
    centres = {x: moved(pose, parts[x].centre / parts.scale)[:3] for x, pose in poses.items()}
    sizes = {x: np.linalg.norm(parts[x].high - parts[x].low) / 2.0 / parts.scale for x in group}
    away = {x: np.linalg.norm(centre - centres[name]) for x, centre in centres.items()}
    return max(float(away[each] + SURELY * sizes[each] + parts[each].off) for each in group)


def reach(before: np.ndarray, after: np.ndarray, centre: np.ndarray, radius: float) -> float:
    """Return how far any point of a body moves at most between two poses (7,).

    Args:
        before: x y z in metres, quaternion w x y z.
        after: the same.
        centre: (3,) in the body's frame, metres.
        radius: of a ball about it that contains the body, metres; infinite: not known.
    """
    shift = after[:3] - before[:3] + rotate(after[3:], centre) - rotate(before[3:], centre)
    sine = np.linalg.norm(multiply(conjugate(before[3:]), after[3:])[1:])  # of half the angle
    # How far what reaches without end moves is known only where it does not turn.
    turned = 2.0 * float(sine) * radius if sine > 0.0 else 0.0
    return float(np.linalg.norm(shift)) + turned


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
