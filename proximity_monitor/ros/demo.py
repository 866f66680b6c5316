"""The demo: monitor and player in one process, and a view of the monitor's topics.

The view is a third node, which subscribes to the monitor's topics like any other. It never reaches
into the other two, so it shows exactly what the interface carries.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from threading import Thread

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rich.console import Console
from rich.live import Live

from proximity_monitor import motion
from proximity_monitor.engine import compiling
from proximity_monitor.ros.node import ProximityMonitor
from proximity_monitor.ros.page_process import PageProcess, can_show_page
from proximity_monitor.ros.player import ProximityPlayer
from proximity_monitor.ros.qos import LATEST
from proximity_monitor.ros.spin import interruptible, ros, spin
from proximity_monitor.ros.table import Picture
from proximity_monitor.scene import Scene, load_scene
from proximity_monitor.scene.naming import counted
from proximity_monitor.scene.opening import find_scene

LIVE_PERIOD_S = 0.25
PLAIN_PERIOD_S = 1.0

READ_PERIOD_S = 0.05
"""Least time between two results that are read, seconds; others are only counted. A monitor may
publish at 1 kHz, and Python takes a tenth of a millisecond to unpack a few pairs."""

ROWS = 20
"""How many pairs are listed if the output is no terminal, whose height would decide."""

MANY = 10
"""From this number of moving bodies on, one message carries all poses, because a process receives
some 3,000 messages a second, whatever they contain."""

FIRST_S = 20.0
"""How long a demo with a time limit waits for its first picture, seconds."""


class View(Node):
    """Subscribes to a monitor and shows its results from time to time."""

    def __init__(self, picture: Picture, show: Callable[[], None], period_s: float) -> None:
        """Subscribe; `show` is called every `period_s` seconds once the picture is ready."""
        super().__init__("proximity_demo")
        self._picture = picture
        self._show = show
        self._unread: bytes | None = None
        self._read_at = -math.inf
        every_alert = QoSProfile(depth=1000)
        name = "/proximity_monitor"
        self.create_subscription(
            DiagnosticArray, f"{name}/closest_points", self._take, LATEST, raw=True
        )
        self.create_subscription(
            DiagnosticStatus, f"{name}/alerts", picture.take_alert, every_alert
        )
        self.create_subscription(DiagnosticArray, "/diagnostics", picture.take_diagnostics, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(period_s, self._on_timer, clock=steady)

    def read(self) -> None:
        """Bring the picture up to date."""
        if self._unread is not None:
            self._picture.take_points(deserialize_message(self._unread, DiagnosticArray))
            self._unread = None
            self._read_at = time.monotonic()

    def _take(self, message: bytes) -> None:
        self._picture.results += 1
        self._unread = message
        if time.monotonic() - self._read_at >= READ_PERIOD_S:
            self.read()

    def _on_timer(self) -> None:
        if self._picture.ready:
            self.read()
            self._show()


def run(scene: str, *, seconds: float | None = None, speed: float = 1.0, page: bool = True) -> int:
    """Run the demo.

    Args:
        scene: a scene file with a motion, or the name of a bundled one.
        seconds: how long to run after the first picture; None: until SIGINT or SIGTERM.
        speed: seconds of motion in a second.
        page: whether the page in the browser is served as well.

    Returns:
        The exit code: 1 if the scene cannot be used, the motion failed, or the monitor published
        nothing.
    """
    # A demo is of no use to others on the network.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    console = Console()
    ended = False
    with ros([], "proximity_monitor demo") as stop, ExitStack() as stack:
        try:
            described = load_scene(find_scene(scene))
            with _progress(), interruptible():
                moves = motion.from_scene(described, live=True, stopped=lambda: ended or stop.asked)
        except (OSError, ValueError) as error:
            print(error, file=sys.stderr)
            return 1
        picture = Picture(described.unit, "; ".join(moves.describe().splitlines()))
        bodies = counted(len(described.bodies), "body", "bodies")
        print(f"{described.path}: {bodies}, {counted(len(described.pairs), 'pair', 'pairs')}")
        print(f"{picture.what_runs}\nStarting ...", flush=True)
        if page:
            _serve_page(console, stack)
        try:
            with _progress():
                nodes = _start(described, moves, speed, stack)
        except (OSError, ValueError) as error:
            print(error, file=sys.stderr)
            return 1
        monitor, player = nodes
        view = _view(picture, console, stack)
        started, allowed = time.monotonic(), math.inf if seconds is None else seconds
        watched: float | None = None  # the time of the first picture
        played = False

        def over() -> bool:
            nonlocal watched
            if watched is None and picture.ready:
                watched = time.monotonic()
            since = started + FIRST_S if watched is None else watched
            return ended or time.monotonic() >= since + allowed

        def play() -> None:
            nonlocal ended, played
            try:
                spin([player], stop, lambda: over() or player.finished)
                played = not player.fault
            finally:  # end the watch as well, also after an error, which the thread prints
                ended = True

        # In its own thread, because a motion that takes long to compute must not delay the watch.
        playing = Thread(target=play)
        playing.start()
        try:
            spin([monitor, view], stop, over)
        finally:
            ended = True
            playing.join()
        view.read()
        stack.close()
        if told := player.fault or moves.trouble:
            print(told, file=sys.stderr)
        if not played:
            return 1
        if picture.results or not stop.asked:
            return _summary(picture, time.monotonic() - (watched or started))
    return 0  # interrupted while it started


def _progress() -> compiling.Progress:
    """Return a context that prints the progress of compiling."""
    said = ""

    def tell(progress: compiling.Progress) -> None:
        nonlocal said
        if str(progress) != said:
            said = str(progress)
            print(said, flush=True)

    return compiling.Progress(compiling.WATCHING, tell)


def _start(scene: Scene, moves: motion.Motion, speed: float, stack: ExitStack) -> list[Node]:
    """Start and return monitor and player; they log fatal errors only: the view shows the rest."""
    for name in ("proximity_monitor", "proximity_player"):
        set_logger_level(name, LoggingSeverity.FATAL)
    moving = {body.name for body in scene.bodies if body.topic is not None}
    bulk = len(moving) >= MANY and moving <= set(moves.bodies)
    choice = Parameter("scene", value=str(scene.path))
    monitor = ProximityMonitor(
        parameter_overrides=[choice, Parameter("body_topics", value=not bulk)]
    )
    stack.callback(monitor.destroy_node)
    if not monitor.start():
        raise ValueError("the monitor could not start")
    player = ProximityPlayer(
        moves,
        parameter_overrides=[
            choice,
            Parameter("speed", value=speed),
            Parameter("bulk", value=bulk),
        ],
    )
    stack.callback(player.destroy_node)
    return [monitor, player]


def _serve_page(console: Console, stack: ExitStack) -> None:
    """Start the page; its lines go through the console, which keeps the live table intact."""

    def say(line: str) -> None:
        console.print(line, markup=False, highlight=False, soft_wrap=True)

    if can_show_page():
        stack.callback(PageProcess(say).stop)
    else:
        say("No page in the browser: it needs viser (pip install '.[display]' in the checkout)")


def _view(picture: Picture, console: Console, stack: ExitStack) -> View:
    if console.is_terminal:
        live = stack.enter_context(Live(console=console, auto_refresh=False))
        view = View(
            picture,
            lambda: live.update(picture.rich(console.height), refresh=True),
            LIVE_PERIOD_S,
        )
    else:
        view = View(picture, lambda: print(picture.plain(ROWS), flush=True), PLAIN_PERIOD_S)
    stack.callback(view.destroy_node)
    return view


def _summary(picture: Picture, took_s: float) -> int:
    if not picture.results:
        print(f"The monitor published nothing in {took_s:.1f} s.", file=sys.stderr)
        return 1
    results = counted(picture.results, "result", "results")
    print(f"\n{took_s:.1f} s, {results} received; alerts: {len(picture.alerts)}.")
    for line in picture.changes():
        print(f"  {line}")
    print("Smallest clearance of each pair in this session, nearest first:")
    for name, least in picture.minima(ROWS):
        print(f"  {name}: {least} {picture.unit.symbol}")
    return 0
