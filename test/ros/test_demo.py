"""The demo as a user starts it."""

import os
import pty
import select
import signal
import subprocess
import sys
import time

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

SCENE = """
version: 1
frame: bench
unit: mm
rate_hz: 50
budget_ms: 15
thresholds: {warn: 20, stop: 2, hysteresis: 1}
bodies:
  - {name: wall, primitive: {box: {size: [10, 200, 200]}}, pose: {position: [125, 0, 0]}}
  - {name: wheel, primitive: {cylinder: {radius: 30, height: 10}}, moving: true}
  - {name: slide, primitive: {box: {size: [20, 20, 20]}}, moving: true}
pairs: all
motion:
  slider_crank:
    crank: wheel
    crank_origin: [0, 0, 0]
    crank_axis: [0, 0, 1]
    slide_direction: [1, 0, 0]
    crank_radius: 20
    rod_length: 80
    rpm: 60
    pistons:
      slide: {phase_deg: 0, offset: [0, 0, 0]}
"""

FAILS = """
import sys
from proximity_monitor.motion.slider_crank import SliderCrank
from proximity_monitor.ros import demo

poses = SliderCrank.poses

def fail(self, t):
    if t > 1.0:
        raise FloatingPointError("no such moment")
    return poses(self, t)

SliderCrank.poses = fail
sys.exit(demo.run(sys.argv[1], seconds=20.0, page=False))
"""

LATE = """
import sys
import time
from proximity_monitor.ros import demo

take, first = demo.View._take, None

def late(self, message):
    global first
    first = time.monotonic() if first is None else first
    if time.monotonic() - first > 2.5:
        take(self, message)

demo.View._take = late
sys.exit(demo.run(sys.argv[1], seconds=1.5, page=False))
"""


@pytest.fixture
def environment(ros_environment):
    """A domain apart from the other tests' monitors, which have the same names."""
    return os.environ | {"ROS_DOMAIN_ID": str(int(os.environ["ROS_DOMAIN_ID"]) % 100 + 1)}


@pytest.fixture
def command(tmp_path):
    path = tmp_path / "slide.yaml"
    path.write_text(SCENE)
    return [sys.executable, "-m", "proximity_monitor", "demo", "--scene", str(path)]


