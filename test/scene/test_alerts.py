import math

import numpy as np
import pytest

from proximity_monitor.scene import Thresholds, Unit
from proximity_monitor.scene.alerts import Alerts, Level
from proximity_monitor.scene.state import PairState, PairStatus

LIMITS = Thresholds(warn=0.010, stop=0.002, hysteresis=0.001)
MM = Unit("millimetre", 0.001, "mm")


def pair(lower, *, upper=None, status=PairStatus.EXACT, silent=()):
    return PairState(
        a="piston",
        b="block",
        lower=lower,
        upper=lower if upper is None else upper,
        point_a=np.zeros(3),
        point_b=np.zeros(3),
        status=status,
        age_s=0.0,
        silent=silent,
        session_min=math.inf,
        session_min_lower=math.inf,
    )


def levels_of(distances, limits=LIMITS):
    alerts = Alerts(1, MM)
    seen = []
    for distance in distances:
        alerts.update([pair(distance)], [limits])
        seen.append(alerts.levels[0])
    return seen


def test_a_distance_equal_to_a_threshold_triggers_it():
    above = [math.nextafter(t, math.inf) for t in (0.010, 0.002)]
    assert levels_of([above[0]]) == [Level.CLEAR]
    assert levels_of([0.010]) == [Level.WARN]
    assert levels_of([above[1]]) == [Level.WARN]
    assert levels_of([0.002]) == [Level.STOP]


def test_a_level_is_released_only_above_threshold_and_hysteresis():
    distances = [0.020, 0.010, 0.0105, 0.011, 0.01101, 0.0105]
    assert levels_of(distances) == [
        Level.CLEAR,
        Level.WARN,
        Level.WARN,
        Level.WARN,
        Level.CLEAR,
        Level.CLEAR,
    ]
    assert levels_of([0.002, 0.0025, 0.003, 0.00301, 0.0105, 0.012]) == [
        Level.STOP,
        Level.STOP,
        Level.STOP,
        Level.WARN,
        Level.WARN,
        Level.CLEAR,
    ]


def test_trembling_about_a_threshold_gives_one_alert():
    alerts = Alerts(1, MM)
    changes = []
    for i in range(100):
        changes += alerts.update([pair(0.010 + (-1) ** i * 0.0005)], [LIMITS])
    assert [(c.old, c.new) for c in changes] == [
        (Level.STALE, Level.CLEAR),
        (Level.CLEAR, Level.WARN),
    ]


def test_the_lower_bound_decides_so_that_clear_is_certain():
    alerts = Alerts(1, MM)
    alerts.update([pair(0.005, upper=0.5, status=PairStatus.BOUNDED)], [LIMITS])
    assert alerts.levels == [Level.WARN]
    alerts.update([pair(0.0, upper=0.5, status=PairStatus.BOUNDED)], [LIMITS])
    assert alerts.levels == [Level.STOP]


def test_intersection_is_stop_even_where_no_threshold_asks_for_it():
    alerts = Alerts(1, MM)
    (change,) = alerts.update(
        [pair(0.0, status=PairStatus.INTERSECTING)], [Thresholds(0.0, 0.0, 0.0)]
    )
    assert change.new is Level.STOP
    assert "intersecting" in change.reason


@pytest.mark.parametrize("status", [PairStatus.EXACT, PairStatus.INTERSECTING])
def test_a_silent_body_makes_its_pair_stale_however_far_away(status):
    alerts = Alerts(1, MM)
    alerts.update([pair(1.0)], [LIMITS])
    (change,) = alerts.update([pair(1.0, status=status, silent=("piston",))], [LIMITS])
    assert (change.old, change.new) == (Level.CLEAR, Level.STALE)
    assert change.reason == "no recent pose of piston"


def test_pairs_begin_as_stale_and_stay_so_until_their_bodies_have_poses():
    alerts = Alerts(1, MM)
    unknown = pair(math.nan, status=PairStatus.UNKNOWN, silent=("piston", "block"))
    assert alerts.levels == [Level.STALE]
    assert alerts.update([unknown], [LIMITS]) == []
    (change,) = alerts.update([pair(0.1)], [LIMITS])
    assert (change.old, change.new) == (Level.STALE, Level.CLEAR)


def test_numbers_that_are_none_are_never_clear():
    alerts = Alerts(1, MM)
    alerts.update([pair(math.nan, status=PairStatus.BOUNDED)], [LIMITS])
    assert alerts.levels == [Level.STOP]


def test_hysteresis_outlives_a_silence():
    alerts = Alerts(1, MM)
    alerts.update([pair(0.002)], [LIMITS])
    alerts.update([pair(0.0025, silent=("block",))], [LIMITS])
    alerts.update([pair(0.0025)], [LIMITS])
    assert alerts.levels == [Level.STOP]


def test_new_thresholds_judge_the_same_distance_anew():
    alerts = Alerts(1, MM)
    alerts.update([pair(0.005)], [LIMITS])
    (change,) = alerts.update([pair(0.005)], [Thresholds(0.004, 0.001, 0.0)])
    assert (change.old, change.new) == (Level.WARN, Level.CLEAR)


def test_an_alert_says_which_pair_the_bounds_and_why_in_the_scenes_unit():
    (change,) = Alerts(1, MM).update(
        [pair(0.0015, upper=0.004, status=PairStatus.BOUNDED)], [LIMITS]
    )
    assert (change.a, change.b, change.lower, change.upper) == ("piston", "block", 0.0015, 0.004)
    assert change.reason == "lower bound 1.5 mm <= stop 2 mm"


def test_each_pair_has_its_own_level_and_thresholds():
    alerts = Alerts(2, MM)
    wide = Thresholds(warn=1.0, stop=0.5, hysteresis=0.0)
    changes = alerts.update([pair(0.3), pair(0.3)], [LIMITS, wide])
    assert alerts.levels == [Level.CLEAR, Level.STOP]
    assert len(changes) == 2
    with pytest.raises(ValueError):
        alerts.update([pair(0.3)], [LIMITS, wide])
