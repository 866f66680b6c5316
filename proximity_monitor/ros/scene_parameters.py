"""The parameters that depend on the scene, and the settings that follow from all parameters.

``thresholds.warn|stop|hysteresis|hold_s`` apply to all pairs without thresholds of their own in the
scene file, and ``pairs.<a>.<b>.warn|...`` to each pair with its own. The scene file's values are
the defaults. To move ``warn`` below the present ``stop``, or ``stop`` above the present ``warn``,
set both in one atomic call.

``attachments.<child>`` names the body to which a moving body is attached, and is empty if there is
none. So an assembly step is a call of the standard parameter service, a refusal says why, and a
parameter file can hold the step. (No standard service takes two names.)

Parameters that are given at start may name the bodies of a pair in either order. Names that match
nothing are reported.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from proximity_monitor.ros import parameters
from proximity_monitor.ros.parameters import AS_SCENE, SPECS
from proximity_monitor.scene import Scene, Thresholds
from proximity_monitor.scene.attachments import Attachments
from proximity_monitor.scene.naming import safe
from proximity_monitor.scene.schema import bounds

MAX_PAIRS = 100
"""How many pairs with thresholds of their own may get parameters. If a scene has more such pairs,
none gets any: a million parameters would take hours to declare, and would help nobody."""

_KEYS = {"warn": "m", "stop": "m", "hysteresis": "m", "hold_s": "s"}


class Settings(NamedTuple):
    """The settings in force, from parameters and scene file together. SI units."""

    rate_hz: float
    budget_s: float
    rel_err: float | None
    """None: each pair's own."""
    abs_err: float | None
    pose_timeout_s: float
    frame: str
    markers: bool
    tick_on_pose: bool
    record_distances: bool
    recording_dir: str
    threads: int
    body_topics: bool
    tf: bool
    thresholds: tuple[Thresholds, ...]
    """One per watched pair."""
    attachments: Mapping[str, str]
    """The parent by attached body."""


