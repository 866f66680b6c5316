"""Parts of searches that are compiled when a search first calls them, as linkers bind symbols late.

Few questions need all the code of a search. So a large part is `lazy`: its callers are compiled
without it, and find its machine code by an address. Until the part is compiled, this is the address
of a Python function, which compiles or loads the part, replaces the address, and calls the part. So
a search does the same whether its parts were compiled before or not.

Ctrl-C or an error of the compiler cannot pass through the search. The call then ends as if the part
had used up the steps of the slice. Whoever runs the search calls `raise_failed` after each slice.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from itertools import product
from threading import get_ident
from typing import Any
from zlib import crc32

from llvmlite import ir
from llvmlite.binding import add_symbol
from numba import float64, int64, types
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, Signature, infer_global

from .cache import kernel_name
from .jit import shared
from .state import BreadthFirst, DepthFirst, Priority
from .tables import TREES, state_type

ALL_STEPS = 1 << 62
"""More steps than any slice has."""

failed: dict[int, BaseException] = {}
"""What was raised while a part was compiled, by the number of the thread."""

_NUMBERS = {int64: ctypes.c_int64, float64: ctypes.c_double}
"""The types of arguments that are numbers. All others are passed as pointers."""


def raise_failed() -> None:
    """Raise what was raised in this thread while a part was compiled, if anything was."""
    if (error := failed.pop(get_ident(), None)) is not None:
        raise error


class Part:
    """A lazy kernel for some types of arguments.

    Attributes:
        kernel: the kernel.
        arguments: the types of its arguments.
        nothing: its result if it could not be compiled, one or two integers.
    """

    def __init__(self, kernel: Any, arguments: tuple[types.Type, ...], nothing: tuple[int, ...]):
        self.kernel, self.arguments, self.nothing = kernel, arguments, nothing
        about = crc32(repr(arguments).encode())
        self._symbol = f"lazy.{kernel_name(kernel.py_func)}.{about:08x}"
        passed = [_NUMBERS.get(each, ctypes.c_void_p) for each in arguments]
        self._form = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * 2, *passed)
        self._first = self._form(self._bind_and_call)
        self._address = ctypes.cast(self._first, ctypes.c_void_p)
        add_symbol(self._symbol, ctypes.addressof(self._address))

    @property
    def signature(self) -> Signature:
        """Return its types."""
        one = len(self.nothing) == 1
        return (int64 if one else types.UniTuple(int64, len(self.nothing)))(*self.arguments)

    def bind(self) -> None:
        """Compile the part, or load it, so that searches call it without delay."""
        self.kernel.compile(self.arguments)
        found = self.kernel.overloads[self.arguments]
        self._address.value = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)

    def _bind_and_call(self, *passed: Any) -> int:
        """Do what the part does; called by searches. An exception cannot leave this function."""
        try:
            self.bind()
            self._form(self._address.value)(*passed)
        except BaseException as error:  # Ctrl-C, too
            failed[get_ident()] = error
        return 0

    def call(self, context: Any, builder: Any, given: list[Any]) -> Any:
        """Generate a call of the part."""
        module = builder.module
        slot = module.globals.get(self._symbol)
        if slot is None:
            slot = ir.GlobalVariable(module, cgutils.intp_t, self._symbol)
        convention, signature = context.call_conv, self.signature
        form = convention.get_function_type(signature.return_type, signature.args)
        part = builder.inttoptr(builder.load(slot), form.as_pointer())
        numbers = [ir.Constant(cgutils.intp_t, each) for each in self.nothing]
        nothing = numbers[0] if len(numbers) == 1 else cgutils.pack_array(builder, numbers)
        result = cgutils.alloca_once_value(builder, nothing)
        error = cgutils.alloca_once(builder, form.args[1].pointee)
        packer = context.get_arg_packer(signature.args)
        builder.call(part, [result, error, *packer.as_arguments(builder, given)])
        return builder.load(result)


def lazy(
    trees_a: tuple[type, ...],
    trees_b: tuple[type, ...],
    waiting: type,
    *more: types.Type,
    nothing: tuple[int, ...] = (ALL_STEPS,),
) -> Callable[[Callable], Callable]:
    """Decorate a part of searches. It takes two trees, a state, and more numbers.

    It returns one or two integers, `nothing` if it could not be compiled: that is how it says that
    all steps of the slice are used up.

    Args:
        trees_a: the types of its first argument.
        trees_b: the types of its second argument.
        waiting: the type of `State.waiting`.
        more: the types of further arguments, int64 or float64.
        nothing: see above.

    Returns:
        What kernels call. Its attribute `parts` holds a `Part` for each type of `State.open` and
        types of both trees.
    """

    def decorate(function: Callable) -> Callable:
        kernel = shared(function)
        orders = DepthFirst, Priority, BreadthFirst
        parts = {}
        for order, a, b in product(orders, trees_a, trees_b):
            arguments = TREES[a], TREES[b], state_type(order, waiting), *more
            parts[order, a, b] = Part(kernel, arguments, nothing)
        by_types = {each.arguments[:3]: each for each in parts.values()}

        def stub(*arguments):
            """Stand in for the function in kernels."""

        class Template(AbstractTemplate):
            key = stub

            def generic(self, args, kws):
                found = by_types.get(args[:3])
                return None if found is None else found.signature

        infer_global(stub, types.Function(Template))

        @lower_builtin(stub, types.VarArg(types.Any))
        def lower(context, builder, signature, given):
            return by_types[signature.args[:3]].call(context, builder, given)

        stub.parts = parts
        stub.__name__, stub.__qualname__ = function.__name__, function.__qualname__
        stub.__module__, stub.__doc__ = function.__module__, function.__doc__
        return stub

    return decorate
