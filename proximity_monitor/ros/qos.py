"""Quality of service, and a count of peers whose quality of service does not fit."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)

POSES = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Only the latest pose is kept; best effort accepts reliable publishers as well."""

LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)

TRANSFORMS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
"""The profile with which tf2 subscribes; many publishers share the topic."""


class Incompatible:
    """Counts publishers and subscribers whose quality of service keeps them from being heard."""

    def __init__(self, node: Node) -> None:
        """Begin with none; each is logged by `node`."""
        self._log = node.get_logger()
        self.count: Counter[str] = Counter()
        """How many there were, by topic."""

    def subscription(self, topic: str) -> SubscriptionEventCallbacks:
        """Return the callbacks for our subscription of a topic."""
        return SubscriptionEventCallbacks(
            incompatible_qos=lambda event: self._note(topic, "a publisher", event),
            use_default_callbacks=False,
        )

    def publisher(self, topic: str) -> PublisherEventCallbacks:
        """Return the callbacks for our publisher of a topic."""
        return PublisherEventCallbacks(
            incompatible_qos=lambda event: self._note(topic, "a subscriber", event),
            use_default_callbacks=False,
        )

    def _note(self, topic: str, who: str, event: Any) -> None:
        self.count[topic] += event.total_count_change
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self._log.warning(
            f"{topic}: {who} has an incompatible {policy} policy: no messages are exchanged with it"
        )
