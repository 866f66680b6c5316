"""The demo: monitor and player in one process, and a view of what the monitor publishes.

The view is a third node that subscribes to the monitor's topics like anybody else; it never looks
into the other two, so what it shows is what the interface carries.
"""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rich.console import Console
from rich.live import Live

from proximity_monitor import motion
from proximity_monitor.ros.node import ProximityMonitor
from proximity_monitor.ros.outputs import LATEST
from proximity_monitor.ros.player import ProximityPlayer
from proximity_monitor.ros.spin import ros, spin
from proximity_monitor.ros.table import Picture
from proximity_monitor.scene import load_scene
from proximity_monitor.scene.opening import find_scene

LIVE_PERIOD_S = 0.25
PLAIN_PERIOD_S = 1.0


class View(Node):
    """Subscribes to a monitor and shows its picture from time to time."""

    def __init__(self, picture: Picture, show: Callable[[], None], period_s: float) -> None:
        """Subscribe; `show` is called every `period_s` seconds once there are results."""
        super().__init__("proximity_demo")
        every_alert = QoSProfile(depth=1000)
        name = "/proximity_monitor"
        self.create_subscription(
            DiagnosticArray, f"{name}/closest_points", picture.take_points, LATEST
        )
        self.create_subscription(
            DiagnosticStatus, f"{name}/alerts", picture.take_alert, every_alert
        )
        self.create_subscription(DiagnosticArray, "/diagnostics", picture.take_diagnostics, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(period_s, lambda: show() if picture.results else None, clock=steady)


def run(scene: str, *, seconds: float | None = None, speed: float = 1.0) -> int:
    """Run the demo.

    Args:
        scene: a scene file with a motion, or the name of a bundled one.
        seconds: how long; None until SIGINT or SIGTERM.
        speed: seconds of motion in a second.

    Returns:
        The exit code: 1 if the scene cannot be used, or the monitor published nothing.
    """
    # Nobody else's network needs to see a demo.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    try:
        described = load_scene(find_scene(scene))
        picture = Picture(described.unit, motion.from_scene(described).describe())
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{described.path}: {len(described.bodies)} bodies, {len(described.pairs)} pairs")
    print("Starting ...", flush=True)
    with ros([]) as stop, ExitStack() as stack:
        try:
            nodes = _start(scene, speed, stack)
        except (OSError, ValueError) as error:
            print(error, file=sys.stderr)
            return 1
        view = _view(picture, stack)
        started = time.monotonic()
        ends = None if seconds is None else started + seconds
        spin([*nodes, view], stop, lambda: ends is not None and time.monotonic() >= ends)
        stack.close()
        if picture.results or not stop.asked:
            return _summary(picture, time.monotonic() - started)
    return 0  # interrupted while it started


def _start(scene: str, speed: float, stack: ExitStack) -> list[Node]:
    """Start monitor and player; only what stops them is logged, as the view shows the rest."""
    for name in ("proximity_monitor", "proximity_player"):
        set_logger_level(name, LoggingSeverity.FATAL)
    choice = Parameter("scene", value=scene)
    monitor = ProximityMonitor(parameter_overrides=[choice])
    stack.callback(monitor.destroy_node)
    if not monitor.start():
        raise ValueError("the monitor could not start")
    player = ProximityPlayer(parameter_overrides=[choice, Parameter("speed", value=speed)])
    stack.callback(player.destroy_node)
    return [monitor, player]


def _view(picture: Picture, stack: ExitStack) -> View:
    console = Console()
    if console.is_terminal:
        live = stack.enter_context(Live(console=console, auto_refresh=False))
        view = View(picture, lambda: live.update(picture.rich(), refresh=True), LIVE_PERIOD_S)
    else:
        view = View(picture, lambda: print(picture.plain(), flush=True), PLAIN_PERIOD_S)
    stack.callback(view.destroy_node)
    return view


def _summary(picture: Picture, took_s: float) -> int:
    if not picture.results:
        print(f"The monitor published nothing in {took_s:.1f} s.", file=sys.stderr)
        return 1
    count = Counter(alert.message.partition(":")[0] for alert in picture.alerts)
    changes = ", ".join(f"{n} x {change}" for change, n in sorted(count.items())) or "none"
    print(f"\n{took_s:.1f} s, {picture.results} results received; alerts: {changes}.")
    print("Smallest clearance of each pair in this session:")
    for row in picture.rows():
        print(f"  {row[0]}: {row[-1]} {picture.unit.symbol}")
    return 0