class SceneParameters:
    """The declared parameters of one scene."""

    def __init__(self, node: Node, scene: Scene) -> None:
        """Declare the parameters.

        Raises:
            ValueError: a value given at start is illegal; the message says why. Then no parameter
                stays declared.
        """
        self._node = node
        self._scene = scene
        own = [i for i, pair in enumerate(scene.pairs) if pair.own_thresholds]
        self.unadjustable = len(own) if len(own) > MAX_PAIRS else 0
        """How many pairs have thresholds of their own, but no parameters for them."""
        self._groups = {"thresholds": scene.thresholds}
        self._own: dict[int, str] = {}
        if not self.unadjustable:
            for i in own:
                pair = scene.pairs[i]
                self._own[i] = f"pairs.{safe(pair.a)}.{safe(pair.b)}"
                self._groups[self._own[i]] = pair.thresholds
        self._fixed = {i: scene.pairs[i].thresholds for i in own if i not in self._own}
        # A parameter's name contains the word for its child; its value is the parent's name.
        self._attachable = {safe(body.name): body.name for body in scene.bodies if body.posed}
        self._hangers = Attachments(scene.bodies)
        self._overrides = node._parameter_overrides  # rclpy offers no other way to see all of them
        self._turn_overrides()
        try:
            self._declare()
        except ParameterException as error:
            self.undeclare()
            raise ValueError(str(error)) from error
        if reason := self._refusal(self._values(), "set both, or correct the scene file"):
            self.undeclare()
            raise ValueError(reason)
        self._tell_overrides_of_nothing()

    def undeclare(self) -> None:
        """Undeclare the parameters."""
        for name in self._names():
            if self._node.has_parameter(name):
                self._node.undeclare_parameter(name)

    def check(self, changes: Sequence[Parameter]) -> SetParametersResult:
        """Judge a set of changes as a whole."""
        changed = {p.name: p.value for p in changes}
        for name, value in changed.items():
            if (
                name in SPECS
                and SPECS[name].fixed
                and self._node.get_parameter(name).value != value
            ):
                reason = f"{name} cannot change while the node is configured: clean it up first"
                return SetParametersResult(successful=False, reason=reason)
        values = parameters.values(self._node) | self._values() | changed
        reason = parameters.refusal(values, tuple(changed)) or self._refusal(values)
        return SetParametersResult(successful=not reason, reason=reason)

    def settings(self) -> Settings:
        """Return the settings in force."""
        scene, values = self._scene, parameters.values(self._node)

        def chosen(name: str, otherwise: Any) -> Any:
            return otherwise if values[name] == AS_SCENE else values[name]

        return Settings(
            rate_hz=chosen("rate_hz", scene.rate_hz),
            budget_s=chosen("budget_ms", scene.budget_s * 1e3) / 1e3,
            rel_err=chosen("rel_err", None),
            abs_err=chosen("abs_err", None),
            frame=values["fixed_frame"] or scene.frame,
            thresholds=self._thresholds(),
            attachments=self._parents(self._values()),
            **{name: values[name] for name in _AS_THEY_ARE},
        )

    def _declare(self) -> None:
        for prefix, thresholds in self._groups.items():
            for key, unit in _KEYS.items():
                least, most = bounds(f"thresholds.{key}")
                descriptor = ParameterDescriptor(
                    description=f"{key} of {_whose(prefix)}, in {unit}; warn >= stop >= 0.",
                    floating_point_range=[FloatingPointRange(from_value=least, to_value=most)],
                )
                default = float(getattr(thresholds, key))
                parameters.declare_one(self._node, f"{prefix}.{key}", default, descriptor)
        for word, child in self._attachable.items():
            descriptor = ParameterDescriptor(
                description=f"The body to which {child} is attached from now on; empty: none."
            )
            self._node.declare_parameter(f"{_ATTACHMENTS}{word}", "", descriptor)

    def _turn_overrides(self) -> None:
        """Take values that are given for pairs.b.a.* as values of pairs.a.b.*."""
        for i in self._own:
            pair = self._scene.pairs[i]
            for key in _KEYS:
                turned = self._overrides.get(f"pairs.{safe(pair.b)}.{safe(pair.a)}.{key}")
                name = f"{self._own[i]}.{key}"
                if turned is not None and name not in self._overrides:
                    del self._overrides[turned.name]
                    self._overrides[name] = Parameter(name, turned.type_, turned.value)

    def _tell_overrides_of_nothing(self) -> None:
        for name in self._overrides:
            if not (self._node.has_parameter(name) or name.startswith(_OF_ROS)):
                self._node.get_logger().warning(
                    f"parameter {name} is set, but no parameter has that name{self._why(name)}"
                )

    def _why(self, name: str) -> str:
        kind, *pair = name.split(".")[:-1] or [""]
        if kind == "pairs" and {safe(body.name) for body in self._scene.bodies} >= set(pair):
            if self.unadjustable:
                return f": more than {MAX_PAIRS} pairs have their own thresholds"
            return ": the scene file has no such pair with its own thresholds"
        known = self._node.list_parameters([], 0).names
        near = difflib.get_close_matches(name, known, n=1)
        return f"; did you mean {near[0]}?" if near else ""

    def _names(self) -> list[str]:
        return [f"{prefix}.{key}" for prefix in self._groups for key in _KEYS] + [
            f"{_ATTACHMENTS}{word}" for word in self._attachable
        ]

    def _values(self) -> dict[str, Any]:
        return {name: self._node.get_parameter(name).value for name in self._names()}

    def _thresholds(self) -> tuple[Thresholds, ...]:
        values = self._values()
        groups = {
            prefix: Thresholds(**{key: values[f"{prefix}.{key}"] for key in _KEYS})
            for prefix in self._groups
        }
        made = [groups["thresholds"]] * len(self._scene.pairs)
        for i, prefix in self._own.items():
            made[i] = groups[prefix]
        for i, thresholds in self._fixed.items():
            made[i] = thresholds
        return tuple(made)

    def _refusal(
        self,
        values: Mapping[str, Any],
        way_out: str = "set both in one atomic call",
    ) -> str:
        for prefix in self._groups:
            warn, stop = values[f"{prefix}.warn"], values[f"{prefix}.stop"]
            if not warn >= stop:
                return f"{prefix}: warn ({warn:g} m) must be at least stop ({stop:g} m); {way_out}"
        return self._hangers.refusal(self._parents(values))

    def _parents(self, values: Mapping[str, Any]) -> dict[str, str]:
        given = (
            (child, values[f"{_ATTACHMENTS}{word}"]) for word, child in self._attachable.items()
        )
        return {child: parent for child, parent in given if parent}


_ATTACHMENTS = "attachments."
_OF_ROS = ("qos_overrides.", "use_sim_time", "start_type_description_service")
_AS_THEY_ARE = tuple(
    name for name in Settings._fields if name in SPECS and not SPECS[name].overrides
)


def _whose(prefix: str) -> str:
    _, _, names = prefix.partition(".")
    return names.replace(".", " and ") or "all pairs without thresholds of their own"
