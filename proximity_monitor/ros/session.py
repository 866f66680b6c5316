"""A configured monitor: what it holds, and its tick, which gathers, decides and publishes."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from proximity_monitor import engine
from proximity_monitor.ros.diagnostics import Health
from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.outputs import Outputs
from proximity_monitor.ros.parameters import Settings
from proximity_monitor.scene import Scene
from proximity_monitor.scene.alerts import Alert, Alerts, Level
from proximity_monitor.scene.schedule import Monitor
from proximity_monitor.scene.state import Tick

POSES = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""The latest pose wins; best effort accepts reliable publishers too."""


class Session:
    """Everything that lives from configure to cleanup.

    Ticks and diagnostics are timed by the steady clock, so that they go on where simulated time
    stands still; stamps, and the age of poses, are of the node's clock.
    """

    def __init__(
        self,
        node: LifecycleNode,
        scene: Scene,
        models: Mapping[str, engine.TriangleMesh],
        settings: Settings,
    ) -> None:
        """Create publishers, services, subscriptions and timers; ticking begins with `start`."""
        self.scene = scene
        self.settings = settings
        self._node = node
        self._paused = False
        self._tick: Tick | None = None
        self._now_ns = 0
        self._monitor = Monitor(scene, models)
        self._alerts = Alerts(len(scene.pairs), scene.unit)
        moving = [body for body in scene.bodies if body.moving]
        self._inputs = Inputs([body.name for body in moving], settings.frame)
        self._health = Health(node.get_fully_qualified_name().lstrip("/"), settings.frame)

        self._outputs = Outputs(node, scene, models, settings)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._services = [
            node.create_service(Trigger, "~/reset_minima", self._on_reset),
            node.create_service(SetBool, "~/pause", self._on_pause),
        ]
        self._subscriptions = [
            node.create_subscription(
                PoseStamped, body.topic, partial(self._store, body.name), POSES
            )
            for body in moving
        ]
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._ticking = node.create_timer(
            1.0 / settings.rate_hz, self._on_tick, clock=steady, autostart=False
        )
        self._seconds = node.create_timer(1.0, self._on_second, clock=steady)
        self.apply(settings)

    def apply(self, settings: Settings) -> None:
        """Put new settings in force from the next tick on."""
        before, self.settings = self.settings, settings
        if (before.rel_err, before.abs_err) != (settings.rel_err, settings.abs_err) or (
            self._tick is None
        ):
            self._monitor.set_tolerance(settings.rel_err, settings.abs_err)
        if before.rate_hz != settings.rate_hz:
            self._ticking.timer_period_ns = int(1e9 / settings.rate_hz)
            if not self._ticking.is_canceled():
                self._ticking.reset()  # else the old period has to end first
        self._monitor.set_thresholds(settings.thresholds)
        self._inputs.timeout_s = settings.pose_timeout_s
        self._outputs.apply(settings)

    def start(self) -> None:
        """Begin to tick."""
        self._health.timing.forget_window()
        self._ticking.reset()

    def stop(self) -> None:
        """Tick no more, and take down what viewers show of the last tick."""
        self._ticking.cancel()
        self._outputs.take_down(self._node.get_clock().now().to_msg())

    def close(self) -> None:
        """Stop, and destroy everything that was created."""
        self.stop()
        self._outputs.destroy()
        self._node.destroy_publisher(self._diagnostics)
        for service in self._services:
            self._node.destroy_service(service)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        for timer in (self._ticking, self._seconds):
            self._node.destroy_timer(timer)

    def _on_tick(self) -> None:
        if self._paused:
            return
        started = time.perf_counter()
        now = self._node.get_clock().now()
        if now.nanoseconds < self._now_ns:
            self._inputs.forget()
            self._node.get_logger().warning("the clock went back: waiting for new poses")
        self._now_ns = now.nanoseconds
        samples = self._inputs.samples(now.nanoseconds)

        tick = self._tick = self._monitor.tick(samples, self.settings.budget_s)
        changes = self._alerts.update(tick.pairs, self.settings.thresholds)

        levels = self._alerts.levels
        self._outputs.publish(now.to_msg(), tick, levels, changes, self._inputs)
        self._outputs.publish_parts(samples, started)
        self._log(changes)
        ended = time.perf_counter()
        self._health.timing.record(ended, tick, ended - started, 1.0 / self.settings.rate_hz)

    def _log(self, changes: Sequence[Alert]) -> None:
        logger = self._node.get_logger()
        for change in changes:
            line = f"{change.a} - {change.b}: {change.new.value}: {change.reason}"
            # Two calls: rclpy refuses one place in the source that logs with varying severity.
            if change.new in (Level.STOP, Level.STALE):
                logger.warning(line)
            else:
                logger.info(line)

    def _on_second(self) -> None:
        now = self._node.get_clock().now()
        for name in self._inputs.note_strangers(self._strangers()):
            self._node.get_logger().warning(
                f"poses of {name} are published, but {self.scene.path.name} has no such moving body"
            )
        activity = "inactive" if self._ticking.is_canceled() else "active"
        if self._paused and activity == "active":
            activity = "paused"
        self._diagnostics.publish(
            self._health.message(
                now.to_msg(),
                settings=self.settings,
                inputs=self._inputs,
                now_ns=now.nanoseconds,
                tick=self._tick,
                levels=self._alerts.levels,
                activity=activity,
            )
        )

    def _store(self, name: str, message: PoseStamped) -> None:
        self._inputs.store(name, message, self._node.get_clock().now().nanoseconds)

    def _strangers(self) -> list[tuple[str, bytes]]:
        """The publishers of topics bodies/*/pose, in our namespace, that no body listens to."""
        heard = {subscription.topic_name for subscription in self._subscriptions}
        pattern = re.compile(
            re.escape(self._node.get_namespace().rstrip("/")) + r"/bodies/([^/]+)/pose"
        )
        return [
            (match[1], bytes(publisher.endpoint_gid))
            for topic, _ in self._node.get_topic_names_and_types()
            if topic not in heard and (match := pattern.fullmatch(topic))
            for publisher in self._node.get_publishers_info_by_topic(topic)
        ]

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._monitor.reset_minima()
        response.success = True
        response.message = f"forgot the minima of {len(self.scene.pairs)} pairs"
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        was, self._paused = self._paused, request.data
        self._health.timing.forget_window()
        response.success = True
        if was == self._paused:
            response.message = f"already {'paused' if was else 'running'}"
        elif self._paused:
            response.message = "paused: nothing is watched or published until it goes on"
        else:
            response.message = "running again"
        return response


def compile_search() -> None:
    """Run one query through every kernel, so that the first tick does not wait for the compiler."""
    triangle = engine.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    above = np.eye(4)
    above[2, 3] = 1.0
    engine.Pair(triangle, triangle).distance(np.eye(4), above, budget_s=1.0)
