"""Runs nodes until they are told to stop."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from proximity_monitor.ending import leave_with

POLL_S = 0.1
"""How long an idle executor waits before it checks whether it should stop: Python's signal handlers
do not run while it waits."""

AGAIN_S = 0.2
"""Seconds after which a signal interrupts a computation once more if it still runs."""


class Stop:
    """Whether a signal asked to stop."""

    def __init__(self) -> None:
        """Begin without a signal."""
        self.asked = False
        self.by = ""
        """The signal's name."""
        self.cut: list[FrameType | None] = []
        """The frames of computations that signals interrupted. They are kept, so that nothing in
        them is ever destroyed: see `leave_with`."""

    def on_signal(self, number: int, frame: FrameType | None) -> None:
        """Take a signal."""
        self.asked = True
        if number != signal.SIGALRM:
            self.by = signal.Signals(number).name
        if _computing:
            # Interrupt again soon, because an import under `except BaseException` swallows it.
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S)
            self.cut.append(frame)
            raise KeyboardInterrupt


_current = Stop()
_computing = False


def asked_to_stop() -> bool:
    """Return whether a signal asked the program to end: long work should then end early."""
    return _current.asked


@contextmanager
def interruptible() -> Iterator[None]:
    """Let a signal end the long computation in this context with KeyboardInterrupt.

    It must be pure computation: an exception in the middle of rclpy's or the middleware's code
    leaves these in a broken state. Everywhere else a signal waits until the present callback ends.
    """
    global _computing
    if _current.asked:
        raise KeyboardInterrupt
    _computing = True
    try:
        yield
    except Exception as error:
        # The interrupt may arrive as another error: numba's compiler and the file readers report
        # whatever is raised below them as an error in their input.
        if _current.asked:
            raise KeyboardInterrupt from error
        raise
    finally:
        _computing = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    if _current.asked:
        raise KeyboardInterrupt  # it was swallowed


@contextmanager
def ros(args: Sequence[str] | None = None, name: str = "") -> Iterator[Stop]:
    """Initialise rclpy for a program that SIGINT and SIGTERM end without an error.

    If `name` is given, a line says which signal ended the program. rclpy's own handlers shut the
    context down while a callback still publishes. With the handlers here, a tick ends first, and
    nodes can clean up. A process runs one such program at a time.
    """
    global _current
    stop = _current = Stop()
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    kinds = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
    before = [signal.signal(kind, stop.on_signal) for kind in kinds]
    complain, sys.unraisablehook = sys.unraisablehook, partial(_unraisable, sys.unraisablehook)
    try:
        yield stop
    except KeyboardInterrupt:
        stop.asked = True
    finally:
        rclpy.try_shutdown()
        if stop.asked and name:
            print(f"{name}: ended by {stop.by}", file=sys.stderr, flush=True)
        if not stop.asked:
            sys.unraisablehook = complain
        if stop.cut:
            leave_with(0)
        gc.freeze()  # else Python searches all objects once more at exit, for half a second
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, handler)


def _unraisable(complain: Callable[[Any], None], told: Any) -> None:
    """Report an error that cannot be raised, unless a signal asked to stop.

    An interrupt causes two kinds of such errors: the interrupt itself, if Python cannot raise it,
    as in a callback from C; and failures of destructors, even at exit, of objects whose
    constructors were interrupted, such as llvmlite's.
    """
    if not _current.asked:
        complain(told)


def spin(nodes: Sequence[Node], stop: Stop, done: Callable[[], bool] | None = None) -> None:
    """Run the nodes' callbacks in this thread until a signal comes or `done()` is true."""
    executor = SingleThreadedExecutor()
    # All objects that exist now, half a million of them numba's, stay to the end. Freeze them,
    # because a collection that searches them can take longer than a tick.
    gc.collect()
    gc.freeze()
    try:
        for node in nodes:
            executor.add_node(node)
        while not stop.asked and not (done is not None and done()):
            executor.spin_once(timeout_sec=POLL_S)
    finally:
        executor.shutdown()
