"""The monitor's parameters, their legal values, and the settings that follow from them.

Four of them override the scene file: ``rate_hz``, ``budget_ms``, ``rel_err`` and ``abs_err``. Their
default, -1, means "as the scene file says". Parameters that depend on the scene are declared when
the node is configured, so that they show the values in force (`scene_parameters`). All lengths are
in metres.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from proximity_monitor.scene.schema import bounds

AS_SCENE = -1.0
"""The value of an overriding parameter that leaves the scene file's value in force."""


class Spec(NamedTuple):
    """A parameter and its legal values."""

    default: Any
    text: str
    low: float = -math.inf
    high: float = math.inf
    fixed: bool = False  # cannot change while the node is configured
    overrides: bool = False  # AS_SCENE means the scene file's value

    def descriptor(self) -> ParameterDescriptor:
        """Return its description for the parameter services."""
        made = ParameterDescriptor(description=self.text)
        if isinstance(self.default, float):
            low = AS_SCENE if self.overrides else self.low
            made.floating_point_range = [FloatingPointRange(from_value=low, to_value=self.high)]
        elif type(self.default) is int:
            made.integer_range = [IntegerRange(from_value=int(self.low), to_value=int(self.high))]
        return made


SPECS: Mapping[str, Spec] = {
    "scene": Spec(
        "engine", "Scene file, or the name of a bundled scene. Read when configured.", fixed=True
    ),
    "fixed_frame": Spec(
        "",
        "Frame of all poses and results; empty: that of the scene file. Read when configured.",
        fixed=True,
    ),
    "autostart": Spec(True, "Configure and activate at start, without a manager.", fixed=True),
    "rate_hz": Spec(
        AS_SCENE, "Ticks per second; -1: as in the scene file.", *bounds("rate_hz"), overrides=True
    ),
    "budget_ms": Spec(
        AS_SCENE,
        "Time for the searches of one tick, in milliseconds; 0: no search, bounds are still"
        " certified; -1: as in the scene file.",
        *bounds("budget_ms"),
        overrides=True,
    ),
    "rel_err": Spec(
        AS_SCENE,
        "Relative tolerance of all pairs; 0 is exact; -1: for each pair as in the scene file.",
        *bounds("tolerance.rel_err"),
        overrides=True,
    ),
    "abs_err": Spec(
        AS_SCENE,
        "Absolute tolerance of all pairs, in metres; 0 is exact; -1: for each pair as in the scene"
        " file.",
        *bounds("tolerance.abs_err"),
        overrides=True,
    ),
    "pose_timeout_s": Spec(
        0.5,
        "A pose, a joint position or a shape is stale this many seconds after its stamp. If it"
        " arrives later than that, it is refused. A body without a newer one makes its pairs stale."
        " With use_sim_time, all bodies are stale while /clock stands still for this many seconds"
        " of real time.",
        0.01,
        3600.0,
    ),
    "markers": Spec(True, "Publish ~/markers and ~/parts if they have subscribers."),
    "tick_on_pose": Spec(
        True,
        "Tick as soon as every body has a new pose (of one stamp, if poses come in step), or a body"
        " at rest has moved, but at most rate_hz times per second; tick at rate_hz if no poses"
        " come. false: always tick at rate_hz.",
    ),
    "record_distances": Spec(
        False,
        "Compute distances for the recording at every tick, even if nobody subscribes to them."
        " false: without subscribers, the recording has the bounds that judge the thresholds.",
    ),
    "recording_dir": Spec(
        "", "Folder for the files of ~/dump_recording; empty: the current folder of the node."
    ),
    "threads": Spec(
        1, "Threads that share the searches of a tick. Read when configured.", 1, 256, fixed=True
    ),
    "body_topics": Spec(
        True,
        "Subscribe to a pose topic for each moving body. false, for hundreds of bodies: their poses"
        " come together on the topic poses. Read when configured.",
        fixed=True,
    ),
    "tf": Spec(
        False,
        "Also take poses from /tf, for frames that have the names of bodies; needs tf2_msgs. Read"
        " when configured.",
        fixed=True,
    ),
}


def declare(node: Node) -> None:
    """Declare the parameters that exist for every scene.

    Raises:
        rclpy.exceptions.ParameterException: a value given at start is of another type or out of
        range.
    """
    for name, spec in SPECS.items():
        declare_one(node, name, spec.default, spec.descriptor())
    node.add_pre_set_parameters_callback(partial(_with_real_numbers, node))


def declare_one(node: Node, name: str, default: Any, descriptor: ParameterDescriptor) -> None:
    """Declare a parameter; a real number may also be given as a whole number.

    Raises:
        rclpy.exceptions.ParameterException: a value given at start is of another type or out of
        range.
    """
    try:
        node.declare_parameter(name, default, descriptor)
    except InvalidParameterTypeException:
        loose = ParameterDescriptor(dynamic_typing=True)
        given = node.declare_parameter(name, default, loose).value
        node.undeclare_parameter(name)
        if not (isinstance(default, float) and type(given) is int):
            raise
        node.declare_parameter(name, float(given), descriptor, ignore_override=True)


def _with_real_numbers(node: Node, changes: Sequence[Parameter]) -> list[Parameter]:
    """Return the changes, with whole numbers made real for real parameters."""
    return [
        Parameter(change.name, value=float(change.value))
        if change.type_ is Parameter.Type.INTEGER
        and node.get_parameter_or(change.name).type_ is Parameter.Type.DOUBLE
        else change
        for change in changes
    ]


def values(node: Node) -> dict[str, Any]:
    """Return the parameters that exist for every scene, by name."""
    return {name: node.get_parameter(name).value for name in SPECS if node.has_parameter(name)}


def refusal(values: Mapping[str, Any], changed: Sequence[str]) -> str:
    """Return why the values are illegal; empty if they are legal.

    Args:
        values: parameters by name.
        changed: the names of the new values, which are judged one by one.
    """
    for name in changed:
        value = values[name]
        if isinstance(value, float) and not math.isfinite(value):
            return f"{name} must be a finite number, not {value}"
        spec = SPECS.get(name)
        given = isinstance(value, int | float) and value != AS_SCENE
        if spec is not None and spec.overrides and given and value < spec.low:
            return (
                f"{name} must be at least {spec.low:g}, or -1 for the scene file's; not {value:g}"
            )
        if name == "scene" and not value:
            return "scene must name a scene file or a bundled scene"
    return ""
