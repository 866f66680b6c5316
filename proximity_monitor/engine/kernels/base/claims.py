"""Processes that need the same kernel at once: one compiles it, and the others wait.

A claim is a lock of a file beside the kernel's. The system lifts it when its process ends, however
that happens, so nobody waits for one that is no more.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Lock
from time import monotonic, sleep

try:
    import fcntl
except ImportError:  # not a POSIX system: every process compiles for itself
    fcntl = None

POSSIBLE = fcntl is not None
"""Whether this system has such locks."""

LONGEST_S = 120.0
"""Nobody waits any longer: the other process may have been stopped."""
_LOOK_S = 0.02

waiting: list[Callable[[], None]] = []
"""Called now and then by whoever waits, in its thread."""

writing = Lock()
"""Held while a kernel is being written."""

_claimed: dict[str, int] = {}


def claim(path: Path) -> bool:
    """Claim the kernel of a file, as soon as no other process has it; whether that took waiting.

    Where there can be no lock, or it takes too long, the kernel is nobody's.
    """
    lock = str(path) + ".lock"
    if not POSSIBLE or lock in _claimed:
        return False
    end, waited = monotonic() + LONGEST_S, False
    with suppress(OSError):
        number = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            while not _locked(number) and monotonic() < end:
                waited = True
                for each in waiting:
                    each()
                sleep(_LOOK_S)
            _claimed[lock] = number
        except BaseException:  # Ctrl-C
            os.close(number)
            raise
    return waited


def is_claimed(path: Path) -> bool:
    """Whether some process has a claim to the kernel of a file."""
    with suppress(OSError):
        number = os.open(str(path) + ".lock", os.O_RDWR | os.O_CLOEXEC)
        try:
            return not _locked(number)
        finally:
            os.close(number)
    return False


def release(path: Path) -> None:
    """Give a claim up, if there is one: the kernel is kept, or is not to be."""
    lock = str(path) + ".lock"
    if (number := _claimed.pop(lock, None)) is not None:
        with suppress(OSError):
            os.unlink(lock)
        os.close(number)


def _locked(number: int) -> bool:
    """Lock an open file, if nobody else has."""
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
