"""The flight recorder."""

import csv
import math

import pytest
from pair_states import pair, tick, watched

from proximity_monitor.scene.alerts import Alert, Level
from proximity_monitor.scene.recording import Recording


def alert(number):
    return Alert(0, "piston", "block", Level.CLEAR, Level.WARN, 0.1, 0.2, f"number {number}")


def test_the_last_ticks_and_alerts_are_kept_and_older_ones_are_overwritten():
    recording = Recording(watched(), ticks=4, alerts=3)
    for i in range(10):
        recording.add(i, tick(pair(0.1 * i)), [alert(i)])
        kept = recording.ticks["stamp_ns"].tolist()
        assert kept == list(range(max(0, i - 3), i + 1))
    assert [each.alert.reason for each in recording.alerts] == ["number 7", "number 8", "number 9"]


def test_a_snapshot_stays_as_it_was(tmp_path):
    recording = Recording(watched(), ticks=4, alerts=3)
    for i in range(6):
        recording.add(i, tick(pair(0.1 * i)), [alert(i)])
    taken = recording.snapshot()
    recording.add(6, tick(pair(0.6)), [alert(6)])
    assert taken.ticks["stamp_ns"].tolist() == [2, 3, 4, 5]
    assert [each.stamp_ns for each in taken.alerts] == [3, 4, 5]
    ticks, _ = taken.write_csv(tmp_path)
    assert [row["stamp_ns"] for row in csv.DictReader(ticks.open())] == ["2", "3", "4", "5"]


def test_the_nearest_pair_is_told_and_a_stale_one_before_any():
    recording = Recording(watched(3), ticks=10)
    far = pair(0.5)
    near = pair(0.1, upper=0.3, index=2, a="a2", b="b2")
    stale = pair(0.7, index=1, a="a1", b="b1", silent=("a1",))
    recording.add(1, tick(far, near), [])
    recording.add(2, tick(far, stale, near), [])
    recording.add(3, tick(far=3), [])
    assert recording.ticks["pair"].tolist() == [2, 1, -1]
    assert recording.ticks["clearance"].tolist() == [0.1, 0.0, math.inf]
    assert recording.ticks["upper"].tolist() == [0.3, 0.7, math.inf]


def test_tables_hold_every_digit(tmp_path):
    recording = Recording(watched(), ticks=10)
    lower = 0.1 + 0.2
    recording.add(1_700_000_000_123_456_789, tick(pair(lower), elapsed_s=0.0123), [alert(1)])
    ticks, alerts = recording.write_csv(tmp_path)
    (row,) = csv.DictReader(ticks.open())
    assert (row["a"], row["b"]) == ("piston", "block")
    assert float(row["clearance_m"]) == lower
    assert float(row["elapsed_s"]) == 0.0123
    assert int(row["stamp_ns"]) == 1_700_000_000_123_456_789
    (row,) = csv.DictReader(alerts.open())
    assert (row["old"], row["new"], row["reason"]) == ("clear", "warn", "number 1")
    assert (float(row["lower_m"]), float(row["upper_m"])) == (0.1, 0.2)


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    with pytest.raises(OSError):
        Recording(watched()).write_csv(tmp_path / "nowhere")
