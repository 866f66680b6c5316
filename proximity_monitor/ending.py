"""How a program of nodes ends."""

from __future__ import annotations

import atexit
import os
import sys


def leave_with(code: int) -> int:
    """Have the process end without destroying what is left; returns the exit code that it gets.

    The libraries of middleware and compiler still have threads and objects of each other when they
    are unloaded: of a thousand processes that had done all their work about one crashed there.

    And Python handles a signal that comes during a call into LLVM when that call returns, before
    llvmlite has noted what it did. A module that was linked into another is then freed twice: the
    process crashes when the frame that holds it goes. So a cut frame is kept until the end, and
    with it those that called it.
    """
    atexit.register(_leave, code)  # called first of all, when the threads have ended
    return code


def _leave(code: int) -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
