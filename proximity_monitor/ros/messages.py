"""Results as messages: points in the fixed frame, lengths in metres.

``~/closest_points`` is a `diagnostic_msgs/DiagnosticArray` with one `DiagnosticStatus` per pair. No
other type in common_interfaces has named values for each of many named things and is shown readably
by ``ros2 topic echo`` and every diagnostics viewer. The message has the pairs that the tick lists:
a pair with a range is left out while it is certainly farther apart.

====================  ==================================================================
``header.stamp``      the tick's stamp; ``header.frame_id``: the fixed frame
``name``              ``piston_1 - block``: the names of bodies A and B
``level``             OK, WARN, ERROR or STALE for clear, warn, stop or stale
``message``           the clearance in the scene's unit and its status: ``0.0254 mm exact``
``hardware_id``       the fixed frame
``point_a, point_b``  the closest points ``x y z``, the first on A; the upper bound's witnesses
``lower_m, upper_m``  certified bounds, every digit of the float64
``status``            exact, within tolerance, bounded, intersecting, overlapping, unknown pose
``state``             clear, warn, stop or stale
``stamp``             the older stamp of the two bodies' poses: the moment of the numbers
``age_s``             seconds since the numbers answered the poses of that time; 0 if they
                      answer the present ones
``direction``         unit vector from A's point to B's; empty if the points coincide
``feature_a, _b``     for a pair at warn or stop, the places of its points on the models: kind of
                      element, its index, and the point's parameters on it. On a mesh
                      ``edge 12 0.5 0.5 0``: the triangle, and the barycentric weights of its
                      corners. On a surface ``patch 4 1 0.8``: the patch, u and v
``session_min_m``     the smallest upper bound since the last reset: the pair was that near
``session_min_lower_m``  the smallest lower bound since then: at no tick was the pair nearer
====================  ==================================================================

If a body has no pose, the pair's values are ``nan``, and its points and direction are empty. A
custom message would be smaller, but every consumer would have to build this package.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from proximity_monitor import cdr
from proximity_monitor.scene import Unit
from proximity_monitor.scene.alerts import Alert, Level
from proximity_monitor.scene.state import NO_POSE_YET, PairState, PairStatus, silence

SEVERITY = {
    Level.CLEAR: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.STOP: DiagnosticStatus.ERROR,
    Level.STALE: DiagnosticStatus.STALE,
}

_NEAR = (Level.WARN, Level.STOP)


def pair_name(a: str, b: str) -> str:
    """Return the name of a pair as it is published."""
    return f"{a} - {b}"


def clearance_text(
    pair: PairState, unit: Unit, silent: Mapping[str, str] = MappingProxyType({})
) -> str:
    """Return a pair's clearance as text: one number if it is known, else both bounds.

    `silent` gives the reason for each silent body.
    """
    if pair.status is PairStatus.UNKNOWN:
        return silence(pair.silent, silent, NO_POSE_YET)
    number = f"{pair.upper / unit.to_metre:.4g}"
    if pair.status is PairStatus.BOUNDED:
        number = f"{pair.lower / unit.to_metre:.4g}..{number}"
    stale = f", {silence(pair.silent, silent)}" if pair.silent else ""
    return f"{number} {unit.symbol} {pair.status.value}{stale}"


def closest_points(
    pairs: Sequence[PairState],
    levels: Mapping[int, Level],
    *,
    stamp: Time,
    frame: str,
    unit: Unit,
    pose_stamp_ns: Callable[[str], int | None],
    silent: Mapping[str, str] = MappingProxyType({}),
) -> bytes:
    """Return all pairs of a tick as one serialised message (see the module's table).

    rclpy takes some 5 µs for each of a pair's dozen values, ten times as long as writing its bytes.

    Args:
        pairs: the pairs that the tick lists.
        levels: by the pair's index in the scene.
        stamp: the tick's stamp.
        frame: the fixed frame.
        unit: for the texts.
        pose_stamp_ns: returns the stamp of a body's pose, by name.
        silent: the reason for each silent body.
    """
    hardware_id = cdr.text(frame)
    head = cdr.stamped(stamp.sec, stamp.nanosec)
    parts, spare = [head, hardware_id, cdr.count(len(pairs))], 0
    for pair in pairs:
        level = levels[pair.index]
        values = _pair_values(pair, level, pose_stamp_ns)
        if spare:  # an octet follows a string without padding
            parts[-1] = parts[-1][:-spare]
        parts += (
            SEVERITY[level] + bytes(spare - 1 if spare else 3),
            cdr.text(pair_name(pair.a, pair.b)),
            cdr.text(clearance_text(pair, unit, silent)),
            hardware_id,
            cdr.count(len(values)),
        )
        for key, value in values.items():
            parts += (_KEYS[key], cdr.text(value))
        spare = 3 - len(value) % 4
    return b"".join(parts)


def alert(change: Alert, *, stamp: Time, frame: str) -> DiagnosticStatus:
    """Return one change of level; the message says why, in the scene's unit.

    Its values: ``old`` and ``new`` level; ``lower_m`` and ``upper_m``; ``reason``; ``stamp`` of the
    tick; ``body`` and ``escape``, the unit vector in the fixed frame along which it gets away;
    ``closing_m_s``, negative if the bodies part; ``seconds_left`` at that speed until stop, or
    until contact if the pair is at stop. Unknown values are empty or ``nan``.
    """
    motion = change.motion
    escape = motion is not None and motion.escape is not None
    return DiagnosticStatus(
        level=SEVERITY[change.new],
        name=pair_name(change.a, change.b),
        message=f"{change.old.value} -> {change.new.value}: {change.reason}",
        hardware_id=frame,
        values=_values(
            {
                "old": change.old.value,
                "new": change.new.value,
                "lower_m": repr(change.lower),
                "upper_m": repr(change.upper),
                "reason": change.reason,
                "body": motion.body if escape else "",
                "escape": _vector(motion.escape.tolist()) if escape else "",
                "closing_m_s": f"{motion.closing:.6g}" if motion is not None else "nan",
                "seconds_left": f"{change.seconds_left:.6g}",
                "stamp": seconds(stamp.sec * 1_000_000_000 + stamp.nanosec),
            }
        ),
    )


def seconds(nanoseconds: int) -> str:
    """Return a time in seconds with all nine decimals."""
    return f"{nanoseconds // 1_000_000_000}.{nanoseconds % 1_000_000_000:09d}"


def _pair_values(
    pair: PairState, level: Level, pose_stamp_ns: Callable[[str], int | None]
) -> dict[str, str]:
    stamps = [s for s in (pose_stamp_ns(pair.a), pose_stamp_ns(pair.b)) if s is not None]
    known = pair.status is not PairStatus.UNKNOWN
    a, b = pair.point_a.tolist(), pair.point_b.tolist()
    values = {
        "point_a": _vector(a) if known else "",
        "point_b": _vector(b) if known else "",
        "lower_m": repr(pair.lower),
        "upper_m": repr(pair.upper),
        "status": pair.status.value,
        "state": level.value,
        "stamp": seconds(min(stamps)) if known and stamps else "nan",
        "age_s": f"{pair.age_s:.4f}" if known else "nan",
        "direction": _direction(a, b) if known else "",
        "session_min_m": repr(pair.session_min if pair.session_min < math.inf else math.nan),
        "session_min_lower_m": repr(
            pair.session_min_lower if pair.session_min_lower < math.inf else math.nan
        ),
    }
    if level in _NEAR:
        for key, feature in zip(_FEATURES, pair.features, strict=False):
            where = (f"{value:.9g}" for value in feature.parameters.tolist())
            values[key] = " ".join((feature.kind, str(feature.index), *where))
    return values


def _direction(a: Sequence[float], b: Sequence[float]) -> str:
    length = math.dist(a, b)
    return _vector([(y - x) / length for x, y in zip(a, b, strict=True)]) if length > 0.0 else ""


def _vector(values: Sequence[float]) -> str:
    x, y, z = values
    return f"{x:.9g} {y:.9g} {z:.9g}"


def _values(items: dict[str, str]) -> list[KeyValue]:
    return [KeyValue(key=key, value=value) for key, value in items.items()]


_FEATURES = ("feature_a", "feature_b")
_KEYS = {
    key: cdr.text(key)
    for key in (
        "point_a", "point_b", "lower_m", "upper_m", "status", "state", "stamp", "age_s",
        "direction", "session_min_m", "session_min_lower_m", *_FEATURES,
    )
}  # fmt: skip
