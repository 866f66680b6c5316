"""The demo's table, made from messages as the monitor builds them."""

from __future__ import annotations

import math
from io import StringIO

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message
from rich.console import Console

from proximity_monitor.ros.messages import closest_points
from proximity_monitor.ros.table import Picture
from proximity_monitor.scene import UNITS
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.state import PairState, PairStatus


def pair(index, lower, upper, status=PairStatus.EXACT, least=None):
    return PairState(
        a=f"a{index}",
        b="b",
        lower=lower,
        upper=upper,
        point_a=np.zeros(3),
        point_b=np.ones(3),
        status=status,
        age_s=0.0,
        silent=(),
        session_min=upper if least is None else least,
        session_min_lower=lower,
        index=index,
    )


def message(*pairs):
    data = closest_points(
        pairs,
        {each.index: Level.STOP if each.upper < 0.0 else Level.CLEAR for each in pairs},
        stamp=Time(),
        frame="cell",
        unit=UNITS["mm"],
        pose_stamp_ns=lambda name: 1,
    )
    return deserialize_message(data, DiagnosticArray)


def picture(*pairs):
    made = Picture(UNITS["mm"], "script: 2 bodies, 4 s in a loop")
    made.take_points(message(*pairs))
    return made


def names(made, limit=99):
    return [row[0] for row in made.rows(limit)]


MIXED = (
    pair(0, 0.004, 0.004),
    pair(1, math.nan, math.nan, PairStatus.UNKNOWN, math.inf),
    pair(2, 0.001, 0.009, PairStatus.BOUNDED),
    pair(3, -0.002, -0.002, PairStatus.OVERLAPPING),
    pair(4, 0.001, 0.002, PairStatus.BOUNDED),
    pair(5, 0.0035, math.inf, PairStatus.BOUNDED, math.inf),
)


def test_pairs_that_may_be_nearest_come_first_and_unknown_ones_last():
    assert names(picture(*MIXED)) == ["a3 - b", "a4 - b", "a2 - b", "a5 - b", "a0 - b", "a1 - b"]


def test_a_clearance_is_one_number_where_it_is_known_and_two_where_it_is_not():
    texts = {row[0]: row[1] for row in picture(*MIXED).rows(99)}
    assert texts == {
        "a0 - b": "4.0000",
        "a1 - b": "nan",
        "a2 - b": "1.0000..9.0000",
        "a3 - b": "-2.0000",
        "a4 - b": "1.0000..2.0000",
        "a5 - b": "above 3.5000",
    }


def test_of_hundreds_of_pairs_the_nearest_are_listed():
    many = [pair(i, 0.001 * i, 0.001 * i) for i in range(400)]
    made = picture(*reversed(many))
    assert names(made, 3) == ["a0 - b", "a1 - b", "a2 - b"]
    lines = made.plain(3).splitlines()
    assert lines[-1] == "  and 397 more pairs, none of them nearer"
    assert len(lines) == 2 + 1 + 3 + 1
    console = Console(width=120, height=24, record=True, file=StringIO())
    console.print(made.rich(24))
    shown = console.export_text().splitlines()
    assert len(shown) <= 23  # one line is for the cursor
    assert any("a14 - b" in line for line in shown)
    assert any("more pairs, none of them nearer" in line for line in shown)


def test_a_terminal_of_any_height_shows_at_least_a_pair():
    console = Console(width=120, record=True, file=StringIO())
    console.print(picture(*MIXED).rich(2))
    assert "a3 - b" in console.export_text()


def test_what_is_not_listed_any_more_keeps_its_minimum():
    made = picture(pair(0, 0.001, 0.001), pair(1, 0.003, 0.003))
    made.take_points(message(pair(1, 0.002, 0.002), pair(2, math.nan, math.nan, least=math.inf)))
    assert names(made) == ["a1 - b", "a2 - b"]
    assert made.minima(9) == [("a0 - b", "1.0000"), ("a1 - b", "2.0000")]
    assert made.minima(1) == [("a0 - b", "1.0000")]


