"""The poses of the bodies in the page's tests: their source, and what the display publishes."""

from __future__ import annotations

import threading
import time
from contextlib import suppress

from waiting import until

START = {"ball": (-0.2, 0.0, 0.3), "die": (0.2, 0.0, 0.3), "cursor": (0.2, -0.2, 0.3)}
RETRY_S = 2.0


class Sources:
    """Publishes the poses of bodies 30 times a second, and receives the display's poses."""

    def __init__(self, domain, monitor):
        import rclpy
        from geometry_msgs.msg import PoseStamped
        from rcl_interfaces.srv import GetParameters
        from rclpy.executors import SingleThreadedExecutor

        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.monitor = monitor
        self.node = rclpy.create_node("sources", context=self._context)
        self._held = dict(START)
        self._released_ns = {}
        self._last = {}
        self._get = self.node.create_client(GetParameters, "proximity_monitor/get_parameters")
        self._publishers = {
            name: self.node.create_publisher(PoseStamped, f"bodies/{name}/pose", 1)
            for name in START
        }
        for name in START:
            self.node.create_subscription(PoseStamped, f"bodies/{name}/pose", self._keeper(name), 1)
        self.node.create_timer(1.0 / 30.0, self._publish)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self):
        self._ended.set()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def release(self, name):
        """Stop publishing the pose of a body."""
        del self._held[name]
        # Taken after the deletion, so that no pose published here counts as the display's.
        self._released_ns[name] = self.node.get_clock().now().nanoseconds

    def move(self, name, position):
        """Publish a body at another position from now on."""
        self._held[name] = position

    def restore(self):
        """Publish all bodies at their start positions again."""
        self._held = dict(START)

    def heard(self, name):
        """Return the last pose (position, quaternion) from others of a released body, or None."""
        stamp_ns, pose = self._last.get(name, (0, None))
        return pose if stamp_ns > self._released_ns[name] else None

    def parameter(self, name):
        """Return the value of a numeric parameter of the monitor."""
        from rcl_interfaces.srv import GetParameters

        until(self._get.service_is_ready, "the service of parameters")
        asked, asked_s = [], -RETRY_S

        def answered():
            nonlocal asked_s
            # An answer is lost if the server has not discovered this client yet.
            if time.monotonic() > asked_s + RETRY_S:
                asked_s = time.monotonic()
                asked.append(self._get.call_async(GetParameters.Request(names=[name])))
            return next((future for future in asked if future.done()), None)

        return until(answered, f"parameter {name}").result().values[0].double_value

    def _spin(self):
        from rclpy.executors import InvalidHandle

        while not self._ended.is_set():
            # A test's own thread may destroy a subscription meanwhile; the executor can go on.
            with suppress(InvalidHandle):
                self._executor.spin_once(timeout_sec=0.05)

    def _keeper(self, name):
        def keep(message):
            stamp, p, q = message.header.stamp, message.pose.position, message.pose.orientation
            pose = ((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
            self._last[name] = (stamp.sec * 10**9 + stamp.nanosec, pose)

        return keep

    def _publish(self):
        from geometry_msgs.msg import PoseStamped

        message = PoseStamped()
        message.header.frame_id = "cell"
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.pose.orientation.w = 1.0
        place = message.pose.position
        for name, position in list(self._held.items()):
            place.x, place.y, place.z = position
            self._publishers[name].publish(message)


def at(sources, axis):
    """Return a coordinate (m) of the die as the display publishes it; None: not yet."""
    found = sources.heard("die")
    return found and found[0]["xyz".index(axis)]
