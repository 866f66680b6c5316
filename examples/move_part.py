"""A program that moves a body of a scene: it publishes poses until an alert says stop.

    python move_part.py BODY [FRAME]

The body comes down along z from 60 mm to 5 mm at 20 mm a second, 0.03 mm off the axis.
"""

from __future__ import annotations

import sys

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

ALERTS = "proximity_monitor/alerts"
RATE_HZ = 30.0


class Mover(Node):
    """Publishes one body's poses, and listens to the monitor's alerts."""

    def __init__(self, body: str, frame: str) -> None:
        super().__init__("part_mover")
        self._message = PoseStamped()
        self._message.header.frame_id = frame
        self._message.pose.position.x = 0.00003
        self._message.pose.orientation.w = 1.0
        self.height = 0.06
        self.stopped = False
        self._out = self.create_publisher(PoseStamped, f"bodies/{body}/pose", 1)
        self.create_subscription(DiagnosticStatus, ALERTS, self._on_alert, 10)
        self.create_timer(1.0 / RATE_HZ, self._on_timer)

    def _on_timer(self) -> None:
        """Publish the next pose, once the monitor subscribes to poses and publishes alerts."""
        if not (self._out.get_subscription_count() and self.count_publishers(ALERTS)):
            return
        self.height = max(0.005, self.height - 0.02 / RATE_HZ)
        self._message.pose.position.z = self.height
        self._message.header.stamp = self.get_clock().now().to_msg()
        self._out.publish(self._message)

    def _on_alert(self, alert: DiagnosticStatus) -> None:
        """Print the alert; its level is OK, WARN, ERROR or STALE for clear, warn, stop or stale."""
        print(f"{alert.name}: {alert.message}", flush=True)
        self.stopped = alert.level == DiagnosticStatus.ERROR


def main() -> None:
    """Move the body until the first stop."""
    body, frame = (*sys.argv[1:], "world")[:2]
    rclpy.init(args=[])
    mover = Mover(body, frame)
    while not mover.stopped:
        rclpy.spin_once(mover)
    print(f"stopped at z = {1000.0 * mover.height:.1f} mm")
    mover.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
