"""Fixtures of the page's tests: monitor, display and browser as processes, and a source of poses.

The processes end with each test file, because later tests would have to share the cores with them.
Nothing here sleeps for a fixed time: a wait checks its condition again until it holds or a deadline
passes. On a busy machine the page lags by seconds, so the tests wait for everything that it shows.
"""

from __future__ import annotations

import os
import shutil
import signal
from contextlib import suppress
from pathlib import Path

import pytest
from deadlines import POSE_TIMEOUT_S, START_DEADLINE_S
from page_hand import (
    CHOSEN,
    DRAWN,
    HIDDEN,
    address_of,
    button,
    choose,
    enter,
    opened,
    press,
    row,
    tab,
    word,
)
from pose_sources import START, Sources, at
from waiting import agree, until

SCENE = """
version: 1
description: a ball and a die above a table
frame: cell
unit: mm
rate_hz: 10
budget_ms: 90
thresholds: {warn: 100, stop: 20, hysteresis: 10}
bodies:
  - {name: table, primitive: {box: {size: [800, 800, 50]}}, pose: {position: [0, 0, -25]}}
  - {name: ball, model: a.ball, moving: true, colour: [0.2, 0.5, 0.8, 1]}
  - {name: die, primitive: {box: {size: [150, 150, 150]}}, moving: true,
     colour: [0.85, 0.74, 0.55, 1]}
  - {name: cursor, primitive: {point: {}}, moving: true, colour: [0.8, 0.2, 0.6, 1]}
pairs:
  groups:
    solids: [table, ball, die]
  watch:
    - {between: [table, ball]}
    - {between: [table, die]}
    - {between: [ball, die], thresholds: {warn: 50, stop: 5}}
    - {between: [cursor, solids], thresholds: {warn: 2, stop: 1}, range: 300}
"""
KINDS = Path(__file__).parents[1] / "kinds"
"""The folder of the package that adds the ball's kind of model; see `test_own_kind.py`."""
SAID = 3000
"""Number of characters of a process's latest output in the report of a failed test."""

# For a machine without a graphics card that may be busy.
FLAGS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",  # only the scene needs the GPU; the panel would cost more on it
    "--no-sandbox",  # root cannot have a sandbox, and containers run as root
)


def pytest_collection_modifyitems(items):
    """Mark the tests that drive a browser."""
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker("browser")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Add the pages' texts and the display's output to the report of a failed test."""
    report = yield
    if not report.failed:
        return report
    process, _ = item.funcargs.get("display", (None, None))
    if process is not None:
        report.sections.append(("the display's process", process.text[-SAID:]))
    browser = item.funcargs.get("browser")
    pages = [] if browser is None else [page for each in browser.contexts for page in each.pages]
    for page in pages:
        with suppress(Exception):  # the report has the failure itself in any case
            report.sections.append((f"page {page.url}", page.inner_text("body", timeout=2e3)))
    return report


@pytest.fixture(scope="session")
def wait():
    return until


@pytest.fixture(scope="session")
def eventually():
    return agree


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    """A scene file for each test file, because decisions about pairs are kept beside it."""
    path = tmp_path_factory.mktemp("display_scene") / "cell.yaml"
    path.write_text(SCENE)
    (path.parent / "a.ball").write_text("0 0 0 100")
    return path


@pytest.fixture(scope="module")
def world(scene_file):
    """The scene and its models, loaded as a user of the library would load them."""
    from proximity_monitor.scene import load_scene
    from proximity_monitor.scene.opening import load_models

    scene = load_scene(scene_file)
    return scene, load_models(scene)


@pytest.fixture
def of_engine(world, as_matrix):
    """A function that returns the library's signed distance (m) of a pair, with its points."""
    from proximity_monitor import engine

    scene, models = world
    fixed = {body.name: body.pose for body in scene.bodies if not body.moving}
    start = {name: as_matrix(place) for name, place in START.items()}

    def of_engine(pair, **held):
        placed = fixed | start | {name: as_matrix(*pose) for name, pose in held.items()}
        a, b = pair.split(" - ")
        return engine.signed_distance(models[a], placed[a], models[b], placed[b])

    return of_engine


@pytest.fixture(scope="session")
def domain(ros_environment):
    """A DDS domain apart from that of other folders' tests, whose monitor has the same name."""
    return str(int(os.environ["ROS_DOMAIN_ID"]) + 50)


