"""Changes to numba that save two fifths of its compile time.

- Numba compiles a kernel once for each integer literal in a call, and for each integer size. No
  kernel needs that: LLVM propagates constants when it inlines a call.
- It compares its options so often that reading them takes noticeable time.
- It tries dozens of overloads for each `+` and each array element; kernels have thousands.
- After each pass it computes the live variables of each block, which no kernel uses, and inserts
  the end of each variable's life, which only reference counting uses.
- It has LLVM parse a module whenever it needs the size of a type.
- It asks its registries and its own functions the same questions thousands of times, often by
  raising and catching an error, and prepares a message for each error that may come.
"""

from __future__ import annotations

import functools
import operator
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any
from weakref import WeakSet

from llvmlite import ir
from numba import types
from numba.core import base, errors, lowering, typeinfer
from numba.core import ir as numba_ir
from numba.core.compiler import Flags
from numba.core.postproc import PostProcessor, VariableLifetime
from numba.core.transforms import canonicalize_cfg
from numba.core.types.functions import BaseFunction
from numba.core.typing.context import BaseContext

_KERNELS = __package__.rpartition(".")[0] + "."

_UNCOUNTED: WeakSet = WeakSet()
"""Functions whose kernels do not count references."""


def widened(compiled: Any) -> Any:
    """Make a kernel take every signed integer argument as int64; return the kernel."""
    if not compiled.targetoptions.get("_nrt", True):
        _UNCOUNTED.add(compiled.py_func)
    ask = compiled.get_call_template

    def get_call_template(args: Any, kws: dict[str, Any]) -> Any:
        return ask([_wide(each) for each in args], {key: _wide(kws[key]) for key in kws})

    compiled.get_call_template = get_call_template
    return compiled


def _wide(kind: types.Type) -> types.Type:
    if isinstance(kind, types.IntegerLiteral) or (isinstance(kind, types.Integer) and kind.signed):
        return types.int64
    return types.boolean if isinstance(kind, types.BooleanLiteral) else kind


_DEFAULTS = {name: option.default for name, option in Flags.options.items()}


def _values(flags: Flags) -> dict[str, Any]:
    """Return all options by name. Numba's own `Flags.values` reads them one by one."""
    return {**_DEFAULTS, **flags._values}


Flags.values = _values


_OPERATORS = {vars(operator)[name] for name in operator.__all__} | {abs, bool, max, min}
_PLAIN = types.Number, types.Boolean, types.Array
_look_up = BaseFunction.get_call_type


def _get_call_type(self: BaseFunction, context: Any, args: tuple, kws: dict[str, Any]) -> Any:
    """Return the signature of a call; for an operator on numbers and arrays, from a cache.

    A signature is cached only if numba implements it with built-in code, which depends on the types
    alone. If numba compiles a function for it (for some cases of `max`), that function depends on
    the options of the caller.
    """
    if kws or self.typing_key not in _OPERATORS:
        return _look_up(self, context, args, kws)
    if not all(isinstance(each, _PLAIN) for each in args):
        return _look_up(self, context, args, kws)
    known = vars(self).setdefault("_known", {})
    if (found := known.get((context, args))) is None:
        found = _look_up(self, context, args, kws)
        if self.get_impl_key(found) is self.typing_key:
            known[context, args] = found
    return found


BaseFunction.get_call_type = _get_call_type


_post_process = PostProcessor.run


