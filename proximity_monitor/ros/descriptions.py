"""Receives robot descriptions from topics, as `robot_state_publisher` latches them."""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import String

from proximity_monitor.ros.qos import LATCHED
from proximity_monitor.ros.spin import POLL_S, asked_to_stop

_AGAIN_S = 10.0
"""Seconds between two warnings that a description has not arrived."""


class Descriptions:
    """The descriptions that a scene asks for; it warns if one of them changes."""

    def __init__(self, node: Node) -> None:
        """Begin without descriptions; `node` gives subscriptions and its log."""
        self._node = node
        self._subscriptions: dict[str, Subscription] = {}
        self._texts: dict[str, str] = {}

    def wait(self, topic: str) -> str:
        """Wait for the description on a topic, and return it.

        Raises:
            KeyboardInterrupt: a signal asked the program to stop meanwhile.
        """
        if topic not in self._subscriptions:
            self._subscriptions[topic] = self._node.create_subscription(
                String, topic, lambda message: self._hear(topic, message), LATCHED
            )
        told, again_at = "", 0.0
        while topic not in self._texts:
            if asked_to_stop():
                raise KeyboardInterrupt
            # Take the message here: the node's executor may itself be waiting in this transition.
            handle = self._subscriptions[topic].handle
            with handle:
                taken = handle.take_message(String, False)
            if taken is not None:
                self._hear(topic, taken[0])
                break
            if told != (told := self._what_is_missing(topic)) or time.monotonic() >= again_at:
                again_at = time.monotonic() + _AGAIN_S
                self._node.get_logger().warning(told)
            time.sleep(POLL_S)
        return self._texts[topic]

    def forget(self) -> None:
        """Forget the descriptions, and unsubscribe from their topics."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
        self._texts.clear()

    def _hear(self, topic: str, message: String) -> None:
        if self._texts.get(topic, message.data) != message.data:
            self._node.get_logger().warning(
                f"the robot description on {self._subscriptions[topic].topic_name} changed, but "
                "the scene still uses the old one: clean up and configure the node, or restart it, "
                "to use the new one"
            )
        self._texts[topic] = message.data

    def _what_is_missing(self, topic: str) -> str:
        name = self._subscriptions[topic].topic_name
        publishers = self._node.get_publishers_info_by_topic(name)
        why = "it has no publisher yet"
        if publishers:
            why = "it has a publisher, but has not arrived yet"
            if all(each.qos_profile.durability == DurabilityPolicy.VOLATILE for each in publishers):
                why = "its publisher's durability is volatile, but must be transient local"
        return f"waiting for the robot description on {name} (std_msgs/msg/String): {why}"
