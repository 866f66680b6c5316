"""What an engineer inspects on the page: the bundled peg in its bore, in a real browser."""

from __future__ import annotations

import re
import signal
from functools import partial

import numpy as np
import peg_hand as peg
import pytest
from deadlines import POSE_TIMEOUT_S, START_DEADLINE_S
from page_hand import (
    CAMERA,
    CANVAS,
    DRAWN,
    FIRST_IS_SEEN,
    LENGTH,
    ON_SCREEN,
    OPACITY,
    TEXTS,
    address_of,
    button,
    enter,
    field,
    lines_of,
    opened,
    row,
    saved,
    select,
    tab,
    word,
)

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")
pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def bench(browser, domain, launch_for_all, wait):
    """The page of the bundled peg, which its player hardly moves."""
    from proximity_monitor.scene import bundled

    settings = {"scene": bundled("peg"), "environment": {"ROS_DOMAIN_ID": domain}}
    monitor = launch_for_all("node", pose_timeout_s=POSE_TIMEOUT_S, **settings)
    player = launch_for_all("player", speed=1e-9, **settings)
    display = launch_for_all("display", port=0, environment=settings["environment"])

    page = opened(browser, address_of(display, wait))
    page.wait_for_selector("#pm-pairs .pm-row", timeout=1e3 * START_DEADLINE_S)
    yield page
    for process in (display, player, monitor):
        process.stop(signal.SIGKILL)


@pytest.fixture
def page(bench):
    """The page, live and with the camera as at the start."""
    bench.mouse.up()
    bench.keyboard.press("Escape")
    bench.evaluate("() => window.__viserMutable.resetCameraPose(false)")
    bench.evaluate(DRAWN)
    if bench.get_attribute("#pm-connection", "data-state") == "past":
        tab(bench, "Session")
        button(bench, "Back to live").click()
    yield bench
    assert bench.errors == []


@pytest.fixture
def put(page, wait):
    """A function that puts the peg at a place in mm."""
    return partial(peg.put_there, page, wait)


@pytest.mark.parametrize("axis", [0, 1, 2], ids="xyz")
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_the_peg_s_handles_are_gripped_where_the_peg_covers_them(page, put, wait, axis, share):
    put(0, 0, -10)
    camera = page.evaluate(CAMERA)
    handle = np.zeros(3)
    handle[axis] = share * page.evaluate(LENGTH)
    page.evaluate(DRAWN)
    x, y = page.evaluate(ON_SCREEN, ["/gizmo", handle.tolist()])
    to_x, to_y = page.evaluate(ON_SCREEN, ["/gizmo", (1.3 * handle).tolist()])
    page.mouse.move(x, y)
    page.evaluate(DRAWN)
    page.mouse.down()
    page.mouse.move(to_x, to_y, steps=4)
    page.mouse.up()
    # Another handle may cover this one on the screen and be gripped instead, but the peg may not.
    wait(
        lambda: (
            peg.held(page) != pytest.approx((0, 0, -10), abs=1e-3) or peg.turned(page) != [0, 0, 0]
        ),
        "the peg to move",
    )
    np.testing.assert_allclose(page.evaluate(CAMERA), camera, atol=1e-9)


def test_a_part_is_chosen_by_a_click_through_what_is_transparent(page, put, wait):
    put(0, 0, -10)
    field(page, "Part").click()
    page.get_by_role("option", name="(none)").click()
    note = page.locator("#pm-held")
    wait(lambda: "Click a part" in note.inner_text(), "nothing to be chosen")
    page.mouse.click(*page.evaluate(ON_SCREEN, ["/parts/0", [0, 0, 0.02]]))
    wait(lambda: "held here" in note.inner_text(), "the peg to be chosen")


def test_a_gap_of_0_02_mm_fills_the_picture_and_is_named(page, put, wait, eventually):
    put(0.03, 0, -10)
    tab(page, "Clearances")
    wait(lambda: row(page, peg.PAIR)[1] == pytest.approx(0.02e-3, abs=1e-8), "the clearance")
    first, second = peg.gap_on_screen(page)
    assert np.linalg.norm(second - first) < 2.0
    button(page, "Zoom to the gap").click()

    def filled():
        first, second = peg.gap_on_screen(page)
        canvas = page.evaluate(CANVAS)
        assert np.linalg.norm(second - first) > 0.3 * min(canvas["width"], canvas["height"])
        for x, y in (first, second):
            assert canvas["left"] < x < canvas["right"] and canvas["top"] < y < canvas["bottom"]
        label = next(text for text in page.evaluate(TEXTS, "/distances") if "mm" in text)
        assert label == "▲ 0.020 mm\npeg - block"

    eventually(filled)
    button(page, "Whole scene").click()
    wait(lambda: np.ptp(peg.gap_on_screen(page), axis=0).max() < 2.0, "the whole scene")


