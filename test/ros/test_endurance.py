"""The node's memory over a hundred lifecycle rounds, and signals during a tick or an import."""

import os
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from lifecycle_msgs.msg import Transition

ROUND = (
    Transition.TRANSITION_CONFIGURE,
    Transition.TRANSITION_ACTIVATE,
    Transition.TRANSITION_DEACTIVATE,
    Transition.TRANSITION_CLEANUP,
)
GROWTH_BYTES = 11_000_000
"""Most growth over 75 rounds. A session, with its tables, publishers and services, takes some
300 kB, so this is half of what 75 leaked sessions take. The memory that the allocator holds back
grows once by 5 MB, at some time, and no more."""

# All triangles of an inner sphere are almost equally near to the outer sphere, so a search takes
# seconds. The outer spheres share one model.
SHELLS = [f"shell_{i}" for i in range(8)]
LARGE = (
    "solid: false, primitive: {sphere: {radius: 100, subdivisions: 7}}, pose: {position: [0, 0, 0]}"
)
SMALL = "solid: false, primitive: {sphere: {radius: 2, subdivisions: 7}}, moving: true"
BODIES = [f"  - {{name: {name}, {LARGE}}}\n" for name in SHELLS]
BODIES += [f"  - {{name: {name}, {SMALL}}}\n" for name in ("ball", "die")]
SLOW = f"""
version: 1
frame: cell
unit: mm
rate_hz: 10
budget_ms: 10000
bodies:
{"".join(BODIES)}
pairs:
  groups: {{inner: [ball, die], outer: {SHELLS}}}
  watch: [{{between: [outer, inner]}}]
"""


FREED_BYTES = 50_000_000
"""Least memory to be freed, of some 120 MB for the spheres above and their search trees."""


def footprint(process):
    """Bytes of memory and number of threads of a process."""
    lines = Path(f"/proc/{process.popen.pid}/status").read_text().splitlines()
    values = dict(line.split(":", 1) for line in lines)
    return int(values["VmRSS"].split()[0]) * 1024, int(values["Threads"])


def spent(process):
    """Seconds of processor time of a process."""
    fields = Path(f"/proc/{process.popen.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def left_behind(peer):
    """Return the endpoints of our namespace's monitor that only a configured monitor has."""
    node, where = peer.node, peer.node.get_namespace()
    names = node.get_publisher_names_and_types_by_node("proximity_monitor", where)
    names += node.get_subscriber_names_and_types_by_node("proximity_monitor", where)
    names += node.get_service_names_and_types_by_node("proximity_monitor", where)
    ours = (
        "/bodies/",
        "/poses",
        "/closest_points",
        "/pairs",
        "/alerts",
        "/parts",
        "/pause",
        "/diagnostics",
    )
    return [name for name, _ in names if any(each in name for each in ours)]


@pytest.mark.long
def test_a_hundred_lives_leave_nothing_behind(launch, scene_file, new_peer):
    process = launch("node", "-r", "__ns:=/lives", scene=scene_file, autostart="false")
    peer = new_peer(process, "lives")
    for _ in range(25):
        assert peer.change(*ROUND), process.text
    memory, threads = footprint(process)
    for _ in range(75):
        assert peer.change(*ROUND), process.text
    after = footprint(process)
    assert after[1] < threads + 10
    assert after[0] - memory < GROWTH_BYTES
    peer.wait(lambda: not left_behind(peer), "the last endpoints to go")
    assert process.stop(signal.SIGTERM)[0] == 0
    assert "Traceback" not in process.text


@pytest.mark.long
def test_what_was_there_before_the_node_was_spun_is_freed_as_well(launch, tmp_path, new_peer):
    """`spin` hides all objects that exist when it begins from the garbage collector."""
    (tmp_path / "slow.yaml").write_text(SLOW)
    # Blocks larger than this go back to the system as soon as they are freed.
    environment = {"MALLOC_MMAP_THRESHOLD_": "1000000"}
    scene = tmp_path / "slow.yaml"
    # Without markers: a leak of the spheres is found as well, in a sixth of the time.
    process = launch(
        "node", "-r", "__ns:=/first", scene=scene, markers="false", environment=environment
    )
    peer = new_peer(process, "first")
    peer.wait(lambda: peer.last("closest_points"), "a tick without poses", START_DEADLINE_S)
    before = footprint(process)[0]
    assert peer.change(*ROUND[2:]), process.text
    peer.wait(lambda: footprint(process)[0] < before - FREED_BYTES, "its memory to be given back")


@pytest.mark.long
def test_a_signal_in_the_middle_of_a_long_tick_ends_it_with_its_state_published(
    launch, tmp_path, new_peer
):
    (tmp_path / "slow.yaml").write_text(SLOW)
    # Without markers: seventy megabytes of parts would crowd out the messages awaited here.
    process = launch("node", "-r", "__ns:=/slow", scene=tmp_path / "slow.yaml", markers="false")
    peer = new_peer(process, "slow")
    peer.wait(lambda: peer.last("closest_points"), "a tick without poses", START_DEADLINE_S)
    peer.hold(ball=(0.0, 0.0, 0.0), die=(0.0, 0.0, 0.0))
    silent_since = {}  # processor time (s) when each count of messages was first seen

    def computing():
        began = silent_since.setdefault(len(peer.received["closest_points"]), spent(process))
        return spent(process) > began + 0.5

    peer.wait(computing, "a search that goes on")
    peer.forget()
    code, took_s = process.stop(signal.SIGTERM)
    assert code == 0, process.text
    # Half a second on an idle machine. Without the signal, the tick would take ten seconds.
    assert took_s < 8.0
    peer.monitor.popen.poll = lambda: None  # now `wait` accepts that the process has ended
    pairs = peer.wait(peer.pairs, "what it published last")
    bounded = [pair for pair in pairs.values() if pair["status"] == "bounded"]
    assert bounded, "the search was cut, and what it knows is certified"
    for pair in bounded:
        assert 0.0 <= float(pair["lower_m"]) < 0.098 < float(pair["upper_m"]) + 1e-5
    assert "Traceback" not in process.text


def test_an_interrupt_while_python_imports_ends_it_without_a_traceback(
    launch, scene_file, tmp_path
):
    """The launcher keeps the signal's default action during imports; this import never ends."""
    endless = "import threading\nprint('importing', flush=True)\nthreading.Event().wait(600)\n"
    (tmp_path / "lifecycle_msgs.py").write_text(endless)
    path = f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    process = launch("node", scene=scene_file, environment={"PYTHONPATH": path})
    deadline = time.monotonic() + START_DEADLINE_S
    while process.text != "importing\n":
        assert time.monotonic() < deadline, process.text
        with suppress(subprocess.TimeoutExpired):
            pytest.fail(f"ended with {process.popen.wait(0.05)}: {process.text}")
    code, _ = process.stop(signal.SIGINT)
    assert code == -signal.SIGINT
    assert process.text == "importing\n"
