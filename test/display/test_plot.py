"""The plot of clearances: its pair, its scale with the numbers, and unknown clearances."""

from __future__ import annotations

import re
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import page_alone
import pytest
import ticks as made
from deadlines import START_DEADLINE_S

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.display import plot as plots
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.plot import LOG, THRESHOLDS, Plot
from proximity_monitor.display.session import Session
from proximity_monitor.display.state import STALE, Thresholds

NEAR, FAR = made.NAMES
WIDE, TIGHT = Thresholds(0.1, 0.02, 0.0), Thresholds(0.002, 0.001, 0.0)
ALIKE = replace(page_alone.SCENE, pairs=2, thresholds=WIDE)
UNLIKE = replace(ALIKE, own_thresholds={FAR: TIGHT})
WIDE_ENOUGH = """() => Object.values(window.__viserTestpoints?.uplots ?? {})
  .some(({chart}) => chart.width > 0)"""
# Which columns of the plot have something blue, and the numbers beside it.
SEEN = """() => {
  const [{chart}] = Object.values(window.__viserTestpoints.uplots);
  const [left, top, width, height] = ["left", "top", "width", "height"]
    .map(name => Math.round(chart.bbox[name]));
  const {data} = chart.ctx.getImageData(left, top, width, height);
  const blue = new Array(width).fill(false);
  for (let i = 0; i < data.length; i += 4)
    if (data[i + 2] > data[i] + 60) blue[(i / 4) % width] = true;
  return [blue, chart.axes[1]._values];
}"""


class Gui:
    """Stands in for the page's panel, and keeps what the plot adds to it."""

    def __init__(self):
        self.title = SimpleNamespace(content="")
        self.scale = SimpleNamespace(value=LOG)
        self.plots = []

    def add_html(self, content):
        return self.title

    def add_dropdown(self, label, options, hint):
        return self.scale

    def add_folder(self, label):
        return nullcontext()

    def add_uplot(self, data, series, **looks):
        assert len(data) == len(series)
        self.plots.append(SimpleNamespace(data=data, series=series, remove=lambda: None, **looks))
        return self.plots[-1]


@pytest.fixture
def shown():
    """A plot, and a function that shows ticks and returns the plot's title and data."""
    gui, session, choice = Gui(), Session(), Choice()
    plot = Plot(gui, session, choice)

    def show(*frames, scene=UNLIKE):
        for frame in frames:
            session.add(frame)
        plot.show(scene, session.span_s[0])
        title = re.sub("<[^>]*>", "", gui.title.content)
        return title, gui.plots[-1].data if title else None

    return SimpleNamespace(show=show, gui=gui, session=session, choice=choice)


def levels(frame, *given):
    return replace(frame, pairs=replace(frame.pairs, level=np.array(given, np.int8)))


def test_limits_are_shared_where_warn_and_stop_are_the_same():
    assert plots.shared_thresholds(ALIKE, ()) == WIDE
    assert plots.shared_thresholds(UNLIKE, ()) is None
    assert plots.shared_thresholds(UNLIKE, {FAR}) == WIDE
    assert plots.shared_thresholds(UNLIKE, {NEAR}) == TIGHT
    steady = replace(WIDE, hysteresis=0.01)
    assert plots.shared_thresholds(replace(ALIKE, own_thresholds={FAR: steady}), ()) is not None
    every = replace(ALIKE, own_thresholds={NEAR: TIGHT, FAR: TIGHT})
    assert plots.shared_thresholds(every, ()) == TIGHT


def test_thresholds_are_those_of_the_pair_that_is_nearest_now_if_they_differ(shown):
    title, data = shown.show(made.frame(0.0, [0.3, 0.01]), made.frame(0.1, [0.3, 0.01]))
    assert title.startswith("smallest clearance of all pairs: ")
    assert title.endswith("; warn dashed, stop dotted, of a - c, the nearest now")
    assert data[1].tolist() == [10.0, 10.0]
    assert (data[4][0], data[5][0]) == (2.0, 1.0)
    title, data = shown.show(made.frame(0.2, [0.005, 0.01]))
    assert title.endswith(", of a - b, the nearest now")
    assert (data[4][0], data[5][0]) == (100.0, 20.0)
    shown.choice.pair = FAR
    title, data = shown.show()
    assert title == "a - c: lower and upper bound [mm] over time [s]; warn dashed, stop dotted"
    assert (data[4][0], data[5][0]) == (2.0, 1.0)


