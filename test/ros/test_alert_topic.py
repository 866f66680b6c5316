"""State changes on ~/alerts, with hysteresis, and the sessions' minima."""

import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import SetBool, Trigger

PAIR = "table - ball"


def ball_at(clearance):
    """A height at which the ball (radius 0.1, on a vertex) is about so far above the table."""
    return (0.0, 0.0, 0.1 + clearance)


def changes(peer):
    """The state changes of the pair so far, as (old, new)."""
    values = [{each.key: each.value for each in alert.values} for alert in peer.alerts(PAIR)]
    return [(each["old"], each["new"]) for each in values]


def test_an_approach_and_a_retreat_give_one_alert_for_each_change(peer):
    for clearance in (0.15, 0.09, 0.015, 0.025, 0.05, 0.105, 0.115):
        peer.settle(ball=ball_at(clearance))
    peer.wait(lambda: len(changes(peer)) >= 4, "four alerts")
    assert changes(peer) == [
        ("clear", "warn"),
        ("warn", "stop"),
        ("stop", "warn"),  # above 20 + 10 mm only
        ("warn", "clear"),  # above 100 + 10 mm only
    ]


def test_an_alert_says_pair_bounds_level_and_reason(peer):
    pairs = peer.settle(ball=ball_at(0.015))
    (alert,) = peer.wait(lambda: peer.alerts(PAIR), "an alert")
    values = {each.key: each.value for each in alert.values}
    assert alert.level == DiagnosticStatus.ERROR
    assert alert.hardware_id == "cell"
    assert alert.message.startswith("clear -> stop: distance ")
    assert alert.message.endswith(" mm <= stop 20 mm")
    assert (values["lower_m"], values["upper_m"]) == (
        pairs[PAIR]["lower_m"],
        pairs[PAIR]["upper_m"],
    )
    assert float(values["stamp"]) == pytest.approx(float(pairs[PAIR]["stamp"]), abs=5.0)


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
    peer.forget()  # after the diagnostics: what was published before the pause has arrived
    peer.hold(ball=ball_at(0.5), die=(0.8, 0.1, 0.9))
    peer.next("diagnostics")
    assert schedule["level"] == DiagnosticStatus.WARN
    assert peer.health()["clearance"]["pairs stop"] == "1"
    assert not peer.received.get("closest_points")
    assert not peer.alerts(PAIR)

    assert peer.call(SetBool, "pause", SetBool.Request(data=False)).message == "running again"
    pairs = peer.settle(ball=ball_at(0.5))
    assert pairs[PAIR]["state"] == "clear"
