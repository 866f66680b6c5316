"""Processes that compile ahead, side by side, what this one is going to need.

Numba compiles one kernel at a time in a process. So when the first kernel of those that
`engine/ahead.py` foresees has to be compiled, processes are started that compile the others, the
longest first, and keep them where this one looks for them (cache.py, claims.py). Whatever such a
process fails to do is done here. It says nothing, and ends when this one does.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from .claims import POSSIBLE

_MOST = 3
"""Processes: there is not work for more."""
_END_S = 1.0

_RUN = (
    "import sys; sys.path[:] = {}; from proximity_monitor.engine import ahead; ahead.work({!r}, {})"
)

_helpers: list[subprocess.Popen] = []
_begun = False

watching = False
"""Whether what a monitor needs is wanted, too."""


def begin(directory: Path) -> None:
    """Start the processes, if this has not been done and can be."""
    global _begun
    if _begun:
        return
    _begun = True
    processors = _processors()
    # This process often waits for a kernel that another compiles, which leaves a processor free.
    count = min(processors if watching else processors - 1, _MOST)
    if processors < 2 or not POSSIBLE or not _is_python():
        return
    # Of the same place, whichever it was chosen by.
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(directory.parents[1])}
    atexit.register(_end)
    with suppress(OSError, ValueError):
        for _ in range(count):
            _helpers.append(
                subprocess.Popen(
                    [sys.executable, "-c", _RUN.format(sys.path, str(directory), watching)],
                    stdin=subprocess.PIPE,  # which ends when this process does
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    env=environment,
                    start_new_session=True,  # Ctrl-C is for this process
                )
            )


def not_here() -> None:
    """Start none from this process."""
    global _begun
    _begun = True


def _processors() -> int:
    """How many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _is_python() -> bool:
    """Whether `sys.executable` is an interpreter, and no program into which one was built."""
    frozen = getattr(sys, "frozen", False)
    return not frozen and Path(sys.executable or "").name.lower().startswith("python")


def _end() -> None:
    """End the processes, which nobody needs any more."""
    for helper in _helpers:
        with suppress(OSError):
            helper.stdin.close()
    for helper in _helpers:
        try:
            helper.wait(_END_S)
        except subprocess.TimeoutExpired:
            helper.kill()
            helper.wait()
