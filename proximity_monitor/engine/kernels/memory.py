"""Small arrays on the stack, for kernels that may not allocate (see jit.py)."""

from __future__ import annotations

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic(prefer_literal=True)
def on_stack(typingctx, count, like):
    """An array (count,) of numbers of the type of `like`, with anything in it.

    It lives until the function that asked for it returns; `count` is a constant.
    """
    if not isinstance(count, types.IntegerLiteral):
        return None
    array_type = types.Array(types.unliteral(like), 1, "C")

    def codegen(context, builder, signature, args):
        item = context.get_data_type(array_type.dtype)
        size = context.get_constant(types.intp, context.get_abi_sizeof(item))
        memory = cgutils.alloca_once(builder, item, size=count.literal_value)
        memory.align = 64
        array = context.make_array(array_type)(context, builder)
        context.populate_array(
            array,
            data=memory,
            shape=[context.get_constant(types.intp, count.literal_value)],
            strides=[size],
            itemsize=size,
            meminfo=None,
        )
        return array._getvalue()

    return array_type(count, like), codegen