@pytest.fixture(scope="module")
def browser():
    """Debian's Chromium, or Playwright's."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    with api.sync_playwright() as playwright:
        try:
            started = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        except api.Error:
            if path is not None:
                raise
            pytest.skip("no Chromium: apt-get install chromium, or playwright install chromium")
        yield started
        started.close()


@pytest.fixture(scope="module")
def sources(browser, domain, launch_for_all, scene_file):
    """A source of the poses of all bodies, and a monitor that receives them."""
    python_path = os.pathsep.join(filter(None, (str(KINDS), os.environ.get("PYTHONPATH"))))
    environment = {"ROS_DOMAIN_ID": domain, "PYTHONPATH": python_path}
    monitor = launch_for_all(
        "node", scene=scene_file, pose_timeout_s=POSE_TIMEOUT_S, environment=environment
    )
    made = Sources(int(domain), monitor)
    yield made
    made.close()
    monitor.stop(signal.SIGKILL)


@pytest.fixture(scope="module")
def start_display(sources, domain, launch_for_all):
    """A function that starts a display at a port, and returns its process and its address."""
    pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")
    started = []

    def start(port):
        process = launch_for_all("display", port=port, environment={"ROS_DOMAIN_ID": domain})
        started.append(process)
        return process, address_of(process, until)

    yield start
    for process in started:
        process.stop(signal.SIGKILL)


@pytest.fixture(scope="module")
def display(start_display):
    """The display's process and its address."""
    return start_display(0)


@pytest.fixture(scope="module")
def address(display):
    """The display's address."""
    return display[1]


@pytest.fixture(scope="module")
def open_page(browser, address, sources):
    """A function that opens the page once more, and waits for its list of pairs."""

    def open_page():
        page = opened(browser, address)

        def listed():
            assert sources.monitor.popen.poll() is None, sources.monitor.text
            return page.query_selector("#pm-pairs .pm-row")

        until(listed, "the list of pairs", START_DEADLINE_S)
        return page

    return open_page


@pytest.fixture(scope="module")
def shared_page(open_page):
    return open_page()


@pytest.fixture
def page(shared_page, sources, wait, eventually):
    """The page as it was at first, whatever the test before has left."""
    page = shared_page
    page.mouse.up()
    page.keyboard.press("Escape")
    page.evaluate("() => window.__viserMutable.resetCameraPose(false)")
    page.evaluate(DRAWN)
    tab(page, "Clearances")
    enter(page, "Search", "")
    for left_over in (CHOSEN, HIDDEN):
        while count := page.locator(left_over).count():
            press(page, left_over)
            wait(lambda n=count, x=left_over: page.locator(x).count() < n, "a press to be heard")

    def at_first():
        assert page.get_attribute("#pm-connection", "data-state") == "live"
        assert word(page) == "clear"
        assert row(page, "table - ball")[0] == pytest.approx(0.2)
        assert row(page, "table - die")[0] == pytest.approx(0.225)

    eventually(at_first)
    yield page
    sources.restore()
    assert page.errors == []


@pytest.fixture
def taken(page, sources, wait):
    """The page with the die at the gizmo; the die's own source has just fallen silent."""
    choose(page, "die")
    sources.release("die")
    yield page
    if sources.heard("die"):
        tab(page, "Move")
        release = button(page, "Let go")
        release.click()  # it waits until enabled: the page may lag behind the topic
        wait(release.is_disabled, "the die to be let go")


@pytest.fixture
def put(taken, sources, wait):
    """A function that types a coordinate of the die in mm, and waits until the die is there."""

    def put(axis, value):
        tab(taken, "Move")
        enter(taken, "Position [mm]", f"{value}", "xyz".index(axis))
        button(taken, "Put it there").click()
        wait(lambda: at(sources, axis) == value * 1e-3, f"{axis} = {value} mm")

    return put


@pytest.fixture
def server():
    """The page's server alone."""
    from proximity_monitor.display import serving

    made = serving.serve("127.0.0.1", 0, "test")
    yield made
    serving.stop(made)


@pytest.fixture
def raw(server):
    """A connection to the server that stands in for a browser; see `RawBrowser`."""
    from raw_browser import RawBrowser

    made = RawBrowser(server)
    yield made
    made.close()


@pytest.fixture
def alone(server, raw, monkeypatch, tmp_path):
    """The page of `raw`, with a scene, and all that it shares with other pages."""
    from page_alone import page_of

    return page_of(server, raw.client, monkeypatch, tmp_path / "cell.conflicts.json")
