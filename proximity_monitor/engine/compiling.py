"""The compiler for code outside of the engine: Python calls an `entry`, an entry calls a `helper`.

Both decorators compile functions that may make arrays. Entries are cached where the engine's own
kernels are, in a directory that is writable even if the package's own is not. Numba notices if the
file of an entry changes, and the engine notices if its own kernels change. So the helpers and
constants of an entry must be in the file of the entry, or come from here: `cross` and `dot` are
products of vectors of three numbers.

`Progress` reports how many of the engine's kernels are compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from numba.core import event

from .kernels.base import ahead, claims
from .kernels.base.cache import DIRECTORIES, KernelCache, kernel_name
from .kernels.base.jit import allocating as helper
from .kernels.base.jit import allocating_entry as entry
from .kernels.base.vectors import cross, dot

__all__ = ["WATCHING", "Progress", "cross", "dot", "entry", "helper"]

WATCHING = frozenset(
    {
        "assembly.carry.place", "assembly.questions.begin_questions",
        "assembly.questions.signs_open", "assembly.questions.take_pairs",
        "assembly.schedule.commit", "assembly.schedule.pending",
        "assembly.schedule.query", "assembly.schedule.report", "assembly.schedule.update",
        "assembly.sweep.sweep", "base.motion.pose_deviation",
        "base.motion.relative_motion_pair", "base.tables._fill",
        "elements.primitives.measure_triangles",
        "inside.angles.surely_outside", "inside.ball._begin_bounding", "inside.ball._begin_cells",
        "inside.ball._bound_cell", "inside.ball._go_on", "inside.ball_begin.begin_ball",
        "inside.ball_kinds._plane_alike",
        "inside.ball_feet.write_ball", "inside.ball.search_ball",
        "inside.ball_caps._one_way",
        "inside.ball_caps._by_volumes", "inside.ball_caps.plane", "inside.ball_frame.common_box",
        "inside.ball_point.continue_depth", "inside.ball_rows.bound_of",
        "inside.ball_tangents.tangent", "inside.contain.look_for_part_in_mesh",
        "inside.contain.part_inside", "inside.contain.settle_signs",
        "inside.solids.connected_parts", "inside.solids.part_volumes",
        "inside.solids.unpaired_edges", "pairs.mesh_mesh.search", "search.descent.advance",
        "tree.build.build_tree", "tree.fit_tree.fit_tree", "tree.measure.measure",
        "tree.pairing.pair_up", "tree.welding.first_drawn", "tree.welding.first_equal",
        "tree.ranges.node_ranges",
    }
)  # fmt: skip
"""The kernels that watching a scene needs, by subpackage of `kernels`, file and function."""

_KERNELS = __package__ + ".kernels."


class Progress(event.Listener):
    """Counts the kernels that are compiled inside its `with` block: "7 of 19".

    The count includes needed kernels that another process has compiled and cached. Numba reports
    only kernels that its cache does not hold, so with a full cache `tell` is never called.

    Args:
        needed: names of kernels. Other kernels that are compiled meanwhile are added.
        tell: called as `tell(progress)` when a compilation begins and when it ends. While this
            process waits for another one that compiles a kernel, it is called now and then, in the
            waiting thread.

    Attributes:
        started: whether any kernel had to be compiled, here or by another process.
    """

    def __init__(
        self, needed: Collection[str], tell: Callable[[Progress], None] = lambda progress: None
    ) -> None:
        self._needed = set(needed)
        self._done: set[str] = set()
        self._tell = tell
        self.started = False

    def __str__(self) -> str:
        """Return the progress as text."""
        kept = {path.name.partition("-")[0] for each in DIRECTORIES for path in each.glob("*.nbc")}
        done = self._done | self._needed & kept
        return f"compiling kernels: {len(done)} of {len(self._needed)}"

    def __enter__(self) -> Progress:
        """Begin to count, and have the kernels compiled ahead if a scene is to be watched."""
        if self._needed >= WATCHING:
            ahead.want(ahead.WATCHING)
        event.register("numba:compile", self)
        claims.waiting.append(self._on_wait)
        return self

    def __exit__(self, *_: object) -> None:
        """Stop counting."""
        claims.waiting.remove(self._on_wait)
        event.unregister("numba:compile", self)

    def _on_wait(self) -> None:
        """Note that this process waits for a kernel that another process compiles."""
        self.started = True
        self._tell(self)

    def on_start(self, start: event.Event) -> None:
        """Note that the compilation of a kernel begins."""
        if name := _kernel(start):
            self.started = True
            self._needed.add(name)
            self._tell(self)

    def on_end(self, end: event.Event) -> None:
        """Note that the compilation of a kernel has ended."""
        if name := _kernel(end):
            self._done.add(name)
            self._tell(self)


def _kernel(compiling: event.Event) -> str:
    """Return the name of a cached kernel of the engine; empty for any other function."""
    dispatcher = compiling.data["dispatcher"]
    function = dispatcher.py_func
    ours = function.__module__.startswith(_KERNELS) and isinstance(dispatcher._cache, KernelCache)
    return kernel_name(function) if ours else ""
