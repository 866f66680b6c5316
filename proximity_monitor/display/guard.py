"""A drag that stops at a limit of the clearance: at `stop`, or at contact.

A clearance shrinks by no more than a body moves. So from its pose in the last tick, a body may move
by the excess of its smallest certified lower bound over the limit. Each tick allows the next move.
As long as the other bodies rest, no published pose comes nearer than the limit. Bodies attached to
a body move with it, so their bounds and their extent count as well.
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
"""Factor on the radius of a part's shown triangles, which are rounded by far less than that."""

_HALVINGS = 40


def carried(name: str, held: Mapping[str, str]) -> frozenset[str]:
    """Return a body with all bodies that move with it; `held` has the parent of each held body."""
    found, new = frozenset(), frozenset({name})
    while new:
        found |= new
        new = frozenset(child for child, parent in held.items() if parent in new) - found
    return found


def slack(group: Collection[str], frame: Frame, scene: SceneInfo, where: str) -> float:
    """Return how far bodies that move together may move from their poses in a tick, in metres.

    If it is not positive, they are at the limit or nearer, or a body that they could meet is
    silent. Unlisted pairs are beyond their range, which is at least `warn` plus the hysteresis.
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
    """Return the radius (m) of a ball about a body's centre that holds all that moves with it.

    None: a pose among them is not known. Infinite: it is not known how far one of them extends.
    """
    poses = {each: frame.pose(scene.moving.index(each)) for each in group}
    if any(pose is None for pose in poses.values()):
        return None
    centres = {x: moved(pose, parts[x].centre / parts.scale)[:3] for x, pose in poses.items()}
    sizes = {x: np.linalg.norm(parts[x].high - parts[x].low) / 2.0 / parts.scale for x in group}
    away = {x: np.linalg.norm(centre - centres[name]) for x, centre in centres.items()}
    return max(float(away[each] + SURELY * sizes[each] + parts[each].deviation) for each in group)


def reach(before: np.ndarray, after: np.ndarray, centre: np.ndarray, radius: float) -> float:
    """Return an upper bound on how far any point of a body moves between two poses (7,), metres.

    Args:
        before: x y z in metres, quaternion w x y z.
        after: as `before`.
        centre: (3,) of a ball that contains the body, in the body's frame, metres.
        radius: of that ball, metres; infinite: not known.
    """
    shift = after[:3] - before[:3] + rotate(after[3:], centre) - rotate(before[3:], centre)
    sine = np.linalg.norm(multiply(conjugate(before[3:]), after[3:])[1:])  # sine of half the angle
    # With an infinite radius the motion is bounded only if the body does not turn.
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
    """Return the pose (7,) between `now` and `target` that is as near `target` as the slack allows.

    Args:
        seen: (7,) the body's pose in the tick.
        now: (7,) the pose at which the body is held.
        target: (7,) where the hand wants the body.
        centre: see `reach`.
        radius: see `reach`.
        slack_m: how far any point of the body may be from its place at `seen`, in metres.
    """
    if reach(seen, target, centre, radius) < slack_m:
        return target
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (low + high) / 2.0
        fits = reach(seen, between(now, target, share), centre, radius) < slack_m
        low, high = (share, high) if fits else (low, share)
    return between(now, target, low) if low > 0.0 else now
