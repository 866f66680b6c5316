"""Finds strangers in the graph: publishers of unknown bodies' poses, and nodes of the same name."""

from __future__ import annotations

import re
from collections.abc import Collection

from rclpy.node import Node


def strangers(node: Node, heard: Collection[str]) -> list[tuple[str, bytes]]:
    """Return the publishers of topics bodies/*/pose in the node's namespace that it does not hear.

    Args:
        node: knows the graph.
        heard: full names of the topics that the node listens to.

    Returns:
        For each publisher the name of the body, and the publisher's identity in the middleware.
    """
    pattern = re.compile(re.escape(node.get_namespace().rstrip("/")) + r"/bodies/([^/]+)/pose")
    return [
        (match[1], bytes(publisher.endpoint_gid))
        for topic, _ in node.get_topic_names_and_types()
        if topic not in heard and (match := pattern.fullmatch(topic))
        for publisher in node.get_publishers_info_by_topic(topic)
    ]


def namesakes(node: Node) -> int:
    """Return how many other nodes have the name of this one, in the same namespace."""
    own = node.get_name(), node.get_namespace()
    return max(node.get_node_names_and_namespaces().count(own) - 1, 0)
