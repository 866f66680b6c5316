"""How compiled kernels are put together: each helper is linked in once, and optimised where it is.

Numba would optimise every function with all that it calls, make machine code of both, and do so
again in each function that calls it: a kernel would take as long to compile as it is deep times
large. Here a helper is nothing but LLVM's code, as numba's front end writes it. A kernel that is
kept is a root: it is linked with all helpers below it, and then optimised and made machine code of.
Roots that are `shared` are not linked into others: these call the machine code that is there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Self
from zlib import crc32

from llvmlite import ir
from llvmlite.binding import ModuleRef, get_host_cpu_features, parse_bitcode
from numba import types
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.cpu_options import FastMathOptions
from numba.core.environment import lookup_environment
from numba.core.untyped_passes import ExtractByteCode

_OBJECTS = "_ZN08NumbaEnv"
"""How the names begin by which code finds its function's Python objects."""


_WIDE = '"prefer-vector-width"="512"'
_PROVEN = "avx512vbmi2"
"""Vectors of sixteen float32 in one register: a tenth of a query's time, a fifth of a long one's.
LLVM halves them, because the first processors that have such registers slow down as a whole where
they are used. Those with this feature, Ice Lake and Zen 4 and what came after, do not.
"""


class _Unset:
    """The code generator, but for what it does with machine code that is not there."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, *_: Any) -> None:
        """Leave a function's Python objects to the roots that it is linked into."""


class _Library(JITCodeLibrary):
    """A function's code, with the vectors that suit this processor."""

    def add_ir_module(self, ir_module: ir.Module) -> None:
        """Take what numba's front end made."""
        if get_host_cpu_features().get(_PROVEN):
            for function in ir_module.functions:
                if not function.is_declaration:
                    # llvmlite knows no attributes with values, and hands on what is in the set.
                    set.add(function.attributes, _WIDE)
        super().add_ir_module(ir_module)


class _Helper(_Library):
    """A function that is linked into roots."""

    def _optimize_functions(self, ll_module: ModuleRef) -> None:
        """Make them smaller, no more: the roots optimise them with all that they are linked with.

        LLVM takes a seventh less of the time than where it does all it can to both.
        """
        ll_module.data_layout = self._codegen._data_layout
        options = self._codegen._pass_builder(opt=1)
        passes = options.getFunctionPassManager()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, options)

    @property
    def codegen(self) -> Any:
        """The code generator."""
        return _Unset(self._codegen)

    def finalize(self) -> None:
        """Leave it as it is."""
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self) -> ModuleRef:
        """What is linked into a root: even where nothing there calls it yet."""
        self._ensure_finalized()
        return self._final_module

    def parts(self) -> tuple[list[tuple[str, str]], bytes] | None:
        """What it calls that is kept, as `kept_as` says of each; and its code, with all else.

        None where it cannot be kept.
        """
        if self._reload_init or self.has_dynamic_globals:
            return None
        code, needs = self._final_module.clone(), []
        own = {function.name for function in code.functions}
        for each in dict.fromkeys(self._linking_libraries):
            if hasattr(each, "kept_as"):
                needs.append(each.kept_as)
            elif type(each) is _Helper:
                return None
            else:  # numba's own, by a name that may mean something else in another process
                code.link_in(each._get_module_for_linking(), preserve=True)
        for function in code.functions:
            if not function.is_declaration and function.name not in own:
                function.linkage = "internal"
        return needs, code.as_bitcode()

    @classmethod
    def made_of(cls, codegen: Any, code: bytes, below: list[CodeLibrary]) -> Self:
        """The library of such code and of what it calls."""
        library = cls(codegen, cls.__name__)
        library._final_module = parse_bitcode(code)
        library._linking_libraries = below
        library._finalized = True
        return library

    def get_pointer_to_function(self, name: str) -> int:
        """No machine code."""
        self._ensure_finalized()
        return 0


