"""The display as a program: `ros2 run proximity_monitor display`."""

from __future__ import annotations

import gc
import signal
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from proximity_monitor.display import serving
from proximity_monitor.display.holds import Holds
from proximity_monitor.display.inbox import Inbox
from proximity_monitor.display.node import ProximityDisplay
from proximity_monitor.display.pages import Pages
from proximity_monitor.ending import checked_output

FRAMES_HZ = 25.0
"""Minimum number of updates of the page per second."""

LEAST_S = 0.02
"""Minimum seconds from the start of an update for a tick to the next, however fast ticks come."""

FAREWELL_S = 1.0
"""Maximum seconds to wait until a player knows that nothing is held here any more."""

SWITCH_S = 0.001
"""Seconds for which a Python thread may keep the others waiting, a fifth of the default. A drag
passes through the threads of the server, of ROS and of the page."""

_IDLE_S = 0.1


def main(args: Sequence[str] | None = None) -> int:
    """Run the display until SIGINT, SIGTERM or a shutdown of ROS; return 1 if it cannot start."""
    with checked_output("proximity_display"):
        return _run(args)


def _run(args: Sequence[str] | None) -> int:
    stop = threading.Event()
    sys.setswitchinterval(SWITCH_S)
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, lambda *_: stop.set())
    inbox, holds = Inbox(), Holds()
    try:
        node = ProximityDisplay(inbox, holds)
    except ParameterException as error:
        print(f"proximity_display: {error}", file=sys.stderr)
        rclpy.try_shutdown()
        return 1
    try:
        server = serving.serve(node.host, node.port, "proximity monitor")
    except OSError as error:
        print(f"proximity_display: {node.host}:{node.port}: {error}", file=sys.stderr)
        node.destroy_node()
        rclpy.try_shutdown()
        return 1
    threads = ThreadPoolExecutor(1)
    spinning = threads.submit(_spin, node, holds, stop)
    try:
        pages = Pages(server, inbox, holds, node)
        _say_where(node, server)
        _frames(pages, inbox, stop)
    finally:
        stop.set()
        threads.shutdown()
        serving.stop(server)
        node.destroy_node()
        rclpy.try_shutdown()
    spinning.result()  # an error in the ROS thread ends the program with that error
    return 0


def _spin(node: ProximityDisplay, holds: Holds, stop: threading.Event) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stop.is_set() and rclpy.ok():
            executor.spin_once(timeout_sec=_IDLE_S)
        holds.release()
        until_s = time.monotonic() + FAREWELL_S
        while rclpy.ok() and not node.player_knows and time.monotonic() < until_s:
            executor.spin_once(timeout_sec=_IDLE_S)
    except ExternalShutdownException:
        pass
    finally:
        stop.set()
        executor.shutdown()


def _frames(pages: Pages, inbox: Inbox, stop: threading.Event) -> None:
    """Update the page as soon as a tick has come, and regularly without ticks."""
    # About a hundred thousand objects of libraries exist now and stay to the end. A garbage
    # collection that searches them takes as long as several ticks.
    gc.collect()
    gc.freeze()
    came = False
    while not stop.is_set():
        began = time.monotonic()
        pages.step()
        if came:  # wait only after a tick: a tick never waits because of a regular update
            stop.wait(began + LEAST_S - time.monotonic())
        came = inbox.wait(began + 1.0 / FRAMES_HZ - time.monotonic())


def _say_where(node: ProximityDisplay, server) -> None:
    port = server.get_port()
    if node.port not in (0, port):
        node.get_logger().warning(f"port {node.port} is taken: using {port}")
    if node.host not in serving.LOOPBACK:
        node.get_logger().warning(
            f"listening on {node.host}: there is no login, whoever reaches it can move the bodies"
        )
    host = f"[{node.host}]" if ":" in node.host else node.host
    print(f"display: http://{host}:{port}", flush=True)
