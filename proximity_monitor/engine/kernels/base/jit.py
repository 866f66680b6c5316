"""How every kernel of this package is compiled: the decorators and the announcement.

`entry` marks the few functions that Python calls; their machine code is cached on disk. `kernel`
marks a helper, which is linked into each entry that calls it; its LLVM code is cached. `shared`
marks a large helper that several entries call; it is compiled once, and cached like an entry (and
if it is `lazy`, only when a search first calls it; see lazy.py).
`loop16` is `kernel` with the fast-math flags that LLVM needs to vectorise a loop over 16 lanes. NaN
and infinity keep their meaning in it. Its results serve as bounds only with a margin that covers
reordered sums.

All of these run without numba's reference counts. The counts are atomic, and each use of an array
out of a tuple of arrays increments and decrements one: that took half the time of a query. So these
kernels must not allocate arrays, except small ones on the stack (memory.py). A function that makes
and returns arrays is an `allocating_entry`, and its helpers are `allocating`.
"""

from __future__ import annotations

import gc
import logging
from types import FunctionType

from llvmlite.binding import ffi
from numba import njit, types
from numba.core import event
from numba.core.typing.templates import infer, infer_global, make_overload_template

from .cache import CACHE_DIRECTORY, HelperCache, KernelCache, refused
from .linking import HELPER, ROOT
from .sooner import widened

_LLVM = ffi.lib._lock
"""llvmlite's lock, held during each call of LLVM. It notifies the callbacks in its `_cblist`."""

_PACKAGE = __package__.partition(".")[0] + "."

_NOWHERE = "not kept, for there is no place to write to: set NUMBA_CACHE_DIR to one"


class _Announcement(event.Listener):
    """Logs once per process that kernels are being compiled, as this may take half a minute.

    Numba reports a compilation only after a cache miss, so a warm start is silent and costs
    nothing. The message is a warning because `logging` shows no lower level by default.
    """

    _made = False

    def on_start(self, start: event.Event) -> None:
        """Log the message at the first compilation of a function of this package."""
        if not self._made and start.data["dispatcher"].py_func.__module__.startswith(_PACKAGE):
            self._made = True
            logging.getLogger(_PACKAGE + "engine").warning(
                "compiling proximity_monitor's kernels for this machine, once: half a minute in"
                " all; %s%s",
                f"kept in {CACHE_DIRECTORY}" if CACHE_DIRECTORY else _NOWHERE,
                f" (not used: {refused[0]})" if refused else "",
            )

    def on_end(self, end: event.Event) -> None:
        """Do nothing."""


event.register("numba:compile", _Announcement())


class _Undisturbed(event.Listener):
    """Disables Python's garbage collector during compilation, where it took a tenth of the time.

    Little of what the compiler makes becomes garbage before it ends. For kernels of this package,
    numba's timing callbacks are disabled as well: they run in a hundred thousand calls of LLVM, a
    dozen each.
    """

    _depth, _enabled, _told = 0, False, None

    def on_start(self, start: event.Event) -> None:
        """Disable them when the outermost compilation starts: one may start others."""
        if self._depth == 0:
            self._enabled = gc.isenabled()
            gc.disable()
            if start.data["dispatcher"].py_func.__module__.startswith(_PACKAGE):
                self._told, _LLVM._cblist = _LLVM._cblist, []
        self._depth += 1

    def on_end(self, end: event.Event) -> None:
        """Restore them when the outermost compilation ends."""
        self._depth -= 1
        if self._depth > 0:
            return
        if self._told is not None:
            self._told, _LLVM._cblist = None, self._told
        if self._enabled:
            if gc.get_freeze_count() == 0:  # else other code has frozen objects, which must stay so
                gc.freeze()  # moves all objects to the oldest generation without visiting each
                gc.unfreeze()
            gc.enable()


event.register("numba:compile", _Undisturbed())