def test_a_section_is_one_click(page, put, wait, eventually):
    put(0.03, 0, -10)
    tab(page, "Clearances")
    button(page, "Section through it").click()

    def cut():
        assert page.evaluate(peg.IS_SHOWN, "/parts/1/cut")
        assert page.evaluate(peg.IS_SHOWN, "/parts/1/hatching")
        assert not page.evaluate(peg.IS_SHOWN, "/parts/1/mesh")
        assert "A section is on" in page.inner_text("#pm-section")
        assert page.evaluate(FIRST_IS_SEEN)
        # The plane goes through both closest points, so they lie in the plane of the outline.
        ends = np.array(page.evaluate(peg.CORNERS, "/distances/points")).reshape(-1, 2, 3)[:, 0]
        lines = np.array(page.evaluate(peg.CORNERS, "/parts/1/outline")).reshape(-1, 3)
        *_, normal = np.linalg.svd(lines - lines.mean(axis=0))[2]
        np.testing.assert_allclose((ends - lines.mean(axis=0)) @ normal, 0.0, atol=1e-5)

    eventually(cut)
    put(20, 0, 40)
    wait(lambda: not page.evaluate(peg.IS_SHOWN, "/parts/0/cut"), "the peg to leave the plane")
    tab(page, "Clearances")
    button(page, "Whole scene").click()
    wait(lambda: page.evaluate(peg.IS_SHOWN, "/parts/1/mesh"), "the whole block")
    assert not page.evaluate(peg.IS_SHOWN, "/parts/1/cut")
    assert not page.locator("#pm-section").count()


def test_each_part_is_as_transparent_as_one_likes(page, wait):
    tab(page, "Clearances")
    page.get_by_text("Picture", exact=True).click()
    select(page, field(page, "Look of"), "peg")
    enter(page, "Opacity", "0.5", 1)
    wait(lambda: page.evaluate(OPACITY, 0) == pytest.approx(0.5), "the peg to be transparent")
    assert page.evaluate(OPACITY, 1) == pytest.approx(0.4)
    assert page.evaluate(peg.IS_SHOWN, "/parts/0/edges")
    page.locator("input[type=checkbox]:visible").nth(1).click()
    wait(lambda: not page.evaluate(peg.IS_SHOWN, "/parts/0/edges"), "its edges to go")
    assert page.evaluate(peg.IS_SHOWN, "/parts/1/edges")
    # The peg's edges are off, so the box for all parts is off. Settings not changed here stay.
    select(page, field(page, "Look of"), "(all parts)")
    wait(lambda: not page.locator("input[type=checkbox]:visible").nth(1).is_checked(), "the edges")
    bands = page.locator("input[type=checkbox]:visible").nth(2)
    bands.click()
    wait(lambda: page.locator("#pm-bands").count(), "the bands")
    bands.click()
    wait(lambda: page.evaluate(peg.IS_SHOWN, "/parts/1/edges"), "the block's edges as before")
    assert page.evaluate(OPACITY, 0) == pytest.approx(0.5)
    select(page, field(page, "Look of"), "peg")
    enter(page, "Opacity", "1", 1)
    page.locator("input[type=checkbox]:visible").nth(1).click()
    page.get_by_text("Picture", exact=True).click()
    wait(lambda: page.evaluate(OPACITY, 0) is None, "the peg to be opaque")


def test_the_bore_is_coloured_by_the_peg_s_clearance(page, put, wait):
    put(0.046, 0, -10)  # 0.004 mm from one side of the bore: below stop
    tab(page, "Clearances")
    page.get_by_text("Picture", exact=True).click()
    select(page, field(page, "Look of"), "block")
    bands = page.locator("input[type=checkbox]:visible").nth(2)
    assert not page.evaluate(peg.BAND, "/parts/1/coat_2")
    bands.click()
    wait(lambda: page.evaluate(peg.BAND, "/parts/1/coat_0"), "what is below stop")
    wait(lambda: page.evaluate(peg.BAND, "/parts/1/coat_2"), "what is above warn")
    wait(lambda: not page.evaluate(peg.IS_SHOWN, "/parts/1/mesh"), "the plain block to go")
    assert "below stop" in page.locator("#pm-bands").inner_text()
    button(page, "Section through it").click()
    wait(lambda: page.evaluate(peg.BAND, "/parts/1/cut_0"), "what is below stop behind the plane")
    wait(lambda: not page.evaluate(peg.IS_SHOWN, "/parts/1/coat_0"), "what is before it to go")
    assert page.evaluate(peg.IS_SHOWN, "/parts/1/outline")
    assert not page.evaluate(peg.IS_SHOWN, "/parts/1/cut")
    button(page, "Whole scene").click()
    wait(lambda: page.evaluate(peg.IS_SHOWN, "/parts/1/coat_0"), "the whole block")
    assert not page.evaluate(peg.BAND, "/parts/1/cut_0")
    put(20, 0, 40)
    wait(lambda: not page.evaluate(peg.BAND, "/parts/1/coat_0"), "nothing below stop")
    tab(page, "Clearances")
    bands.click()
    wait(lambda: page.evaluate(peg.IS_SHOWN, "/parts/1/mesh"), "the plain block")
    assert not page.evaluate(peg.BAND, "/parts/1/coat_2")
    page.get_by_text("Picture", exact=True).click()


