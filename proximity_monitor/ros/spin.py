"""Running nodes until they are told to stop."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

POLL_S = 0.1
"""How long an idle executor waits before it looks whether it should stop: Python's signal handlers
do not run while it waits."""

AGAIN_S = 0.2
"""After which time a signal interrupts computing that it did not end."""


class Stop:
    """Whether a signal asked to stop."""

    def __init__(self) -> None:
        """Begin with nothing asked."""
        self.asked = False
        self.by = ""
        """The signal's name."""

    def on_signal(self, number: int, *_: object) -> None:
        """Take a signal."""
        self.asked = True
        if number != signal.SIGALRM:
            self.by = signal.Signals(number).name
        if _computing:
            # And again soon: an import that is tried under `except BaseException` swallows it.
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S)
            raise KeyboardInterrupt


_current = Stop()
_computing = False


def asked_to_stop() -> bool:
    """Return whether a signal asked the program to end: then long work should end early."""
    return _current.asked


@contextmanager
def interruptible() -> Iterator[None]:
    """Let a signal end what runs here with KeyboardInterrupt, as it can take long.

    It must be pure computing: an exception in the middle of rclpy's or the middleware's code leaves
    that broken, so everywhere else a signal waits for the present callback to end.
    """
    global _computing
    if _current.asked:
        raise KeyboardInterrupt
    _computing = True
    try:
        yield
    except Exception as error:
        # The interrupt itself may come up as another error: numba's compiler and readers of files
        # take whatever is raised below them for a fault of their input.
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

    If it has a `name`, it says in a line that it ended so.

    rclpy's own handlers shut the context down under a callback that is still publishing; with these
    a tick ends first, and nodes can say goodbye. A process runs one such program at a time.
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
        sys.unraisablehook = complain
        gc.freeze()  # or Python looks through all objects once more, for half a second, to end
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, handler)


def _unraisable(complain: Callable[[Any], None], told: Any) -> None:
    """Say nothing of the interrupt where Python cannot raise it, as in a callback from C."""
    if not (_current.asked and issubclass(told.exc_type, KeyboardInterrupt)):
        complain(told)


def spin(nodes: Sequence[Node], stop: Stop, done: Callable[[], bool] | None = None) -> None:
    """Run the nodes' callbacks in this thread until a signal came or `done()` is true."""
    executor = SingleThreadedExecutor()
    # What is there now, half a million objects of numba most of all, stays to the end: a collection
    # that looks through it takes longer than many a tick.
    gc.collect()
    gc.freeze()
    try:
        for node in nodes:
            executor.add_node(node)
        while not stop.asked and not (done is not None and done()):
            executor.spin_once(timeout_sec=POLL_S)
    finally:
        executor.shutdown()
