"""The page as a designer uses it: a browser, a display and a monitor that really run."""

from __future__ import annotations

import csv
import io
import re

import imageio.v3 as iio
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor import engine

# The world position of a node's local point on the screen, in CSS pixels.
ON_SCREEN = """([name, local]) => {
  const m = window.__viserMutable, node = m.nodeRefFromName[name];
  node.updateWorldMatrix(true, false);
  m.camera.updateMatrixWorld();
  const p = node.position.clone().set(...local).applyMatrix4(node.matrixWorld).project(m.camera);
  const r = m.canvas.getBoundingClientRect();
  return [r.left + (p.x + 1) * r.width / 2, r.top + (1 - p.y) * r.height / 2];
}"""
# The texts of the labels that are shown under a node.
TEXTS = """under => Object.entries(window.__viserSceneTree.getState())
  .filter(([name, node]) => name.startsWith(under) && node.effectiveVisibility)
  .map(([, node]) => node.message.props.text).filter(text => text)"""


def decoded(png):
    """The pixels (height, width, 3) of a PNG."""
    return np.asarray(iio.imread(png, extension=".png"))[..., :3]


def text_of(file):
    return file.path().read_text(encoding="utf-8")


def row(page, pair):
    """The bounds of a pair in metres, and its text, as the list shows them now."""
    return page.eval_on_selector(
        f'#pm-pairs [data-pair="{pair}"]',
        "r => [+r.dataset.lower, +r.dataset.upper, r.innerText]",
    )


def listed(page):
    return page.eval_on_selector_all(
        "#pm-pairs .pm-row", "rows => rows.map(r => [r.dataset.pair, +r.dataset.lower])"
    )


def press(page, selector):
    page.locator(selector).dispatch_event("pointerdown")


def tab(page, name):
    page.get_by_role("tab", name=name).click()


def choose(page, part):
    tab(page, "Move")
    page.locator("input[role=combobox]:visible").click()
    page.get_by_role("option", name=part).click()
    page.wait_for_function("() => window.__viserSceneTree.getState()['/gizmo'].effectiveVisibility")


def drag(page, along, start=0.12):
    """Drag the gizmo by `along`, a vector in metres along one of its axes."""
    along = np.array(along, float)
    handle = start * np.abs(np.sign(along))
    x, y = page.evaluate(ON_SCREEN, ["/gizmo", handle.tolist()])
    to_x, to_y = page.evaluate(ON_SCREEN, ["/gizmo", (handle + along).tolist()])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(to_x, to_y, steps=6)
    page.mouse.up()


@pytest.fixture
def page(shared_page, sources, wait):
    """The page, with all parts where they began."""
    yield shared_page
    tab(shared_page, "Move")
    release = shared_page.get_by_role("button", name="Let go")
    sources.held = dict(sources.start)
    sources.heard.clear()
    if release.is_enabled():
        release.click()
    tab(shared_page, "Clearances")
    wait(lambda: row(shared_page, "table - die")[0] == pytest.approx(0.225), "the parts to return")
    assert shared_page.errors == []


@pytest.fixture
def taken(page, sources):
    """The die at the gizmo; its own source is silent as soon as it is held."""
    choose(page, "die")
    del sources.held["die"]
    return page


def of_engine(world, as_matrix, a, b, poses):
    """The distance in metres, and its points, that the library gives for two bodies."""
    scene, models = world
    fixed = {body.name: body.pose for body in scene.bodies if not body.moving}
    at = {name: as_matrix(*pose) for name, pose in poses.items()} | fixed
    return engine.distance(models[a], at[a], models[b], at[b])


def test_the_page_shows_the_parts(page):
    shot = page.locator("canvas").first.screenshot()
    pixels = decoded(shot)
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200
    # The ball is blue and in front of nothing.
    x, y = page.evaluate(ON_SCREEN, ["/parts/1", [0, 0, 0]])
    left, top = page.evaluate(
        "() => { const r = window.__viserMutable.canvas.getBoundingClientRect();"
        " return [r.left, r.top] }"
    )
    red, green, blue = pixels[round(y - top), round(x - left)].astype(int)
    assert blue > green > red
    for name in ("table", "ball", "die", "cursor"):
        assert name in page.evaluate(TEXTS, "/parts")


def test_the_list_says_what_the_library_says_the_nearest_first(page, world, as_matrix, sources):
    still = (0.0, 0.0, 0.0, 1.0)
    poses = {name: (place, still) for name, place in sources.start.items()}
    found = listed(page)
    # table - cursor is at the end of its range, where it may be listed or not.
    assert {"die - cursor", "table - ball", "table - die", "ball - die"} <= {n for n, _ in found}
    assert [lower for _, lower in found] == sorted(lower for _, lower in found)
    for name, lower in found:
        expected = of_engine(world, as_matrix, *name.split(" - "), poses)
        assert lower == pytest.approx(expected.lower, abs=1e-9)
    assert "125.000 mm" in row(page, "die - cursor")[2]
    assert "Δ 0.000, -125.000, 0.000" in row(page, "die - cursor")[2]
    assert any("● 125.000 mm" in text for text in page.evaluate(TEXTS, "/distances"))
    assert "all 6 pairs" in page.inner_text("#pm-banner")
    assert page.get_attribute("#pm-connection", "data-state") == "live"


