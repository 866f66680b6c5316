"""Each bundled scene in `LEAST` runs by its one command and shows a plausible table."""

import os
import re
import signal
import statistics
import subprocess
import sys
import time
from importlib import metadata

import pytest
from deadlines import DEADLINE_S, START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

GEARS = "pinion - wheel"

LEAST = {
    # For each scene: a pair, its unit, and its smallest clearance in the whole motion, as the
    # comment in the scene file says.
    "cave": ("torus - cave", "m", 0.0083),
    "peg": ("peg - block", "mm", 0.0097),
    "probe": ("tip - pebble", "mm", 0.309),
    "gearbox": (GEARS, "mm", 0.119),
    "turbine": ("blade_4 - shroud", "mm", 0.2489),
    "chess": ("pawn - cup", "mm", 1.109),
    "arm": ("jaw_2 - panda_leftfinger", "mm", 11.99),
}

TABLES = 3
"""Tables to wait for. The demo prints one a second; the time of its start is not limited."""


def wait_for_tables(demo, log, line):
    """Wait until `TABLES` lines of the demo's output match `line`."""
    deadline = time.monotonic() + START_DEADLINE_S
    while len(line.findall(log.read_text())) < TABLES:
        assert demo.poll() is None, log.read_text()
        assert time.monotonic() < deadline, log.read_text()
        time.sleep(0.1)


def installed(package):
    try:
        return bool(metadata.version(package))
    except metadata.PackageNotFoundError:
        return False


@pytest.mark.long
@pytest.mark.parametrize("name", LEAST)
def test_a_bundled_scene_runs(ros_environment, tmp_path, name):
    if name == "arm" and not installed("example-robot-data"):
        pytest.skip("needs example-robot-data: pip install example-robot-data")
    if name == "gearbox" and not installed("cadquery-ocp"):
        pytest.skip("needs OpenCASCADE: pip install cadquery-ocp")
    pair, unit, least = LEAST[name]
    # A domain apart from the other tests' monitors, which have the same names.
    domain = str(int(os.environ["ROS_DOMAIN_ID"]) % 100 + 1)
    log = tmp_path / "demo.log"
    with log.open("w") as out:
        demo = subprocess.Popen(
            # The page is not needed: test_demo_page.py tests it.
            [sys.executable, "-m", "proximity_monitor", "demo", "--scene", name, "--no-page"],
            env=os.environ | {"ROS_DOMAIN_ID": domain},
            stdout=out,
            stderr=subprocess.STDOUT,
        )
    try:
        wait_for_tables(demo, log, re.compile(rf"^  {re.escape(pair)} +-?\d", re.MULTILINE))
        demo.send_signal(signal.SIGINT)
        code = demo.wait(DEADLINE_S)
    finally:
        demo.kill()
        demo.wait()
    said = log.read_text()
    assert code == 0, said
    assert f"clearance [{unit}]" in said
    assert "script: " in said
    summary = said.partition("Smallest clearance")[2].splitlines()
    (reached,) = [float(line.split()[-2]) for line in summary if line.startswith(f"  {pair}:")]
    # Only some seconds of the motion are seen: never below its smallest clearance, nor far off.
    assert reached < 2000.0
    shown = re.findall(rf"^  {re.escape(pair)} +(?:\S+\.\.)?([\d.]+) ", said, re.MULTILINE)
    assert least <= statistics.median(map(float, shown))
    # Each gear has a topic of its own. Where the machine is busy, one may be ahead for a tick.
    assert least <= reached or pair == GEARS