def _run(self: PostProcessor, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Prepare a function's code for the next pass, without computing live variables by block.

    Only generators and object mode need these, and no kernel is either. The end of a variable's
    life is marked only in kernels that count references. LLVM finds it by itself.
    """
    code = self.func_ir
    if code.is_generator or not code.func_id.modname.startswith(_KERNELS):
        _post_process(self, emit_dels, extend_lifetimes)
        return
    code.blocks = canonicalize_cfg(code.blocks)
    code.variable_lifetime = VariableLifetime(code.blocks)
    code.generator_info = None
    if emit_dels and code.func_id.func not in _UNCOUNTED:
        self._insert_var_dels(extend_lifetimes=extend_lifetimes)


PostProcessor.run = _run


_measure = base.BaseContext.get_abi_sizeof


def _size(self: base.BaseContext, kind: ir.Type) -> int:
    """Return the size of a type in bytes, from a cache.

    Numba asks this for each variable. The text of a type is a sufficient key unless it contains a
    named type (`%`).
    """
    text = str(kind)
    if "%" in text:
        return _measure(self, kind)
    known = vars(self).setdefault("_sizes", {})
    if text not in known:
        known[text] = _measure(self, kind)
    return known[text]


base.BaseContext.get_abi_sizeof = _size


_LITERALS = types.Literal.ctor_map


def _literal(value: Any) -> types.Literal | None:
    """Return the literal type of a value, or None if there is none."""
    make = _LITERALS.get(type(value))
    return None if make is None else make(value)


def _literal_or_omitted(value: Any) -> types.Type:
    """Return the literal type of a value, or else its `Omitted` type."""
    return _literal(value) or types.Omitted(value)


types.maybe_literal = _literal
lowering._lit_or_omitted = _literal_or_omitted


def _variables(self: numba_ir.Inst, held: Any) -> list[numba_ir.Var]:
    """Return the variables in an operand of an instruction; there is mostly one or none."""
    kind = type(held)
    if kind is numba_ir.Var:
        return [held]
    if kind is dict:
        held = held.values()
    elif kind is not list and kind is not tuple:
        return held.list_vars() if isinstance(held, numba_ir.Inst) else []
    return [variable for each in held for variable in self._rec_list_vars(each)]


numba_ir.Inst._rec_list_vars = _variables


_implementation = base.BaseContext.get_function


def _get_function(
    self: base.BaseContext, function: Any, signature: Any, _firstcall: bool = True
) -> Any:
    """Return the implementation of a function.

    At every access, numba asks for the `__array__` conversion of an array. No such implementation
    exists, and numba would refresh all registries to find that out. So raise its error at once.
    """
    if function == "__array__" and type(signature.args[0]) in (types.Array, types.NestedArray):
        raise NotImplementedError(function)
    return _implementation(self, function, signature, _firstcall)


base.BaseContext.get_function = _get_function
base._has_loc = functools.lru_cache(base._has_loc)


_load = base.BaseContext.refresh


def _refresh(self: base.BaseContext) -> None:
    """Load what was registered since the last time, if anything was."""
    if _registered(self) != vars(self).get("_taken_up"):
        _load(self)
        self._taken_up = _registered(self)


def _registered(context: base.BaseContext) -> int:
    """Return the number of entries in the registries of a context and of its typing context."""
    registries = *context._registries, *context.typing_context._registries
    kept = [each for one in registries for each in vars(one).values()]
    return sum(len(each) for each in kept if isinstance(each, list))


base.BaseContext.refresh = _refresh


_FUNCTIONS = BuiltinFunctionType, FunctionType, ModuleType
_data_type = BaseContext.resolve_value_type


def _resolve_value_type(self: BaseContext, value: Any) -> types.Type:
    """Return the type of a constant.

    Numba first asks whether it is data. For a function, that raises and catches an error with a
    coloured message.
    """
    if isinstance(value, _FUNCTIONS) and (found := self._get_global_type(value)) is not None:
        return found
    return _data_type(self, value)


BaseContext.resolve_value_type = _resolve_value_type


_error_context = errors.new_error_context


class _ErrorContext:
    """What to add to the message of an error. Numba's own is a generator, entered for each type."""

    __slots__ = "_about", "_more"

    def __init__(self, *about: Any, **more: Any) -> None:
        self._about, self._more = about, more
        if "loc" in more:
            errors.loc_info.update(more)  # numba tells from it where it compiles

    def __enter__(self) -> None:
        """Do nothing yet."""

    def __exit__(self, kind: Any, error: BaseException | None, traceback: Any) -> None:
        """Add the context to the error, if there is one."""
        if error is not None:
            with _error_context(*self._about, **self._more):
                raise error


typeinfer.new_error_context = lowering.new_error_context = _ErrorContext