def test_the_demo_prints_what_the_monitor_publishes_and_ends_by_itself(command, environment):
    run = subprocess.run(
        [*command, "--seconds", "3", "--speed", "2"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=START_DEADLINE_S,
    )
    assert run.returncode == 0, run.stderr
    # On a new machine, stderr says that the kernels are compiled, and nothing else.
    told = run.stderr.splitlines()
    assert len(told) <= 1
    assert all(line.startswith("compiling proximity_monitor's kernels") for line in told)
    assert "wall - slide" in run.stdout
    assert "clearance [mm]" in run.stdout
    assert "% of 15 ms" in run.stdout
    assert "warn -> clear" in run.stdout
    # The slide's face is 10 mm ahead of its origin. The origin reaches 100 mm, and the wall begins
    # at 120 mm.
    summary = run.stdout.partition("Smallest clearance")[2].splitlines()
    (least,) = [float(line.split()[-2]) for line in summary if line.startswith("  wall - slide:")]
    assert 10.0 - 1e-3 <= least < 11.0  # on a busy machine, ticks may miss the closest moment


@pytest.mark.long
def test_its_seconds_begin_with_the_first_picture(command, environment):
    """The patched view drops all results for 2.5 s, longer than the 1.5 s of the demo."""
    run = subprocess.run(
        [sys.executable, "-c", LATE, command[-1]],
        env=environment,
        capture_output=True,
        text=True,
        timeout=START_DEADLINE_S,
    )
    assert run.returncode == 0, run.stderr
    assert "wall - slide" in run.stdout.partition("Smallest clearance")[0]


@pytest.mark.long
def test_many_bodies_without_thresholds_are_played_in_bulk_and_the_nearest_listed(
    tmp_path, environment
):
    """Cubes of 10 mm on one line, their centres 20, 40, 60 ... mm apart, move together."""
    count = 12
    bodies = [
        f"  - {{name: cube_{i}, primitive: {{box: {{size: [10, 10, 10]}}}}, moving: true}}\n"
        for i in range(count)
    ]
    slides = [
        f"      cube_{i}: {{slide: {{axis: [0, 1, 0], offsets: [[0, 0], [9, 90]],"
        f" pose: {{position: [{10 * i * (i + 1)}, 0, 0]}}}}}}\n"
        for i in range(count)
    ]
    path = tmp_path / "cubes.yaml"
    path.write_text(
        "version: 1\nunit: mm\nrate_hz: 20\nbudget_ms: 20\nbodies:\n"
        + "".join(bodies)
        + "motion:\n  script:\n    bodies:\n"
        + "".join(slides)
    )
    run = subprocess.run(
        [sys.executable, "-m", "proximity_monitor", "demo", "--scene", str(path), "--seconds", "4"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=START_DEADLINE_S,
    )
    assert run.returncode == 0, run.stderr
    assert "12 bodies, 66 pairs" in run.stdout
    assert "script: 12 bodies, 9 s in a loop" in run.stdout
    shown = run.stdout.partition("Smallest clearance")[0].split("66 pairs: ")[1:]
    # Skip tables with stale pairs: poses become stale if the machine stalls for half a second.
    last = [each for each in shown if each.startswith("66 clear\n")][-1].splitlines()
    title = next(i for i, line in enumerate(last) if line.startswith("  pair "))  # after warnings
    assert [line.split()[:4] for line in last[title + 1 : title + 3]] == [
        ["cube_0", "-", "cube_1", "10.0000"],
        ["cube_1", "-", "cube_2", "30.0000"],
    ]
    assert "  and 46 more pairs, none of them nearer" in last
    summary = run.stdout.partition("Smallest clearance")[2].splitlines()
    assert summary[1] == "  cube_0 - cube_1: 10.0000 mm"
    assert len(summary) == 1 + 20


@pytest.mark.long
@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_in_a_terminal_it_shows_a_live_table_until_a_signal_ends_it(command, environment, kind):
    ours, theirs = pty.openpty()
    demo = subprocess.Popen(
        command, env=environment | {"TERM": "xterm", "COLUMNS": "120"}, stdout=theirs, stderr=theirs
    )
    os.close(theirs)
    shown = b""
    deadline = time.monotonic() + START_DEADLINE_S
    try:
        while b"% of 15 ms" not in shown:
            assert time.monotonic() < deadline, shown.decode()
            if select.select([ours], [], [], 1.0)[0]:
                shown += os.read(ours, 65536)
        demo.send_signal(kind)
        began = time.monotonic()
        try:
            while part := os.read(ours, 65536):
                shown += part
        except OSError:  # raised when the program has closed the terminal
            pass
        assert demo.wait(START_DEADLINE_S) == 0, shown.decode()
        assert time.monotonic() - began < 15.0
    finally:
        demo.kill()
        os.close(ours)
    assert b"\x1b[" in shown
    assert b"Traceback" not in shown
    assert b"Smallest clearance" in shown


@pytest.mark.long
def test_a_motion_that_fails_while_it_is_played_ends_the_demo(tmp_path, environment):
    (tmp_path / "slide.yaml").write_text(SCENE)
    command = [sys.executable, "-c", FAILS, str(tmp_path / "slide.yaml")]
    run = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=START_DEADLINE_S
    )
    assert run.returncode == 1
    assert "FloatingPointError: no such moment" in run.stderr
    assert "Smallest clearance" not in run.stdout


def test_a_demo_that_cannot_start_says_why(environment):
    command = [sys.executable, "-m", "proximity_monitor", "demo", "--scene", "no-such"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert run.returncode == 1
    assert "no bundled scene 'no-such'" in run.stderr
    assert "Traceback" not in run.stderr
