"""All poses in one message."""

import math

import numpy as np
import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

BALL, DIE = (0.0, 0.0, 0.4), (0.7, 0.0, 0.6)


def rejected(peer, reason):
    health = peer.health()
    return int(health["inputs"][f"rejected: {reason}"]) if health else -1


@pytest.fixture
def alone(peer):
    """A peer that publishes nothing by itself."""
    peer.hold()
    return peer


def test_an_array_never_shows_halves_of_two_moments(alone):
    """Both bodies jump together, so their distance is the same at every moment a tick sees."""
    rng = np.random.default_rng(3)
    apart = alone.settle()
    true = float(apart["ball - die"]["upper_m"])
    alone.hold()
    alone.forget()
    between = np.array([0.8, 0.1, 0.4])

    def jump():
        ball = np.array([*rng.uniform(-0.2, 0.2, 2), rng.uniform(0.3, 0.6)])
        alone.publish_array(ball, ball + between)
        seen = {pair["lower_m"]: pair for pair in places()}
        return len(seen) > 20 and seen

    def places():
        messages = alone.received.get("closest_points", ())
        return [alone.pairs(message)["table - ball"] for message in messages]

    alone.wait(jump, "twenty moments")
    pairs = [alone.pairs(message)["ball - die"] for message in alone.received["closest_points"]]
    bounds = [(float(pair["lower_m"]), float(pair["upper_m"])) for pair in pairs]
    assert all(lower - 1e-12 <= true <= upper + 1e-12 for lower, upper in bounds)


def test_a_body_that_is_not_good_keeps_its_pose_and_the_others_move(alone):
    before = rejected(alone, "not finite") if alone.next("diagnostics") else 0

    def moved():
        alone.publish_array((math.nan, 0.0, 0.0), (0.8, 0.1, 0.7))
        pairs = alone.pairs()
        return pairs and float(pairs["table - die"]["lower_m"]) == pytest.approx(0.6, abs=1e-6)

    alone.wait(moved, "the die to move")
    assert alone.pairs()["table - ball"]["state"] in ("clear", "stale")
    alone.wait(lambda: rejected(alone, "not finite") > before, "the count")


@pytest.mark.parametrize("places", [[BALL], [BALL, DIE, DIE]])
def test_an_array_of_another_length_is_counted_and_moves_nothing(alone, places):
    before = rejected(alone, "wrong length") if alone.next("diagnostics") else 0
    alone.forget()

    def counted():
        alone.publish_array(*places)
        return alone.health() and rejected(alone, "wrong length") > before

    alone.wait(counted, "the count")
    seen = {alone.pairs(m)["table - die"]["upper_m"] for m in alone.received["closest_points"]}
    assert len(seen) == 1


@pytest.mark.long
def test_without_topics_of_bodies_the_array_still_moves_them(launch, scene_file, new_peer):
    process = launch(
        "node", "-r", "__ns:=/bulk", scene=scene_file, body_topics="false", threads="2"
    )
    peer = new_peer(process, "bulk")
    peer.hold(ball=BALL, die=DIE)  # the monitor does not subscribe to these topics

    def known():
        peer.publish_array(BALL, DIE)
        pairs = peer.pairs()
        return pairs and {pair["state"] for pair in pairs.values()} == {"clear"}

    peer.wait(known, "answers to the array", START_DEADLINE_S)
    topics = [name for name, _ in peer.node.get_topic_names_and_types()]
    assert not any(
        peer.node.count_subscribers(topic) for topic in topics if topic.startswith("/bulk/bodies")
    )
