"""The margin of a pair to its own threshold: what the list, the report and the tables say."""

import csv
import io
import re

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_alone import NAMES, SCENE
from ticks import frame

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.events import Events
from proximity_monitor.display.export import pairs_csv
from proximity_monitor.display.found import conflicts, find
from proximity_monitor.display.order import kinds, margin_of, margins
from proximity_monitor.display.pairs import table
from proximity_monitor.display.report import conflicts_csv, report_html
from proximity_monitor.display.session import Session
from proximity_monitor.display.state import BOUNDED, OVERLAPPING, STALE, STOP, WARN

CASES = (
    ("clear", {"level": 0}, (0.31, 0.33), "warn", 0.21),
    ("warn", {"level": WARN}, (0.05, 0.07), "stop", 0.03),
    ("stop", {"level": STOP}, (0.005, 0.007), "stop", -0.015),
    ("held at stop by the hysteresis", {"level": STOP}, (0.025, 0.025), "stop", 0.005),
    ("overlap", {"level": STOP, "status": OVERLAPPING}, (-0.02, -0.01), "contact", -0.02),
)


def tick(stamp_s, bounds, names=(NAMES,), **given):
    lower, upper = bounds
    each = frame(stamp_s, [lower], [upper], names=names, **{"status": BOUNDED} | given)
    return each


@pytest.mark.parametrize("_, given, bounds, to, metres", CASES)
def test_the_margin_is_the_lower_bound_less_the_next_threshold(_, given, bounds, to, metres):
    now = tick(1.0, bounds, **given)
    found = margin_of(now.pairs, 0, SCENE)
    assert found == (to, pytest.approx(metres))
    # The list is sorted by it.
    assert margins(now.pairs, SCENE, kinds(now.pairs)).tolist() == [found.metres]
    said = f"margin to {to}: at least {1e3 * metres:.3f} mm"
    own = Choice(pair=NAMES)
    assert f"<div class='pm-small pm-margin'>{said}</div>" in table(now.pairs, SCENE, own)
    shown = table(now.pairs, SCENE, Choice())
    assert "pm-margin" not in shown
    assert f'title="stop 20.000 mm, warn 100.000 mm; {said}"' in shown


def test_of_a_stale_pair_no_margin_is_told():
    now = tick(1.0, (0.31, 0.31), level=STALE)
    assert np.isnan(margin_of(now.pairs, 0, SCENE).metres)
    assert "margin" not in table(now.pairs, SCENE, Choice(pair=NAMES))
    (row,) = csv.DictReader(io.StringIO(pairs_csv(now, SCENE, Session(), {})))
    assert (row["margin [mm]"], row["margin_to"]) == ("nan", "")


def test_the_tables_and_the_report_have_the_margins_then_and_at_the_end():
    session, events = Session(), Events()
    for stamp_s, bounds, level in (
        (0, (0.3, 0.3), 0),
        (1, (0.005, 0.007), STOP),
        (2, (0.31,) * 2, 0),
    ):
        last = tick(stamp_s, bounds, level=level)
        session.add(last, keep=events.note(last, SCENE))
    (row,) = csv.DictReader(io.StringIO(pairs_csv(last, SCENE, session, {})))
    assert (float(row["margin [mm]"]), row["margin_to"]) == (pytest.approx(210.0), "warn")
    found = conflicts(find(SCENE, session, events, {}), session, events, {})
    (row,) = csv.DictReader(io.StringIO(conflicts_csv(found, SCENE, last, session.span_s)))
    assert (float(row["margin [mm]"]), row["margin_to"]) == (pytest.approx(210.0), "warn")
    assert (float(row["min_margin [mm]"]), row["min_margin_to"]) == (pytest.approx(-15.0), "stop")
    text = re.sub("<[^>]*>", " ", report_html(found, {}, SCENE, last, session.span_s, {}))
    assert "upper bound 7.000 mm; margin to stop: at least -15.000 mm" in text
    assert "310.000 mm; margin to warn: at least 210.000 mm" in text
