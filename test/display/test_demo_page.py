"""The page that comes with the demo."""

import contextlib
import os
import signal
import subprocess
import sys
from urllib.request import ProxyHandler, build_opener

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

BESIDE = "Drag the parts and see their clearances at "
SCENE = """
version: 1
frame: bench
unit: mm
bodies:
  - {name: wall, primitive: {box: {size: [10, 200, 200]}}, pose: {position: [125, 0, 0]}}
  - {name: slide, primitive: {box: {size: [20, 20, 20]}}, moving: true}
pairs: all
motion: {script: {bodies: {slide: {slide: {axis: [1, 0, 0], offsets: [[0, 0], [2, 50]]}}}}}
"""


class Demo:
    """The demo in a process group of its own, and what it prints."""

    def __init__(self, command, log):
        self._log = log
        with log.open("w") as out:
            self._process = subprocess.Popen(command, stdout=out, start_new_session=True)

    def says(self, start):
        """The rest of a line that begins like this, spaces apart; empty until it comes."""
        assert self._process.poll() is None, self.text
        lines = (line.lstrip() for line in self.text.splitlines(keepends=True))
        found = (x.removeprefix(start).strip() for x in lines if x.startswith(start) and "\n" in x)
        return next(found, "")

    def interrupt(self):
        """Press Ctrl-C, so to say; return the exit code."""
        self._process.send_signal(signal.SIGINT)
        return self._process.wait(START_DEADLINE_S)

    def is_gone(self):
        """Whether no process of its group is left."""
        try:
            os.killpg(self._process.pid, 0)
        except ProcessLookupError:
            return True
        return False

    def kill(self):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    @property
    def text(self):
        return self._log.read_text()


@pytest.fixture
def demo(ros_environment, tmp_path, monkeypatch):
    """Start the demo with arguments; it is killed in the end."""
    started = []
    path = tmp_path / "slide.yaml"
    path.write_text(SCENE)
    # A domain apart from the other tests' monitors, which have the same names.
    monkeypatch.setenv("ROS_DOMAIN_ID", str(int(os.environ["ROS_DOMAIN_ID"]) % 100 + 1))
    for desktop in ("DISPLAY", "WAYLAND_DISPLAY"):  # where it would open a browser
        monkeypatch.delenv(desktop, raising=False)

    def start(*arguments):
        command = [sys.executable, "-m", "proximity_monitor", "demo", "--scene", path, *arguments]
        started.append(Demo(command, tmp_path / f"demo_{len(started)}.log"))
        return started[-1]

    yield start
    for each in started:
        each.kill()


def test_the_demo_prints_its_address_and_takes_the_page_along_when_it_ends(demo, wait):
    process = demo()
    address = wait(lambda: process.says(BESIDE), "the address", START_DEADLINE_S)
    with build_opener(ProxyHandler({})).open(address, timeout=60.0) as answer:
        assert answer.status == 200
    assert process.interrupt() == 0
    wait(process.is_gone, "the display to end")


def test_the_demo_can_do_without(demo, wait):
    process = demo("--no-page")
    wait(lambda: process.says("wall - slide"), "a clearance", START_DEADLINE_S)
    assert process.interrupt() == 0
    assert "Smallest clearance" in process.text
    assert "http" not in process.text