def test_dragging_the_gizmo_moves_the_body_and_the_numbers_follow(
    taken, sources, world, as_matrix, wait
):
    page = taken
    drag(page, (-0.1, 0.0, 0.0))
    place, turn = wait(lambda: sources.heard.get("die"), "the die's pose on its topic")
    assert place[0] == pytest.approx(0.1, abs=0.01)
    assert place[1:] == pytest.approx((0.0, 0.3), abs=1e-6)
    poses = {name: (at, (0.0, 0.0, 0.0, 1.0)) for name, at in sources.start.items()}
    poses["die"] = (place, turn)
    tab(page, "Clearances")
    for name in ("ball - die", "die - cursor", "table - die"):
        expected = of_engine(world, as_matrix, *name.split(" - "), poses)
        wait(
            lambda name=name, expected=expected: (
                row(page, name)[0] == pytest.approx(expected.lower, abs=1e-9)
            ),
            f"the new clearance of {name}",
        )
    near = of_engine(world, as_matrix, "ball", "die", poses)
    text = f"{1e3 * near.upper:.3f} mm"
    assert text in row(page, "ball - die")[2]
    wait(lambda: any(text in t for t in page.evaluate(TEXTS, "/distances")), "the line's label")
    x, y, z = 1e3 * (near.point_b - near.point_a)
    assert f"Δ {x:.3f}, {y:.3f}, {z:.3f}".replace("-0.000", "0.000") in row(page, "ball - die")[
        2
    ].replace("-0.000", "0.000")


def test_dragging_into_the_stop_zone_raises_the_alert(taken, sources, wait):
    page = taken
    drag(page, (0.0, 0.0, -0.215))
    wait(lambda: page.get_attribute("#pm-banner", "data-word") == "STOP", "the alert")
    assert "■ STOP" in page.inner_text("#pm-banner")
    assert "table - die" in page.inner_text("#pm-banner")
    assert "stop at 20.000 mm" in page.inner_text("#pm-banner")
    tab(page, "Clearances")
    assert "■ STOP" in row(page, "table - die")[2]
    assert any(text.startswith("■ ") for text in page.evaluate(TEXTS, "/distances"))
    tab(page, "Move")
    page.get_by_role("button", name="Undo").click()
    wait(lambda: page.get_attribute("#pm-banner", "data-word") == "clear", "the alert to end")


def test_a_typed_pose_is_taken_and_undone_and_reset(taken, sources, wait):
    page = taken
    field = page.get_by_label("Position [mm]")
    field.fill("150.5")
    page.get_by_role("button", name="Put it there").click()
    wait(lambda: sources.heard.get("die", ((0,),))[0][0] == 0.1505, "the typed pose")
    field.fill("160")
    page.get_by_role("button", name="Put it there").click()
    wait(lambda: sources.heard["die"][0][0] == 0.16, "the second pose")
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Undo").click()
    wait(lambda: sources.heard["die"][0][0] == 0.1505, "the pose before")
    page.get_by_role("button", name="Back to where it was").click()
    wait(lambda: sources.heard["die"][0][0] == 0.2, "the pose at first")


def test_a_source_that_falls_silent_is_shown(page, sources, wait):
    del sources.held["ball"]
    wait(lambda: page.get_attribute("#pm-connection", "data-state") == "stale", "staleness")
    told = page.inner_text("#pm-connection")
    assert re.search(r"no recent pose: ball for \d+\.\d s", told)
    wait(lambda: "? stale" in row(page, "table - ball")[2], "staleness in the list")
    assert "no recent pose of ball" in row(page, "table - ball")[2]
    sources.held["ball"] = sources.start["ball"]
    wait(lambda: page.get_attribute("#pm-connection", "data-state") == "live", "life")


def test_a_pressed_pair_is_highlighted_and_the_rest_is_dim(page, wait):
    before = page.evaluate("() => window.__viserMutable.camera.position.toArray()")
    press(page, '[data-pair="table - die"]')
    page.wait_for_selector('.pm-chosen[data-pair="table - die"]')
    opacity = "i => window.__viserSceneTree.getState()[`/parts/${i}/mesh`].message.props.opacity"
    wait(lambda: page.evaluate(opacity, 1) is not None, "the ball to be dim")
    assert page.evaluate(opacity, 1) < 0.2
    assert page.evaluate(opacity, 2) is None
    wait(
        lambda: page.evaluate("() => window.__viserMutable.camera.position.toArray()") != before,
        "the camera to go there",
    )
    page.wait_for_selector("text=table - die: lower and upper bound [mm]")
    press(page, '[data-pair="table - die"]')
    wait(lambda: page.evaluate(opacity, 1) is None, "the ball to come back")


