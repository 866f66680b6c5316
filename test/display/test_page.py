"""The page as a designer uses it: a browser, a display and a monitor that really run."""

from __future__ import annotations

import re

import numpy as np
import pytest
from page_hand import (
    CAMERA,
    CHOSEN,
    FIRST_IS_SEEN,
    HIDDEN,
    OPACITY,
    REACH,
    SAVE_MS,
    TEXTS,
    ball_is_blue,
    button,
    choose,
    decoded,
    drag,
    enter,
    field,
    lines_of,
    listed,
    press,
    row,
    saved,
    tab,
    word,
)
from pose_sources import at

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.display.labels import GLYPHS


def test_the_page_shows_the_parts(page, eventually):
    def shown():
        pixels = decoded(page.locator("canvas").first.screenshot())
        assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200
        assert ball_is_blue(page, pixels)
        assert {"table", "ball", "die", "cursor"} <= set(page.evaluate(TEXTS, "/distances"))

    eventually(shown)


def test_the_list_begins_where_the_smallest_window_shows_it(page, wait):
    tab(page, "Clearances")
    wait(lambda: page.evaluate(FIRST_IS_SEEN), "the first row to be seen")


def test_a_part_of_a_kind_from_another_package_is_shown_and_its_features_told(
    page, world, sources, wait, eventually
):
    from diagnostic_msgs.msg import DiagnosticArray

    assert world[1]["ball"].kind == "ball"
    told = {}

    def take(message):
        told.update((s.name, {v.key: v.value for v in s.values}) for s in message.status)

    listening = sources.node.create_subscription(
        DiagnosticArray, "proximity_monitor/closest_points", take, 1
    )
    sources.move("ball", (-0.2, 0.0, 0.105))
    wait(lambda: told.get("table - ball", {}).get("feature_b") == "ball 0", "the ball's feature")
    sources.node.destroy_subscription(listening)

    def shown():
        assert row(page, "table - ball")[0] == pytest.approx(0.005, abs=1e-9)
        assert page.evaluate(REACH, 1) == pytest.approx(0.1, rel=1e-6)

    eventually(shown)


def test_the_list_says_what_the_library_says_the_least_margin_first(page, of_engine, eventually):
    warn = {"ball - die": 0.05, "table - ball": 0.1, "table - die": 0.1}

    def told():
        found = listed(page)
        lower = [bounds[0] for bounds in found.values()]
        margins = [bounds[0] - warn.get(pair, 0.002) for pair, bounds in found.items()]
        # The pair table - cursor is exactly at its range, so it may be listed or not.
        assert {"die - cursor", "table - ball", "table - die", "ball - die"} <= set(found)
        assert margins == sorted(margins)
        assert lower == pytest.approx([of_engine(pair).lower for pair in found], abs=1e-9)
        assert "125.000 mm" in found["die - cursor"][2]
        assert "Δ 0.000, -125.000, 0.000" in found["die - cursor"][2]
        assert any("● 125.000 mm" in text for text in page.evaluate(TEXTS, "/distances"))
        banner = " ".join(page.inner_text("#pm-banner").split())
        assert "all 6 pairs; nearest" in banner
        assert banner.endswith("die - cursor: 125.000 mm")

    eventually(told)


def test_dragging_the_gizmo_moves_the_body_and_the_numbers_follow(
    taken, sources, of_engine, eventually
):
    page = taken
    drag(page, (-0.1, 0.0, 0.0))
    tab(page, "Clearances")

    def followed():
        die = sources.heard("die")
        assert die is not None
        assert die[0] == pytest.approx((0.1, 0.0, 0.3), abs=0.01)
        assert die[0][1:] == pytest.approx((0.0, 0.3), abs=1e-6)
        found = listed(page)
        for pair in ("ball - die", "die - cursor", "table - die"):
            assert found[pair][0] == pytest.approx(of_engine(pair, die=die).lower, abs=1e-9)
        near = of_engine("ball - die", die=die)
        text = f"{1e3 * near.upper:.3f} mm"
        assert text in found["ball - die"][2]
        assert any(text in label for label in page.evaluate(TEXTS, "/distances"))
        x, y, z = 1e3 * (near.point_b - near.point_a)
        delta = f"Δ {x:.3f}, {y:.3f}, {z:.3f}".replace("-0.000", "0.000")
        assert delta in found["ball - die"][2].replace("-0.000", "0.000")

    eventually(followed)


def test_pairs_of_the_chosen_part_have_labels_whatever_is_nearer(page, wait):
    def named():
        return any("225.000 mm\nball - die" in text for text in page.evaluate(TEXTS, "/distances"))

    choose(page, "ball")
    wait(named, "its label")
    field(page, "Part").click()
    page.get_by_role("option", name="(none)").click()
    wait(lambda: not named(), "the label to go: three pairs are nearer")


def test_no_label_waits_for_a_character_to_be_drawn(page, wait):
    """A browser draws a character that is new to it in a later frame than the list's number."""
    wanted = {each for each in GLYPHS if each != " "}
    wait(lambda: wanted <= set(page.evaluate("() => [...window.glyphs]")), "all characters")


