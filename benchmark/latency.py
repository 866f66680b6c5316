"""From a pose to its closest points across two processes, beside the bare round trip of ROS 2.

    make latency ARGS="--quick"
    python benchmark/latency.py --csv latency.csv    # in an environment with the package and ROS 2

The monitor runs as users start it, in a process of its own. This process publishes a pose at a
steady rate and takes the time until the closest points of that very pose arrive (their `stamp`
says so). In between, at the same rate and in the same run, it sends the same message to an echo: a
third process whose one rclpy callback publishes what it receives. No node could be faster. Message,
middleware and this process's own work are the same for both. This process looks for the stamp in
the answer as it arrives, serialised, so that neither time includes making Python objects of it.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SCENE = """\
version: 1
frame: world
unit: mm
rate_hz: 100
budget_ms: 4
thresholds: {warn: 20, stop: 2}
bodies:
  - {name: ground, primitive: {sphere: {radius: 100, subdivisions: 5}}, pose: {position: [0, 0, 0]}}
  - {name: probe, primitive: {sphere: {radius: 20, subdivisions: 3}}, moving: true}
"""
START_S = 240.0  # the first start on a machine compiles the kernels
LATE_S = 1.0  # an answer that takes longer is lost
TO_POINTS, BARE = "pose to closest points", "bare round trip"
POINTS, ECHOED = "proximity_monitor/closest_points", "echoed"
# A pose's stamp in the answer: as text from the monitor, and as serialised in a header.
AS_WRITTEN = {
    TO_POINTS: lambda seconds, nanoseconds: f"{seconds}.{nanoseconds:09d}".encode(),
    BARE: struct.Struct("<iI").pack,
}


def main() -> int:
    """Measure and print a table; return the exit code."""
    parser = argparse.ArgumentParser(
        description="Latency from a pose to its closest points, beside a bare round trip.",
        epilog="The targets are a median below 1 ms and a 99th percentile below 5 ms at 100 Hz.",
    )
    parser.add_argument("--quick", action="store_true", help="5 seconds instead of 30")
    parser.add_argument("--rate", type=float, default=100.0, metavar="HZ", help="poses per second")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write every latency to FILE")
    parser.add_argument("--echo", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.echo:
        return _echo()
    os.environ.update(
        ROS_DOMAIN_ID=str(random.SystemRandom().randint(1, 100)),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
    )
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.yaml"
        scene.write_text(SCENE, encoding="utf-8")
        node = Path(sys.prefix) / "lib" / "proximity_monitor" / "node"
        if not node.is_file():
            print(f"{node} does not exist: install the package first", file=sys.stderr)
            return 1
        quiet = ["--ros-args", "--log-level", "WARN"]
        processes = [
            subprocess.Popen([node, *quiet, "-p", f"scene:={scene}"]),
            subprocess.Popen([sys.executable, __file__, "--echo"]),
        ]
        try:
            taken = _measure(chosen.rate, 5.0 if chosen.quick else 30.0, processes)
        finally:
            for process in processes:
                process.send_signal(signal.SIGINT)
            for process in processes:
                try:
                    process.wait(10.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
    _print(taken, chosen.rate)
    if chosen.csv is not None:
        with chosen.csv.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["what", "latency_s"])
            writer.writerows((what, s) for what, each in taken.items() for s in each)
    return 0


def _measure(
    rate_hz: float, seconds: float, processes: list[subprocess.Popen]
) -> dict[str, list[float]]:
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import PoseStamped
    from rclpy.executors import SingleThreadedExecutor

    rclpy.init(args=[])
    node = rclpy.create_node("latency", start_parameter_services=False, enable_rosout=False)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    awaited, arrived = b"", math.nan

    def on_answer(data: bytes) -> None:
        nonlocal arrived
        if awaited in data:
            arrived = time.perf_counter()

    for kind, topic in ((DiagnosticArray, POINTS), (PoseStamped, ECHOED)):
        node.create_subscription(kind, topic, on_answer, 1, raw=True)
    publishers = {
        TO_POINTS: node.create_publisher(PoseStamped, "bodies/probe/pose", 1),
        BARE: node.create_publisher(PoseStamped, "to_echo", 1),
    }
    taken: dict[str, list[float]] = {what: [] for what in publishers}

    def send(what: str, angle: float) -> float | None:
        """Publish a pose, wait for its answer, and return the seconds; None if none came."""
        nonlocal awaited, arrived
        message = PoseStamped()
        message.header.frame_id = "world"
        message.header.stamp = node.get_clock().now().to_msg()
        place = message.pose.position
        place.x, place.y, place.z = 0.15 * np.cos(angle), 0.15 * np.sin(angle), 0.01
        stamp = message.header.stamp
        awaited, arrived = AS_WRITTEN[what](stamp.sec, stamp.nanosec), math.nan
        began = time.perf_counter()
        publishers[what].publish(message)
        while math.isnan(arrived):
            if time.perf_counter() - began > LATE_S:
                return None
            executor.spin_once(timeout_sec=0.1)
        return arrived - began

    try:
        deadline = time.perf_counter() + START_S
        for what in publishers:  # until each has answered once
            while send(what, 0.0) is None:
                if time.perf_counter() > deadline or any(p.poll() is not None for p in processes):
                    raise RuntimeError(f"no answer for the {what}")
        for i in range(int(seconds * rate_hz)):
            # Half a period apart, so that neither is slowed by the other's work.
            due = time.perf_counter()
            for what in publishers:
                latency = send(what, 2.0 * np.pi * i / (5.0 * rate_hz))
                taken[what].append(np.inf if latency is None else latency)
                due += 0.5 / rate_hz
                while (left := due - time.perf_counter()) > 0.0:
                    executor.spin_once(timeout_sec=left)
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return taken


def _echo() -> int:
    """Republish on one topic what arrives on another, until a signal; return the exit code."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.executors import ExternalShutdownException

    rclpy.init(args=[])
    node = rclpy.create_node("echo", start_parameter_services=False, enable_rosout=False)
    publisher = node.create_publisher(PoseStamped, ECHOED, 1)
    node.create_subscription(PoseStamped, "to_echo", publisher.publish, 1)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _print(taken: dict[str, list[float]], rate_hz: float) -> None:
    print(f"| ms, at {rate_hz:g} Hz | median | 90 % | 99 % | max | lost of |")
    print("| --- | --- | --- | --- | --- | --- |")
    for what, each in taken.items():
        times = np.array(each)
        got = times[np.isfinite(times)] * 1e3
        shares = np.percentile(got, (50, 90, 99, 100)) if len(got) else ()
        cells = " | ".join(f"{value:.3f}" for value in shares) or " | ".join(["lost"] * 4)
        print(f"| {what} | {cells} | {len(times) - len(got)} of {len(times)} |")


if __name__ == "__main__":
    sys.exit(main())
