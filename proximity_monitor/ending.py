"""How a program ends: in good order, and with a word where its output cannot be written."""

from __future__ import annotations

import atexit
import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


def leave_with(code: int) -> int:
    """Have the process end without destroying what is left; returns the exit code that it gets.

    The libraries of middleware and compiler still have threads and objects of each other when they
    are unloaded: of a thousand processes that had done all their work about one crashed there.

    And Python handles a signal that comes during a call into LLVM when that call returns, before
    llvmlite has noted what it did. A module that was linked into another is then freed twice: the
    process crashes when the frame that holds it goes. So a cut frame is kept until the end, and
    with it those that called it.
    """
    atexit.register(leave_now, code)  # called first of all, when the threads have ended
    return code


def leave_now(code: int) -> None:
    """End the process here, without destroying anything; with 1 where output is lost."""
    try:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
    except (OSError, SystemExit):
        code = 1
    os._exit(code)


@contextmanager
def checked_output(name: str) -> Iterator[None]:
    """End the program where its standard output cannot be written, as on a full disk.

    One line on the standard error says so, with the program's name, and the exit code is 1. Where
    the reader has gone, as `head` does, there is no line: that is no fault.

    What is raised is SystemExit, which no handler of errors in files takes for one of its own.
    """
    before = sys.stdout
    if before is not None and before is sys.__stdout__:  # else it is captured, or checked already
        raw = _Output(name, before.fileno())
        sys.stdout = io.TextIOWrapper(
            raw if before.write_through else io.BufferedWriter(raw),
            encoding=before.encoding,
            errors=before.errors,
            line_buffering=before.line_buffering,
            write_through=before.write_through,
        )
    try:
        yield
    finally:
        if sys.stdout is not None:
            sys.stdout.flush()


class _Output(io.FileIO):
    """The standard output of a program of that name."""

    def __init__(self, program: str, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._program = program
        self._failed = False

    def write(self, data) -> int | None:
        """Write bytes, or say why that is impossible and end the program."""
        try:
            return super().write(data)
        except OSError as error:
            if not self._failed:
                self._failed = True
                leave_with(1)  # Python itself would try again, and complain
                if error.errno != errno.EPIPE:
                    told = f"{self._program}: the output cannot be written: {error.strerror}\n"
                    with suppress(OSError):
                        os.write(2, told.encode())
            raise SystemExit(1) from None
