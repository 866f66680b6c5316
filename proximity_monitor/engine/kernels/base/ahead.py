"""Processes that compile ahead, side by side, what this one is going to need.

Numba compiles one kernel at a time in a process. Whoever makes a model, or watches a scene, says
with `want` what is likely to be asked; `engine/ahead.py` knows which kernels that takes. When the
first kernel has to be compiled, processes are started that compile those, the longest first, and
keep them where this one looks for them (cache.py, claims.py). They hear of what is wanted later,
too. Whatever such a process fails to do is done here. It says nothing, and ends when it has had
nothing to do for a while, or this one does.
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

_RUN = "import sys; sys.path[:] = {}; from proximity_monitor.engine import ahead; ahead.work({!r})"

WATCHING = "watching"
"""What a monitor wants besides."""

_wanted: list[str] = []
_told = 0
_helpers: list[subprocess.Popen] = []
_alone = False


def want(name: str) -> None:
    """Say that the kernels of that name in `engine/ahead.py` are going to be needed."""
    if name not in _wanted:
        _wanted.append(name)


def begin(directory: Path) -> None:
    """Have what is wanted compiled by other processes, if it can be."""
    global _told
    names, _told = _wanted[_told:], len(_wanted)
    if _alone or not names:
        return
    living = [helper for helper in _helpers if helper.poll() is None] or _started(directory)
    for helper in living:
        with suppress(OSError):  # it has just ended
            helper.stdin.write("".join(f"{name}\n" for name in names).encode())
            helper.stdin.flush()


def _started(directory: Path) -> list[subprocess.Popen]:
    """Processes that wait to be told what is wanted."""
    processors = _processors()
    # This process often waits for a kernel that another compiles, which leaves a processor free.
    count = min(processors if WATCHING in _wanted else processors - 1, _MOST)
    if processors < 2 or not POSSIBLE or not _is_python():
        return []
    # Of the same place, whichever it was chosen by.
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(directory.parents[1])}
    atexit.unregister(_end)
    atexit.register(_end)
    _helpers.clear()
    with suppress(OSError, ValueError):
        for _ in range(count):
            _helpers.append(
                subprocess.Popen(
                    [sys.executable, "-c", _RUN.format(sys.path, str(directory))],
                    stdin=subprocess.PIPE,  # which ends when this process does
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    env=environment,
                    start_new_session=True,  # Ctrl-C is for this process
                )
            )
    return _helpers


def not_here() -> None:
    """Start none from this process."""
    global _alone
    _alone = True


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