@pytest.mark.parametrize("scale", ["Log", "Thresholds"])
def test_the_plot_tells_fits_apart_after_a_long_way_and_shows_the_thresholds(
    page, put, eventually, scale
):
    for z in (40, -10):
        put(0, 0, z)
    select(page, field(page, "Scale"), scale)
    assert field(page, "Scale").input_value() == scale

    def told_apart():
        for threshold in (0.03, 0.005):
            apart, there, height = page.evaluate(peg.IN_PLOT, [0.05, 0.02, threshold])
            assert apart > 0.03 * height
            assert 0.0 < there < height

    eventually(told_apart)


def test_the_plot_covers_nothing_of_a_small_window(page):
    tab(page, "Clearances")
    for shown in ("#pm-pairs .pm-sign", "#pm-pairs .pm-press", "#pm-banner", "canvas[data-engine]"):
        assert page.locator(shown).first.evaluate(peg.UNCOVERED), shown


def test_enter_puts_the_part_there_steps_go_down_to_a_micrometre_and_ctrl_z_undoes(put, page, wait):
    tab(page, "Move")
    enter(page, "Step [mm]", "0.001")
    put(0, 0, 40)  # once the peg is there, the typed step is known too
    enter(page, "Position [mm]", "20.5", 0)
    page.keyboard.press("Enter")
    wait(lambda: peg.at_place(page, (20.5, 0, 40)), "Enter to put it there")
    page.get_by_role("button", name="-Y", exact=True).click()
    wait(lambda: peg.at_place(page, (20.5, -0.001, 40)), "a step of a micrometre")
    page.get_by_role("button", name="+RZ", exact=True).click()
    wait(lambda: peg.turned(page) == [0, 0, 1], "a turn by a degree")
    for there in ((20.5, -0.001, 40), (20.5, 0, 40), (0, 0, 40)):
        page.keyboard.press("Control+z")
        wait(
            lambda there=there: peg.at_place(page, there) and peg.turned(page) == [0, 0, 0],
            f"{there}",
        )


def test_a_geared_drag_moves_the_part_by_a_hundredth_and_snaps(put, page, wait):
    put(0, 0, 40)
    page.evaluate(DRAWN)
    apart, begin = peg.apart(page), peg.place(page)

    def gone():
        return np.linalg.norm(peg.place(page) - begin)

    peg.dragged(page, 0, 60)
    wait(lambda: gone() > 1e-6, "the drag")  # otherwise it could end before it begins
    peg.end_drag(page, wait, apart)
    far = gone()
    put(0, 0, 40)
    wait(lambda: gone() < 1e-6 < far, "the peg to be back")
    peg.pick(page, "Drag", "1 : 100")
    peg.dragged(page, 0, 60)
    wait(lambda: gone() == pytest.approx(far / 100.0, rel=0.2), "a hundredth of it")
    page.mouse.up()
    page.get_by_text("Snap drags to the steps").click()
    enter(page, "Step [mm]", "0.05")
    put(0, 0, 40)
    peg.dragged(page, 0, 60)
    wait(lambda: peg.held(page)[0] > 0.0, "a drag")
    page.mouse.up()
    steps = peg.held(page)[0] / 0.05
    assert steps == pytest.approx(round(steps), abs=1e-6)
    page.get_by_text("Snap drags to the steps").click()
    peg.pick(page, "Drag", "1 : 1")


def test_a_drag_stops_before_the_clearance_is_below_stop(put, page, wait, eventually):
    put(0, 0, -10)
    peg.pick(page, "Drags stop", "at stop")
    peg.dragged(page, 0, 60)  # some millimetres into the wall, which is 0.05 mm away

    def stopped():
        assert page.locator("#pm-near").inner_text().split()[-2:] == ["0.005", "mm"]
        assert peg.held(page)[0] == pytest.approx(0.045, abs=0.0011)

    eventually(stopped)
    page.mouse.up()
    tab(page, "Clearances")
    assert row(page, peg.PAIR)[0] >= 0.005e-3
    tab(page, "Move")
    peg.pick(page, "Drags stop", "nowhere")