class _Root(_Library):
    """A kernel with all helpers below it."""

    needs: tuple[tuple[str, str], ...] = ()
    """The roots that it calls, as `kept_as` says of each."""

    def finalize(self) -> None:
        """Link and optimise."""
        below = list(_below(self, set()))
        helpers = [each for each in below if type(each) is _Helper]
        others = [each for each in below if type(each) is not _Helper]
        self.needs = tuple(sorted({each.kept_as for each in others if hasattr(each, "kept_as")}))
        # Numba's own last: LLVM takes no code of them that nothing calls so far.
        others = [each for each in others if not hasattr(each, "kept_as")]
        self._linking_libraries = helpers + others
        self._helpers = {f.name for each in helpers for f in each.get_defined_functions()}
        super().finalize()
        for each in self._final_module.global_variables:
            if each.name.startswith(_OBJECTS) and (objects := lookup_environment(each.name)):
                self._codegen.set_env(each.name, objects)

    def _optimize_final_module(self) -> None:
        """Optimise. A helper is known to no other root, so what is called once is put in there."""
        for function in self._final_module.functions:
            if function.name in self._helpers:
                function.linkage = "internal"
        super()._optimize_final_module()


def kernel_of(target: Any, below: list[CodeLibrary], *kept: Any) -> CompileResult:
    """A kernel of what was kept of it; the machine code that it calls is there."""
    return CompileResult._rebuild(target, *kept)


def helper_of(
    target: Any, below: list[CodeLibrary], code: bytes, about: Any, environment: Any, signature: Any
) -> CompileResult:
    """A helper of its parts, as numba has one that it compiled."""
    library = _Helper.made_of(target.codegen(), code, below)
    return CompileResult(
        target_context=target, typing_context=target.typing_context, library=library,
        environment=environment, entry_point=target.get_executable(library, about, environment),
        fndesc=about, type_annotation="", signature=signature, objectmode=False, lifted=(),
        typing_error=None, call_helper=None, metadata=None, reload_init=(), referenced_envs=(),
    )  # fmt: skip


def _below(library: CodeLibrary, seen: set[int]) -> Iterator[CodeLibrary]:
    """What a library calls, and what the helpers among that call."""
    for each in library._linking_libraries:
        if id(each) in seen:
            continue
        seen.add(id(each))
        yield each
        if type(each) is _Helper:
            yield from _below(each, seen)


def _compiler(kind: type[JITCodeLibrary]) -> type[Compiler]:
    """Numba's compiler with a library of that kind."""

    class Made(Compiler):
        def __init__(self, typing: Any, target: Any, library: Any, *given: Any) -> None:
            library = kind(target.codegen(), kind.__name__)
            library.enable_object_caching()
            super().__init__(typing, target, library, *given)

        def compile_extra(self, function: Any) -> Any:
            """As numba does, but that a helper's code has the same name in all processes.

            The name tells the types of the arguments, but not the shapes of arrays in records. To
            tell functions apart all the same, numba counts them. Here the number is a digest.
            """
            if kind is not _Helper:
                return super().compile_extra(function)
            self.state.func_id = identity = FunctionIdentity.from_function(function)
            flags, args = self.state.flags, self.state.args
            options = sorted(flags.fastmath.flags), flags.forceinline, flags.nrt
            about = identity.modname, identity.func_qualname, args, options
            identity.unique_id = crc32(repr(about).encode())
            identity.unique_name = f"{identity.func_qualname}${identity.unique_id}"
            ExtractByteCode().run_pass(self.state)
            self.state.lifted, self.state.lifted_from = (), None
            return self._compile_bytecode()

    return Made


HELPER, ROOT = _compiler(_Helper), _compiler(_Root)
"""For `njit(pipeline_class=...)`."""


def _mangled(self: types.Record) -> tuple[str, tuple[int]]:
    """A record's part in the name of a function's code: numba's own is another in each process."""
    return type(self).__name__, (crc32(self.name.encode()),)


types.Record.mangling_args = property(_mangled)


def _encoded(self: FastMathOptions) -> str:
    """Options in the name of a function's code: the order of a set is another in each process."""
    return str(sorted(self.flags))


FastMathOptions.encode = _encoded
