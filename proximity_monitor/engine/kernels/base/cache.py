"""Where compiled kernels are kept from one process to the next, and what is taken from there.

A file holds the machine code of one kernel for one set of argument types, or LLVM's code of one
helper, and its name is a digest of all that this depends on. Nothing is taken for code that
somebody else could have written, nor what does not come out as it was written: such a kernel is
compiled anew.
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
"""Numba's settings that make other code. A kernel that was made for a profiler, and takes a third
longer, is for no other process."""

refused: list[str] = []
"""What was found but not taken, and why."""


@lru_cache
def _digest(source: Path) -> str:
    return hashlib.sha256(source.read_bytes()).hexdigest()


def _sources_digest() -> str:
    """Digest of all kernel sources: an edited helper must not leave a caller's cache stale.

    Nor must an edited constant, which is compiled into them.
    """
    sources = sorted(_KERNELS.rglob("*.py"))
    named = "".join(f"{source.relative_to(_KERNELS)}{_digest(source)}" for source in sources)
    return hashlib.sha256(named.encode()).hexdigest()[:16]


def _trusted(status: os.stat_result) -> bool:
    """Whether nobody but this user and the system's administrator can have written there."""
    if os.name != "posix":
        return True
    return status.st_uid in (os.geteuid(), 0) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _roots() -> Iterator[tuple[Path, bool]]:
    """Where kernels may be kept, and whether others could have made that place before us."""
    chosen = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    # A user may have neither a HOME nor an entry among the users, a machine nothing temporary.
    with suppress(RuntimeError):
        yield (Path(chosen) if chosen else Path.home() / ".cache") / "proximity_monitor", False
    with suppress(FileNotFoundError):
        user = os.geteuid() if os.name == "posix" else os.environ.get("USERNAME", "")
        yield Path(tempfile.gettempdir()) / f"proximity_monitor-{user}", True


def _ours(root: Path) -> bool:
    """Whether a directory among those of all users is ours alone, no link; made where missing."""
    root.mkdir(mode=0o700, exist_ok=True)
    status = root.lstat()
    ours = stat.S_ISDIR(status.st_mode) and _trusted(status)
    return ours and (os.name != "posix" or status.st_uid == os.geteuid())


def _directories() -> tuple[list[Path], Path | None]:
    """Where this version's kernels are read from, in this order, and where they are written to."""
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
"""Which version of the kernels this is."""

DIRECTORIES, CACHE_DIRECTORY = _directories()
"""A directory that is only read, as of an installation, and the one that is written to, if any."""


_present: dict[str, CompileResult] = {}
"""What this process has compiled or loaded, by the names of files."""


def _note(name: str, compiled: CompileResult) -> None:
    """Note what is present, and how kernels that call it tell of it: its file and its symbol."""
    _present[name] = compiled
    compiled.library.kept_as = name, compiled.fndesc.mangled_name


def kernel_name(function) -> str:
    """A kernel's name by its room, file and function."""
    return ".".join([*function.__module__.split(".")[-2:], function.__qualname__])


class _Cache:
    """What is kept of one function, as numba's dispatcher asks for it.

    Numba's own dies of a broken file, and takes nothing from where it cannot write.
    """

    _suffix: str

    def __init__(self, function, options: Mapping[str, object]) -> None:
        self._function, self._options = function, options
        self._label = kernel_name(function)
        self.cache_path = None if CACHE_DIRECTORY is None else str(CACHE_DIRECTORY)

    @cached_property  # there are hundreds, of which a process may compile none
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
        """What a file of that name holds, with all that it calls."""
        for directory in DIRECTORIES:
            try:
                with (directory / name).open("rb") as file:
                    needs, rebuilt, content = _read(file, name)
                below = []
                for needed, symbol in needs:  # LLVM ends the process where code is not there
                    found = _present.get(needed) or cls._load(needed, target)
                    if found is None or found.fndesc.mangled_name != symbol:
                        return None
                    below.append(found.library)
                found = rebuilt(target, below, *content)
                _note(name, found)
                return found
            except FileNotFoundError:
                continue
            except Exception as error:  # of whatever kind: what is broken breaks anywhere
                refused.append(f"{directory / name}: {error or type(error).__name__}")
        return None

    @staticmethod
    def _write(name, data: bytes) -> None:
        """Keep the data of a function in a file of that name."""
        # Kernels that could not be kept are there all the same: a full disk is no error.
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
        """Kernels are compiled anew only where their sources changed, hence under other names."""


