"""The monitor's parameters: what they are, what they may be, and the settings they give.

Four of them override the scene file: ``rate_hz``, ``budget_ms``, ``rel_err`` and ``abs_err``. Their
default, -1, means "as the scene file says". The thresholds become parameters when the node is
configured, with the scene file's values as defaults, so that what they show is what is in force:
``thresholds.warn|stop|hysteresis`` for all pairs without thresholds of their own in the scene
file, and ``pairs.<a>.<b>.warn|stop|hysteresis`` for each pair with its own. All lengths are
metres. To move ``warn`` below the present ``stop``, or the other way round, set both in one atomic
call.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from proximity_monitor.scene import Scene, Thresholds

AS_SCENE = -1.0
"""The value of an overriding parameter that leaves the scene file's value in force."""

_LEVELS = ("warn", "stop", "hysteresis")
_FURTHEST = 1e6  # metres; thresholds beyond it are slips of the keyboard


class _Spec(NamedTuple):
    default: Any
    text: str
    low: float = -math.inf
    high: float = math.inf
    fixed: bool = False  # cannot change while the node is configured
    overrides: bool = False  # AS_SCENE means the scene file's value

    def descriptor(self) -> ParameterDescriptor:
        limits = []
        if isinstance(self.default, float):
            low = AS_SCENE if self.overrides else self.low
            limits = [FloatingPointRange(from_value=low, to_value=self.high)]
        return ParameterDescriptor(description=self.text, floating_point_range=limits)


_SPECS: Mapping[str, _Spec] = {
    "scene": _Spec(
        "engine", "Scene file, or the name of a bundled scene. Read when configured.", fixed=True
    ),
    "fixed_frame": _Spec(
        "",
        "Frame of all poses and results; empty: the scene file's. Read when configured.",
        fixed=True,
    ),
    "autostart": _Spec(True, "Configure and activate at start, without a manager.", fixed=True),
    "rate_hz": _Spec(
        AS_SCENE, "Ticks a second; -1: the scene file's.", 0.1, 1000.0, overrides=True
    ),
    "budget_ms": _Spec(
        AS_SCENE,
        "Time for the searches of one tick, in milliseconds; 0 only certifies bounds; -1: the scene"
        " file's.",
        0.0,
        10000.0,
        overrides=True,
    ),
    "rel_err": _Spec(
        AS_SCENE,
        "Relative tolerance of all pairs; 0 is exact; -1: each pair's from the scene file.",
        0.0,
        1.0,
        overrides=True,
    ),
    "abs_err": _Spec(
        AS_SCENE,
        "Absolute tolerance of all pairs, in metres; 0 is exact; -1: each pair's from the scene"
        " file.",
        0.0,
        _FURTHEST,
        overrides=True,
    ),
    "pose_timeout_s": _Spec(
        0.5,
        "Seconds after its stamp at which a pose is stale: refused if it arrives so late, and a"
        " body without a newer one makes its pairs stale.",
        0.01,
        3600.0,
    ),
    "markers": _Spec(True, "Publish ~/markers and ~/parts where they have subscribers."),
}


class Settings(NamedTuple):
    """What is in force, parameters and scene file taken together. SI units."""

    rate_hz: float
    budget_s: float
    rel_err: float | None
    """None: each pair's own."""
    abs_err: float | None
    pose_timeout_s: float
    frame: str
    markers: bool
    thresholds: tuple[Thresholds, ...]
    """One a watched pair."""


def declare(node: Node) -> None:
    """Declare the parameters that exist whatever the scene.

    Raises:
        rclpy.exceptions.ParameterException: a value given at start is of another type or out of
        range.
    """
    for name, spec in _SPECS.items():
        node.declare_parameter(name, spec.default, spec.descriptor())


def declare_thresholds(node: Node, scene: Scene) -> None:
    """Declare the threshold parameters of a scene, with its values as defaults.

    Raises:
        ValueError: a value given at start is no legal one; the message says why.
    """
    for prefix, limits in _threshold_groups(scene).items():
        for level in _LEVELS:
            descriptor = ParameterDescriptor(
                description=f"{level} of {_whose(prefix)}, in metres; warn >= stop >= 0.",
                floating_point_range=[FloatingPointRange(from_value=0.0, to_value=_FURTHEST)],
            )
            try:
                node.declare_parameter(
                    f"{prefix}.{level}", float(getattr(limits, level)), descriptor
                )
            except ParameterException as error:
                raise ValueError(str(error)) from error
    if reason := refusal(_values(node, _threshold_groups(scene)), changed=()):
        raise ValueError(reason)


