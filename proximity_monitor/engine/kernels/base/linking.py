"""How compiled kernels are linked: each helper is linked once into a kernel and optimised there.

Numba itself optimises each function together with everything it calls, generates machine code for
all of that, and repeats this in each caller. Compile time would grow with a kernel's size times its
call depth. Here a helper stays LLVM code, as numba's front end generates it. A kernel that is
cached as machine code is a root: it is linked with all helpers below it, then optimised, then
compiled to machine code. A `shared` root is not linked into other roots: these call its machine
code.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Self
from zlib import crc32

from llvmlite import ir
from llvmlite.binding import ModuleRef, get_host_cpu_features, parse_bitcode
from numba import types
from numba.core import typed_passes, untyped_passes
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import CodeLibrary, JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, CompileResult, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager
from numba.core.cpu_options import FastMathOptions
from numba.core.environment import lookup_environment

_OBJECTS = "_ZN08NumbaEnv"
"""Prefix of the global variables through which code finds its function's Python objects."""


_WIDE = '"prefer-vector-width"="512"'
_PROVEN = "avx512vbmi2"
"""CPU feature that permits sixteen float32 in one register, which saves a tenth of a query's time,
and a fifth of a long query's. By default LLVM splits such vectors in two, because the first
processors with 512-bit registers lower their clock when these are used. Processors with this
feature (Ice Lake, Zen 4 and later) do not.
"""


class _Unset:
    """The code generator, without the step that needs machine code: a helper has none."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, *_: Any) -> None:
        """Do nothing: each root that a helper is linked into sets the helper's Python objects."""


class _Library(JITCodeLibrary):
    """The code of a function, with the vector width that suits this processor."""

    def add_ir_module(self, ir_module: ir.Module) -> None:
        """Add a module that numba's front end made."""
        if get_host_cpu_features().get(_PROVEN):
            for function in ir_module.functions:
                if not function.is_declaration:
                    # llvmlite's `add` accepts no attribute with a value, but prints what the set
                    # holds.
                    set.add(function.attributes, _WIDE)
        super().add_ir_module(ir_module)


