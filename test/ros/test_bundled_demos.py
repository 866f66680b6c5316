"""Every bundled scene that this file knows runs by its one command and shows a plausible table."""

import os
import subprocess
import sys
from importlib import metadata

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

LEAST = {
    # By scene, a pair and the smallest clearance of its whole motion, as the scene's comment says.
    "cave": ("torus - cave", "m", 0.0083),
    "peg": ("peg - block", "mm", 0.0097),
    "probe": ("tip - pebble", "mm", 0.309),
    # 0.119; but one gear may be a tick or two ahead of the other, and a tooth moves 0.05 in each.
    "gearbox": ("pinion - wheel", "mm", 0.01),
    "turbine": ("blade_4 - shroud", "mm", 0.2489),
    "chess": ("pawn - cup", "mm", 1.109),
    "arm": ("jaw_2 - panda_leftfinger", "mm", 11.99),
}


def installed(package):
    try:
        return bool(metadata.version(package))
    except metadata.PackageNotFoundError:
        return False


@pytest.mark.once
@pytest.mark.parametrize("name", LEAST)
def test_a_bundled_scene_runs(ros_environment, name):
    if name == "arm" and not installed("example-robot-data"):
        pytest.skip("needs example-robot-data: pip install example-robot-data")
    if name == "gearbox" and not installed("cadquery-ocp"):
        pytest.skip("needs OpenCASCADE: pip install cadquery-ocp")
    pair, unit, least = LEAST[name]
    # The first ticks of curved solids take a second on an idle machine, and tests run beside.
    seconds = "15" if name in ("gearbox", "chess") else "5"
    # A domain apart from the other tests' monitors, which have the same names.
    domain = str(int(os.environ["ROS_DOMAIN_ID"]) % 100 + 1)
    run = subprocess.run(
        [sys.executable, "-m", "proximity_monitor", "demo", "--scene", name, "--seconds", seconds],
        env=os.environ | {"ROS_DOMAIN_ID": domain},
        capture_output=True,
        text=True,
        timeout=START_DEADLINE_S,
    )
    assert run.returncode == 0, run.stderr
    assert f"clearance [{unit}]" in run.stdout
    assert "script: " in run.stdout
    summary = run.stdout.partition("Smallest clearance")[2].splitlines()
    (reached,) = [float(line.split()[-2]) for line in summary if line.startswith(f"  {pair}:")]
    # Seen for some seconds of its motion: not nearer than it ever is, and not far off.
    assert least <= reached < 2000.0
