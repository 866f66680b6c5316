"""A monitor in a process of its own, and a peer that talks to it over DDS.

Nothing here sleeps: every wait spins the peer until a condition holds or a deadline passes.
"""

from __future__ import annotations

import time

import pytest
from deadlines import DEADLINE_S, POSE_TIMEOUT_S, START_DEADLINE_S

SCENE = """
version: 1
frame: cell
unit: mm
rate_hz: 50
budget_ms: 10000
thresholds: {warn: 100, stop: 20, hysteresis: 10}
bodies:
  - {name: table, primitive: {box: {size: [2000, 2000, 100]}}, pose: {position: [0, 0, -50]}}
  - {name: ball, primitive: {sphere: {radius: 100}}, moving: true, colour: [1, 0, 0, 0.5]}
  - {name: die, primitive: {box: {size: [200, 200, 200]}}, moving: true}
pairs:
  watch:
    - {between: [table, ball]}
    - {between: [table, die]}
    - {between: [ball, die], thresholds: {warn: 50, stop: 5}}
"""
APART = {"ball": (0.0, 0.0, 0.5), "die": (0.8, 0.1, 0.9)}


@pytest.fixture(scope="session", autouse=True)
def domain(ros_environment):
    """Run all tests of this folder in one ROS domain."""


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "cell.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="session")
def world(scene_file):
    """The scene and its models, loaded here as a user of the library would."""
    from proximity_monitor.scene import load_scene
    from proximity_monitor.scene.opening import load_models

    scene = load_scene(scene_file)
    return scene, load_models(scene)


