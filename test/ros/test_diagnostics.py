"""The counts in the diagnostics, tested without a node."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from proximity_monitor.ros.diagnostics import Health, NodeState
from proximity_monitor.scene import Thresholds, Unit, WatchedPair
from proximity_monitor.scene.alerts import Alerts
from proximity_monitor.scene.state import PairState, PairStatus, Tick
from proximity_monitor.scene.unseen import Unseen

LIMITS = Thresholds(warn=0.010, stop=0.002, hysteresis=0.001, hold_s=5.0)


def state(index, lower):
    return PairState(
        a=f"a{index}", b=f"b{index}", lower=lower, upper=lower, point_a=np.zeros(3),
        point_b=np.zeros(3), status=PairStatus.EXACT, age_s=0.0, silent=(), session_min=math.inf,
        session_min_lower=math.inf, index=index,
    )  # fmt: skip


def test_every_pair_is_counted_once_listed_or_not():
    """Pairs 1 and 3 are silent and not listed. Pair 2 was at warn and is held there while far."""
    watched = [WatchedPair(f"a{i}", f"b{i}", 0.0, 0.0, LIMITS, False, range=0.1) for i in range(5)]
    alerts, thresholds = Alerts(watched, Unit("metre", 1.0, "m")), [LIMITS] * 5
    near = [state(i, 0.005) for i in range(3)]
    alerts.update(Tick(near, 0.0, 0.0, (), 0, far=2), thresholds, 1.0)
    tick = Tick(near[:1], 0.0, 0.0, (), 0, far=2, unsure=2)
    alerts.update(tick, thresholds, 2.0, silent=dict.fromkeys(("a1", "a3"), "no recent pose"))
    nothing = dict.fromkeys(NodeState._fields)
    unseen = Unseen(2, (("a0", "b0"), ("a1", "b1")), {"a0": "not watertight"})
    given = {"tick": tick, "levels": alerts.levels, "watched": 5, "unseen": unseen}
    told = Health("monitor", "cell")._clearance(NodeState(**nothing | given))
    counts = {each.key: each.value for each in told.values}
    assert counts["pairs that cannot see containment"] == "2"
    assert counts["containment unseen"] == "a0 - b0, a1 - b1"
    assert [counts[f"pairs {level}"] for level in ("stop", "warn", "stale", "clear")] == [
        "0", "2", "2", "1",
    ]  # fmt: skip
    assert told.message == "2 pairs at warn, 2 stale"
    others = [counts[f"pairs {which}"] for which in ("beyond range", "not listed", "not watched")]
    assert others == ["2", "2", "0"]
    attached = Tick(near[:1], 0.0, 0.0, (), 0, far=2)
    told = Health("monitor", "cell")._clearance(NodeState(**nothing | given | {"tick": attached}))
    assert {each.key: each.value for each in told.values}["pairs not watched"] == "2"


@pytest.mark.parametrize(
    "lower, said",
    [
        ((0.001,), "1 pair at stop"),
        ((0.001, 0.001), "2 pairs at stop"),
        ((0.005,), "1 pair at warn, 0 stale"),
    ],
)
def test_one_pair_is_told_in_the_singular(lower, said):
    watched = [WatchedPair(f"a{i}", f"b{i}", 0.0, 0.0, LIMITS, False) for i in range(len(lower))]
    alerts = Alerts(watched, Unit("metre", 1.0, "m"))
    tick = Tick([state(i, each) for i, each in enumerate(lower)], 0.0, 0.0, (), 0)
    alerts.update(tick, [LIMITS] * len(lower), 1.0)
    given = {"tick": tick, "levels": alerts.levels, "watched": 2, "unseen": Unseen(0, (), {})}
    told = Health("monitor", "cell")._clearance(
        NodeState(**dict.fromkeys(NodeState._fields) | given)
    )
    assert told.message == said


@pytest.mark.parametrize("count, said", [(1, "1 message rejected"), (2, "2 messages rejected")])
def test_one_rejected_message_is_told_in_the_singular(count, said):
    inputs = SimpleNamespace(rejected={"late": count}, strangers=())
    nothing = ("silent", "waiting", "dropped", "clouds", "held", "refused_joints")
    given = {"inputs": inputs, **{key: {} for key in nothing}}
    state = NodeState(**dict.fromkeys(NodeState._fields) | given)
    assert Health("monitor", "cell")._inputs(state).message == f"{said} in the last second"


@pytest.mark.parametrize("count, said", [(1, "1 overrun in"), (2, "2 overruns in")])
def test_one_overrun_is_told_in_the_singular(count, said):
    health = Health("monitor", "cell")
    health.timing.budget_overruns = count
    settings = SimpleNamespace(rate_hz=10.0, budget_s=0.01)
    given = {"tick": None, "settings": settings, "activity": "active", "distance_ticks": 0}
    state = NodeState(**dict.fromkeys(NodeState._fields) | given)
    assert health._schedule(state).message == f"{said} the last second"
