"""State changes on ~/alerts, with hysteresis, and the smallest clearances of a session."""

import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import SetBool, Trigger

APART = {"ball": (0.0, 0.0, 0.5), "die": (0.8, 0.1, 0.9)}

PAIR = "table - ball"


def ball_at(clearance):
    """Return a ball position about `clearance` (m) above the table; a vertex is lowest."""
    return (0.0, 0.0, 0.1 + clearance)


def changes(peer):
    """Return the state changes of the pair so far, as (old, new)."""
    values = [{each.key: each.value for each in alert.values} for alert in peer.alerts(PAIR)]
    return [(each["old"], each["new"]) for each in values]


def test_an_approach_and_a_retreat_give_one_alert_for_each_change(peer):
    for clearance in (0.15, 0.09, 0.015, 0.025, 0.05, 0.105, 0.115):
        peer.settle(ball=ball_at(clearance))
    peer.wait(lambda: len(changes(peer)) >= 4, "four alerts")
    assert changes(peer) == [
        ("clear", "warn"),
        ("warn", "stop"),
        ("stop", "warn"),  # only above 20 + 10 mm
        ("warn", "clear"),  # only above 100 + 10 mm
    ]


def test_an_alert_says_pair_bounds_level_and_reason(peer):
    pairs = peer.settle(ball=ball_at(0.015))
    (alert,) = peer.wait(lambda: peer.alerts(PAIR), "an alert")
    values = {each.key: each.value for each in alert.values}
    assert alert.level == DiagnosticStatus.ERROR
    assert alert.hardware_id == "cell"
    assert alert.message.startswith("clear -> stop: distance ")
    assert " mm <= stop 20 mm" in alert.message
    assert (values["lower_m"], values["upper_m"]) == (
        pairs[PAIR]["lower_m"],
        pairs[PAIR]["upper_m"],
    )
    assert float(values["stamp"]) == pytest.approx(float(pairs[PAIR]["stamp"]), abs=5.0)


def test_an_alert_says_the_way_out_and_how_long_there_is(peer):
    began = peer.node.get_clock().now().nanoseconds

    def sink():
        """Lower the ball at 10 mm/s from 105 mm, so that seconds pass between warn and stop."""
        now = peer.node.get_clock().now().nanoseconds
        fall = 0.01 * (now - began) * 1e-9
        pose = peer.pose(ball_at(0.105 - fall))
        pose.header.stamp.sec, pose.header.stamp.nanosec = divmod(now, 1_000_000_000)
        peer.publish(ball=pose)
        return peer.alerts(PAIR)

    peer.hold(die=APART["die"])
    (alert,) = peer.wait(sink, "an alert")
    values = {each.key: each.value for each in alert.values}
    assert values["new"] == "warn"
    assert values["body"] == "ball"
    escape = [float(part) for part in values["escape"].split()]
    assert escape == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert float(values["closing_m_s"]) == pytest.approx(0.01, rel=0.05)
    left = (float(values["lower_m"]) - 0.02) / 0.01
    assert float(values["seconds_left"]) == pytest.approx(left, rel=0.05)
    assert " mm <= warn 100 mm, closing at " in alert.message
    assert "stop in" in alert.message


@pytest.fixture
def holding(peer):
    """A peer of a monitor that holds each level for 0.6 s."""
    assert peer.set_parameters(thresholds__hold_s=0.6) == (True, "")
    yield peer
    assert peer.set_parameters(thresholds__hold_s=0.0) == (True, "")


def test_a_level_is_held_for_its_time(holding):
    peer = holding
    peer.settle(ball=ball_at(0.05))
    peer.wait(lambda: len(changes(peer)) == 1, "the warning")
    near_s = max(seen(peer))[0]  # not after the last near tick, whose message may be lost
    peer.forget()
    peer.hold(ball=ball_at(0.5), die=APART["die"])
    peer.wait(lambda: changes(peer), "its end")
    ended_s = peer.wait(
        lambda: next((at_s for at_s, state in seen(peer) if state == "clear"), None),
        "the end among the points",
    )
    assert changes(peer) == [("warn", "clear")]
    assert ended_s - near_s >= 0.6


def seen(peer):
    """Return the time (s) and the pair's state for each tick that was received so far."""
    ticks = []
    for message in peer.received.get("closest_points", ()):
        pair = peer.pairs(message)[PAIR]
        at_s = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        ticks.append((at_s, pair["state"]))
    return ticks


def test_a_pair_with_thresholds_of_its_own_is_judged_by_them(peer):
    pairs = peer.settle(ball=(0.57, 0.1, 0.9))
    state = pairs["ball - die"]
    assert 0.005 < float(state["upper_m"]) < 0.05
    assert state["state"] == "warn"


def test_a_stop_is_an_error_in_the_diagnostics(peer):
    peer.settle(ball=ball_at(0.0))
    clearance = peer.wait(
        lambda: (c := peer.health().get("clearance")) and c["pairs stop"] == "1" and c,
        "diagnostics of the stop",
    )
    assert clearance["level"] == DiagnosticStatus.ERROR


def test_minima_are_kept_until_they_are_reset(peer):
    assert peer.call(Trigger, "reset_minima", Trigger.Request()).success
    near = float(peer.settle(ball=ball_at(0.12))[PAIR]["upper_m"])
    pairs = peer.settle()
    assert float(pairs[PAIR]["session_min_m"]) == pytest.approx(near, abs=1e-9)
    assert float(pairs[PAIR]["session_min_lower_m"]) <= near

    answer = peer.call(Trigger, "reset_minima", Trigger.Request())
    assert answer.success
    assert "3 pairs" in answer.message

    def reset():  # a message published before the answer may arrive after it
        pair = peer.pairs()[PAIR]
        return float(pair["session_min_m"]) == pytest.approx(float(pair["upper_m"]), abs=1e-9)

    peer.wait(reset, "the minimum to begin anew")


def test_a_pause_stops_the_watch_visibly_and_clears_nothing(peer):
    peer.settle(ball=ball_at(0.015))
    answer = peer.call(SetBool, "pause", SetBool.Request(data=True))
    assert answer.success
    assert answer.message.startswith("paused")
    assert peer.call(SetBool, "pause", SetBool.Request(data=True)).message == "already paused"
    schedule = peer.wait(
        lambda: (s := peer.health().get("schedule")) and s["activity"] == "paused" and s,
        "diagnostics of the pause",
    )
    paused = peer.last("diagnostics").header.stamp
    peer.forget()
    peer.hold(ball=ball_at(0.5), die=(0.8, 0.1, 0.9))
    peer.next("diagnostics")
    assert schedule["level"] == DiagnosticStatus.WARN
    assert peer.health()["clearance"]["pairs stop"] == "1"
    ticks = [message.header.stamp for message in peer.received.get("closest_points", ())]
    assert not [at for at in ticks if (at.sec, at.nanosec) > (paused.sec, paused.nanosec)]
    assert not peer.alerts(PAIR)

    assert peer.call(SetBool, "pause", SetBool.Request(data=False)).message == "running again"
    pairs = peer.settle(ball=ball_at(0.5))
    assert pairs[PAIR]["state"] == "clear"