def test_the_nearest_pair_is_known_not_ignored_and_steady():
    def nearest(*upper, ignored=(), level=0):
        pairs = made.pairs([-1.0, -1.0], upper, level=level)
        return plots.nearest_pair(pairs, ignored, 1e-6)

    assert nearest(0.3, 0.01) == FAR
    assert nearest(0.3, 0.01, ignored={FAR, ("a", "z")}) == NEAR
    assert nearest(np.nan, 0.01) == FAR
    assert nearest(0.01 + 1e-9, 0.01) == NEAR, "equal in the shown digits"
    assert nearest(np.nan, np.inf) is nearest(0.1, 0.1, level=STALE) is None


def test_no_clearance_known_leaves_the_thresholds_of_the_scene(shown):
    title, data = shown.show(*(made.frame(t, [0.3, 0.01], level=STALE) for t in (0.0, 0.1)))
    assert "dotted, of the scene" in title
    assert (data[4][0], data[5][0]) == (100.0, 20.0)


@pytest.mark.parametrize("thresholds", [(0.015, 0.005), (5.0, 1.5), (5.0, 0.0), (0.0, 0.0)])
@pytest.mark.parametrize("low", [0.0, -0.1])
def test_no_positive_clearance_looks_like_contact(thresholds, low):
    thresholds = Thresholds(*thresholds, 0.0)
    scale = plots.scale_of(
        LOG, thresholds, np.array([0.02, low, np.nan]), np.array([0.02, 0.02, 0.0])
    )
    (bottom, top), bend = (np.array(scale["range"]), scale["asinh"])
    span = np.arcsinh(top / bend) - np.arcsinh(bottom / bend)
    pixels = np.arcsinh(0.02 / bend) / span * (plots.HEIGHT - plots.BELOW - plots.PADDING[0])
    assert pixels > 5.0
    assert np.arcsinh(0.02 / bend) > 0.8


def test_pairs_with_the_same_limits_share_one_curve(shown):
    frames = [made.frame(0.0, [0.3, 0.01]), made.frame(0.1, [0.005, 0.01])]
    title, data = shown.show(*frames, scene=ALIKE)
    assert title == (
        "smallest clearance of all pairs: lower and upper bound [mm] over time [s];"
        " warn dashed, stop dotted"
    )
    assert data[1].tolist() == [10.0, 5.0]
    assert (data[4][0], data[5][0]) == (100.0, 20.0)


def test_what_belongs_to_another_scene_goes(shown):
    shown.show(made.frame(1.0, [0.3, 0.01]), made.frame(1.1, [0.3, 0.01]))
    gone = []
    shown.gui.plots[-1].remove = lambda: gone.append(True)
    assert shown.show(made.frame(0.0, [0.3, 0.01]))[0] == ""
    assert gone


@pytest.mark.parametrize("high", [0.06, 0.5, 3.0, 40.0, 700.0, 2e4])
@pytest.mark.parametrize("low", [0.0, -0.02, -3.0])
@pytest.mark.parametrize(("warn", "stop"), [(0.03, 0.005), (100.0, 20.0), (5.0, 0.0), (2.0, 1.9)])
def test_the_logarithmic_scale_has_numbers_that_do_not_overlap(warn, stop, low, high):
    thresholds = Thresholds(warn, stop, 0.0)
    scale = plots.scale_of(LOG, thresholds, np.array([low, high]), np.array([low, high]))
    at = np.array(plots.ticks(scale, thresholds))
    (bottom, top), bend = scale["range"], scale["asinh"]
    pixels = np.arcsinh(at / bend) - np.arcsinh(bottom / bend)
    pixels *= (plots.HEIGHT - plots.BELOW - plots.PADDING[0]) / (
        np.arcsinh(top / bend) - np.arcsinh(bottom / bend)
    )
    assert len(at) >= 3
    assert np.diff(pixels).min() >= plots.LABEL - 1e-9
    assert bottom <= at[0] and at[-1] <= top
    assert stop in at
    assert np.abs(pixels - np.interp(warn, at, pixels)).min() < plots.LABEL
    assert all(float(f"{x:g}") == x for x in at)


def test_the_numbers_beside_the_plot_are_told_for_the_logarithmic_scale_alone(shown):
    shown.choice.pair = FAR
    shown.show(made.frame(0.0, [0.3, 0.01]), made.frame(0.1, [0.3, 0.01]))
    beside = shown.gui.plots[-1].axes[1]
    assert {"0", "1", "2", "10"} <= set(beside["values"])
    assert len(beside["values"]) == len(beside["splits"]) == len(beside["filter"])
    shown.gui.scale.value = THRESHOLDS
    shown.show()
    assert "splits" not in shown.gui.plots[-1].axes[1]


