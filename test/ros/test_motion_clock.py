"""The clock that tells the moment of a motion, and changes of this clock while it runs."""

import json

import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from proximity_monitor.ros.motion_clock import MotionClock

S = 1_000_000_000
START = 1_700_000_000 * S


@pytest.mark.parametrize("ask", ["speed", "seek", "read", "told"])
def test_the_motion_waits_for_the_first_time_of_a_simulation(ask):
    """With use_sim_time, a node's clock stands at 0 until the first /clock message, then jumps."""
    clock = MotionClock(1.0, 3.0)
    if ask == "speed":
        clock.go_on(0, 2.0)
    elif ask == "seek":
        clock.seek(0, 3.0)
    elif ask == "told":
        assert json.loads(clock.told(0, None, False))["moment_s"] == 3.0
    assert clock.read(0) == 3.0
    assert clock.read(START) == 3.0
    passed = 2.0 if ask == "speed" else 1.0
    assert clock.read(START + S) == 3.0 + passed
    told = {"moment_s": 3.0, "stamp_s": START / S, "speed": passed, "period_s": None}
    told["repeats"] = True
    assert json.loads(clock.told(START + S, None, True)) == told


def test_a_simulation_that_begins_again_begins_the_motion_again():
    clock = MotionClock(1.0, 0.5)
    assert clock.read(START) == 0.5
    clock.go_on(START + S, 4.0)
    assert clock.read(START + 2 * S) == 5.5
    assert clock.read(0) == 0.5
    assert clock.read(10) == 0.5
    assert clock.read(10 + S) == 4.5
