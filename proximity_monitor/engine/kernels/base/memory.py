"""Arrays without heap allocation (see jit.py): small ones on the stack, others by address."""

from __future__ import annotations

import math

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def _on_stack(context, builder, array_type, shape):
    """Return an array of a type and a shape on the stack of the calling function."""
    item = context.get_data_type(array_type.dtype)
    memory = cgutils.alloca_once(builder, item, size=math.prod(shape))
    memory.align = 64
    return _array(context, builder, array_type, memory, shape)


def array_over(context, builder, array_type, address, rows, width):
    """Return the array (rows, width), or (rows,) if width is 0, that begins at an address."""
    item = context.get_data_type(array_type.dtype)
    data = builder.inttoptr(address, item.as_pointer())
    return _array(context, builder, array_type, data, (rows, width) if width else (rows,))


def _array(context, builder, array_type, data, shape):
    """Return an array over memory that it does not own.

    All numbers of its shape except the first are Python integers. Numba's own constructor writes an
    array struct to memory field by field, and LLVM has to find out that this is unnecessary.
    """
    size = context.get_abi_sizeof(context.get_data_type(array_type.dtype))
    rows, *others = shape
    known = isinstance(rows, int)
    fixed = {
        "meminfo": None, "parent": None, "itemsize": size, "data": ir.Undefined,
        "nitems": math.prod(shape) if known else ir.Undefined,
        "shape": [rows if known else ir.Undefined, *others],
        "strides": [size * math.prod(shape[i + 1 :]) for i in range(len(shape))],
    }  # fmt: skip
    place = context.data_model_manager[array_type].get_field_position
    parts = sorted(fixed, key=place)
    array = ir.Constant(context.get_value_type(array_type), [fixed[part] for part in parts])
    array = builder.insert_value(array, data, place("data"))
    if known:
        return array
    each = context.get_constant(types.intp, math.prod(others))
    count = builder.mul(rows, each, flags=["nsw"]) if others else rows
    array = builder.insert_value(array, count, place("nitems"))
    return builder.insert_value(array, rows, (place("shape"), 0))


@intrinsic(prefer_literal=True)
def on_stack(typingctx, count, like):
    """Return an uninitialised array (count,) of numbers of the type of `like`.

    It lives until the calling function returns. `count` is a constant.
    """
    if not isinstance(count, types.IntegerLiteral):
        return None
    array_type = types.Array(types.unliteral(like), 1, "C")

    def codegen(context, builder, signature, args):
        return _on_stack(context, builder, array_type, (count.literal_value,))

    return array_type(count, like), codegen


@intrinsic(prefer_literal=True)
def table_on_stack(typingctx, rows, columns, like):
    """Return an array (rows, columns); otherwise like `on_stack`."""
    if not (isinstance(rows, types.IntegerLiteral) and isinstance(columns, types.IntegerLiteral)):
        return None
    array_type = types.Array(types.unliteral(like), 2, "C")

    def codegen(context, builder, signature, args):
        shape = rows.literal_value, columns.literal_value
        return _on_stack(context, builder, array_type, shape)

    return array_type(rows, columns, like), codegen


@intrinsic
def read_only(typingctx, array):
    """Return the same array with a read-only type: then kernels are not compiled for both types."""
    frozen = array.copy(readonly=True)

    def codegen(context, builder, signature, args):
        return args[0]

    return frozen(array), codegen


@intrinsic(prefer_literal=True)
def rows_at(typingctx, address, rows, columns, like):
    """Return the array (rows, columns) of numbers of the type of `like` that begins at an address.

    It is (rows,) if `columns`, a constant, is 0. The array does not keep its memory alive. The
    caller is responsible for address, size and type.
    """
    if not isinstance(columns, types.IntegerLiteral):
        return None
    width = columns.literal_value
    array_type = types.Array(types.unliteral(like), 2 if width else 1, "C")
    arguments = types.int64, types.int64, columns, like

    def codegen(context, builder, signature, args):
        return array_over(context, builder, array_type, args[0], args[1], width)

    return array_type(*arguments), codegen


@intrinsic
def records_at(typingctx, address, rows, record):
    """Return an array (rows,) of records of a constant dtype; otherwise like `rows_at`."""
    if not (isinstance(record, types.DType) and isinstance(record.dtype, types.Record)):
        return None
    array_type = types.Array(record.dtype, 1, "C")

    def codegen(context, builder, signature, args):
        return array_over(context, builder, array_type, args[0], args[1], 0)

    return array_type(types.int64, types.int64, record), codegen


@intrinsic
def addresses(typingctx, arrays):
    """Return the addresses of the arrays in a tuple, and after these the number of rows of each."""
    if not (isinstance(arrays, types.BaseTuple) and len(arrays)):
        return None

    def codegen(context, builder, signature, args):
        begin, rows = [], []
        for i, kind in enumerate(arrays.types):
            array = context.make_array(kind)(context, builder, builder.extract_value(args[0], i))
            begin.append(builder.ptrtoint(array.data, context.get_value_type(types.int64)))
            rows.append(builder.extract_value(array.shape, 0))
        return context.make_tuple(builder, signature.return_type, begin + rows)

    return types.UniTuple(types.int64, 2 * len(arrays))(arrays), codegen