def test_the_list_is_searched_and_pairs_are_ignored_and_watched_again(page, wait):
    search = page.locator("xpath=//label[.='Search']/ancestor::*[.//input][1]//input")
    search.fill("die ta")
    wait(lambda: [name for name, _ in listed(page)] == ["table - die"], "the one pair")
    search.fill("")
    press(page, '[data-word="ignore:table - die"]')
    wait(lambda: "table - die" not in dict(listed(page)), "the pair to go")
    press(page, '[data-word="ignore:table - die"]')
    wait(lambda: "table - die" in dict(listed(page)), "the pair to come back")


def test_limits_are_the_monitor_s_parameters(page, sources, wait):
    tab(page, "Limits")
    page.wait_for_selector("#pm-cost >> text=of the budget")
    for label, name, factor in (("warn [mm]", "thresholds.warn", 1e-3), ("Budget", "budget_ms", 1)):
        slider = (
            page.get_by_role("slider")
            .and_(page.locator(":visible"))
            .nth(0 if label.startswith("warn") else 3)
        )
        before = float(slider.get_attribute("aria-valuenow"))
        slider.press("ArrowRight")
        wait(lambda b=before, s=slider: float(s.get_attribute("aria-valuenow")) > b, label)
        now = float(slider.get_attribute("aria-valuenow"))
        wait(
            lambda name=name, value=now * factor: (
                sources.parameter(name) == pytest.approx(value, rel=1e-6)
            ),
            f"{name} = {now * factor}",
        )
        slider.press("ArrowLeft")
        wait(
            lambda name=name, value=before * factor: (
                sources.parameter(name) == pytest.approx(value, rel=1e-6)
            ),
            f"{name} as before",
        )


def test_the_session_s_worst_pose_comes_back(taken, sources, wait):
    page = taken
    drag(page, (0.0, 0.0, -0.15))
    place, _ = wait(lambda: sources.heard.get("die"), "the die's pose")
    page.get_by_role("button", name="Undo").click()
    wait(lambda: sources.heard["die"][0][2] == 0.3, "the start")
    tab(page, "Clearances")
    press(page, '[data-pair="table - die"]')
    tab(page, "Session")
    page.wait_for_selector("#pm-worst >> text=table - die")
    page.get_by_role("button", name="Return to that pose").click()
    wait(lambda: sources.heard["die"][0][2] <= place[2] + 1e-9, "the worst pose")
    tab(page, "Clearances")
    press(page, '[data-pair="table - die"]')


def saved(page, name):
    tab(page, "Session")
    with page.expect_download() as download:
        page.get_by_role("button", name=name).click()
    return download.value


def test_the_pairs_are_saved(page):
    file = saved(page, "Pairs as CSV")
    assert file.suggested_filename == "cell.csv"
    table = {(r["a"], r["b"]): r for r in csv.DictReader(io.StringIO(text_of(file)))}
    pair = table["die", "cursor"]
    assert float(pair["lower [mm]"]) == pytest.approx(125.0, abs=1e-6)
    assert float(pair["delta_y [mm]"]) == pytest.approx(-125.0, abs=1e-6)
    assert float(pair["warn [mm]"]) == 2.0
    assert (pair["state"], pair["status"]) == ("clear", "exact")


def test_the_session_is_saved(page):
    file = saved(page, "Session as CSV")
    ticks = list(csv.DictReader(io.StringIO(text_of(file))))
    stamps = [float(tick["stamp [s]"]) for tick in ticks]
    assert stamps == sorted(stamps)
    assert len(set(stamps)) > 10
    least = min(float(tick["upper [mm]"]) for tick in ticks if tick["b"] == "die")
    assert least < 225.0


def test_the_picture_is_saved(page):
    pixels = decoded(saved(page, "Picture").path().read_bytes())
    assert pixels.shape[0] > 300
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200


def test_the_replay_plays_from_a_file(page, browser, tmp_path):
    file = tmp_path / "replay.html"
    saved(page, "Replay").save_as(file)
    alone = browser.new_context(offline=True).new_page()
    alone.goto(file.as_uri())
    report = alone.wait_for_selector("#pm-report").inner_text()
    assert "table - die" in report
    assert "100.000 mm" in report
    alone.wait_for_function("() => window.__viserSceneTree?.getState()['/parts/2/mesh']")
    assert any("mm" in text for text in alone.evaluate(TEXTS, "/distances"))
    assert alone.evaluate("() => '/gizmo' in window.__viserSceneTree.getState()") is False
    alone.context.close()
