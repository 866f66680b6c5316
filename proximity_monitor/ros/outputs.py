"""The monitor's publishers. Nothing is built for a topic without subscribers."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, String
from visualization_msgs.msg import MarkerArray

from proximity_monitor import engine
from proximity_monitor.ros import messages
from proximity_monitor.ros.looks import Looks
from proximity_monitor.ros.markers import ClearanceMarkers
from proximity_monitor.ros.pairs_message import PairsMessage
from proximity_monitor.ros.parts import PartsMessage
from proximity_monitor.ros.poses_message import PosesMessage
from proximity_monitor.ros.qos import LATCHED, LATEST, Incompatible
from proximity_monitor.ros.scene_message import SceneMessage
from proximity_monitor.ros.scene_parameters import Settings
from proximity_monitor.scene import Scene
from proximity_monitor.scene.alerts import Alert, Level
from proximity_monitor.scene.state import PoseSample, Tick, as_arrays

KEPT_ALERTS = 1000
"""How many alerts are kept for slow or late subscribers. A tick publishes at most this many, the
most urgent, because no subscriber could hold more."""

LAST_WORD_S = 0.5
"""How long to wait until subscribers have the last state, before its publishers are destroyed."""

_URGENCY = (Level.STOP, Level.STALE, Level.WARN, Level.CLEAR)


class Outputs:
    """Publishes the results of ticks."""

    def __init__(
        self,
        node: LifecycleNode,
        scene: Scene,
        settings: Settings,
        incompatible: Incompatible,
    ) -> None:
        """Create the publishers; `show` must follow before anything is published."""
        self._node = node
        self._scene = scene
        self._frame = settings.frame
        # All pairs may change at once, and twice before a slow subscriber reads. A late
        # subscriber still gets the last changes.
        alerts = QoSProfile(
            depth=min(2 * len(scene.pairs), KEPT_ALERTS),
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        self._publishers = []
        self.built: Counter[str] = Counter()
        """How many messages were made for each topic."""
        self.alerts_left_out = 0

        def create(kind: type, topic: str, qos: QoSProfile):
            self.built[topic] = 0
            made = node.create_lifecycle_publisher(
                kind, f"~/{topic}", qos, event_callbacks=incompatible.publisher(f"~/{topic}")
            )
            self._publishers.append(made)
            return made

        self._alerts = create(DiagnosticStatus, "alerts", alerts)
        self._clearance = create(Float64, "clearance", LATEST)
        self._closest = create(DiagnosticArray, "closest_points", LATEST)
        self._pairs = create(PointCloud2, "pairs", LATEST)
        self._markers = create(MarkerArray, "markers", LATEST)
        self._parts = create(MarkerArray, "parts", LATCHED)
        self._poses = create(PoseArray, "poses", LATEST)
        self._described = create(String, "scene", LATCHED)
        self._scene_is_new = True
        self._held: Mapping[str, str] = {}
        self._deforming: set[str] = set()
        moving = [body.name for body in scene.bodies if body.moving]
        self._poses_message = PosesMessage(moving, settings.frame)
        self._pairs_message = PairsMessage([body.name for body in scene.bodies], settings.frame)
        self._points_wanted = self._clearance_wanted = self._marks_wanted = False
        self._pairs_wanted = False
        self._message: PartsMessage | None = None
        self._looks = Looks()
        self._shown: dict[str, np.ndarray | None] = {}
        self._viewers = 0
        self._parts_due_s = 0.0
        self._settings = settings

    def show(self, models: Mapping[str, engine.Model]) -> None:
        """Take the models of all bodies by name; nothing can be published before."""
        self._models = models
        self._scene_message = SceneMessage(self._scene, models, self._node.resolve_topic_name)
        size = max(2.0 * model.radius for model in models.values())
        self._marks = ClearanceMarkers(self._frame, self._scene.unit, size)
        self.apply(self._settings)

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings
        self._scene_is_new = True
        self._marks.live(max(1.0, 3.0 / settings.rate_hz))

    def check_demand(self) -> bool:
        """Note the subscribers, for the next `publish`; return whether any want distances."""
        self._points_wanted = self._closest.get_subscription_count() > 0
        self._pairs_wanted = self._pairs.get_subscription_count() > 0
        self._clearance_wanted = self._clearance.get_subscription_count() > 0
        self._marks_wanted = self._settings.markers and self._markers.get_subscription_count() > 0
        return (
            self._points_wanted
            or self._pairs_wanted
            or self._clearance_wanted
            or self._marks_wanted
        )

    def publish(
        self,
        stamp: Time,
        tick: Tick,
        levels: Mapping[int, Level],
        changes: Sequence[Alert],
        silent: Mapping[str, str],
        pose_stamp_ns: Callable[[str], int | None],
    ) -> None:
        """Publish a tick: alerts always, because late subscribers get them, the rest on demand.

        Call `check_demand` first.

        Args:
            stamp: the tick's stamp.
            tick: the tick's results.
            levels: by index of the pair.
            changes: the changes of levels.
            silent: the reason for each silent body.
            pose_stamp_ns: returns the stamp of a body's pose, by name.
        """
        told = changes
        if len(changes) > KEPT_ALERTS:
            told = sorted(changes, key=lambda change: _URGENCY.index(change.new))[:KEPT_ALERTS]
            self.alerts_left_out += len(changes) - len(told)
        for change in told:
            self._send(
                "alerts", self._alerts, messages.alert(change, stamp=stamp, frame=self._frame)
            )
        if self._pairs_wanted:
            words = len(self._pairs_message.words)
            self._send(
                "pairs",
                self._pairs,
                self._pairs_message.serialised(
                    as_arrays(tick.pairs),
                    levels,
                    stamp=stamp,
                    pose_stamp_ns=pose_stamp_ns,
                    silent=silent,
                ),
            )
            self._scene_is_new |= len(self._pairs_message.words) > words
        pairs = tuple(tick.pairs) if self._marks_wanted or self._points_wanted else ()
        if self._points_wanted:
            self._send(
                "closest_points",
                self._closest,
                messages.closest_points(
                    pairs,
                    levels,
                    stamp=stamp,
                    frame=self._frame,
                    unit=self._scene.unit,
                    silent=silent,
                    pose_stamp_ns=pose_stamp_ns,
                ),
            )
        if self._clearance_wanted:
            self._send("clearance", self._clearance, Float64(data=tick.clearance()))
        if self._marks_wanted:
            self._send("markers", self._markers, self._marks.message(pairs, levels, stamp))

    def publish_parts(self, samples: Mapping[str, PoseSample | None], now_s: float) -> None:
        """Publish the parts if a viewer came, or if there is a viewer and a body has moved."""
        viewers = self._parts.get_subscription_count() if self._settings.markers else 0
        came, self._viewers = viewers > self._viewers, viewers
        if not viewers or (now_s < self._parts_due_s and not came):
            return
        if self._message is None:
            self._message = self._build_parts()
        poses = {name: None if at is None else at.pose for name, at in samples.items()}
        # Each new good pose is a new array, so a body with the same array has not moved.
        moved = {name: pose for name, pose in poses.items() if self._shown.get(name) is not pose}
        self._shown.update(moved)
        self._message.place(moved)
        if came or moved:
            self._send("parts", self._parts, self._message.serialised())
            self._parts_due_s = now_s + self._message.period_s

    def publish_scene(self, held: Mapping[str, str], unwatched: Collection[int]) -> None:
        """Publish the scene, the settings and the attachments in force, if they changed.

        Args:
            held: the parent's name by the child's, for attached bodies that are carried now.
            unwatched: the indices of pairs that are not watched because of these attachments.
        """
        if self._scene_is_new or held != self._held:
            self._scene_is_new, self._held = False, held
            message = self._scene_message.message(
                self._settings, self._deforming, self._pairs_message.words, held, unwatched
            )
            self._send("scene", self._described, message)

    def publish_poses(self, samples: Mapping[str, PoseSample | None], stamp: Time) -> None:
        """Publish the poses of a tick if there is a subscriber."""
        if self._poses.get_subscription_count():
            self._send("poses", self._poses, self._poses_message.serialised(samples, stamp))

    def reshape(self, name: str) -> None:
        """Note that a body has another shape: the parts are rebuilt before they are shown again."""
        self._scene_is_new |= name not in self._deforming
        self._deforming.add(name)
        self._message = None
        self._shown.clear()

    def take_down(self, stamp: Time) -> None:
        """Remove the markers from viewers; the parts stay."""
        if self._markers.get_subscription_count():
            self._markers.publish(self._marks.farewell(stamp))

    def destroy(self) -> None:
        """Destroy the publishers, once the last state has arrived.

        A message that is still under way when its publisher is destroyed is lost. That was one in
        four, measured with six processes on two cores.
        """
        until = time.monotonic() + LAST_WORD_S
        for publisher in (self._closest, self._pairs, self._clearance, self._markers):
            left_s = max(0.0, until - time.monotonic())
            if not publisher.wait_for_all_acked(Duration(seconds=left_s)):
                log = self._node.get_logger()
                log.warning(
                    f"{publisher.topic_name}: not all subscribers received the last message"
                )
        # Wait briefly: Fast DDS asks only every three seconds whether a longer history arrived.
        self._alerts.wait_for_all_acked(Duration(seconds=0.02))
        for publisher in self._publishers:
            self._node.destroy_lifecycle_publisher(publisher)

    def _send(self, topic: str, publisher, message) -> None:
        self.built[topic] += 1
        publisher.publish(message)

    def _build_parts(self) -> PartsMessage:
        """Build the message for the first viewer."""
        message = PartsMessage(self._scene.bodies, self._models, self._frame, self._looks)
        message.place({body.name: body.pose for body in self._scene.bodies if not body.moving})
        return message