# Each kernel sets all of these options. Numba takes an unset option from the caller for which the
# kernel is compiled first. A helper of a `loop16` would then reorder its sums also when a proof
# calls it.
_OWN = {"error_model": "numpy", "fastmath": False, "forceinline": False}


def _entry(function, counted, wrapped=True):
    compiled = njit(
        nogil=True,
        no_cpython_wrapper=not wrapped,
        no_cfunc_wrapper=True,
        _nrt=counted,
        pipeline_class=ROOT,
        **_OWN,
    )(function)
    compiled._cache = KernelCache(function, compiled.targetoptions)
    return widened(compiled)


def entry(function):
    """Compile a function that Python calls: cached on disk, releases the GIL, no exceptions."""
    return _entry(function, counted=False)


def shared(function):
    """Compile a helper that several entries call, once for all of them: cached like an entry."""
    return _entry(function, counted=False, wrapped=False)


def allocating_entry(function):
    """Compile a function that Python calls and that makes arrays; otherwise like `entry`."""
    return _entry(function, counted=True)


# Only compiled code calls a helper, so it gets no wrapper for Python: wrappers take a third of the
# compile time.
def _helper(**own):
    options = _OWN | own
    compiler = njit(
        no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=HELPER, **options
    )

    def helper(function):
        compiled = compiler(function)
        compiled._cache = HelperCache(function, compiled.targetoptions)
        return widened(compiled)

    return helper


kernel = _helper(_nrt=False)
"""Compile a helper of the entries."""

allocating = _helper()
"""Compile a helper of the allocating entries that makes arrays itself."""

_FREE = {"reassoc", "contract", "nsz", "arcp"}

loop16 = _helper(_nrt=False, fastmath=_FREE)
"""Compile a branch-free loop over 16 lanes so that LLVM may vectorise it."""

inlined = _helper(_nrt=False, forceinline=True)
"""Compile a helper that LLVM inlines, because a call would pass dozens of array fields. Numba's own
inlining compiles each copy again, and its code is a tenth slower."""

fused = _helper(_nrt=False, forceinline=True, fastmath={"contract"})
"""Like `inlined`, but LLVM may contract a product and the sum it is part of to one rounding. So it
errs by no more than its margin, which is for two roundings."""

inlined16 = _helper(_nrt=False, forceinline=True, fastmath=_FREE)
"""Compile a helper that is inlined into a `loop16`, so that the loop can still be vectorised."""


def specialised(function, name, **constants):
    """Return a copy of a function with another name, and with `constants` replacing some globals.

    Numba treats globals, including types, as constants. So it compiles each copy for its own
    constants. Passing types as arguments would do the same, but needs one more compiled function.
    """
    copy = FunctionType(function.__code__, {**function.__globals__, **constants}, name)
    copy.__qualname__ = name  # the cache identifies its code by this
    copy.__module__, copy.__doc__ = constants.get("__name__", function.__module__), function.__doc__
    return copy


def implements(stub, *kinds):
    """Decorate a kernel so that it replaces a stub if the first arguments are of these kinds.

    A stub is a function of this package that has only a docstring. A kind is a NamedTuple type or a
    tuple of such types. An argument is of that kind if it is one of the types, or a value of one.
    Numba chooses when it compiles, so the choice costs nothing at run time.

    This is `numba.extending.overload` for an existing kernel. `overload` would wrap the function in
    another kernel and have numba compile that with its own pipeline (see linking.py).
    """

    def fits(argument, kind):
        own = getattr(argument, "instance_class", None)
        return own in kind if type(kind) is tuple else own is kind

    def register(kernel):
        def build(self, key, args, kws):
            found = all(map(fits, args, kinds))
            self._impl_cache[key] = (kernel, args) if found else (None, None)
            return self._impl_cache[key]

        template = make_overload_template(stub, kernel.py_func, {}, False, "never")
        template._build_impl = build
        infer(template)
        infer_global(stub, types.Function(template))
        return kernel

    return register
