"""How compiled kernels are put together: each function is optimised, and made machine code of, once.

Numba would do both with every function and all that it calls, and again in each function that calls
it, so a kernel would take as long to compile as it is deep times large. Here a helper is nothing but
LLVM's code, as numba's front end writes it. A kernel that is kept is a root: it is linked with all
helpers below it, and then optimised. Of another root it knows the name alone: LLVM's engine finds
that by its symbol, which must be there before. So where a root is read from the cache, it first
calls for those that it needs, by numba's own list of what to do then (`reload_init`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any, NamedTuple

from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import Compiler

_ROOT = "root"
"""The name of a root's library, by which it is known when it was read from the cache, too."""


class Needed(NamedTuple):
    """Calls for a root: compiles it, or reads it from the cache, unless that has been done."""

    module: str
    name: str
    types: tuple[Any, ...]

    def __call__(self) -> None:
        """Call for it."""
        getattr(import_module(self.module), self.name).compile(self.types)


class _Unset:
    """The code generator, but for what it does with machine code that is not there."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, *_: Any) -> None:
        """Set what errors are raised with: roots do so with all that is linked into them."""


class _Helper(JITCodeLibrary):
    """A function that is linked into roots."""

    @property
    def codegen(self) -> Any:
        """The code generator."""
        return _Unset(self._codegen)

    def finalize(self) -> None:
        """Leave it as it is."""
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """No machine code."""
        self._ensure_finalized()
        return 0


class _Root(JITCodeLibrary):
    """A kernel with all helpers below it."""

    def finalize(self) -> None:
        """Link and optimise."""
        below = list(_below(self, set()))
        self._linking_libraries = [each for each in below if each.name != _ROOT]
        for each in below:
            self._reload_init |= each._reload_init
        super().finalize()


def _below(library: CodeLibrary, seen: set[int]) -> Iterator[CodeLibrary]:
    """The helpers that a library calls, and those that they call; of roots themselves alone."""
    for each in library._linking_libraries:
        if id(each) in seen:
            continue
        seen.add(id(each))
        yield each
        if type(each) is _Helper:
            yield from _below(each, seen)


def _compiler(kind: type[JITCodeLibrary], name: str) -> type[Compiler]:
    """Numba's compiler with a library of that kind."""

    class Made(Compiler):
        def __init__(self, typing: Any, target: Any, library: Any, *given: Any) -> None:
            library = kind(target.codegen(), name)
            library.enable_object_caching()
            super().__init__(typing, target, library, *given)

    return Made


HELPER = _compiler(_Helper, "helper")
"""For `njit(pipeline_class=...)`."""

ROOT = _compiler(_Root, _ROOT)


def needs(library: CodeLibrary, function: Callable, types: tuple[Any, ...]) -> None:
    """Let all that calls a root call for it when it is read from the cache."""
    library._reload_init.add(Needed(function.__module__, function.__qualname__, types))