def test_pairs_are_highlighted_and_seen_by_keys_alone(page, wait):
    def chosen():
        return page.eval_on_selector_all(CHOSEN, "all => all.map(row => row.dataset.pair)")

    def press_key(key, pairs):
        page.keyboard.press(key)
        wait(lambda: chosen() == pairs, f"{pairs} after {key}")

    first, second, *_ = listed(page)
    page.evaluate("() => document.activeElement.blur()")  # not in the field for the search
    for key, pair in (("n", first), ("n", second), ("p", first)):
        press_key(key, [pair])
    page.keyboard.press("x")
    page.wait_for_selector("#pm-section")
    page.keyboard.press("h")
    wait(lambda: not page.locator("#pm-section").count(), "the whole scene")
    press_key("0", [])
    for gear in ("1 : 10", "1 : 100", "1 : 1000", "1 : 1"):
        page.keyboard.press("f")
        wait(lambda gear=gear: field(page, "Drag").input_value() == gear, "finer drags")


def test_dragging_into_the_stop_zone_raises_the_alert(taken, eventually, wait):
    page = taken
    drag(page, (0.0, 0.0, -0.215))
    tab(page, "Clearances")

    def alerted():
        assert word(page) == "STOP"
        banner = page.inner_text("#pm-banner")
        assert "■ STOP" in banner
        assert "table - die" in banner
        assert "stop at 20.000 mm" in banner
        assert "■ STOP" in row(page, "table - die")[2]
        assert any(text.startswith("■ ") for text in page.evaluate(TEXTS, "/distances"))

    eventually(alerted)
    tab(page, "Move")
    button(page, "Undo").click()
    wait(lambda: word(page) == "clear", "the alert to end")


def test_a_typed_pose_is_taken_and_undone_and_reset(put, taken, sources, wait):
    put("x", 150.5)
    put("x", 160)
    taken.keyboard.press("Escape")
    button(taken, "Undo").click()
    wait(lambda: at(sources, "x") == 0.1505, "the pose before")
    button(taken, "Back to where it was").click()
    wait(lambda: at(sources, "x") == 0.2, "the pose at first")


def test_the_buttons_stay_in_place_while_a_pose_is_typed_and_taken(put, taken, sources, wait):
    def place():
        return button(taken, "Undo").bounding_box()

    put("x", 150)
    at_first = place()
    enter(taken, "Position [mm]", "160")
    now = taken.locator("#pm-now")
    wait(now.inner_text, "the pose, since the fields show another one")
    assert place() == at_first
    button(taken, "Put it there").click()
    wait(lambda: not now.inner_text(), "the pose to be in the fields")
    assert place() == at_first
    put("z", 900)
    wait(lambda: "cursor" not in taken.inner_text("#pm-near"), "the cursor to be out of range")
    assert place() == at_first


def test_a_source_that_falls_silent_is_shown(page, sources, wait, eventually):
    sources.release("ball")

    def told():
        assert page.get_attribute("#pm-connection", "data-state") == "stale"
        silent = r"no recent pose: ball \(\d+\.\d s\)"
        assert re.search(silent, page.inner_text("#pm-connection"))
        text = row(page, "table - ball")[2]
        assert "? stale" in text
        assert "no recent pose of ball" in text

    eventually(told)
    sources.restore()
    wait(lambda: page.get_attribute("#pm-connection", "data-state") == "live", "life")


def test_a_pressed_pair_is_highlighted_and_the_rest_is_dim(page, wait, eventually):
    def far():
        """Return how far the camera is from the gap between table and die."""
        return np.linalg.norm(np.array(page.evaluate(CAMERA)) - (0.2, 0.0, 0.11))

    before = far()
    press(page, '[data-pair="table - die"]')
    page.wait_for_selector(f'{CHOSEN}[data-pair="table - die"]')

    def shown():
        assert (page.evaluate(OPACITY, 1) or 1.0) < 0.2
        assert page.evaluate(OPACITY, 2) is None
        assert far() < 0.9 * before

    eventually(shown)
    page.wait_for_selector("text=table - die: lower and upper bound [mm]")
    press(page, '[data-pair="table - die"]')
    wait(lambda: page.evaluate(OPACITY, 1) is None, "the ball to come back")


def test_the_list_is_searched_and_pairs_are_ignored_and_watched_again(page, wait):
    enter(page, "Search", "die ta")
    wait(lambda: list(listed(page)) == ["table - die"], "the one pair")
    enter(page, "Search", "")
    press(page, '[data-word="ignore:table - die"]')
    wait(lambda: "ball - die" in listed(page) and "table - die" not in listed(page), "it to go")
    press(page, HIDDEN)
    wait(lambda: "table - die" in listed(page), "the pair to come back")


