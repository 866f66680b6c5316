"""A monitor, a display and a browser, each in a process of its own; the poses come from here.

Nothing here sleeps: whoever waits looks again until a condition holds or a deadline passes.
"""

from __future__ import annotations

import os
import shutil
import threading
import time

import pytest

SCENE = """
version: 1
description: a ball and a die above a table
frame: cell
unit: mm
rate_hz: 30
budget_ms: 15
thresholds: {warn: 100, stop: 20, hysteresis: 10}
bodies:
  - {name: table, primitive: {box: {size: [800, 800, 50]}}, pose: {position: [0, 0, -25]}}
  - {name: ball, primitive: {sphere: {radius: 100}}, moving: true, colour: [0.2, 0.5, 0.8, 1]}
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
START = {"ball": (-0.2, 0.0, 0.3), "die": (0.2, 0.0, 0.3), "cursor": (0.2, -0.2, 0.3)}
DEADLINE_S = 20.0
START_DEADLINE_S = 180.0  # the first start on a machine compiles the kernels

# Without a graphics card, on a machine that may be busy.
FLAGS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--no-sandbox",  # it cannot be had as root, which is what a container runs as
)


def until(condition, what, timeout_s=DEADLINE_S):
    """Look until the condition returns something true, and return that."""
    deadline = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited for {what}"
        threading.Event().wait(0.02)
    return found


def pytest_collection_modifyitems(items):
    """Mark what drives a browser."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker("browser")


@pytest.fixture(scope="session")
def wait():
    return until


class Sources:
    """Publishes the poses of bodies 30 times a second, and hears what the display publishes."""

    def __init__(self, domain):
        import rclpy
        from geometry_msgs.msg import PoseStamped
        from rclpy.executors import SingleThreadedExecutor

        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.node = rclpy.create_node("sources", context=self._context)
        self.start = START
        self.held = dict(START)
        self.heard = {}
        self._get = None
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
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def close(self):
        self._ended.set()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def parameter(self, name):
        """The value of a parameter of the monitor, a number."""
        from rcl_interfaces.srv import GetParameters

        if self._get is None:
            self._get = self.node.create_client(GetParameters, "proximity_monitor/get_parameters")
        future = self._get.call_async(GetParameters.Request(names=[name]))
        until(future.done, f"parameter {name}")
        return future.result().values[0].double_value

    def _spin(self):
        while not self._ended.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def _keeper(self, name):
        def keep(message):
            if name not in self.held:
                p, q = message.pose.position, message.pose.orientation
                self.heard[name] = ((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))

        return keep

    def _publish(self):
        from geometry_msgs.msg import PoseStamped

        message = PoseStamped()
        message.header.frame_id = "cell"
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.pose.orientation.w = 1.0
        place = message.pose.position
        for name, position in list(self.held.items()):
            place.x, place.y, place.z = position
            self._publishers[name].publish(message)


@pytest.fixture(scope="session")
def chromium():
    """The browser's path."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None:
        pytest.skip("no Chromium on the PATH (Debian: apt-get install chromium)")
    return found


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("display_scene") / "cell.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="session")
def world(scene_file):
    """The scene and its models, loaded here as a user of the library would."""
    from proximity_monitor.scene import load_scene
    from proximity_monitor.scene.opening import load_models

    scene = load_scene(scene_file)
    return scene, load_models(scene)


@pytest.fixture(scope="session")
def domain(ros_environment):
    """A DDS domain besides that of other folders' tests: these processes outlive this folder's."""
    return int(os.environ["ROS_DOMAIN_ID"]) + 50


@pytest.fixture(scope="session")
def sources(chromium, domain, launch, scene_file):
    """The poses of all bodies, of which a monitor hears."""
    made = Sources(domain)
    made.monitor = launch("node", scene=scene_file, environment={"ROS_DOMAIN_ID": str(domain)})
    yield made
    made.close()


@pytest.fixture(scope="session")
def address(sources, domain, launch):
    """Where the display is."""
    pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")
    process = launch("display", port=0, environment={"ROS_DOMAIN_ID": str(domain)})

    def said():
        assert process.popen.poll() is None, process.text
        line = next((x for x in process.text.splitlines() if x.startswith("display: ")), None)
        return line and line.removeprefix("display: ")

    return until(said, "the display's address", START_DEADLINE_S)


@pytest.fixture(scope="session")
def browser(chromium):
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    os.environ.pop("DISPLAY", None)
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield started
        started.close()


@pytest.fixture(scope="session")
def shared_page(browser, address, sources):
    page = browser.new_page(
        viewport={"width": 1000, "height": 640}, accept_downloads=True, device_scale_factor=1
    )
    page.set_default_timeout(1e3 * DEADLINE_S)
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.goto(address)

    def listed():
        assert sources.monitor.popen.poll() is None, sources.monitor.text
        return page.query_selector("#pm-pairs .pm-row")

    until(listed, "the list of pairs", START_DEADLINE_S)
    for close in page.locator(".mantine-Notification-closeButton").all():
        close.click()  # it says that the graphics are software
    return page