class KernelCache(_Cache):
    """The cache of a kernel that is kept as machine code."""

    _suffix = ".nbc"

    def load_overload(self, signature, target):
        """What was compiled for a signature; None where that is to be done here."""
        if _is_foreign(signature):
            return None
        target.refresh()
        name = self._name(signature, target.codegen())
        kept = self._load(name, target)
        if kept is None and CACHE_DIRECTORY is not None:
            if not self._label.startswith("base."):  # where small ones are that stand alone
                ahead.begin(CACHE_DIRECTORY)
            if claims.claim(CACHE_DIRECTORY / name):
                kept = self._load(name, target)
            if kept is not None:
                claims.release(CACHE_DIRECTORY / name)
        return kept

    def is_wanting(self, signature, target) -> bool:
        """Whether a kernel is neither kept nor being compiled by any process."""
        name = self._name(signature, target.codegen())
        kept = any((directory / name).exists() for directory in DIRECTORIES)
        return not kept and not claims.is_claimed(CACHE_DIRECTORY / name)

    def save_overload(self, signature, compiled) -> None:
        """Keep what was compiled, if that is possible."""
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

    They compile another part of the same at the same time, or what else needs it later. Nobody
    waits for a helper: to compile it takes no longer.
    """

    _suffix = ".part"

    def load_overload(self, signature, target):
        """What was compiled for a signature, here or elsewhere; None where that is to be done."""
        target.refresh()
        name = self._name(signature, target.codegen())
        return _present.get(name) or self._load(name, target)

    def save_overload(self, signature, compiled) -> None:
        """Keep what was compiled, if that is possible."""
        parts = compiled.library.parts()
        if CACHE_DIRECTORY is None or parts is None or _is_foreign(signature):
            return
        needs, code = parts
        name = self._name(signature, compiled.codegen)
        _note(name, compiled._replace(metadata=None))  # numba would time it once more
        compiled.fndesc.typemap = compiled.fndesc.calltypes = None  # as it does with its own
        about = compiled.fndesc, compiled.environment, compiled.signature
        self._write(name, dumps((needs, helper_of, (code, *about))))


def _in_order(option: object) -> str:
    return repr(sorted(option) if isinstance(option, set) else option)


def _is_foreign(kinds: Iterable[types.Type]) -> bool:
    """Whether any types are of another package's making: it may change its kernels unnoticed."""
    for kind in kinds:
        made = getattr(kind, "instance_class", None)
        if made is not None and not made.__module__.startswith(_PACKAGE):
            return True
        inner = [each.kind for each in kind.fields.values()] if isinstance(kind, Addressed) else ()
        if _is_foreign(inner or getattr(kind, "types", ())):
            return True
    return False


def _checksum(data: bytes | memoryview, name: str) -> bytes:
    """Of data in a file of that name: under another it is not what was written there."""
    return crc32(data, crc32(name.encode())).to_bytes(_CHECK, "little")


def _read(file: BinaryIO, name: str) -> tuple:
    """What stands in a file."""
    if not _trusted(os.fstat(file.fileno())):
        raise PermissionError("others may have written it")
    content = memoryview(file.read())
    if _checksum(content[_CHECK:], name) != content[:_CHECK]:
        raise ValueError("broken")
    return pickle.loads(content[_CHECK:])