@pytest.mark.parametrize(
    "i, name, factor", [(0, "thresholds.warn", 1e-3), (3, "budget_ms", 1.0)], ids=["warn", "budget"]
)
def test_settings_are_the_monitor_s_parameters(page, sources, wait, eventually, i, name, factor):
    tab(page, "Settings")
    page.wait_for_selector("#pm-cost >> text=of the budget")
    slider = page.get_by_role("slider").and_(page.locator(":visible")).nth(i)

    def shown():
        return float(slider.get_attribute("aria-valuenow"))

    before = wait(shown, "the value in force")

    def in_force(sense):
        now = sources.parameter(name) / factor
        assert shown() == pytest.approx(now)
        assert np.sign(round(now - before, 6)) == sense

    slider.press("ArrowRight")
    eventually(lambda: in_force(1))
    slider.press("ArrowLeft")
    eventually(lambda: in_force(0))


def test_the_session_s_worst_pose_comes_back(put, taken, sources, of_engine, wait, eventually):
    page = taken
    put("z", 77)  # nearer than in any other test
    tab(page, "Clearances")
    wait(lambda: row(page, "table - die")[0] == pytest.approx(0.002), "the new clearance")
    tab(page, "Move")
    button(page, "Undo").click()
    wait(lambda: at(sources, "z") == 0.3, "the start")
    tab(page, "Clearances")
    press(page, '[data-pair="table - die"]')
    page.wait_for_selector(f'{CHOSEN}[data-pair="table - die"]')
    tab(page, "Session")
    worst = r"2\.000 mm.*, table - die"
    wait(lambda: re.search(worst, page.inner_text("#pm-worst")), "the session's worst")
    button(page, "Return to that pose").click()
    wait(lambda: at(sources, "z") == 0.077, "the worst pose")
    assert of_engine("table - die", die=sources.heard("die")).upper == pytest.approx(0.002)


# The place of a button while an element has another text; in one call, since the page renews it.
BELOW_TEXT = """([id, text, label]) => {
  const told = document.getElementById(id), before = told.innerHTML;
  told.innerText = text;
  const below = [...document.querySelectorAll('button, label')]
    .find(each => each.innerText.startsWith(label)).getBoundingClientRect().y;
  told.innerHTML = before;
  return below;
}"""


@pytest.mark.parametrize(
    ("where", "text", "below"),
    [("Session", "pm-worst", "Return to that pose"), ("Clearances", "pm-plot", "Scale")],
)
def test_what_is_below_a_text_stays_in_place_when_it_becomes_longer(page, where, text, below):
    tab(page, where)
    page.wait_for_selector(f"#{text}")
    one, two = (page.evaluate(BELOW_TEXT, [text, n * "word ", below]) for n in (1, 16))
    assert one == two > 0.0


# The replay's controls whose middle is covered by the report.
COVERED = """() => [...document.querySelectorAll('button, input, svg')].filter(each => {
  if (each.closest('#pm-report')) return false;
  const r = each.getBoundingClientRect();
  const top = document.elementFromPoint((r.left + r.right) / 2, (r.top + r.bottom) / 2);
  return top && top.closest('#pm-report');
}).map(each => each.outerHTML)"""


def test_the_pairs_are_saved(page, eventually):
    def saved_right():
        file = saved(page, "Pairs as CSV")
        assert file.suggested_filename == "cell.csv"
        table = {(line["a"], line["b"]): line for line in lines_of(file)}
        pair = table["die", "cursor"]
        assert float(pair["lower [mm]"]) == pytest.approx(125.0, abs=1e-6)
        assert float(pair["delta_y [mm]"]) == pytest.approx(-125.0, abs=1e-6)
        assert float(pair["warn [mm]"]) == 2.0
        assert (pair["state"], pair["status"]) == ("clear", "exact")

    eventually(saved_right)


def test_the_session_is_saved(put, page, eventually):
    put("z", 150)

    def saved_right():
        lines = lines_of(saved(page, "Session as CSV"))
        stamps = [float(line["stamp [s]"]) for line in lines]
        assert stamps == sorted(stamps)
        assert len(set(stamps)) > 10
        *_, last = (line for line in lines if (line["a"], line["b"]) == ("table", "die"))
        assert float(last["upper [mm]"]) == pytest.approx(75.0)

    eventually(saved_right)


def test_the_picture_is_saved(page):
    pixels = decoded(saved(page, "Picture").path().read_bytes())
    assert ball_is_blue(page, pixels)


def test_the_replay_plays_from_a_file(page, browser, tmp_path, wait):
    file = tmp_path / "replay.html"
    saved(page, "Replay").save_as(file)
    with browser.new_context(offline=True) as context:
        alone = context.new_page()
        alone.set_default_timeout(SAVE_MS)
        alone.goto(file.as_uri())
        report = alone.wait_for_selector("#pm-report").inner_text()
        assert "table - die" in report
        assert "100.000 mm" in report
        alone.wait_for_function("() => window.__viserSceneTree?.getState()['/parts/2/mesh']")
        wait(lambda: any("mm" in text for text in alone.evaluate(TEXTS, "/distances")), "a label")
        assert alone.evaluate(COVERED) == []
        assert alone.evaluate("() => '/gizmo' in window.__viserSceneTree.getState()") is False
