"""Publishers of unknown bodies are counted, however many come and go."""

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from proximity_monitor.ros.inputs import Inputs, Reason


def test_each_publisher_is_counted_when_it_comes_and_forgotten_when_it_is_gone():
    inputs = Inputs(["cup"], "world")
    stays = ("ghost", b"stays")
    for i in range(5):
        new = inputs.note_strangers(iter((stays, ("other", b"%d" % i), ("other", b"%d" % i))))
        assert new == ([] if i else ["ghost", "other"])
        assert inputs.rejected[Reason.UNKNOWN_BODY] == 2 + i
    assert len(inputs._counted) == 2
    assert inputs.note_strangers(()) == inputs.strangers == []
    assert not inputs._counted
