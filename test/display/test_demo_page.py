"""The page that comes with the demo."""

import os
import signal
import subprocess
import sys
from urllib.request import urlopen

import pytest

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


@pytest.fixture
def demo(ros_environment, tmp_path):
    """Start the demo with arguments; it is killed in the end."""
    started = []
    path = tmp_path / "slide.yaml"
    path.write_text(SCENE)

    def start(*arguments):
        # A domain apart from the other tests' monitors, which have the same names.
        domain = str(int(os.environ["ROS_DOMAIN_ID"]) % 100 + 1)
        started.append(
            subprocess.Popen(
                [sys.executable, "-m", "proximity_monitor", "demo", "--scene", path, *arguments],
                stdout=subprocess.PIPE,
                env=os.environ | {"ROS_DOMAIN_ID": domain},
                text=True,
            )
        )
        return started[-1]

    yield start
    for process in started:
        process.kill()


def test_the_demo_prints_its_address_and_takes_it_along_when_it_ends(demo):
    process = demo()
    line = next(line for line in process.stdout if line.startswith(BESIDE))
    address = line.removeprefix(BESIDE).strip()
    with urlopen(address) as answer:
        assert answer.status == 200
    process.send_signal(signal.SIGINT)
    process.stdout.read()
    assert process.wait(30.0) == 0
    with pytest.raises(OSError):
        urlopen(address)


def test_the_demo_can_do_without(demo):
    process = demo("--no-page", "--seconds", "1")
    said = process.stdout.read()
    assert process.wait(30.0) == 0
    assert "Smallest clearance" in said
    assert "http" not in said
