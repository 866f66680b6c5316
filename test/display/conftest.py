"""Fixtures of the page's tests: monitor, display and browser as processes, and a source of poses.

The processes end with each test file, because later tests would have to share the cores with them.
Nothing here sleeps for a fixed time: a wait checks its condition again until it holds or a deadline
passes. On a busy machine the page lags by seconds, so the tests wait for everything that it shows.
"""

from __future__ import annotations

import os
import shutil
import signal
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest
from deadlines import DEADLINE_S, POSE_TIMEOUT_S, START_DEADLINE_S
from page_hand import address_of, opened

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
START = {"ball": (-0.2, 0.0, 0.3), "die": (0.2, 0.0, 0.3), "cursor": (0.2, -0.2, 0.3)}
LOOK_S = 0.1
SAID = 3000
"""Number of characters of a process's latest output in the report of a failed test."""
RETRY_S = 2.0

# For a machine without a graphics card that may be busy.
FLAGS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",  # only the scene needs the GPU; the panel would cost more on it
    "--no-sandbox",  # root cannot have a sandbox, and containers run as root
)


def until(condition, what, timeout_s=DEADLINE_S):
    """Call the condition until it returns something true, and return that."""
    deadline = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited for {what}"
        threading.Event().wait(LOOK_S)
    return found


def agree(check, timeout_s=DEADLINE_S):
    """Call `check` until none of its assertions fails, and return its result."""
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            return check()
        except AssertionError:
            if time.monotonic() > deadline:
                raise
        threading.Event().wait(LOOK_S)


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


class Sources:
    """Publishes the poses of bodies 30 times a second, and receives the display's poses."""

    def __init__(self, domain, monitor):
        import rclpy
        from geometry_msgs.msg import PoseStamped
        from rcl_interfaces.srv import GetParameters
        from rclpy.executors import SingleThreadedExecutor

        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.monitor = monitor
        self.node = rclpy.create_node("sources", context=self._context)
        self._held = dict(START)
        self._released_ns = {}
        self._last = {}
        self._get = self.node.create_client(GetParameters, "proximity_monitor/get_parameters")
        self._publishers = {
            name: self.node.create_publisher(PoseStamped, f"bodies/{name}/pose", 1)
            for name in START
        }
        for name in START:
            self.node.create_subscription(PoseStamped, f"bodies/{name}/pose", self._keeper(name), 1)
        self.node.create_timer(1.0 / 30.0, self._publish)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self):
        self._ended.set()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def release(self, name):
        """Stop publishing the pose of a body."""
        del self._held[name]
        # Taken after the deletion, so that no pose published here counts as the display's.
        self._released_ns[name] = self.node.get_clock().now().nanoseconds

    def move(self, name, position):
        """Publish a body at another position from now on."""
        self._held[name] = position

    def restore(self):
        """Publish all bodies at their start positions again."""
        self._held = dict(START)

    def heard(self, name):
        """Return the last pose (position, quaternion) from others of a released body, or None."""
        stamp_ns, pose = self._last.get(name, (0, None))
        return pose if stamp_ns > self._released_ns[name] else None

    def parameter(self, name):
        """Return the value of a numeric parameter of the monitor."""
        from rcl_interfaces.srv import GetParameters

        until(self._get.service_is_ready, "the service of parameters")
        asked, asked_s = [], -RETRY_S

        def answered():
            nonlocal asked_s
            # An answer is lost if the server has not discovered this client yet.
            if time.monotonic() > asked_s + RETRY_S:
                asked_s = time.monotonic()
                asked.append(self._get.call_async(GetParameters.Request(names=[name])))
            return next((future for future in asked if future.done()), None)

        return until(answered, f"parameter {name}").result().values[0].double_value

    def _spin(self):
        from rclpy.executors import InvalidHandle

        while not self._ended.is_set():
            # A test's own thread may destroy a subscription meanwhile; the executor can go on.
            with suppress(InvalidHandle):
                self._executor.spin_once(timeout_sec=0.05)

    def _keeper(self, name):
        def keep(message):
            stamp, p, q = message.header.stamp, message.pose.position, message.pose.orientation
            pose = ((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
            self._last[name] = (stamp.sec * 10**9 + stamp.nanosec, pose)

        return keep

    def _publish(self):
        from geometry_msgs.msg import PoseStamped

        message = PoseStamped()
        message.header.frame_id = "cell"
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.pose.orientation.w = 1.0
        place = message.pose.position
        for name, position in list(self._held.items()):
            place.x, place.y, place.z = position
            self._publishers[name].publish(message)


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
