"""The ROS side: passes the monitor's messages to the inbox and publishes poses of held bodies."""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from proximity_monitor.display.holds import Holds
from proximity_monitor.display.inbox import Inbox
from proximity_monitor.display.state import Health, Playing, SceneInfo

HELD_HZ = 40.0
"""How often the poses of held bodies are published, in hertz."""

_LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
_EACH = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""For ticks: every tick counts for smallest clearances and events, even if no page shows it."""
_LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


class ProximityDisplay(Node):
    """Listens to one monitor and publishes the poses of held bodies.

    Parameters, all read at start: ``monitor`` and ``player`` (names of nodes), ``host``, ``port``,
    ``conflicts`` (the file with people's decisions about conflicts).
    """

    def __init__(self, inbox: Inbox, holds: Holds, **node_options) -> None:
        """Subscribe to the monitor and the player.

        Args:
            inbox: takes the messages.
            holds: has the poses to publish.
            node_options: for `rclpy.node.Node`, such as parameter_overrides.

        Raises:
            rclpy.exceptions.ParameterException: a parameter has another type or an illegal value,
                such as a name that no node can have.
        """
        super().__init__("proximity_display", **node_options)
        self._inbox = inbox
        self._holds = holds
        self._scene: SceneInfo | None = None
        self._topics: dict[str, str] = {}  # of the bodies that can be held, by name
        self._publishers_of: dict[str, object] = {}
        self._parts = None
        text = "Name of the monitor's node, in this node's namespace unless it begins with a slash."
        self.monitor = self._declare_node("monitor", "proximity_monitor", text)
        text = "Address to listen on. There is no login: whoever reaches it can move the bodies."
        self.host = self._declare("host", "127.0.0.1", text)
        text = "Name of a player, which does not move the bodies that are held here."
        self._player = self._declare_node("player", "proximity_player", text)
        ports = [IntegerRange(from_value=0, to_value=65535)]
        text = "Port of the page; 0: any free port. If it is taken, the next free one is used."
        self.port = self._declare("port", 8080, text, integer_range=ports)
        text = "File with the status of conflicts; empty: beside the scene's file."
        self.conflicts = self._declare("conflicts", "", text)

        def hear(kind, topic, take, qos, raw=False):
            return self.create_subscription(kind, f"{self.monitor}/{topic}", take, qos, raw=raw)

        hear(String, "scene", self._on_scene, _LATCHED)
        hear(PointCloud2, "pairs", inbox.put_pairs, _EACH, raw=True)
        hear(PoseArray, "poses", inbox.put_poses, _EACH, raw=True)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self._to_monitor = self.create_client(
            SetParametersAtomically, f"{self.monitor}/set_parameters_atomically"
        )
        self._to_reset = self.create_client(Trigger, f"{self.monitor}/reset_minima")
        self._to_player = self.create_client(SetParameters, f"{self._player}/set_parameters")
        self.create_subscription(String, f"{self._player}/motion", self._on_motion, _LATCHED)
        self._asked: frozenset[str] | None = None  # bodies that the player was asked to leave alone
        self._released: frozenset[str] | None = None  # those to which it agreed; None: unknown
        self.create_timer(1.0 / HELD_HZ, self._publish_held)
        # A moved body is published at once, without waiting for the timer.
        holds.on_move = self.create_guard_condition(self._publish_held).trigger
        self.create_timer(0.5, self._look_around)

    def set_parameters_of_monitor(self, values: Mapping[str, float | str]) -> None:
        """Ask for new values, all or none; the inbox gets a refusal. Any thread may call this."""
        request = SetParametersAtomically.Request(
            parameters=[Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        )

        def refuse(reason: str) -> None:
            self._inbox.tell(refusal=reason, refused=frozenset(values if reason else ()))

        def on_answer(future) -> None:
            result = future.result().result
            refuse("" if result.successful else result.reason)

        if self._to_monitor.service_is_ready():
            refuse("")
            self._to_monitor.call_async(request).add_done_callback(on_answer)
        else:
            refuse(f"{self._to_monitor.srv_name} does not answer")

    def reset_minima_of_monitor(self) -> None:
        """Ask it to forget the smallest clearances, and pass on its answer. Any thread may call."""
        if not self._to_reset.service_is_ready():
            self._inbox.tell(reset=f"{self._to_reset.srv_name} does not answer: reset only here")
            return
        self._inbox.tell(reset="reset here; the monitor was asked to")
        self._to_reset.call_async(Trigger.Request()).add_done_callback(
            lambda future: self._inbox.tell(reset=f"the monitor {future.result().message}")
        )

    def set_parameters_of_player(self, values: Mapping[str, float]) -> None:
        """Ask the player for new values; the inbox gets a refusal. Any thread may call this."""
        if not self._to_player.service_is_ready():
            self._inbox.tell(player_refusal=f"{self._to_player.srv_name} does not answer")
            return
        parameters = [Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]

        def on_answer(future) -> None:
            reasons = [each.reason for each in future.result().results if not each.successful]
            self._inbox.tell(player_refusal="; ".join(reasons))

        request = SetParameters.Request(parameters=parameters)
        self._to_player.call_async(request).add_done_callback(on_answer)

    @property
    def player_knows(self) -> bool:
        """Whether there is no player, or it has agreed to leave alone exactly the held bodies."""
        return not self._to_player.service_is_ready() or self._holds.poses.keys() == self._released

    def _declare(self, name: str, default, text: str, **limits):
        descriptor = ParameterDescriptor(description=text, read_only=True, **limits)
        return self.declare_parameter(name, default, descriptor).value

    def _declare_node(self, name: str, default: str, text: str) -> str:
        """Declare a parameter for the name of a node; return the name with its namespace."""
        value = self._declare(name, default, text)
        try:
            return self.resolve_topic_name(value)
        except RuntimeError as error:
            why = str(error).partition(", at ")[0]  # the rest is a place in ROS's own source
            reason = f"not a valid node name: {why}"
            raise InvalidParameterValueException(name, value, reason) from error

    def _on_scene(self, message: String) -> None:
        try:
            scene = SceneInfo.read(message.data)
        except ValueError as error:
            self.get_logger().error(str(error))
            self._inbox.judge("scene", str(error))
            return
        before, self._scene = self._scene, scene
        if before is None or before.key != scene.key:
            self._topics = {body.name: body.topic for body in scene.bodies if body.topic}
            self._inbox.begin(scene)
            self._holds.begin(scene.key)
            self._hear_parts(True)
        self._inbox.judge("scene", None)
        self._inbox.tell(scene=scene)

    def _on_motion(self, message: String) -> None:
        try:
            self._inbox.tell(playing=Playing.read(message.data), player_ended=False)
        except ValueError as error:
            self.get_logger().error(str(error))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        told = {
            status.name: {each.key: each.value for each in status.values}
            | {"message": status.message}
            for status in message.status
        }
        schedule, clearance = (
            told.get(f"{self.monitor.lstrip('/')}: {task}") for task in ("schedule", "clearance")
        )
        if schedule is not None:
            self._inbox.put_health(Health(schedule, clearance or {}))

    def _publish_held(self) -> None:
        held = self._holds.poses
        if held.keys() != self._asked:
            self._tell_player(frozenset(held))
        if not held or self._scene is None:
            return
        message = PoseStamped()
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = self._scene.frame
        place, turn = message.pose.position, message.pose.orientation
        for name in held.keys() & self._topics.keys():
            pose = held[name]
            place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z = pose.tolist()
            self._publisher(name).publish(message)

    def _tell_player(self, held: frozenset[str]) -> None:
        if not self._to_player.service_is_ready():
            return
        self._asked = held
        value = Parameter("released", Parameter.Type.STRING_ARRAY, sorted(held))
        request = SetParameters.Request(parameters=[value.to_parameter_msg()])

        def on_answer(future) -> None:
            if all(result.successful for result in future.result().results):
                self._released = held

        self._to_player.call_async(request).add_done_callback(on_answer)

    def _publisher(self, name: str):
        topic = self._topics[name]
        if topic not in self._publishers_of:
            self._publishers_of[topic] = self.create_publisher(PoseStamped, topic, _LATEST)
        return self._publishers_of[topic]

    def _look_around(self) -> None:
        """Check which nodes are there, and subscribe to the meshes only while they are needed."""
        news = self._inbox.news
        names = self.get_node_names_and_namespaces()
        present = any(f"{space.rstrip('/')}/{name}" == self.monitor for name, space in names)
        if self._asked != self._released or not self._to_player.service_is_ready():
            # The player refused, its answer was lost, or it is gone and may come again: ask again.
            self._asked = self._released = None
        rivals = {
            info.node_name
            for name in self._holds.poses.keys() & self._topics.keys()
            for info in self.get_publishers_info_by_topic(self._topics[name])
            if self._is_rival(name, f"{info.node_namespace.rstrip('/')}/{info.node_name}")
        }
        self._inbox.tell(present=present, rivals=tuple(sorted(rivals)))
        if self.count_publishers(f"{self._player}/motion") == 0 and news.playing is not None:
            self._inbox.tell(playing=None, player_ended=True)
        if self._scene is not None:
            self._hear_parts(news.parts is None or bool(self._scene.deforming))

    def _is_rival(self, body: str, node: str) -> bool:
        """Return whether a node that publishes on a held body's topic may publish its poses."""
        agreed = node == self._player and body in (self._released or ())
        return not agreed and node != self.get_fully_qualified_name()

    def _hear_parts(self, wanted: bool) -> None:
        """Start or stop listening to ~/parts.

        Reading large meshes several times a second would take a whole core; once is enough.
        """
        if wanted and self._parts is None:
            self._parts = self.create_subscription(
                MarkerArray, f"{self.monitor}/parts", self._inbox.put_parts, _LATCHED, raw=True
            )
        elif not wanted and self._parts is not None:
            self.destroy_subscription(self._parts)
            self._parts = None
