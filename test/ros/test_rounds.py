"""When ticks come: rounds of new poses, bodies that wake, and the pace."""

import time
from itertools import count

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

import rclpy
from rclpy.executors import SingleThreadedExecutor

from proximity_monitor.ros.bulk import StampedPose
from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.pace import Pace
from proximity_monitor.ros.ticking import Ticking
from proximity_monitor.scene import pose_matrix

SECOND = 1_000_000_000


@pytest.fixture
def inputs():
    return Inputs(("one", "two", "three"), "cell")


def test_a_round_is_complete_when_all_that_are_awaited_spoke(inputs):
    inputs.await_again(["one", "three"])
    assert not inputs.complete
    pose = pose_matrix((0, 0, 0), (0, 0, 0, 1))[None]
    inputs.store_many(["one"], pose, 10 * SECOND, "cell", 10 * SECOND)
    assert not inputs.complete
    inputs.store_many(["three"], pose, 10 * SECOND, "cell", 10 * SECOND)
    assert inputs.complete


def _rounds(inputs, heard):
    """Hear (body, stamp) in turn; return at which a round was complete, and begin another there."""
    pose, ended = pose_matrix((0, 0, 0), (0, 0, 0, 1))[None], []
    inputs.await_again(["one", "two"])
    for body, stamp in heard:
        inputs.store_many([body], pose, 10 * SECOND + stamp, "cell", 10 * SECOND)
        if inputs.complete:
            ended.append((body, stamp))
            inputs.await_again(["one", "two"])
    return ended


def test_a_round_ends_with_poses_of_one_moment(inputs):
    """A tick between two poses of a moment must not shift all later ticks to there."""
    heard = [(body, k) for k in range(6) for body in ("one", "two")]
    assert _rounds(inputs, heard[1:]) == [("two", k) for k in range(1, 6)]


def test_bodies_that_are_not_in_step_are_not_waited_for(inputs):
    heard = [(body, 2 * k + (body == "two")) for k in range(1, 5) for body in ("one", "two")]
    ended = [("one", 4), ("one", 6), ("one", 8)]
    assert _rounds(inputs, heard) == ended, "the first round is extended, by one pose"
    in_step = [(body, 20) for body in ("one", "two")]
    ceased = [(body, 2 * k + (body == "two")) for k in range(11, 16) for body in ("one", "two")]
    ended = [stamp for _, stamp in _rounds(inputs, in_step + ceased)]
    assert ended == [20, 24, 26, 28, 30], "only one round is extended, by one pose"


def test_the_first_round_waits_for_all_bodies(inputs):
    inputs.await_again([])
    pose = pose_matrix((0, 0, 0), (0, 0, 0, 1))[None]
    for body in inputs.names:
        assert not inputs.complete
        inputs.store_many([body], pose, 10 * SECOND, "cell", 10 * SECOND)
    assert inputs.complete


def test_a_body_wakes_that_rested_and_moves(inputs):
    stamps = count(10 * SECOND)

    def woken(x):
        pose = StampedPose(next(stamps), "cell", (x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        assert inputs.store("one", pose, 10 * SECOND) is None
        return inputs.woken

    inputs.await_again(["one", "two"])
    assert [woken(x) for x in (0.0, 1.0, 2.0, 2.0)] == [False] * 4
    inputs.renew()
    assert [woken(x) for x in (2.0, 3.0, 4.0)] == [False, True, True]
    inputs.await_again(["one", "two"])
    assert [woken(x) for x in (5.0, 5.0)] == [False, False]
    inputs.forget()
    assert not woken(6.0)


def test_a_tick_may_come_half_a_period_early():
    pace = Pace(10.0)
    assert pace.wait_s(0.0) <= 0.0
    assert pace.allows(0.0)
    assert pace.wait_s(0.02) == pytest.approx(0.03)
    assert pace.allows(0.06)
    assert pace.wait_s(0.06) == pytest.approx(0.09), "the next is due where it would have been"


def test_bodies_that_wake_get_no_more_ticks_than_the_rate(rclpy_context, inputs):
    """A body may wake at any moment. A timer that fires for it must not fire again soon after."""
    node, ticks, seconds = rclpy.create_node("ticking"), [], 2.0

    def tick():
        ticks.append(time.monotonic())
        inputs.await_again(["one", "two"])

    ticking = Ticking(node, 20.0, inputs, tick)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    ticking.start()
    begun, done = time.monotonic(), 0
    while (now := time.monotonic()) < begun + seconds:
        executor.spin_once(timeout_sec=0.002)
        # Every second period all bodies get new poses. A fifth of a period later, one moves.
        while begun + 0.1 * (done // 2) + 0.01 * (done % 2) < now:
            for name in ("one",) if done % 2 else ("two", "one"):
                x = (float((done + 1) // 2), 0.0, 0.0)
                inputs.store(name, StampedPose(10 * SECOND, "cell", x, (0, 0, 0, 1)), 10 * SECOND)
                ticking.take_poses()
            done += 1
    ticking.destroy()
    executor.shutdown()
    node.destroy_node()
    assert len(ticks) <= 20.0 * seconds + 6, "half as many more if the timer rings once too often"


def test_a_flood_gets_no_more_ticks_than_the_rate_and_a_steady_source_gets_all():
    pace = Pace(100.0)
    flood = sum(pace.allows(i * 1e-4) for i in range(20_000))
    assert flood == pytest.approx(200, abs=2)
    pace, rng = Pace(100.0), np.random.default_rng(1)
    trembling = np.arange(500) * 0.01 + rng.uniform(-0.002, 0.002, 500)
    assert all(pace.allows(now) for now in trembling.tolist())


def test_a_higher_rate_has_its_ticks_at_once():
    pace = Pace(0.1)
    assert pace.allows(0.0)
    pace.limit(100.0)
    assert pace.wait_s(0.01) <= 0.0
    assert pace.allows(0.01)
    assert 0.0 < pace.wait_s(0.01) < 0.02
