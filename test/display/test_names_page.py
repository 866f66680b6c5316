"""CAD names of parts on the page: long names, Chinese names, characters that HTML uses."""

from __future__ import annotations

import signal

import pytest
from deadlines import POSE_TIMEOUT_S, START_DEADLINE_S
from page_hand import (
    CHOSEN,
    address_of,
    button,
    enter,
    field,
    listed,
    opened,
    press,
    row,
    select,
    tab,
)

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

# It has no space at which it could wrap; the other one has.
LONG = ("Grundplatte_&_<b>Deckel</b>,_sehr_lang,_mit_Überlänge;_" * 3)[:155] + "x"
OTHER = LONG[::-1].replace("_", " ")
CHINESE = "轴承座 左"
SCENE = f"""
version: 1
unit: mm
rate_hz: 10
bodies:
  - {{name: '{LONG}', primitive: {{box: {{size: [90, 90, 90]}}}}, moving: true}}
  - {{name: {CHINESE}, primitive: {{box: {{size: [90, 90, 90]}}}}, moving: true}}
  - {{name: '{OTHER}', primitive: {{box: {{size: [9, 9, 9]}}}}, pose: {{position: [0, 0, 50]}}}}
pairs:
  groups: {{alle Teile: ['{LONG}', '{OTHER}']}}
  watch:
    - {{between: [alle Teile, alle Teile], thresholds: {{warn: 5, stop: 1}}}}
    - {{between: [alle Teile, {CHINESE}], thresholds: {{warn: 5, stop: 1}}}}
motion:
  script:
    bodies:
      '{LONG}': {{keys: [{{t: 0, position: [0, 0, 0]}}, {{t: 1, position: [0, 0, 0]}}]}}
      {CHINESE}: {{keys: [{{t: 0, position: [120, 0, 0]}}, {{t: 1, position: [120, 0, 0]}}]}}
"""
PAIR = f"{LONG} - {CHINESE}"
TWO_LONG = f"{LONG} - {OTHER}"
INSIDE = """each => {
  const r = each.getBoundingClientRect();
  return r.width > 0 && r.left >= 0 && r.right <= innerWidth;
}"""

# Whether all of an element of the banner is inside each element around it, up to the banner.
WHOLE = """each => {
  const r = each.getBoundingClientRect();
  for (let e = each; e.id !== 'pm-banner'; e = e.parentElement) {
    const o = e.parentElement.getBoundingClientRect();
    if (e.scrollWidth > e.clientWidth && e.clientWidth) return false;
    if (r.left < o.left || r.right > o.right || r.top < o.top || r.bottom > o.bottom) return false;
  }
  return r.width > 0;
}"""


@pytest.fixture(scope="module")
def page(browser, domain, launch_for_all, wait, tmp_path_factory):
    """The page of a scene with such names."""
    path = tmp_path_factory.mktemp("names") / "teile.yaml"
    path.write_text(SCENE, encoding="utf-8")
    environment = {"ROS_DOMAIN_ID": domain}
    monitor = launch_for_all(
        "node", scene=path, pose_timeout_s=POSE_TIMEOUT_S, environment=environment
    )
    player = launch_for_all("player", scene=path, environment=environment)
    display = launch_for_all("display", port=0, environment=environment)

    page = opened(browser, address_of(display, wait))
    wait(lambda: page.query_selector("#pm-pairs .pm-row"), "the list", START_DEADLINE_S)
    yield page
    for process in (display, player, monitor):
        process.stop(signal.SIGKILL)


def test_long_names_are_listed_and_push_no_number_out(page):
    assert set(listed(page)) == {PAIR, TWO_LONG, f"{CHINESE} - {OTHER}"}
    assert LONG in row(page, TWO_LONG)[2]
    numbers = page.locator("#pm-pairs td.pm-num, #pm-pairs td.pm-sign, #pm-pairs .pm-press")
    for i in range(numbers.count()):
        assert numbers.nth(i).evaluate(INSIDE)
    for hide in page.locator("#pm-pairs .pm-press").all():
        assert hide.evaluate("each => each.getClientRects().length") == 1, "it is broken"
    assert page.locator("#pm-banner b").first.evaluate(INSIDE)


def test_the_banner_cuts_the_names_and_not_the_numbers(page):
    numbers = page.locator("#pm-banner .pm-on")
    assert numbers.all_inner_texts() == ["0.500 mm,", "stop at 1.000 mm"]
    for number in numbers.all():
        assert number.evaluate(WHOLE)


def test_a_pair_of_two_long_names_is_picked_by_a_press(page, wait):
    rows = page.locator("#pm-pairs .pm-row")
    i = next(i for i in range(rows.count()) if rows.nth(i).get_attribute("data-pair") == TWO_LONG)
    rows.nth(i).dispatch_event("pointerdown")
    wait(lambda: page.locator(CHOSEN).count() == 1, "the pair to be highlighted")
    assert page.locator(CHOSEN).get_attribute("data-pair") == TWO_LONG
    press(page, CHOSEN)
    wait(lambda: not page.locator(CHOSEN).count(), "the pair to be let go")


def test_a_part_with_a_chinese_name_is_moved(page, wait):
    assert row(page, PAIR)[0] == pytest.approx(0.03)
    tab(page, "Move")
    select(page, field(page, "Part"), CHINESE)
    wait(lambda: float(field(page, "Position [mm]", 0).input_value()) == 120.0, "the part")
    enter(page, "Position [mm]", "140", 0)
    page.keyboard.press("Enter")
    wait(lambda: row(page, PAIR)[0] == pytest.approx(0.05), "the monitor to hear of it")
    # The key is not for the field in which the number was typed.
    page.keyboard.press("Control+z")
    wait(lambda: row(page, PAIR)[0] == pytest.approx(0.03), "the part to be back")
    tab(page, "Clearances")


def test_thresholds_of_such_a_pair_are_set_by_the_sliders(page, wait):
    press(page, f"#pm-pairs .pm-row:has-text('{CHINESE}')")
    wait(lambda: page.locator(CHOSEN).count() == 1, "the pair to be highlighted")
    pair = page.locator(CHOSEN).get_attribute("data-pair")
    tab(page, "Settings")
    wait(lambda: page.get_by_text(f"of {pair}", exact=True).count(), "its own thresholds")
    enter(page, "warn [mm]", "7", 1)
    told = page.locator(f"{CHOSEN} .pm-num")
    wait(lambda: "warn 7.000 mm" in told.get_attribute("title"), "the monitor to take it")


def test_no_list_is_wider_than_the_panel(page, wait):
    # An event of a pair with a long name.
    tab(page, "Move")
    select(page, field(page, "Part"), CHINESE)
    wait(lambda: float(field(page, "Position [mm]", 0).input_value()) >= 120.0, "the part")
    enter(page, "Position [mm]", "93", 0)
    button(page, "Put it there").click()
    tab(page, "Clearances")
    wait(lambda: row(page, PAIR)[0] == pytest.approx(0.003), "the pair to be near")
    page.get_by_text("Clash matrix").click()
    inside(page, wait, "#pm-matrix")
    page.get_by_text("Clash matrix").click()
    tab(page, "Session")
    inside(page, wait, "#pm-conflicts")
    inside(page, wait, "#pm-events")


def inside(page, wait, table):
    """Check that all cells of a list are inside the window."""
    cells = f"{table} tr:nth-child(n + 2) td"
    all_inside = f"all => all.length > 0 && all.every({INSIDE})"
    wait(lambda: page.eval_on_selector_all(cells, all_inside), f"{table} to be in the window")
