"""The disk cache of compiled kernels.

A file holds the machine code of one kernel for one set of argument types, or the LLVM bitcode of
one helper. Its name contains a digest of everything that the code depends on. A file is not used if
another user could have written it, or if its checksum is wrong. The kernel is then compiled again.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import pickle
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property, lru_cache
from pathlib import Path
from typing import BinaryIO
from zlib import crc32

import numba
from numba import types
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from . import ahead, claims
from .addressed import Addressed
from .linking import helper_of, kernel_of

_KERNELS = Path(__file__).parents[1]
_PACKAGE = __package__.partition(".")[0] + "."
_CHECK = 4
"""Bytes of the checksum at the beginning of a file."""

_OPTIONS = (
    "OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "EXTEND_VARIABLE_LIFETIMES", "LOOP_VECTORIZE",
    "SLP_VECTORIZE", "DISABLE_INTEL_SVML", "LLVM_REFPRUNE_PASS",
)  # fmt: skip
"""Numba's settings that change the generated code. For example, a kernel compiled for a profiler
takes a third longer, and no other process should load it."""

refused: list[str] = []
"""Files and directories that were found but not used, and why."""


@lru_cache
def _digest(source: Path) -> str:
    return hashlib.sha256(source.read_bytes()).hexdigest()


def _sources_digest() -> str:
    """Return a digest of all kernel sources.

    An edited helper, or an edited constant compiled into a caller, must not leave the caller's
    cached code stale.
    """
    sources = sorted(_KERNELS.rglob("*.py"))
    named = "".join(f"{source.relative_to(_KERNELS)}{_digest(source)}" for source in sources)
    return hashlib.sha256(named.encode()).hexdigest()[:16]


def _trusted(status: os.stat_result) -> bool:
    """Return whether only this user and root can have written the file or directory."""
    if os.name != "posix":
        return True
    return status.st_uid in (os.geteuid(), 0) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _roots() -> Iterator[tuple[Path, bool]]:
    """Yield possible cache roots, and for each whether another user could have made it first."""
    chosen = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    # A user may have neither HOME nor a passwd entry; a machine may have no temporary directory.
    with suppress(RuntimeError):
        yield (Path(chosen) if chosen else Path.home() / ".cache") / "proximity_monitor", False
    with suppress(FileNotFoundError):
        user = os.geteuid() if os.name == "posix" else os.environ.get("USERNAME", "")
        yield Path(tempfile.gettempdir()) / f"proximity_monitor-{user}", True


def _ours(root: Path) -> bool:
    """Make `root` in a shared directory if it is missing.

    Return whether it belongs to this user alone and is not a symbolic link.
    """
    root.mkdir(mode=0o700, exist_ok=True)
    status = root.lstat()
    ours = stat.S_ISDIR(status.st_mode) and _trusted(status)
    return ours and (os.name != "posix" or status.st_uid == os.geteuid())


def _directories() -> tuple[list[Path], Path | None]:
    """Return the directories to read this version's kernels from, in order; and the one to write.

    The latter is None if there is no safe directory to write to.
    """
    found = []
    for root, shared in _roots():
        directory = root.absolute() / f"kernels-{KERNELS}"
        try:
            safe = not shared or _ours(root)
            if safe:
                directory.mkdir(mode=0o755, parents=True, exist_ok=True)
                safe = _trusted(directory.stat())
        except OSError:
            continue
        if not safe:
            refused.append(f"{root}: others may write there")
            continue
        found.append(directory)
        if os.access(directory, os.R_OK | os.W_OK | os.X_OK):
            return found, directory
    return found, None


KERNELS = _sources_digest()
"""Version of the kernels: a digest of their sources."""

DIRECTORIES, CACHE_DIRECTORY = _directories()
"""The directories to read from, for example a read-only one of an installation; and the directory
to write to, or None. The latter is also the last to be read."""


_present: dict[str, CompileResult] = {}
"""Code that this process has compiled or loaded, by file name."""


def _note(name: str, compiled: CompileResult) -> None:
    """Record compiled code as present.

    Also store its file name and symbol as `kept_as`, by which its callers refer to it in the cache.
    """
    _present[name] = compiled
    compiled.library.kept_as = name, compiled.fndesc.mangled_name


def kernel_name(function) -> str:
    """Return the name of a kernel: its subpackage, module and function."""
    return ".".join([*function.__module__.split(".")[-2:], function.__qualname__])


class _Cache:
    """The cache of one function, with the interface that numba's dispatcher expects.

    Numba's own cache raises on a broken file, and reads nothing from a directory that it cannot
    write to.
    """

    _suffix: str

    def __init__(self, function, options: Mapping[str, object]) -> None:
        self._function, self._options = function, options
        self._label = kernel_name(function)
        self.cache_path = None if CACHE_DIRECTORY is None else str(CACHE_DIRECTORY)

    @cached_property  # lazy: there are hundreds of functions, and a process may compile none
    def _about(self):
        function, options = self._function, self._options
        source = _digest(Path(inspect.getfile(function)))
        versions = numba.__version__, sys.implementation.cache_tag, sys.abiflags
        own = tuple(sorted((key, _in_order(options[key])) for key in options))
        return function.__module__, function.__qualname__, source, versions, own

    def _name(self, signature, codegen) -> str:
        options = [getattr(numba.config, option, None) for option in _OPTIONS]
        about = repr((self._about, options, signature, codegen.magic_tuple()))
        return f"{self._label}-{hashlib.sha256(about.encode()).hexdigest()[:32]}{self._suffix}"

    @classmethod
    def _load(cls, name, target):
        """Load the code in the file of this name and all code that it calls; None if it fails."""
        for directory in DIRECTORIES:
            try:
                with (directory / name).open("rb") as file:
                    needs, rebuilt, content = _read(file, name)
                below = []
                for needed, symbol in needs:  # LLVM aborts the process if a symbol is missing
                    found = _present.get(needed) or cls._load(needed, target)
                    if found is None or found.fndesc.mangled_name != symbol:
                        return None
                    below.append(found.library)
                found = rebuilt(target, below, *content)
                _note(name, found)
                return found
            except FileNotFoundError:
                continue
            except Exception as error:  # a broken file can raise anything
                refused.append(f"{directory / name}: {error or type(error).__name__}")
        return None

    @staticmethod
    def _write(name, data: bytes) -> None:
        """Write the data of a function to the file of this name."""
        # A kernel that cannot be written is still usable here, so a full disk is no error.
        with claims.writing, suppress(OSError):
            CACHE_DIRECTORY.mkdir(mode=0o755, parents=True, exist_ok=True)
            number, temporary = tempfile.mkstemp(dir=CACHE_DIRECTORY)
            try:
                with open(number, "wb") as file:
                    file.write(_checksum(data, name) + data)
                os.chmod(temporary, 0o644)
                os.replace(temporary, CACHE_DIRECTORY / name)
            except BaseException:
                os.unlink(temporary)
                raise

    def flush(self) -> None:
        """Do nothing: kernels are recompiled only after a source change, under other names."""


class KernelCache(_Cache):
    """The cache of a kernel that is stored as machine code."""

    obtained = 0
    """How many kernels this process has compiled or loaded so far."""

    _suffix = ".nbc"

    def load_overload(self, signature, target):
        """Return the code compiled for a signature, or None if this process has to compile it."""
        if _is_foreign(signature):
            return None
        target.refresh()
        name = self._name(signature, target.codegen())
        kept = self._load(name, target)
        if kept is None and CACHE_DIRECTORY is not None:
            if not self._label.startswith("base."):  # kernels of `base` are small and independent
                ahead.begin(CACHE_DIRECTORY)
            if claims.claim(CACHE_DIRECTORY / name):
                kept = self._load(name, target)
            if kept is not None:
                claims.release(CACHE_DIRECTORY / name)
        KernelCache.obtained += kept is not None
        return kept

    def is_wanting(self, signature, target) -> bool:
        """Return whether the kernel is neither in the cache nor being compiled by any process."""
        name = self._name(signature, target.codegen())
        kept = any((directory / name).exists() for directory in DIRECTORIES)
        return not kept and not claims.is_claimed(CACHE_DIRECTORY / name)

    def save_overload(self, signature, compiled) -> None:
        """Store compiled code in the cache, if possible."""
        KernelCache.obtained += 1
        if _is_foreign(signature):
            return
        name = self._name(signature, compiled.codegen)
        _note(name, compiled)
        if CACHE_DIRECTORY is None:
            return
        if not compiled.library.has_dynamic_globals:
            self._write(name, dumps((compiled.library.needs, kernel_of, compiled._reduce())))
        claims.release(CACHE_DIRECTORY / name)


class HelperCache(_Cache):
    """The cache of a helper: code that other processes link into their kernels.

    These processes compile other kernels that need the helper, at the same time or later. No
    process waits for a helper, because compiling it takes no longer than waiting.
    """

    _suffix = ".part"

    def load_overload(self, signature, target):
        """Return the code compiled for a signature, here or elsewhere, or None if there is none."""
        target.refresh()
        name = self._name(signature, target.codegen())
        return _present.get(name) or self._load(name, target)

    def save_overload(self, signature, compiled) -> None:
        """Store compiled code in the cache, if possible."""
        parts = compiled.library.parts()
        if CACHE_DIRECTORY is None or parts is None or _is_foreign(signature):
            return
        needs, code = parts
        name = self._name(signature, compiled.codegen)
        _note(name, compiled._replace(metadata=None))  # else numba would time it once more
        compiled.fndesc.typemap = compiled.fndesc.calltypes = None  # numba's own cache does this
        about = compiled.fndesc, compiled.environment, compiled.signature
        self._write(name, dumps((needs, helper_of, (code, *about))))


def _in_order(option: object) -> str:
    return repr(sorted(option) if isinstance(option, set) else option)


def _is_foreign(kinds: Iterable[types.Type]) -> bool:
    """Return whether a type comes from another package: its code may change without notice here."""
    for kind in kinds:
        made = getattr(kind, "instance_class", None)
        if made is not None and not made.__module__.startswith(_PACKAGE):
            return True
        inner = [each.kind for each in kind.fields.values()] if isinstance(kind, Addressed) else ()
        if _is_foreign(inner or getattr(kind, "types", ())):
            return True
    return False


def _checksum(data: bytes | memoryview, name: str) -> bytes:
    """Return the checksum of a file's data and name, so that a renamed file does not match."""
    return crc32(data, crc32(name.encode())).to_bytes(_CHECK, "little")


def _read(file: BinaryIO, name: str) -> tuple:
    """Return the content of an open cache file.

    Raises PermissionError if others may have written it, ValueError if its checksum is wrong.
    """
    if not _trusted(os.fstat(file.fileno())):
        raise PermissionError("others may have written it")
    content = memoryview(file.read())
    if _checksum(content[_CHECK:], name) != content[:_CHECK]:
        raise ValueError("broken")
    return pickle.loads(content[_CHECK:])
