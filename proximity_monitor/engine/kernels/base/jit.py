"""How every kernel of this package is compiled: the decorators and the announcement.

`entry` marks the few functions that Python calls: they are cached on disk. `kernel` marks their
helpers, which are compiled into the entries and need no cache of their own; the large ones that
several entries have in common are `shared`, and cached as well. `loop16` is `kernel` with the
fast-math flags that a vectorised loop over 16 lanes needs; it keeps NaN and infinity meaningful,
and whatever it computes is used as a bound only with a margin for reordered sums.

These run without numba's reference counts, which are atomic and took half the time of a query: each
use of an array out of a tuple of arrays counts up and down. They may not make arrays, but for small
ones on the stack (memory.py). What makes and returns arrays is an `allocating_entry`, and its
helpers `allocating`.
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
"""Taken for each call of LLVM; it tells those in `_cblist`."""

_PACKAGE = __package__.partition(".")[0] + "."

_NOWHERE = "not kept, for there is no place to write to: set NUMBA_CACHE_DIR to one"


class _Announcement(event.Listener):
    """Says once a process that it compiles: nobody likes half a minute of silence.

    Numba reports a compilation only after its cache had nothing, so a warm start is silent and
    pays nothing. It is a warning because `logging`, where nobody set it up, shows nothing less.
    """

    _made = False

    def on_start(self, start: event.Event) -> None:
        """Hear of a compilation, ours or another package's."""
        if not self._made and start.data["dispatcher"].py_func.__module__.startswith(_PACKAGE):
            self._made = True
            logging.getLogger(_PACKAGE + "engine").warning(
                "compiling proximity_monitor's kernels for this machine, once: half a minute in"
                " all; %s%s",
                f"kept in {CACHE_DIRECTORY}" if CACHE_DIRECTORY else _NOWHERE,
                f" (not used: {refused[0]})" if refused else "",
            )

    def on_end(self, end: event.Event) -> None:
        """Nothing is said of the end."""


event.register("numba:compile", _Announcement())


class _Undisturbed(event.Listener):
    """Lets Python look for no garbage while it compiles, which took a tenth of the time.

    Little of what the compiler makes is garbage before it is done. Nor does numba time the calls of
    LLVM for a kernel of ours: a hundred thousand, each of them for a dozen callers.
    """

    _depth, _enabled, _told = 0, False, None

    def on_start(self, start: event.Event) -> None:
        """Hear of a compilation: one may need others."""
        if self._depth == 0:
            self._enabled = gc.isenabled()
            gc.disable()
            if start.data["dispatcher"].py_func.__module__.startswith(_PACKAGE):
                self._told, _LLVM._cblist = _LLVM._cblist, []
        self._depth += 1

    def on_end(self, end: event.Event) -> None:
        """Go on as before when the outermost is done."""
        self._depth -= 1
        if self._depth > 0:
            return
        if self._told is not None:
            self._told, _LLVM._cblist = None, self._told
        if self._enabled:
            if gc.get_freeze_count() == 0:  # else somebody has frozen some, which stay so
                gc.freeze()  # all count as old from now on, without a look at each
                gc.unfreeze()
            gc.enable()


event.register("numba:compile", _Undisturbed())


# Each kernel says all of these. What it leaves open numba takes from the caller that it is compiled
# for first: a sum that a `loop16` needs would be reordered, in a proof that needs it as well.
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
    """Compile a function that Python calls and that makes arrays; else as `entry`."""
    return _entry(function, counted=True)


# What only other compiled code calls needs nothing that Python could call: a third of the time that
# compiling takes.
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
"""Compile into the caller's own code: where a call would pass dozens of array fields. LLVM does it;
numba's own inlining compiles each copy anew, and the code is a tenth slower."""

fused = _helper(_nrt=False, forceinline=True, fastmath={"contract"})
"""The same, where a product may be rounded together with the sum that it is a part of."""

inlined16 = _helper(_nrt=False, forceinline=True, fastmath=_FREE)
"""Compile into a `loop16`, which must see through it."""


def specialised(function, name, **constants):
    """The same function under another name, with constants of its own for some of its globals.

    Numba takes globals for constants, types among them, so a copy is compiled for these. A call
    with types for arguments would do the same, by one more function to compile.
    """
    copy = FunctionType(function.__code__, {**function.__globals__, **constants}, name)
    copy.__qualname__ = name  # by which its code is kept
    copy.__module__, copy.__doc__ = constants.get("__name__", function.__module__), function.__doc__
    return copy


def implements(stub, *kinds):
    """Let a kernel stand in for a stub where the first arguments are of these kinds.

    A kind is a NamedTuple type, or some of them; an argument is of that kind where it is one of
    these types or a value of it. Numba chooses when it compiles, so a choice costs nothing later.
    A stub is a function of this package that does nothing but say what it is for.

    It is `numba.extending.overload`, but for a kernel that is already there: of a function it would
    make another kernel around it, and have numba compile that as its own (see linking.py).
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
