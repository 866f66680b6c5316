"""The node computes and builds only outputs that have a subscriber; the diagnostics count them."""

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Float64


class Listener:
    """Publishes poses and listens to the diagnostics alone."""

    def __init__(self, node, namespace):
        self.node = node
        self.told = []
        self.publishers = {
            name: node.create_publisher(PoseStamped, f"/{namespace}/bodies/{name}/pose", 1)
            for name in ("ball", "die")
        }
        node.create_subscription(DiagnosticArray, "/diagnostics", self.take, 10)
        self.prefix = f"{namespace}/proximity_monitor: "

    def take(self, message):
        if message.status[0].name.startswith(self.prefix):
            values = [{each.key: each.value for each in s.values} for s in message.status]
            self.told.append({k: v for each in values for k, v in each.items()})


@pytest.mark.long
def test_what_nobody_listens_to_is_not_built(launch, scene_file, new_peer):
    """`quiet` listens in a namespace without a monitor; `asked` uses its node for this one."""
    process = launch("node", "-r", "__ns:=/asked", scene=scene_file, pose_timeout_s=60.0)
    quiet = new_peer(process, "nobody")
    asked = Listener(quiet.node, "asked")
    stop = []

    def publish():
        if not stop:
            for name, position in (("ball", (0.0, 0.0, 0.15)), ("die", (0.8, 0.1, 0.9))):
                asked.publishers[name].publish(quiet.pose(position))

    quiet.node.create_timer(0.02, publish)

    def last(key):
        return int(asked.told[-1][key]) if asked.told else 0

    quiet.wait(
        lambda: asked.told and asked.told[-1]["pairs warn"] == "1", "a warning", START_DEADLINE_S
    )
    quiet.wait(lambda: len(asked.told) > 2, "some seconds")
    for topic in ("closest_points", "pairs", "clearance", "markers", "parts"):
        assert last(f"built: {topic}") == 0, topic
    assert last("built: alerts") == 3
    assert last("ticks with distances") == 0, "the thresholds are all that is asked for"

    clearance = quiet.node.create_subscription(
        Float64, "/asked/proximity_monitor/clearance", lambda message: None, 1
    )
    quiet.wait(lambda: last("built: clearance") > 0, "the clearance")
    assert last("ticks with distances") > 0
    for topic in ("closest_points", "pairs", "markers", "parts"):
        assert last(f"built: {topic}") == 0, topic

    quiet.node.destroy_subscription(clearance)

    def built_no_more():
        counts = [int(told["built: clearance"]) for told in asked.told]
        return len(counts) > 3 and counts[-1] == counts[-2]

    quiet.wait(built_no_more, "the clearance to end")
    stop.append(True)
