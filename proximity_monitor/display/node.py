"""The ROS side: what the monitor publishes goes into the inbox, and held bodies are published."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray, PoseStamped
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from proximity_monitor.display.holds import Holds
from proximity_monitor.display.inbox import Alert, Inbox
from proximity_monitor.display.state import Health, Scene

HELD_HZ = 40.0
"""How often the poses of held bodies are published."""

_LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
_LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
_ALERTS = QoSProfile(
    depth=200, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
_LEVELS = {
    DiagnosticStatus.OK: "clear",
    DiagnosticStatus.WARN: "warn",
    DiagnosticStatus.ERROR: "stop",
    DiagnosticStatus.STALE: "stale",
}


class ProximityDisplay(Node):
    """Listens to one monitor.

    Parameters, all read at start: ``monitor`` and ``player`` (names of nodes), ``host``, ``port``.
    """

    def __init__(self, inbox: Inbox, holds: Holds, **node_options) -> None:
        """Subscribe.

        Args:
            inbox: takes what arrives.
            holds: the poses to publish.
            node_options: for `rclpy.node.Node`, such as parameter_overrides.

        Raises:
            rclpy.exceptions.ParameterException: a parameter is of another type or no legal value.
        """
        super().__init__("proximity_display", **node_options)
        self._inbox = inbox
        self._holds = holds
        self._scene: Scene | None = None
        self._publishers_of: dict[str, object] = {}
        self._parts = None
        text = "Name of the monitor's node, in this node's namespace unless it begins with a slash."
        self._declare("monitor", "proximity_monitor", text)
        text = "Address to listen on. There is no login: whoever reaches it can move the bodies."
        self.host = self._declare("host", "127.0.0.1", text)
        text = "Name of a player, which leaves the bodies that are held here alone."
        player = self.resolve_topic_name(self._declare("player", "proximity_player", text))
        ports = [IntegerRange(from_value=0, to_value=65535)]
        text = "Port of the page; 0: any that is free. Where it is taken, the next free one."
        self.port = self._declare("port", 8080, text, integer_range=ports)
        self.monitor = self.resolve_topic_name(self.get_parameter("monitor").value)

        def hear(kind, topic, take, qos, raw=False):
            return self.create_subscription(kind, f"{self.monitor}/{topic}", take, qos, raw=raw)

        hear(String, "scene", self._on_scene, _LATCHED)
        hear(DiagnosticArray, "closest_points", inbox.put_points, _LATEST, raw=True)
        hear(PoseArray, "poses", inbox.put_poses, _LATEST, raw=True)
        hear(DiagnosticStatus, "alerts", self._on_alert, _ALERTS)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self._parameters = self.create_client(
            SetParametersAtomically, f"{self.monitor}/set_parameters_atomically"
        )
        self._player = self.create_client(SetParameters, f"{player}/set_parameters")
        self._released: frozenset[str] = frozenset()
        self._reset = self.create_client(Trigger, f"{self.monitor}/reset_minima")
        self.create_timer(1.0 / HELD_HZ, self._publish_held)
        self.create_timer(0.5, self._look_around)

    def set_parameters_of_monitor(self, values: Mapping[str, float]) -> None:
        """Ask for new values, all or none; the inbox tells a refusal. Any thread may call."""
        request = SetParametersAtomically.Request(
            parameters=[Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        )

        def on_answer(future) -> None:
            result = future.result().result
            self._inbox.tell(refusal="" if result.successful else result.reason)

        self._ask(self._parameters, request, on_answer)

    def reset_minima(self) -> None:
        """Have the monitor forget its smallest clearances. Any thread may call."""
        self._ask(self._reset, Trigger.Request(), lambda future: None)

    def _declare(self, name: str, default, text: str, **limits):
        descriptor = ParameterDescriptor(description=text, read_only=True, **limits)
        return self.declare_parameter(name, default, descriptor).value

    def _ask(self, client, request, on_answer: Callable) -> None:
        if not client.service_is_ready():
            self._inbox.tell(refusal=f"{client.srv_name} does not answer")
            return
        client.call_async(request).add_done_callback(on_answer)

    def _on_scene(self, message: String) -> None:
        try:
            scene = Scene.read(message.data)
        except ValueError as error:
            self.get_logger().error(str(error))
            self._inbox.tell(refusal=str(error))
            return
        before, self._scene = self._scene, scene
        if before is None or (before.name, before.frame, before.bodies) != (
            scene.name,
            scene.frame,
            scene.bodies,
        ):
            self._inbox.forget()
            self._holds.release()
            self._hear_parts(True)
        self._inbox.tell(scene=scene)

    def _on_alert(self, message: DiagnosticStatus) -> None:
        values = {each.key: each.value for each in message.values}
        stamp_s = float(values.get("stamp", "nan"))
        self._inbox.put_alert(Alert(stamp_s, _LEVELS[message.level], message.name, message.message))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        prefix = f"{self.monitor.lstrip('/')}: "
        told = {
            status.name.removeprefix(prefix): {v.key: v.value for v in status.values}
            | {"message": status.message}
            for status in message.status
            if status.name.startswith(prefix)
        }
        if told:
            kinds = ("schedule", "clearance", "inputs")
            self._inbox.put_health(Health(**{kind: told.get(kind, {}) for kind in kinds}))

    def _publish_held(self) -> None:
        held = self._holds.poses
        if held.keys() != self._released:
            self._tell_player(frozenset(held))
        if not held or self._scene is None:
            return
        message = PoseStamped()
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = self._scene.frame
        place, turn = message.pose.position, message.pose.orientation
        for name, pose in held.items():
            place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z = pose.tolist()
            self._publisher(name).publish(message)

    def _tell_player(self, held: frozenset[str]) -> None:
        if self._player.service_is_ready():
            self._released = held
            value = Parameter("released", Parameter.Type.STRING_ARRAY, sorted(held))
            self._player.call_async(SetParameters.Request(parameters=[value.to_parameter_msg()]))

    def _publisher(self, name: str):
        topic = self._scene.body(name).topic
        if topic not in self._publishers_of:
            self._publishers_of[topic] = self.create_publisher(PoseStamped, topic, _LATEST)
        return self._publishers_of[topic]

    def _look_around(self) -> None:
        """See who is there, and hear the meshes only as long as they are needed."""
        news = self._inbox.news
        names = self.get_node_names_and_namespaces()
        present = any(f"{space.rstrip('/')}/{name}" == self.monitor for name, space in names)
        rivals = {
            info.node_name
            for name in self._holds.poses
            for info in self.get_publishers_info_by_topic(self._scene.body(name).topic)
            if info.node_name != self.get_name()
        }
        self._inbox.tell(present=present, rivals=tuple(sorted(rivals)))
        if self._scene is not None:
            self._hear_parts(news.parts is None or bool(self._scene.deforming))

    def _hear_parts(self, wanted: bool) -> None:
        """A large mesh is worth a core if it comes several times a second, and comes but once."""
        if wanted and self._parts is None:
            self._parts = self.create_subscription(
                MarkerArray, f"{self.monitor}/parts", self._inbox.put_parts, _LATCHED, raw=True
            )
        elif not wanted and self._parts is not None:
            self.destroy_subscription(self._parts)
            self._parts = None
