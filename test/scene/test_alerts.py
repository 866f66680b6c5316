import math

import numpy as np
import pytest
from pair_states import pair, tick, watched

from proximity_monitor.scene import Thresholds, Unit
from proximity_monitor.scene.alerts import Alerts, Level
from proximity_monitor.scene.relative_motion import Course
from proximity_monitor.scene.state import PairStatus

LIMITS = Thresholds(warn=0.010, stop=0.002, hysteresis=0.001)
HELD = Thresholds(warn=0.010, stop=0.002, hysteresis=0.001, hold_s=0.625)
MM = Unit("millimetre", 0.001, "mm")


class Watch:
    """Alerts of one or more pairs. Each call is a tick, an eighth of a second after the last."""

    def __init__(self, count=1, reach=math.inf, limits=LIMITS):
        self.alerts = Alerts(watched(count, reach), MM)
        self.limits = [limits] * count
        self.now_s = 0.0

    def see(self, *pairs, **more):
        self.now_s += 0.125
        return self.alerts.update(tick(*pairs), self.limits, self.now_s, **more)

    def level(self, *pairs, index=0, **more):
        self.see(*pairs, **more)
        return self.alerts.levels.get(index, Level.CLEAR)


def levels_of(distances, limits=LIMITS):
    watch = Watch(limits=limits)
    return [watch.level(pair(distance)) for distance in distances]


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
    watch, changes = Watch(), []
    for i in range(100):
        changes += watch.see(pair(0.010 + (-1) ** i * 0.0005))
    assert [(c.old, c.new) for c in changes] == [
        (Level.STALE, Level.CLEAR),
        (Level.CLEAR, Level.WARN),
    ]


def test_the_lower_bound_decides_so_that_clear_is_certain():
    watch = Watch()
    assert watch.level(pair(0.005, upper=0.5, status=PairStatus.BOUNDED)) is Level.WARN
    assert watch.level(pair(0.0, upper=0.5, status=PairStatus.BOUNDED)) is Level.STOP


def test_intersection_is_stop_even_where_no_threshold_asks_for_it():
    watch = Watch(limits=Thresholds(0.0, 0.0, 0.0))
    watch.see(pair(1.0))
    (change,) = watch.see(pair(0.0, status=PairStatus.INTERSECTING))
    assert change.new is Level.STOP
    assert "intersecting" in change.reason


def test_a_touch_ends_only_when_the_bodies_have_been_apart_for_the_time():
    watch = Watch(limits=Thresholds(0.0, 0.0, 0.0, hold_s=0.375))
    touch = pair(0.0, status=PairStatus.INTERSECTING)
    assert [watch.level(p) for p in (touch, pair(1.0), pair(1.0), touch)] == [Level.STOP] * 4
    seen = [watch.level(pair(1.0)) for _ in range(4)]
    assert seen == [Level.STOP] * 3 + [Level.CLEAR]


@pytest.mark.parametrize("status", [PairStatus.EXACT, PairStatus.INTERSECTING])
def test_a_silent_body_makes_its_pair_stale_however_far_away(status):
    watch = Watch()
    watch.see(pair(1.0))
    (change,) = watch.see(pair(1.0, status=status, silent=("piston",)))
    assert (change.old, change.new) == (Level.CLEAR, Level.STALE)
    assert change.reason == "no recent pose of piston"


def test_pairs_begin_as_stale_and_stay_so_until_their_bodies_have_poses():
    watch = Watch()
    unknown = pair(math.nan, status=PairStatus.UNKNOWN, silent=("piston", "block"))
    assert watch.see(unknown) == []
    assert watch.alerts.levels[0] is Level.STALE
    (change,) = watch.see(pair(0.1))
    assert (change.old, change.new) == (Level.STALE, Level.CLEAR)
    assert change.reason == "distance 100 mm > warn 10 mm"


def test_numbers_that_are_none_are_never_clear():
    assert Watch().level(pair(math.nan, status=PairStatus.BOUNDED)) is Level.STOP


def test_hysteresis_outlives_a_silence():
    watch = Watch()
    watch.see(pair(0.002))
    watch.see(pair(0.0025, silent=("block",)))
    assert watch.level(pair(0.0025)) is Level.STOP


def test_new_thresholds_judge_the_same_distance_anew():
    watch = Watch()
    watch.see(pair(0.005))
    watch.limits = [Thresholds(0.004, 0.001, 0.0)]
    (change,) = watch.see(pair(0.005))
    assert (change.old, change.new) == (Level.WARN, Level.CLEAR)
    watch.limits = [Thresholds(0.006, 0.001, 0.0)]
    (change,) = watch.see(pair(0.005))
    assert (change.old, change.new) == (Level.CLEAR, Level.WARN)