def test_an_event_is_listed_and_a_press_goes_to_its_moment(put, page, wait, eventually):
    put(0, 0, -10)
    latest = page.locator("#pm-events .pm-row").first
    wait(lambda: word(page) == "clear", "a clear scene")
    put(0.046, 0, -10)
    tab(page, "Session")

    def told():
        _, change, pair, clearance = latest.inner_text().split("\t")
        assert change.endswith("→ ■ STOP")
        assert (pair, clearance) == (peg.PAIR, "0.004 mm")

    eventually(told)
    put(0, 0, 40)
    peg.look_back_at_stop(page, wait)

    def there():
        assert page.get_attribute("#pm-connection", "data-state") == "past"
        assert row(page, peg.PAIR)[1] == pytest.approx(0.004e-3, abs=1e-7)
        x, _, z = page.evaluate(peg.POSITION, "/parts/0")
        assert (x, z) == pytest.approx((0.046e-2, -0.1), abs=1e-6)

    eventually(there)
    told = page.locator("#pm-event")
    wait(lambda: "STOP, 0.004 mm" in told.inner_text(), "its bounds")
    pixels = peg.picture_of_event(page, wait)
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50
    lines = lines_of(saved(page, "Events as CSV"))
    assert {(line["a"], line["b"]) for line in lines} == {("peg", "block")}
    # If the machine stands still for long, poses become stale in between.
    after = [line["after"] for line in lines]
    assert [line["before"] for line in lines][1:] == after[:-1]
    assert "stop" in after
    assert after[-1] == "clear"
    peg.back_to_live(page, wait)


def test_an_event_s_picture_shows_whole_parts_also_while_a_section_is_on(page, put, wait):
    tab(page, "Session")
    told, pictures = page.locator("#pm-event"), []
    before = told.inner_text() if told.count() else ""  # perhaps of another event
    for cut in (False, True):
        last = peg.newest_stop(page)
        put(0, 0, -10)
        wait(lambda: word(page) == "clear", "a clear scene")
        put(0.046, 0, -10)
        wait(lambda: "STOP" in word(page), "the peg to be too near")
        if cut:
            tab(page, "Clearances")
            button(page, "Section through it").click()
            wait(lambda: page.evaluate(peg.IS_SHOWN, "/parts/1/cut"), "the section")
        peg.look_back_at_stop(page, wait, last)
        wait(lambda before=before: told.inner_text() not in ("", before), "the event")
        pictures.append(peg.picture_of_event(page, wait).astype(int))
        before = told.inner_text()
        peg.back_to_live(page, wait)
    assert (np.abs(np.subtract(*pictures)).max(axis=2) > 60).mean() < 0.005
    wait(lambda: page.evaluate(peg.IS_SHOWN, "/parts/1/cut"), "the section to be back")
    button(page, "Whole scene").click()
    wait(lambda: not page.evaluate(peg.IS_SHOWN, "/parts/1/cut"), "the whole block")


def test_the_motion_is_sought_played_and_paused_from_the_page(page, wait):
    peg.let_go(page)
    tab(page, "Session")
    note = page.locator("#pm-motion")
    wait(lambda: re.fullmatch(r"At 0.00 of .*, speed 1e-09.", note.inner_text()), "the motion")
    before = peg.held(page)
    enter(page, "Moment [s]", "2", 1)
    wait(lambda: note.inner_text().startswith("At 2.00 of"), "the player to go there")
    wait(lambda: peg.held(page) != pytest.approx(before, abs=1e-3), "the peg to be elsewhere")
    button(page, "Pause").click()
    wait(lambda: note.inner_text().endswith("paused."), "the player to pause")
    page.get_by_role("button", name="Play", exact=True).click()
    wait(lambda: note.inner_text().endswith("speed 1e-09."), "the player to go on")
    enter(page, "Speed", "0.5")
    wait(lambda: note.inner_text().endswith("speed 0.5."), "the player to be faster")
    there = peg.held(page)
    wait(lambda: peg.held(page) != pytest.approx(there, abs=1e-3), "the peg to move")
    button(page, "Pause").click()
    wait(lambda: note.inner_text().endswith("paused."), "the player to pause")


def test_the_smallest_clearances_begin_anew(put, page, wait):
    put(0.03, 0, -10)
    tab(page, "Session")
    worst = page.locator("#pm-worst")
    wait(lambda: not worst.count() or "41." not in worst.inner_text(), "a small one")
    put(0, 0, -10)
    tab(page, "Session")
    button(page, "Reset the smallest clearances").click()
    wait(lambda: "0.050 mm" in worst.inner_text(), "the present one")
    wait(lambda: page.inner_text("#pm-reset") == "the monitor reset the minima of 1 pair", "it")
