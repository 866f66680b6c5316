"""How every kernel of this package is compiled: three decorators and one cache directory.

`entry` marks the few functions that Python calls: they are cached on disk. `kernel` marks their
helpers, which are compiled into the entries and need no cache of their own. `loop16` is `kernel`
with the fast-math flags that a vectorised loop over 16 lanes needs; it keeps NaN and infinity
meaningful, and whatever it computes is used as a bound only with a margin for reordered sums.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

import numba
from numba import njit


def _sources_digest() -> str:
    """Digest of all kernel sources: an edited helper must not leave a caller's cache stale."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _cache_directory() -> Path:
    """A writable directory of this version of the kernels; the installation may be read-only."""
    chosen = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    root = Path(chosen) if chosen else Path.home() / ".cache"
    name = f"kernels-{_sources_digest()}"
    for base in (root, Path(tempfile.gettempdir())):
        directory = base / "proximity_monitor" / name
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(directory, os.W_OK):
            return directory
    return Path(tempfile.mkdtemp(prefix="proximity_monitor-"))


CACHE_DIRECTORY = _cache_directory()


def entry(function):
    """Compile a function that Python calls: cached on disk, releases the GIL, no exceptions."""
    # Numba reads its cache directory when the decorator runs. It is set for that moment only,
    # so that other packages' functions keep the cache of their own choice.
    previous = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(CACHE_DIRECTORY)
    try:
        return njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = previous


kernel = njit(error_model="numpy")
"""Compile a helper of the entries."""

loop16 = njit(error_model="numpy", fastmath={"reassoc", "contract", "nsz", "arcp"})
"""Compile a branch-free loop over 16 lanes so that LLVM may vectorise it."""

inlined = njit(error_model="numpy", inline="always")
"""Compile into the caller's own code: where a call would pass dozens of array fields, or where a
loop over lanes must see through it. An exact query takes a fifth less time for it; compilation is
slower. Not for a loop that needs flags of its own: the caller's would apply."""
