"""Worker processes that compile, in parallel, the kernels that this process is going to need.

Numba compiles one kernel at a time per process. Code that makes a model, watches a scene or is
about to compile a search calls `want` to announce this; `engine/ahead.py` knows which kernels it
takes. When the first kernel has to be compiled, this process starts the workers. They compile the
wanted kernels, the longest first, and store them in the cache where this process looks for them
(cache.py, claims.py). Later calls of `want` reach running workers, too. This process compiles
whatever a worker fails to compile. A worker prints nothing. It ends when it has been idle for a
while, or when this process ends.
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
"""Most workers: there is not enough work for more."""
_END_S = 1.0

_RUN = "import sys; sys.path[:] = {}; from proximity_monitor.engine import ahead; ahead.work({!r})"

WATCHING = "watching"
"""Name to `want` for the further kernels that a monitor needs."""

_wanted: list[str] = []
_told = 0
_helpers: list[subprocess.Popen] = []
_alone = False


def want(name: str) -> None:
    """Announce that the kernels listed under `name` in `engine/ahead.py` are going to be needed."""
    if name not in _wanted:
        _wanted.append(name)


def begin(directory: Path) -> None:
    """Send newly wanted names to the workers, starting these first if possible and necessary."""
    global _told
    names, _told = _wanted[_told:], len(_wanted)
    if _alone or not names:
        return
    living = [helper for helper in _helpers if helper.poll() is None] or _started(directory)
    for helper in living:
        with suppress(OSError):  # the worker has just ended
            helper.stdin.write("".join(f"{name}\n" for name in names).encode())
            helper.stdin.flush()


def _started(directory: Path) -> list[subprocess.Popen]:
    """Start workers, which wait for names, and return them; return none if workers cannot run."""
    processors = _processors()
    # A monitor often waits for a kernel that a worker compiles; that leaves a processor free.
    count = min(processors if WATCHING in _wanted else processors - 1, _MOST)
    if processors < 2 or not POSSIBLE or not _is_python():
        return []
    # The workers use the same cache root, whichever variable or default chose it.
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(directory.parents[1])}
    atexit.unregister(_end)
    atexit.register(_end)
    _helpers.clear()
    with suppress(OSError, ValueError):
        for _ in range(count):
            _helpers.append(
                subprocess.Popen(
                    [sys.executable, "-c", _RUN.format(sys.path, str(directory))],
                    stdin=subprocess.PIPE,  # closes when this process ends
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    env=environment,
                    start_new_session=True,  # Ctrl-C reaches only this process
                )
            )
    return _helpers


def not_here() -> None:
    """Forbid this process to start workers: it is one itself."""
    global _alone
    _alone = True


def _processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _is_python() -> bool:
    """Return whether `sys.executable` is a Python interpreter, not a program that contains one."""
    frozen = getattr(sys, "frozen", False)
    return not frozen and Path(sys.executable or "").name.lower().startswith("python")


def _end() -> None:
    """End the workers."""
    for helper in _helpers:
        with suppress(OSError):
            helper.stdin.close()
    for helper in _helpers:
        try:
            helper.wait(_END_S)
        except subprocess.TimeoutExpired:
            helper.kill()
            helper.wait()
