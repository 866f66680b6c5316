"""Wrong, late or missing poses: counted, reported, never fatal, and never taken as free space."""

import math
from itertools import cycle

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped

FAR = (0.0, 0.0, 5.0)  # where the ball would be clear of everything
NEAR = (0.0, 0.0, 0.15)  # where it is at warn

BAD = {
    "not finite": dict(position=(0.0, math.nan, 5.0)),
    "quaternion not unit": dict(position=FAR, quaternion=(0.0, 0.0, 0.0, 1.1)),
    "position out of range": dict(position=(0.0, 0.0, 1e12)),
    "other frame": dict(position=FAR, frame="world"),
    "stale stamp": dict(position=FAR, late_s=60.0),
    "stamp in the future": dict(position=FAR, late_s=-5.0),
}
MORE = {
    "not finite": dict(position=FAR, quaternion=(0.0, 0.0, math.inf, 1.0)),
    "quaternion not unit": dict(position=FAR, quaternion=(0.0, 0.0, 0.0, 0.0)),
    "other frame": dict(position=FAR, frame=""),
}
OLD = {"stamp out of order": dict(position=FAR)}


def rejected(health, reason):
    return int(health["inputs"][f"rejected: {reason}"])


@pytest.mark.parametrize("bad", [BAD, MORE, OLD], ids=["bad", "more", "old"])
def test_a_bad_pose_is_counted_by_reason_and_never_looks_clear(peer, bad):
    """Send each kind in turn, again and again: diagnostics come only once a second."""
    pairs = peer.settle(ball=NEAR)
    assert pairs["table - ball"]["state"] == "warn"
    health = peer.health(peer.next("diagnostics"))
    before = {reason: rejected(health, reason) for reason in bad}
    peer.forget()

    ticks, given = 0, cycle(bad.values())

    def counted():
        nonlocal ticks
        seen = len(peer.received.get("closest_points", ()))
        if seen >= ticks:  # ten a second: more would crowd out the good poses that are held
            ticks = seen + 5
            pose = peer.pose(**next(given))
            if bad is OLD:  # older than the pose that the monitor has
                if not seen:
                    return None
                at = int(peer.pairs()["table - ball"]["stamp"].replace(".", "")) - 1
                pose.header.stamp.sec, pose.header.stamp.nanosec = divmod(at, 1_000_000_000)
            peer.publish(ball=pose)
        health = peer.health()
        return health and all(rejected(health, reason) > n for reason, n in before.items())

    others = {name: p for name, p in peer.held.items() if name != "ball"}
    if bad is not OLD:  # an old pose needs a newer good pose before it
        peer.hold(**others)
    peer.wait(counted, f"poses rejected as {', '.join(bad)}")
    seen = [peer.pairs(message)["table - ball"] for message in peer.received["closest_points"]]
    assert {pair["state"] for pair in seen} <= {"warn", "stale"}
    kept = {float(pair["upper_m"]) for pair in seen}
    assert max(kept) - min(kept) < 1e-9, "the last good pose stays"


def test_a_good_pose_after_bad_ones_is_taken(peer):
    peer.publish(ball=peer.pose(FAR, quaternion=(1.0, 1.0, 1.0, 1.0)))
    pairs = peer.settle(ball=NEAR)
    assert pairs["table - ball"]["state"] == "warn"


def test_a_quaternion_within_a_thousandth_is_normalised(peer):
    peer.hold(die=(0.8, 0.1, 0.9))
    before = rejected(peer.health(peer.next("diagnostics")), "quaternion not unit")

    def answered():
        peer.publish(ball=peer.pose(NEAR, quaternion=(0.0, 0.0, 0.0, 1.0009)))
        pair = peer.pairs().get("table - ball")
        return pair and float(pair["upper_m"]) == pytest.approx(0.05, abs=1e-3)

    peer.wait(answered, "an answer to the nearly unit quaternion")
    assert rejected(peer.health(peer.next("diagnostics")), "quaternion not unit") == before


def test_a_body_that_falls_silent_makes_its_pairs_stale_until_it_speaks_again(impatient):
    peer = impatient
    peer.hold(die=(0.8, 0.1, 0.9))

    def silent():  # on a busy machine, the die is silent for a moment as well
        states = {name: pair["state"] for name, pair in peer.pairs().items()}
        known = states and (states["table - ball"], states["table - die"]) == ("stale", "clear")
        return peer.pairs() if known else None

    pairs = peer.wait(silent, "the ball's pairs to become stale, and those alone")
    assert pairs["table - ball"]["level"] == DiagnosticStatus.STALE
    assert "no recent pose of ball" in pairs["table - ball"]["text"]
    assert pairs["ball - die"]["state"] == "stale"
    peer.wait(lambda: peer.next("clearance").data == 0.0, "no clearance")

    def reported():  # the body may be silent one tick before its pairs are stale
        health = peer.health()
        silent = health and health["inputs"]["silent bodies"] == "ball"
        return health if silent and health["clearance"]["pairs stale"] == "2" else None

    health = peer.wait(reported, "diagnostics of the silent body and its two pairs")
    assert health["inputs"]["level"] == DiagnosticStatus.WARN
    alert = peer.wait(lambda: peer.alerts("table - ball"), "an alert")[-1]
    assert alert.level == DiagnosticStatus.STALE
    assert alert.message == "clear -> stale: no recent pose of ball"
    pairs = peer.settle()
    assert pairs["table - ball"]["state"] == "clear"


def test_a_body_that_the_scene_does_not_have_is_reported_by_name(peer):
    before = rejected(peer.health(peer.next("diagnostics")), "unknown body")
    stranger = peer.node.create_publisher(PoseStamped, "bodies/ghost/pose", 1)
    inputs = peer.wait(
        lambda: (i := peer.health().get("inputs")) and i["unknown bodies"] == "ghost" and i,
        "diagnostics of the ghost",
    )
    assert int(inputs["rejected: unknown body"]) == before + 1
    assert inputs["level"] == DiagnosticStatus.WARN
    assert "ghost" in inputs["text"]
    assert {pair["state"] for pair in peer.settle().values()} == {"clear"}
    peer.node.destroy_publisher(stranger)


@pytest.mark.long
def test_bodies_that_never_had_a_pose_are_unknown_and_not_room(launch, scene_file, new_peer):
    peer = new_peer(launch("node", "-r", "__ns:=/quiet", scene=scene_file), "quiet")
    peer.hold(die=(0.8, 0.1, 0.9))

    def known():
        pairs = peer.pairs()
        return pairs if pairs and pairs["table - die"]["state"] == "clear" else None

    pairs = peer.wait(known, "the die's distance", START_DEADLINE_S)
    ball = pairs["table - ball"]
    assert (ball["status"], ball["state"]) == ("unknown pose", "stale")
    assert (ball["lower_m"], ball["upper_m"], ball["point_a"]) == ("nan", "nan", "")
    assert ball["text"] == "no pose yet of ball"
    assert peer.next("clearance").data == 0.0
    lines = peer.marks().markers[0]
    assert len(lines.points) == 2, "only the pair with poses is drawn"