def undeclare_thresholds(node: Node, scene: Scene) -> None:
    """Remove the threshold parameters of a scene, those of them that are declared."""
    for prefix in _threshold_groups(scene):
        for level in _LEVELS:
            if node.has_parameter(f"{prefix}.{level}"):
                node.undeclare_parameter(f"{prefix}.{level}")


def read(node: Node, scene: Scene) -> Settings:
    """Return the settings in force for a scene whose threshold parameters are declared."""
    values = _values(node, _threshold_groups(scene))

    def chosen(name: str, otherwise: Any) -> Any:
        return otherwise if values[name] == AS_SCENE else values[name]

    budget_ms = chosen("budget_ms", scene.budget_s * 1e3)
    return Settings(
        rate_hz=chosen("rate_hz", scene.rate_hz),
        budget_s=budget_ms / 1e3,
        rel_err=chosen("rel_err", None),
        abs_err=chosen("abs_err", None),
        pose_timeout_s=values["pose_timeout_s"],
        frame=values["fixed_frame"] or scene.frame,
        markers=values["markers"],
        thresholds=tuple(
            Thresholds(*(values[f"{_prefix(pair)}.{level}"] for level in _LEVELS))
            for pair in scene.pairs
        ),
    )


def check(node: Node, scene: Scene | None, changes: Sequence[Parameter]) -> SetParametersResult:
    """Judge a set of changes as one; `scene` is None while the node is not configured."""
    changed = {p.name: p.value for p in changes}
    if scene is not None:
        for name, value in changed.items():
            if name in _SPECS and _SPECS[name].fixed and node.get_parameter(name).value != value:
                reason = f"{name} cannot change while the node is configured: clean it up first"
                return SetParametersResult(successful=False, reason=reason)
    groups = _threshold_groups(scene) if scene is not None else {}
    reason = refusal({**_values(node, groups), **changed}, changed=tuple(changed))
    return SetParametersResult(successful=not reason, reason=reason)


def refusal(values: Mapping[str, Any], changed: Sequence[str]) -> str:
    """Return why the values cannot be in force together; empty if they can.

    Args:
        values: all parameters by name; thresholds only where a whole group is there.
        changed: the names that are new, for which each value is judged by itself.
    """
    for name in changed:
        value = values[name]
        if isinstance(value, float) and not math.isfinite(value):
            return f"{name} must be a finite number, not {value}"
        spec = _SPECS.get(name)
        if spec is not None and spec.overrides and value != AS_SCENE and value < spec.low:
            return (
                f"{name} must be at least {spec.low:g}, or -1 for the scene file's; not {value:g}"
            )
        if name == "scene" and not value:
            return "scene must name a scene file or a bundled scene"
    for name, warn in values.items():
        prefix, _, level = name.rpartition(".")
        stop = values.get(f"{prefix}.stop")
        if level == "warn" and stop is not None and not warn >= stop:
            return (
                f"{prefix}: warn ({warn:g} m) must be at least stop ({stop:g} m);"
                " set both in one atomic call to move them past each other"
            )
    return ""


def _threshold_groups(scene: Scene) -> dict[str, Thresholds]:
    groups = {"thresholds": scene.thresholds}
    groups.update({_prefix(pair): pair.thresholds for pair in scene.pairs if pair.own_thresholds})
    return groups


def _prefix(pair: Any) -> str:
    return f"pairs.{pair.a}.{pair.b}" if pair.own_thresholds else "thresholds"


def _whose(prefix: str) -> str:
    _, _, names = prefix.partition(".")
    return names.replace(".", " and ") or "all pairs without thresholds of their own"


def _values(node: Node, groups: Mapping[str, Thresholds]) -> dict[str, Any]:
    names = [*_SPECS, *(f"{prefix}.{level}" for prefix in groups for level in _LEVELS)]
    return {name: node.get_parameter(name).value for name in names if node.has_parameter(name)}
