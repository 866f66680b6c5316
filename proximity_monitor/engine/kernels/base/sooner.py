"""What saves numba two fifths of its time.

It would compile a kernel once for each integer that a call writes out, and for integers of each
size. No kernel needs that: LLVM puts in the constants where it inlines a call. It compares its
options so often that how they are read matters. It looks through dozens of meanings for each `+`
and each element of an array, of which kernels have thousands. After each of its passes it finds out
which variables live in each block, for nobody; and it says where each variable ends, which only
what counts references asks for. It has LLVM read a module whenever it wants to know how large a
type is. And it asks the same of its registries and of its own functions thousands of times, often
by an error that it raises and catches.
"""

from __future__ import annotations

import functools
import operator
from typing import Any
from weakref import WeakSet

from llvmlite import ir
from numba import types
from numba.core import base, lowering
from numba.core import ir as numba_ir
from numba.core.compiler import Flags
from numba.core.postproc import PostProcessor, VariableLifetime
from numba.core.transforms import canonicalize_cfg
from numba.core.types.functions import BaseFunction

_KERNELS = __package__.rpartition(".")[0] + "."

_UNCOUNTED: WeakSet = WeakSet()
"""Functions whose kernels count no references."""


def widened(compiled: Any) -> Any:
    """Have a kernel take the integers of all that call it as int64."""
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
    """All options, by name. Numba's own `Flags.values` reads them one by one."""
    return {**_DEFAULTS, **flags._values}


Flags.values = _values


_OPERATORS = {vars(operator)[name] for name in operator.__all__} | {abs, bool, max, min}
_PLAIN = types.Number, types.Boolean, types.Array
_look_up = BaseFunction.get_call_type


def _get_call_type(self: BaseFunction, context: Any, args: tuple, kws: dict[str, Any]) -> Any:
    """The signature of a call, of an operator of numbers and arrays as it was found before.

    That is kept only where numba has code of its own for it, which depends on the types alone. What
    it would compile a function for, as for some of `max`, it compiles by its caller's options.
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
    """Prepare a function's code for the next pass, without the variables that live in each block.

    Only generators and what runs by Python's objects ask for these: no kernel is either. Nor is it
    said where a variable ends, unless references are counted down there: LLVM finds it out.
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
    """How many bytes a type takes, as was found before.

    That is asked of each variable. Its text says all of a type that has no name of its own.
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
    """The type of a value that is written out; None of one that cannot be."""
    make = _LITERALS.get(type(value))
    return None if make is None else make(value)


def _literal_or_omitted(value: Any) -> types.Type:
    """The type of an operand that may be written out."""
    return _literal(value) or types.Omitted(value)


types.maybe_literal = _literal
lowering._lit_or_omitted = _literal_or_omitted


def _variables(self: numba_ir.Inst, held: Any) -> list[numba_ir.Var]:
    """The variables in what an instruction holds, which is mostly one or none."""
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
    """What implements a function.

    For every access numba asks how an array is made of an array, as it is of other objects. Nothing
    does that, and to find out it would take up all registries anew.
    """
    if function == "__array__" and type(signature.args[0]) in (types.Array, types.NestedArray):
        raise NotImplementedError(function)
    return _implementation(self, function, signature, _firstcall)


base.BaseContext.get_function = _get_function
base._has_loc = functools.lru_cache(base._has_loc)


_load = base.BaseContext.refresh


def _refresh(self: base.BaseContext) -> None:
    """Take up what was registered since the last time, if there is any."""
    if _registered(self) != vars(self).get("_taken_up"):
        _load(self)
        self._taken_up = _registered(self)


def _registered(context: base.BaseContext) -> int:
    """How much the registries hold at which a context, and that of its types, look."""
    registries = *context._registries, *context.typing_context._registries
    kept = [each for one in registries for each in vars(one).values()]
    return sum(len(each) for each in kept if isinstance(each, list))


base.BaseContext.refresh = _refresh