class _Helper(_Library):
    """A function that is linked into roots."""

    def _optimize_functions(self, ll_module: ModuleRef) -> None:
        """Simplify the functions only: roots optimise them after linking.

        This takes LLVM a seventh less time than full optimisation of both helpers and roots.
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
        """Mark the library as final without linking or optimising it."""
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self) -> ModuleRef:
        """Return the module to link into a root, even if nothing in the root calls it yet."""
        self._ensure_finalized()
        return self._final_module

    def parts(self) -> tuple[list[tuple[str, str]], bytes] | None:
        """Return what the cache stores of a helper, or None if it cannot be cached.

        These are the `kept_as` of each cached function that it calls, and its bitcode, linked with
        everything else that it calls.
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
            else:  # code of numba, whose name may mean something else in another process
                code.link_in(each._get_module_for_linking(), preserve=True)
        for function in code.functions:
            if not function.is_declaration and function.name not in own:
                function.linkage = "internal"
        return needs, code.as_bitcode()

    @classmethod
    def made_of(cls, codegen: Any, code: bytes, below: list[CodeLibrary]) -> Self:
        """Make a library from bitcode that `parts` returned and the libraries that it calls."""
        library = cls(codegen, cls.__name__)
        library._final_module = parse_bitcode(code)
        library._linking_libraries = below
        library._finalized = True
        return library

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: a helper has no machine code."""
        self._ensure_finalized()
        return 0


class _Root(_Library):
    """A kernel with all helpers below it."""

    needs: tuple[tuple[str, str], ...] = ()
    """The `kept_as` of each root that it calls."""

    def finalize(self) -> None:
        """Link the helpers into the root and optimise it."""
        below = list(_below(self, set()))
        helpers = [each for each in below if type(each) is _Helper]
        others = [each for each in below if type(each) is not _Helper]
        self.needs = tuple(sorted({each.kept_as for each in others if hasattr(each, "kept_as")}))
        # Numba's libraries come last: LLVM links only those of their functions that are called by
        # code linked before.
        others = [each for each in others if not hasattr(each, "kept_as")]
        self._linking_libraries = helpers + others
        self._helpers = {f.name for each in helpers for f in each.get_defined_functions()}
        super().finalize()
        if not self._compiled:  # see `_set_env_of_code`; LLVM returns code by a callback, too
            raise KeyboardInterrupt
        for each in self._final_module.global_variables:
            if each.name.startswith(_OBJECTS) and (objects := lookup_environment(each.name)):
                self._codegen.set_env(each.name, objects)

    def _optimize_final_module(self) -> None:
        """Optimise with the helpers internal: LLVM then inlines every helper called only once."""
        for function in self._final_module.functions:
            if function.name in self._helpers:
                function.linkage = "internal"
        super()._optimize_final_module()


def kernel_of(target: Any, below: list[CodeLibrary], *kept: Any) -> CompileResult:
    """Rebuild a kernel from its cached data; the machine code that it calls is already loaded."""
    return CompileResult._rebuild(target, *kept)


def helper_of(
    target: Any, below: list[CodeLibrary], code: bytes, about: Any, environment: Any, signature: Any
) -> CompileResult:
    """Rebuild a helper from its cached parts, in the form of a function that numba compiled."""
    library = _Helper.made_of(target.codegen(), code, below)
    return CompileResult(
        target_context=target, typing_context=target.typing_context, library=library,
        environment=environment, entry_point=target.get_executable(library, about, environment),
        fndesc=about, type_annotation="", signature=signature, objectmode=False, lifted=(),
        typing_error=None, call_helper=None, metadata=None, reload_init=(), referenced_envs=(),
    )  # fmt: skip


def _below(library: CodeLibrary, seen: set[int]) -> Iterator[CodeLibrary]:
    """Yield the libraries that a library calls, and those that helpers among them call."""
    for each in library._linking_libraries:
        if id(each) in seen:
            continue
        seen.add(id(each))
        yield each
        if type(each) is _Helper:
            yield from _below(each, seen)


NEEDLESS = {
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
    typed_passes.DumpParforDiagnostics,
}
"""Passes that kernels are compiled without. They are about closures, with statements, literals,
inlining by numba, and expressions of whole arrays. They take a twentieth of the time."""


def _compiler(kind: type[JITCodeLibrary]) -> type[Compiler]:
    """Return numba's compiler, made to use a library of that kind."""

    class Made(Compiler):
        def __init__(self, typing: Any, target: Any, library: Any, *given: Any) -> None:
            library = kind(target.codegen(), kind.__name__)
            library.enable_object_caching()
            super().__init__(typing, target, library, *given)

        def compile_extra(self, function: Any) -> Any:
            """Compile as numba does, but give a helper's code the same name in all processes.

            The name contains the argument types, but not the shapes of arrays in records. Numba
            adds a counter to distinguish such functions. Here a digest replaces the counter.
            """
            if kind is not _Helper:
                return super().compile_extra(function)
            self.state.func_id = identity = FunctionIdentity.from_function(function)
            flags, args = self.state.flags, self.state.args
            options = sorted(flags.fastmath.flags), flags.forceinline, flags.nrt
            about = identity.modname, identity.func_qualname, args, options
            identity.unique_id = crc32(repr(about).encode())
            identity.unique_name = f"{identity.func_qualname}${identity.unique_id}"
            untyped_passes.ExtractByteCode().run_pass(self.state)
            self.state.lifted, self.state.lifted_from = (), None
            return self._compile_bytecode()

        def define_pipelines(self) -> list[PassManager]:
            """Return numba's passes without those that change nothing in a kernel."""
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.passes = [each for each in passes.passes if each[0] not in NEEDLESS]
            passes.finalize()
            return [passes]

    return Made


HELPER, ROOT = _compiler(_Helper), _compiler(_Root)
"""Values for `njit(pipeline_class=...)`."""


def _mangled(self: types.Record) -> tuple[str, tuple[int]]:
    """Return a record type's part of a mangled function name; numba's own differs by process."""
    return type(self).__name__, (crc32(self.name.encode()),)


types.Record.mangling_args = property(_mangled)


def _encoded(self: FastMathOptions) -> str:
    """Return the options' part of a mangled function name, sorted: set order differs by process."""
    return str(sorted(self.flags))


FastMathOptions.encode = _encoded


_set_env = JITCPUCodegen.set_env


def _set_env_of_code(self: JITCPUCodegen, name: str, objects: Any) -> None:
    """Do as numba does, but raise KeyboardInterrupt if LLVM did not get the function's code.

    LLVM gets code from the cache by a callback to Python. If Ctrl-C comes in this callback, Python
    drops the exception, and LLVM goes on without the code. Numba would then write to address 0,
    which crashes the process. The function can be loaded again.
    """
    if not self._engine.get_global_value_address(name):
        raise KeyboardInterrupt
    _set_env(self, name, objects)


JITCPUCodegen.set_env = _set_env_of_code