class Peer:
    """A node that publishes poses to a monitor and keeps what the monitor publishes."""

    def __init__(self, monitor, namespace=""):
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
        from geometry_msgs.msg import PoseArray, PoseStamped
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from std_msgs.msg import Float64, String
        from visualization_msgs.msg import MarkerArray

        self.monitor = monitor
        self.node = rclpy.create_node("peer", namespace=namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.held = {}
        self.received = {}
        self.since = 0.0
        self._clients = {}
        self._publishers = {
            name: self.node.create_publisher(PoseStamped, f"bodies/{name}/pose", 1)
            for name in APART
        }
        self._array = self.node.create_publisher(PoseArray, "poses", 1)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        kinds = {
            "closest_points": (DiagnosticArray, 10),
            "clearance": (Float64, 10),
            "markers": (MarkerArray, 10),
            "parts": (MarkerArray, latched),
            "alerts": (DiagnosticStatus, latched),
            "scene": (String, latched),
        }
        for topic, (kind, qos) in kinds.items():
            name = f"proximity_monitor/{topic}"
            self.node.create_subscription(kind, name, self._keeper(topic), qos)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnosed, 10)
        self.node.create_timer(0.02, lambda: self.publish(**self.held))

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()

    def _keeper(self, topic):
        def keep(message):
            self.received.setdefault(topic, []).append(message)

        return keep

    def _diagnosed(self, message):
        prefix = self.node.get_namespace().strip("/")
        name = f"{prefix}/proximity_monitor" if prefix else "proximity_monitor"
        if message.status and message.status[0].name.startswith(f"{name}: "):
            self.received.setdefault("diagnostics", []).append(message)

    # Talking

    def pose(self, position, quaternion=(0.0, 0.0, 0.0, 1.0), frame="cell", late_s=0.0):
        """A PoseStamped of now, or of `late_s` seconds ago."""
        from geometry_msgs.msg import PoseStamped
        from rclpy.duration import Duration

        message = PoseStamped()
        message.header.frame_id = frame
        stamp = self.node.get_clock().now() - Duration(nanoseconds=int(late_s * 1e9))
        message.header.stamp = stamp.to_msg()
        place, turn = message.pose.position, message.pose.orientation
        place.x, place.y, place.z = (float(value) for value in position)
        turn.x, turn.y, turn.z, turn.w = (float(value) for value in quaternion)
        return message

    def publish(self, **poses):
        """Publish each body's pose: a position, a position and a quaternion, or a message."""
        for name, pose in poses.items():
            if isinstance(pose, tuple):
                pose = self.pose(*pose) if len(pose) == 2 else self.pose(pose)
            self._publishers[name].publish(pose)

    def publish_array(self, *positions, frame="cell"):
        """Publish positions of all moving bodies, in the scene's order, in one message."""
        from geometry_msgs.msg import PoseArray

        message = PoseArray(poses=[self.pose(position).pose for position in positions])
        message.header.frame_id = frame
        message.header.stamp = self.node.get_clock().now().to_msg()
        self._array.publish(message)

    def hold(self, **positions):
        """From now on, publish these poses, and no others, whenever the peer waits."""
        self.held = positions

    def call(self, kind, name, request):
        future = self.client(kind, name).call_async(request)
        self.wait(future.done, f"an answer of {name}", START_DEADLINE_S)
        return future.result()

    def client(self, kind, name):
        """Return a client of the monitor's service after the server has discovered it.

        A server's answer to a client that it has not discovered yet is lost. It discovers clients
        in the order of their creation, so a second, later client is called until it is answered.
        """
        from rcl_interfaces.srv import GetParameters

        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, f"proximity_monitor/{name}")
            later = self.node.create_client(GetParameters, "proximity_monitor/get_parameters")
            self.wait(later.service_is_ready, "the parameter services", START_DEADLINE_S)
            asked = {}

            def heard():
                if time.monotonic() > max(asked.values(), default=0.0) + 1.0:
                    asked[later.call_async(GetParameters.Request())] = time.monotonic()
                return any(future.done() for future in asked)

            self.wait(heard, "an answer of get_parameters", START_DEADLINE_S)
            self.node.destroy_client(later)
        self.wait(self._clients[name].service_is_ready, f"service {name}", START_DEADLINE_S)
        return self._clients[name]

    def change(self, *transitions):
        """Request transitions by their ids; return whether all of them succeeded."""
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState

        requests = [ChangeState.Request(transition=Transition(id=each)) for each in transitions]
        return all(self.call(ChangeState, "change_state", each).success for each in requests)

    def set_parameters(self, atomically=True, **values):
        """Set parameters by service (`__` stands for a dot); return success and reason."""
        from rcl_interfaces.srv import SetParameters, SetParametersAtomically
        from rclpy.parameter import Parameter

        messages = [
            Parameter(name.replace("__", "."), value=value).to_parameter_msg()
            for name, value in values.items()
        ]
        if atomically:
            request = SetParametersAtomically.Request(parameters=messages)
            kind = SetParametersAtomically
            result = self.call(kind, "set_parameters_atomically", request).result
        else:
            request = SetParameters.Request(parameters=messages)
            result = self.call(SetParameters, "set_parameters", request).results[-1]
        return result.successful, result.reason

    # Listening

    def wait(self, condition, what, timeout_s=DEADLINE_S):
        """Spin until the condition returns something true, and return that."""
        deadline = time.monotonic() + timeout_s
        while not (found := condition()):
            dead = self.monitor.popen.poll() is not None
            if dead or time.monotonic() > deadline:
                state = "is dead" if dead else "runs"
                pytest.fail(
                    f"waited for {what}; the monitor {state} and said:\n{self.monitor.text}"
                )
            self.executor.spin_once(timeout_sec=0.02)
        return found

    def last(self, topic):
        return self.received[topic][-1] if self.received.get(topic) else None

    def forget(self):
        self.received.clear()
        self.since = self.node.get_clock().now().nanoseconds * 1e-9

    def alerts(self, pair):
        """Return the alerts of a pair whose stamp is later than the last `forget`."""
        return [
            status
            for status in self.received.get("alerts", ())
            if status.name == pair
            and any(v.key == "stamp" and float(v.value) > self.since for v in status.values)
        ]

    def next(self, topic, timeout_s=DEADLINE_S):
        """Wait for the next message that arrives on a topic, and return it."""
        self.received.pop(topic, None)
        return self.wait(lambda: self.last(topic), f"a message on {topic}", timeout_s)

    def marks(self):
        """Wait for the markers of the tick of the last closest points, or of a later tick."""
        told = self.last("closest_points").header.stamp

        def come():
            message = self.last("markers")
            at = message.markers[0].header.stamp if message else None
            return message if at and (at.sec, at.nanosec) >= (told.sec, told.nanosec) else None

        return self.wait(come, "the markers")

    def pairs(self, message=None):
        """Return, by pair, the values of a closest-points message, with level and text."""
        message = message or self.last("closest_points")
        return {
            status.name: {each.key: each.value for each in status.values}
            | {"level": status.level, "text": status.message}
            for status in (message.status if message else ())
        }

    def health(self, message=None):
        """Return, by task, the values of a diagnostics message, with level and text."""
        message = message or self.last("diagnostics")
        return {
            status.name.rpartition(": ")[2]: {each.key: each.value for each in status.values}
            | {"level": status.level, "text": status.message}
            for status in (message.status if message else ())
        }

    def settle(self, **positions):
        """Hold positions until each pair has a fresh, complete answer; return the pairs."""
        self.hold(**(APART | positions))
        began = self.node.get_clock().now().nanoseconds * 1e-9

        def answered():
            pairs = self.pairs()
            fresh = [float(p["stamp"]) > began and p["age_s"] == "0.0000" for p in pairs.values()]
            known = [p["state"] != "stale" and p["status"] != "bounded" for p in pairs.values()]
            return pairs if pairs and all(fresh) and all(known) else None

        return self.wait(answered, f"answers to {positions}", START_DEADLINE_S)


@pytest.fixture(scope="module")
def shared_monitor(launch_for_all, scene_file):
    """One monitor that all tests of a file share. Each test restores what it changes."""
    return launch_for_all("node", scene=scene_file, pose_timeout_s=POSE_TIMEOUT_S)


@pytest.fixture(scope="module")
def shared_peer(rclpy_context, shared_monitor):
    peer = Peer(shared_monitor)
    yield peer
    peer.close()


@pytest.fixture
def peer(shared_peer):
    """The peer of the shared monitor. All pairs are clear when a test begins."""
    pairs = shared_peer.settle()
    assert {pair["state"] for pair in pairs.values()} == {"clear"}
    shared_peer.forget()
    return shared_peer


@pytest.fixture
def impatient(peer):
    """The same peer, whose monitor calls a body silent after one second."""
    assert peer.set_parameters(pose_timeout_s=1.0) == (True, "")
    yield peer
    assert peer.set_parameters(pose_timeout_s=POSE_TIMEOUT_S) == (True, "")


@pytest.fixture(scope="module")
def peer_for_all(rclpy_context):
    """Like `new_peer`, for monitors that all tests of a file share."""
    yield from _peers()


@pytest.fixture
def new_peer(rclpy_context):
    """Return a function that makes a peer of a monitor, in its own namespace."""
    yield from _peers()


def _peers():
    made = []

    def make(monitor, namespace=""):
        made.append(Peer(monitor, namespace))
        return made[-1]

    yield make
    for each in made:
        each.close()