@pytest.mark.parametrize("kind", [LOG, THRESHOLDS])
def test_a_search_that_was_cut_does_not_stretch_the_scale(kind):
    thresholds = Thresholds(5.0, 1.5, 0.0)
    lower, upper = np.array([20.0, -400.0, -np.inf, np.nan]), np.array([20.0, 3.0, 30.0, np.nan])
    assert plots.scale_of(kind, thresholds, lower, upper)["range"][0] == -5.0


def test_a_certain_overlap_is_shown_however_deep():
    thresholds = Thresholds(5.0, 1.5, 0.0)
    deep = np.array([20.0, -80.0])
    assert plots.scale_of(LOG, thresholds, deep, deep)["range"] == (-100.0, 20.0)


def at_gaps(stamps, known, period_s=0.1):
    places, rows, cover = plots.covered(np.array(stamps), np.array(known, bool), period_s)
    assert (np.diff(places) >= 0).all()
    return list(zip(places.tolist(), rows.tolist(), cover.tolist(), strict=True))


def test_what_nobody_knows_is_covered():
    assert at_gaps([0.0, 0.1, 0.2], [1, 1, 1]) == [(0, 0, 0.0), (1, 1, 0.0), (2, 2, 0.0)]
    assert at_gaps([0.0, 0.1, 0.2, 0.3], [1, 0, 0, 1]) == [
        (0, 0, 0.0), (0, 0, 1.0), (3, 3, 1.0), (3, 3, 0.0)
    ]  # fmt: skip
    assert at_gaps([0.0, 0.1, 0.2], [0, 1, 0]) == [
        (0, 1, 1.0), (1, 1, 1.0), (1, 1, 0.0), (1, 1, 1.0), (2, 1, 1.0)
    ]  # fmt: skip
    assert at_gaps([0.0, 0.1, 0.2], [0, 0, 0]) == [(0, 0, 1.0), (2, 2, 1.0)]


def test_what_is_stale_is_not_known(shown):
    stale = levels(made.frame(0.1, [0.3, 0.01]), 0, STALE)
    _, data = shown.show(made.frame(0.0, [0.3, 0.01]), stale, made.frame(0.2, [0.3, 0.01]))
    assert data[3].max() == 1.0, "it may be the smallest"
    shown.choice.ignored = frozenset({FAR})
    assert shown.show()[1][1].tolist() == [300.0, 300.0, 300.0]
    shown.choice.pair = FAR
    title, data = shown.show()
    assert "grey: not known" in title
    assert data[3].max() == 1.0


def test_times_without_ticks_are_covered_but_not_a_slow_monitor():
    stopped = [0.0, 0.1, 0.2, 15.2, 15.3]
    assert at_gaps(stopped, [1] * 5)[2:6] == [(2, 2, 0.0), (2, 2, 1.0), (3, 3, 1.0), (3, 3, 0.0)]
    for slow, period_s in (([0.0, 2.0, 4.0], 0.1), ([0.0, 0.1, 2.0], 1.0)):
        assert not any(cover for _, _, cover in at_gaps(slow, [1, 1, 1], period_s))


def test_the_plot_says_what_its_grey_is(shown):
    shown.choice.pair = FAR
    frames = [made.frame(0.1 * i, [0.3, 0.01 if i != 3 else np.nan]) for i in range(6)]
    title, data = shown.show(*frames)
    assert title.endswith("; grey: not known")
    assert data[0].tolist() == [0.0, 0.1, 0.2, 0.2, 0.4, 0.4, 0.5]
    assert data[3].tolist() == [0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    assert np.isfinite(np.array(data)).all()


@pytest.mark.long
def test_a_browser_draws_no_line_through_a_gap_and_all_numbers(browser, server, eventually):
    session, choice = Session(), Choice(pair=FAR)
    plot = Plot(server.gui, session, choice)
    for stamp in (*np.arange(0.0, 10.0, 0.1), *np.arange(20.0, 30.0, 0.1)):
        session.add(made.frame(stamp, [0.3, 0.01], [0.3, 0.02]))
    plot.show(UNLIKE, 0.0)
    page = browser.new_page()
    page.goto(f"http://127.0.0.1:{server.get_port()}", timeout=1e3 * START_DEADLINE_S)
    page.wait_for_function(WIDE_ENOUGH, timeout=1e3 * START_DEADLINE_S)

    def drawn():
        blue, numbers = page.evaluate(SEEN)
        third = np.array_split(np.array(blue), 3)
        assert [part[4:-4].mean() for part in third] == [1.0, 0.0, 1.0]
        assert {"1", "2", "0"} <= set(numbers)

    eventually(drawn)
    page.close()
