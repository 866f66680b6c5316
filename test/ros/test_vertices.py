"""Bodies whose vertices arrive while the node runs."""

import numpy as np
import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2, PointField

SCENE = """
version: 1
frame: cell
unit: mm
rate_hz: 50
budget_ms: 15
bodies:
  - {name: wall, primitive: {box: {size: [10, 500, 500]}}, pose: {position: [-105, 0, 0]}}
  - {name: ball, primitive: {sphere: {radius: 100}}, moving: true, deforming: true}
"""


def cloud(vertices):
    fields = [
        PointField(name=name, offset=8 * i, datatype=PointField.FLOAT64, count=1)
        for i, name in enumerate("xyz")
    ]
    return PointCloud2(
        height=1,
        width=len(vertices),
        fields=fields,
        point_step=24,
        row_step=24 * len(vertices),
        data=np.ascontiguousarray(vertices, "<f8").tobytes(),
    )


def test_vertices_move_a_deforming_body_and_bad_ones_are_counted(launch, tmp_path, new_peer):
    from proximity_monitor.scene import load_scene
    from proximity_monitor.scene.opening import load_models

    (tmp_path / "soft.yaml").write_text(SCENE)
    process = launch("node", "-r", "__ns:=/soft", scene=tmp_path / "soft.yaml")
    peer = new_peer(process, "soft")
    vertices = load_models(load_scene(tmp_path / "soft.yaml"))["ball"].vertices
    publisher = peer.node.create_publisher(PointCloud2, "bodies/ball/vertices", 1)
    peer.hold(ball=(0.2, 0.0, 0.0))

    def gap(expected, message=None):
        def told():
            if message is not None:
                publisher.publish(message)
            pair = peer.pairs().get("wall - ball")
            at = expected if pair is None else float(pair["upper_m"])
            return pair and pair["age_s"] == "0.0000" and at == pytest.approx(expected, abs=2e-3)

        peer.wait(told, f"a gap of {expected} m", START_DEADLINE_S)

    gap(0.2)
    gap(0.25, cloud(0.5 * vertices))
    gap(0.2, cloud(vertices))

    holed = vertices.copy()
    holed[7, 1] = np.nan
    for bad, reason in (
        (cloud(vertices[:-1]), "wrong length"),
        (cloud(holed), "not finite"),
        (cloud(vertices * 1e12), "position out of range"),
        (PointCloud2(width=3, height=1), "unreadable layout"),
    ):

        def counted(bad=bad, reason=reason):
            publisher.publish(bad)
            return peer.health() and int(peer.health()["inputs"][f"rejected: {reason}"]) > 0

        peer.wait(counted, reason)
    gap(0.2)

    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    other = peer.node.create_publisher(PointCloud2, "bodies/ball/vertices", best_effort)
    key = "incompatible QoS: bodies/ball/vertices"
    peer.wait(lambda: peer.health()["outputs"].get(key) == "1", "the publisher that does not fit")
    peer.node.destroy_publisher(other)