def test_a_level_is_held_until_the_bound_was_above_for_the_whole_time_without_a_break():
    watch = Watch(limits=HELD)
    assert watch.level(pair(0.005)) is Level.WARN
    seen = [watch.level(pair(0.020)) for _ in range(4)]
    assert seen == [Level.WARN] * 4
    assert watch.level(pair(0.0105)) is Level.WARN, "a break: the time begins anew"
    seen = [watch.level(pair(0.020)) for _ in range(6)]
    assert seen == [Level.WARN] * 5 + [Level.CLEAR]
    assert watch.level(pair(0.005)) is Level.WARN, "what triggers, triggers at once"


def test_stop_and_warn_are_held_at_the_same_time():
    watch = Watch(limits=HELD)
    watch.see(pair(0.001))
    seen = [watch.level(pair(0.020)) for _ in range(6)]
    assert seen == [Level.STOP] * 5 + [Level.CLEAR]
    watch.see(pair(0.001))
    seen = [watch.level(pair(0.005)) for _ in range(6)]
    assert seen == [Level.STOP] * 5 + [Level.WARN]


def test_a_silence_breaks_the_time():
    watch = Watch(limits=HELD)
    watch.see(pair(0.005))
    for _ in range(3):
        watch.see(pair(0.020))
    assert watch.level(pair(0.020, silent=("block",))) is Level.STALE
    assert [watch.level(pair(0.020)) for _ in range(6)] == [Level.WARN] * 5 + [Level.CLEAR]


def test_a_pair_that_is_not_listed_is_clear_after_its_time():
    watch = Watch(reach=0.050, limits=HELD)
    watch.see(pair(0.005))
    seen = [watch.level() for _ in range(5)]
    assert seen == [Level.WARN] * 5
    (change,) = watch.see()
    assert (change.new, change.lower, change.upper) == (Level.CLEAR, 0.050, math.inf)
    assert change.reason == "farther than 50 mm"
    assert not watch.alerts.levels
    assert watch.see() == []


@pytest.mark.parametrize(
    ("limits", "farther"),
    [(HELD, "11 mm"), (Thresholds(0.040, 0.002, 0.005, hold_s=0.625), "45 mm")],
    ids=["a range no wider than the hysteresis", "a threshold raised beyond the range"],
)
def test_a_pair_beyond_all_that_is_asked_is_released_whatever_its_range(limits, farther):
    reach = HELD.warn + HELD.hysteresis
    watch = Watch(reach=reach, limits=limits)
    watch.see(pair(0.005))
    assert [watch.level() for _ in range(5)] == [Level.WARN] * 5
    (change,) = watch.see()
    assert change.new is Level.CLEAR
    assert change.lower == max(reach, limits.warn + limits.hysteresis)
    assert change.reason == f"farther than {farther}"


def test_a_pair_that_comes_into_range_is_judged_as_one_that_was_clear():
    watch = Watch(count=2, reach=0.050)
    watch.see(pair(0.040))
    (change,) = watch.see(pair(0.040), pair(0.005, index=1, a="a1", b="b1"))
    assert (change.index, change.a, change.old, change.new) == (1, "a1", Level.CLEAR, Level.WARN)
    assert set(watch.alerts.levels) == {0, 1}


def test_a_pair_that_is_not_listed_because_a_body_is_silent_stays_stale():
    watch = Watch(reach=0.050)
    watch.see(pair(0.005))
    (change,) = watch.see(silent={"block": "no recent vertices"})
    assert (change.new, change.reason) == (Level.STALE, "no recent vertices of block")
    assert math.isnan(change.lower), "nothing is certain about it"
    assert watch.see(silent={"block": "no recent vertices"}) == []
    (change,) = watch.see()
    assert change.new is Level.CLEAR


def test_an_attached_pair_is_clear_because_it_is_not_watched():
    watch = Watch()
    watch.see(pair(0.001))
    (change,) = watch.see(unwatched={0: "attached to each other: not watched"})
    assert (change.old, change.new) == (Level.STOP, Level.CLEAR)
    assert change.reason == "attached to each other: not watched"