def test_states_are_counted_with_the_pairs_that_are_not_listed():
    made = picture(*MIXED)
    assert made.count() == "6 pairs listed: 1 stop, 5 clear"
    told = {"pairs beyond range": "494", "pairs watched": "500"}
    values = [KeyValue(key=key, value=value) for key, value in told.items()]
    status = DiagnosticStatus(name="proximity_monitor: clearance", values=values)
    made.take_diagnostics(DiagnosticArray(status=[status]))
    assert made.count() == "500 pairs: 1 stop, 5 clear, 494 beyond their range"


def test_one_pair_is_told_in_the_singular():
    made = picture(*MIXED)
    assert made.plain(5).splitlines()[-1] == "  and 1 more pair, not nearer"
    told = {"pairs beyond range": "1", "pairs watched": "7"}
    values = [KeyValue(key=key, value=value) for key, value in told.items()]
    status = DiagnosticStatus(name="proximity_monitor: clearance", values=values)
    made.take_diagnostics(DiagnosticArray(status=[status]))
    assert made.count() == "7 pairs: 1 stop, 5 clear, 1 beyond its range"


def test_nothing_listed_is_no_error():
    made = picture()
    assert made.rows(5) == []
    assert "waiting for the first diagnostics" in made.plain(5)


def told(task, text="", level=DiagnosticStatus.OK, **values):
    items = [KeyValue(key=key.replace("_bodies", " bodies"), value=v) for key, v in values.items()]
    return DiagnosticStatus(name=f"m: {task}", message=text, level=level, values=items)


def schedule(rate):
    times = {f"{what}_p{share}_ms": "1.0" for what in ("search", "tick") for share in (50, 99)}
    return told("schedule", rate_achieved_hz=rate, budget_ms="10", **times)


def test_there_is_nothing_to_show_before_a_rate_is_known():
    made = picture(pair(0, 0.004, 0.004))
    assert not made.ready
    made.results = 1
    made.take_diagnostics(DiagnosticArray(status=[schedule("nan")]))
    assert not made.ready
    assert "nan" not in made.header()
    made.take_diagnostics(DiagnosticArray(status=[schedule("20.00")]))
    assert made.ready
    assert made.header().startswith("20.00 Hz")


def test_a_silence_that_is_over_is_not_told_above_pairs_that_are_clear():
    """Diagnostics come once a second, pairs with each tick: the diagnostics may be outdated."""
    made = picture(pair(0, 0.004, 0.004))
    line = "no recent pose of a0"
    silent = told("inputs", line, DiagnosticStatus.WARN, silent_bodies="a0")
    made.take_diagnostics(DiagnosticArray(status=[silent]))
    assert line not in made.plain(9)
    stale = message(pair(0, 0.004, 0.004))
    for value in stale.status[0].values:
        value.value = "stale" if value.key == "state" else value.value
    made.take_points(stale)
    assert line in made.plain(9)


def test_the_summary_names_the_pairs_of_each_kind_of_alert_and_why():
    made = picture()
    for i in range(5):
        for new, why in (("warn", "9 mm <= warn 10 mm"), ("clear", "12 mm > warn 10 mm")):
            old = "clear" if new == "warn" else "warn"
            made.take_alert(DiagnosticStatus(name=f"a{i} - b", message=f"{old} -> {new}: {why}"))
    made.take_alert(DiagnosticStatus(name="a1 - b", message="warn -> stop: 1 mm <= stop 2 mm"))
    clear, _, stop = made.changes()
    assert clear.startswith("5 x clear -> warn: a2 - b (9 mm <= warn 10 mm), a3 - b (")
    assert clear.endswith(", and 2 other pairs")
    assert stop == "1 x warn -> stop: a1 - b (1 mm <= stop 2 mm)"
