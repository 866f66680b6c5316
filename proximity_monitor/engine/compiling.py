"""The compiler for other rooms: `entry` marks what Python calls, `helper` what an entry calls.

Both may make arrays. Entries are kept where the engine's own kernels are, in a place that can be
written even where the package cannot. Numba notices a change of the file in which an entry stands,
and of no other: its helpers and the constants that they use belong there, too.
"""

from __future__ import annotations

from .kernels.jit import allocating as helper
from .kernels.jit import allocating_entry as entry

__all__ = ["entry", "helper"]