def test_an_alert_says_which_pair_the_bounds_and_why_in_the_scenes_unit():
    watch = Watch()
    (change,) = watch.see(pair(0.0015, upper=0.004, status=PairStatus.BOUNDED))
    assert (change.a, change.b, change.lower, change.upper) == ("piston", "block", 0.0015, 0.004)
    assert change.reason == "lower bound 1.5 mm (upper 4 mm) <= stop 2 mm"


def test_overlapping_solids_are_at_stop_and_say_how_deep():
    watch = Watch()
    (change,) = watch.see(pair(-0.003, status=PairStatus.OVERLAPPING))
    assert change.new is Level.STOP
    assert change.reason == "overlapping by 3 mm: distance -3 mm <= stop 2 mm"
    watch = Watch()
    (change,) = watch.see(pair(-0.003, upper=-0.001, status=PairStatus.OVERLAPPING))
    assert change.reason.startswith("overlapping by 1..3 mm")


def test_an_alert_says_how_fast_the_bodies_close_and_how_long_there_is():
    still = Course(np.eye(4), np.eye(4), math.inf)
    before, after = np.eye(4), np.eye(4)
    before[2, 3], after[2, 3] = 0.016, 0.006
    courses = {"piston": Course(before, after, 0.1), "block": still}
    watch = Watch()
    watch.see(pair(0.016))
    near = pair(0.006, points=((0.0, 0.0, 0.006), (0.0, 0.0, 0.0)))
    (change,) = watch.see(near, courses=courses.get)
    assert change.motion.body == "piston"
    assert change.motion.escape.tolist() == [0.0, 0.0, 1.0]
    assert change.motion.closing == pytest.approx(0.1)
    assert change.seconds_left == pytest.approx(0.04)  # 4 mm to stop at 100 mm/s
    assert change.reason == "distance 6 mm <= warn 10 mm, closing at 100 mm/s, stop in 0.04 s"
    at_stop = pair(0.002, points=((0.0, 0.0, 0.002), (0.0, 0.0, 0.0)))
    (change,) = watch.see(at_stop, courses=courses.get)
    assert change.seconds_left == pytest.approx(0.02)
    assert change.reason.endswith("contact in 0.02 s")


def test_each_pair_has_its_own_level_and_thresholds():
    alerts = Alerts(watched(2), MM)
    wide = Thresholds(warn=1.0, stop=0.5, hysteresis=0.0)
    both = tick(pair(0.3), pair(0.3, index=1, a="a1", b="b1"))
    changes = alerts.update(both, [LIMITS, wide], 0.0)
    assert dict(alerts.levels) == {0: Level.CLEAR, 1: Level.STOP}
    assert [change.index for change in changes] == [0, 1]


def test_a_scene_file_says_the_time_in_seconds_and_pairs_inherit_it(load):
    bodies = "".join(
        f"  - {{name: {name}, primitive: {{sphere: {{radius: 1}}}}, moving: true}}\n"
        for name in "abc"
    )
    scene = load(
        "version: 1\nunit: mm\nthresholds: {warn: 5, hold_s: 0.75}\nbodies:\n"
        f"{bodies}pairs:\n  watch:\n    - {{between: [a, b], thresholds: {{warn: 7}}}}\n"
        "    - {between: [a, c], thresholds: {hold_s: 2}}\n    - {between: [b, c]}\n"
    )
    limits = [(pair.thresholds.warn, pair.thresholds.hold_s) for pair in scene.pairs]
    assert limits == [(0.007, 0.75), (0.005, 2.0), (0.005, 0.75)]
    assert scene.thresholds.hold_s == 0.75


@pytest.mark.parametrize("wrong", ["-1", "soon", "1e9"])
def test_a_time_that_cannot_be_is_refused_by_line(problems, wrong):
    (told,) = problems(
        f"version: 1\nunit: mm\nthresholds: {{hold_s: {wrong}}}\nbodies:\n"
        "  - {name: a, primitive: {sphere: {radius: 1}}, moving: true}\n"
        "  - {name: b, primitive: {sphere: {radius: 1}}, moving: true}\n"
    )
    assert told.startswith("3: thresholds.hold_s: must be ")


def test_a_time_in_which_nothing_was_watched_is_no_time_above():
    watch = Watch(limits=HELD)
    watch.see(pair(0.001))
    assert watch.level(pair(0.020)) is Level.STOP  # above the limits from here on
    watch.alerts.interrupt()
    watch.now_s += 10.0
    assert [watch.level(pair(0.020)) for _ in range(5)] == [Level.STOP] * 5
    assert watch.level(pair(0.020)) is Level.CLEAR
