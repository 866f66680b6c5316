"""Ends a program cleanly, and reports when its output cannot be written."""

from __future__ import annotations

import atexit
import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


def leave_with(code: int) -> int:
    """Make the process end without destroying any objects; return its exit code, `code`.

    When the libraries of the middleware and the compiler are unloaded, they still have threads and
    objects of each other. About one in a thousand processes crashed there, after all its work.

    The second reason is LLVM. Python handles a signal that comes during a call into LLVM when the
    call returns, before llvmlite has recorded what the call did. If the call linked one module into
    another, the linked module is then freed twice: the process crashes when the frame that holds it
    is destroyed. Hence an interrupted frame and its callers are kept until the end.
    """
    atexit.register(leave_now, code)  # runs before all earlier handlers, after the threads ended
    return code


def leave_now(code: int) -> None:
    """End the process here, without destroying anything; with code 1 if output is lost."""
    try:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
    except (OSError, SystemExit):
        code = 1
    os._exit(code)


@contextmanager
def checked_output(name: str) -> Iterator[None]:
    """End the program if its standard output cannot be written, as on a full disk.

    One line on standard error then names the program and the reason, and the exit code is 1. If
    the reader of a pipe has gone, as `head` does, no line is written, because that is no fault.

    The program ends by SystemExit, which no handler of file errors catches by mistake.
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
    """A program's standard output, which ends the program when a write fails."""

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
                leave_with(1)  # a normal exit would try to write again, and complain
                if error.errno != errno.EPIPE:
                    told = f"{self._program}: the output cannot be written: {error.strerror}\n"
                    with suppress(OSError):
                        os.write(2, told.encode())
            raise SystemExit(1) from None
