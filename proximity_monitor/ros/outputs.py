"""The monitor's publishers. Nothing is built for a topic that nobody listens to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64
from visualization_msgs.msg import MarkerArray

from proximity_monitor import engine
from proximity_monitor.ros import messages
from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.markers import ClearanceMarkers
from proximity_monitor.ros.parameters import Settings
from proximity_monitor.ros.parts import PartsMessage
from proximity_monitor.scene import Scene
from proximity_monitor.scene.alerts import Alert, Level
from proximity_monitor.scene.state import PoseSample, Tick

LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


class Outputs:
    """Publishes what a tick found."""

    def __init__(
        self,
        node: LifecycleNode,
        scene: Scene,
        models: Mapping[str, engine.TriangleMesh],
        settings: Settings,
    ) -> None:
        """Create the publishers, and the parts' message if markers are wanted."""
        self._node = node
        self._scene = scene
        self._models = models
        self._frame = settings.frame
        self._size = max(2.0 * model.radius for model in models.values())
        # Every pair may change at one moment, twice before a slow subscriber looks; who comes late
        # still gets the last changes.
        alerts = QoSProfile(
            depth=2 * len(scene.pairs),
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        create = node.create_lifecycle_publisher
        self._alerts = create(DiagnosticStatus, "~/alerts", alerts)
        self._clearance = create(Float64, "~/clearance", LATEST)
        self._closest = create(DiagnosticArray, "~/closest_points", LATEST)
        self._markers = create(MarkerArray, "~/markers", LATEST)
        self._parts = create(MarkerArray, "~/parts", LATCHED)
        self._message: PartsMessage | None = None
        self._shown: dict[str, np.ndarray | None] = {}
        self._viewers = 0
        self._parts_due_s = 0.0
        self._marks = ClearanceMarkers(settings.frame, scene.unit, self._size)
        self.apply(settings)

    def apply(self, settings: Settings) -> None:
        """Take new settings; the parts' message is built when markers are first wanted."""
        self._settings = settings
        self._marks.live(max(1.0, 3.0 / settings.rate_hz))
        if settings.markers and self._message is None:
            self._message = PartsMessage(self._scene.bodies, self._models, self._frame)
            for body in self._scene.bodies:
                if not body.moving:
                    self._message.place(body.name, body.pose)

    def publish(
        self,
        stamp: Time,
        tick: Tick,
        levels: Sequence[Level],
        changes: Sequence[Alert],
        inputs: Inputs,
    ) -> None:
        """Publish a tick: alerts always, as late subscribers get them too, the rest on demand."""
        for change in changes:
            self._alerts.publish(messages.alert(change, stamp=stamp, frame=self._frame))
        if self._clearance.get_subscription_count():
            self._clearance.publish(Float64(data=tick.clearance()))
        if self._closest.get_subscription_count():
            self._closest.publish(
                messages.closest_points(
                    tick.pairs,
                    levels,
                    stamp=stamp,
                    frame=self._frame,
                    unit=self._scene.unit,
                    pose_stamp_ns=inputs.stamp_ns,
                )
            )
        if self._settings.markers and self._markers.get_subscription_count():
            self._markers.publish(self._marks.message(tick.pairs, levels, stamp))

    def publish_parts(self, samples: Mapping[str, PoseSample | None], now_s: float) -> None:
        """Publish the parts if a viewer has come, or one is there and a body moved since."""
        viewers = self._parts.get_subscription_count() if self._settings.markers else 0
        came, self._viewers = viewers > self._viewers, viewers
        if not viewers or self._message is None or (now_s < self._parts_due_s and not came):
            return
        moved = False
        for name, sample in samples.items():
            pose = None if sample is None else sample.pose
            if self._shown.get(name) is not pose:  # a new good message makes a new array
                self._shown[name] = pose
                self._message.place(name, pose)
                moved = True
        if came or moved:
            self._parts.publish(self._message.serialised())
            self._parts_due_s = now_s + self._message.period_s

    def take_down(self, stamp: Time) -> None:
        """Remove the marks from viewers' pictures; the parts stay."""
        if self._markers.get_subscription_count():
            self._markers.publish(self._marks.farewell(stamp))

    def destroy(self) -> None:
        """Destroy the publishers."""
        for publisher in (self._alerts, self._clearance, self._closest, self._markers, self._parts):
            self._node.destroy_lifecycle_publisher(publisher)
