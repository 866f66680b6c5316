"""Claims on kernels: if several processes need the same one, one compiles it and the others wait.

A claim is a lock on a file beside the kernel's file. The system releases the lock when the process
ends, however that happens. So nobody waits for a process that no longer exists.
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
except ImportError:  # not a POSIX system: every process compiles all its kernels itself
    fcntl = None

POSSIBLE = fcntl is not None
"""Whether this system has file locks."""

LONGEST_S = 120.0
"""Longest wait for a claim, seconds: the process that holds it may have been suspended."""
_LOOK_S = 0.02

waiting: list[Callable[[], None]] = []
"""Functions that a waiting thread calls now and then."""

writing = Lock()
"""Held while a kernel is being written."""

_claimed: dict[str, int] = {}


def claim(path: Path) -> bool:
    """Wait until no other process claims the kernel file, then claim it; return whether it waited.

    If locks are impossible, or the wait takes too long, return without a lock.
    """
    lock = str(path) + ".lock"
    if not POSSIBLE or lock in _claimed:
        return False
    end, waited = monotonic() + LONGEST_S, False
    with suppress(OSError):
        number = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            while not (mine := _locked(number)) and monotonic() < end:
                waited = True
                for each in waiting:
                    each()
                sleep(_LOOK_S)
            if mine:
                _claimed[lock] = number
            else:
                os.close(number)
        except BaseException:  # Ctrl-C
            os.close(number)
            raise
    return waited


def is_claimed(path: Path) -> bool:
    """Return whether some process claims the kernel file."""
    with suppress(OSError):
        number = os.open(str(path) + ".lock", os.O_RDWR | os.O_CLOEXEC)
        try:
            return not _locked(number)
        finally:
            os.close(number)
    return False


def release(path: Path) -> None:
    """Release the claim on a kernel file, if there is one: the kernel is stored, or will not be."""
    lock = str(path) + ".lock"
    if (number := _claimed.pop(lock, None)) is not None:
        with suppress(OSError):
            os.unlink(lock)
        os.close(number)


def _locked(number: int) -> bool:
    """Lock an open file if no other process has; return whether it is locked now."""
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
