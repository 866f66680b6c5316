"""Parameters that change while the node runs, and those that are refused with a reason."""

import math

import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python

REFUSED = [
    ({"rate_hz": 0.0}, "rate_hz"),
    ({"rate_hz": 1e6}, "rate_hz"),
    ({"rate_hz": math.nan}, "rate_hz"),
    ({"budget_ms": -0.5}, "budget_ms must be at least 0, or -1"),
    ({"budget_ms": "soon"}, "type"),
    ({"rel_err": -2.0}, "rel_err"),
    ({"rel_err": math.inf}, "rel_err"),
    ({"abs_err": -1e-9}, "abs_err must be at least 0, or -1"),
    ({"pose_timeout_s": 0.0}, "pose_timeout_s"),
    ({"thresholds__warn": 0.01}, "warn (0.01 m) must be at least stop (0.02 m)"),
    ({"thresholds__stop": 0.2}, "warn (0.1 m) must be at least stop (0.2 m)"),
    ({"thresholds__stop": -0.1}, "thresholds.stop"),
    ({"thresholds__hysteresis": math.nan}, "thresholds.hysteresis"),
    ({"pairs__ball__die__stop": 0.06}, "pairs.ball.die: warn (0.05 m)"),
    ({"scene": "engine"}, "scene cannot change while the node is configured"),
    ({"fixed_frame": "map"}, "fixed_frame cannot change while the node is configured"),
    ({"autostart": False}, "autostart cannot change while the node is configured"),
    ({"no_such": 1.0}, "undeclared"),
]


def current(peer, *names):
    response = peer.call(GetParameters, "get_parameters", GetParameters.Request(names=names))
    return [parameter_value_to_python(value) for value in response.values]


@pytest.fixture
def restored(peer):
    """A peer whose monitor gets its former parameters back."""
    names = ["rate_hz", "budget_ms", "rel_err", "abs_err", "pose_timeout_s", "markers"]
    names += [f"{group}.{level}" for group in ("thresholds", "pairs.ball.die")
              for level in ("warn", "stop", "hysteresis")]  # fmt: skip
    before = dict(zip(names, current(peer, *names), strict=True))
    yield peer
    assert peer.set_parameters(**{n.replace(".", "__"): v for n, v in before.items()})[0]


@pytest.mark.parametrize(("change", "reason"), REFUSED)
@pytest.mark.parametrize("atomically", [True, False])
def test_a_bad_change_is_refused_with_a_reason_and_changes_nothing(
    peer, change, reason, atomically
):
    known = [name.replace("__", ".") for name in change if name != "no_such"]
    before = current(peer, *known)
    done, why = peer.set_parameters(atomically, **change)
    assert not done
    assert reason in why
    assert current(peer, *known) == before


def test_a_change_is_refused_whole_if_a_part_of_it_is_bad(peer):
    done, why = peer.set_parameters(thresholds__warn=0.3, thresholds__stop=0.4, rel_err=0.1)
    assert not done
    assert "warn" in why
    assert current(peer, "thresholds.warn", "rel_err") == [0.1, -1.0]


def test_thresholds_can_pass_each_other_in_one_call(restored):
    assert restored.set_parameters(thresholds__warn=0.01, thresholds__stop=0.005) == (True, "")
    assert restored.settle(ball=(0.0, 0.0, 0.15))["table - ball"]["state"] == "clear"


def test_a_new_threshold_judges_pairs_that_have_none_of_their_own(restored):
    apart = restored.settle()
    assert restored.set_parameters(thresholds__warn=2.0)[0]
    pairs = restored.wait(
        lambda: (p := restored.pairs()) and p["table - ball"]["state"] == "warn" and p,
        "the new threshold",
    )
    assert pairs["table - die"]["state"] == "warn"
    assert pairs["ball - die"]["state"] == apart["ball - die"]["state"] == "clear"
    assert restored.set_parameters(pairs__ball__die__warn=2.0)[0]
    restored.wait(
        lambda: restored.pairs()["ball - die"]["state"] == "warn", "the pair's own threshold"
    )


def test_a_budget_of_nothing_leaves_certified_bounds(restored, world):
    exact = restored.settle()
    assert restored.set_parameters(budget_ms=0.0)[0]
    restored.hold(ball=(0.0, 0.01, 0.5), die=(0.8, 0.11, 0.9))
    pairs = restored.wait(
        lambda: (p := restored.pairs()) and p["table - ball"]["status"] == "bounded" and p,
        "bounds",
    )
    lower, upper = (float(pairs["table - ball"][key]) for key in ("lower_m", "upper_m"))
    true = float(
        exact["table - ball"]["upper_m"]
    )  # the table is level: a step aside changes nothing
    assert lower < true < upper
    assert lower == pytest.approx(true - 0.01, abs=1e-9)
    text = f"{lower * 1e3:.4g}..{upper * 1e3:.4g} mm bounded"
    assert pairs["table - ball"]["text"] == text


def test_a_tolerance_takes_effect_and_is_kept(restored):
    exact = float(restored.settle()["ball - die"]["upper_m"])
    assert restored.set_parameters(rel_err=0.5)[0]

    def loose():
        restored.hold(ball=(0.0, 0.0, 0.5), die=(0.8, 0.1, 0.9))
        pair = restored.pairs().get("ball - die")
        return pair if pair and pair["status"] in ("within tolerance", "exact") else None

    pair = restored.wait(loose, "an answer within tolerance")
    lower, upper = float(pair["lower_m"]), float(pair["upper_m"])
    assert lower - 1e-12 <= exact <= upper + 1e-12 <= 1.5 * exact


def test_the_rate_changes_at_once(restored):
    assert restored.set_parameters(rate_hz=5.0)[0]
    schedule = restored.wait(
        lambda: (s := restored.health().get("schedule")) and s["rate_hz"] == "5" and s,
        "diagnostics of the new rate",
    )
    assert schedule["activity"] == "active"

    def apart():
        first = restored.next("closest_points").header.stamp
        second = restored.next("closest_points").header.stamp
        return (second.sec - first.sec) + (second.nanosec - first.nanosec) * 1e-9

    # Messages of the old rate may still be on their way.
    restored.wait(lambda: apart() == pytest.approx(0.2, abs=0.1), "five ticks a second")


def test_markers_can_be_switched_off(restored):
    restored.settle()
    restored.next("markers")
    assert restored.set_parameters(markers=False)[0]

    def none():  # after those that were still on their way
        restored.forget()
        restored.next("closest_points")
        restored.next("closest_points")
        return not restored.received.get("markers")

    restored.wait(none, "no more markers")
    assert restored.set_parameters(markers=True)[0]
    restored.next("markers")


def test_every_parameter_is_described_and_numbers_have_ranges(peer):
    names = peer.call(ListParameters, "list_parameters", ListParameters.Request()).result.names
    ours = [n for n in names if n != "use_sim_time" and not n.startswith(("qos_", "start_type"))]
    assert {"scene", "rate_hz", "budget_ms", "rel_err", "abs_err", "pose_timeout_s"} <= set(ours)
    assert {"fixed_frame", "markers", "autostart", "thresholds.warn"} <= set(ours)
    assert "pairs.ball.die.stop" in ours
    assert "pairs.table.ball.stop" not in ours, "it has none of its own"
    request = DescribeParameters.Request(names=ours)
    for each in peer.call(DescribeParameters, "describe_parameters", request).descriptors:
        assert each.description, each.name
        assert bool(each.floating_point_range) == (each.type == 3), each.name
