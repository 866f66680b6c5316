"""Three LLVM operations that numba has no name for.

Comparing sixteen float32 at once into a bit mask, and counting its trailing zeros: which lanes
survive. And the fused multiply-add.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def not_above(typingctx, values, first, limit):
    """Bit k of the result says that values[first + k] is below limit, or NaN, for k in 0..15."""
    if not (isinstance(values, types.Array) and values.dtype == types.float32):
        return None

    def codegen(context, builder, signature, args):
        array = context.make_array(signature.args[0])(context, builder, args[0])
        vector = ir.VectorType(ir.FloatType(), 16)
        start = builder.gep(array.data, [args[1]])
        pointer = builder.bitcast(start, vector.as_pointer())
        loaded = builder.load(pointer)
        loaded.align = 4
        limits = ir.Constant(vector, ir.Undefined)
        limits = builder.insert_element(limits, args[2], ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), 16), [0] * 16)
        limits = builder.shuffle_vector(limits, limits, zeros)
        mask = builder.fcmp_unordered("<", loaded, limits)
        return builder.zext(builder.bitcast(mask, ir.IntType(16)), ir.IntType(64))

    return types.int64(values, types.int64, types.float32), codegen


@intrinsic
def lowest(typingctx, mask):
    """Number of the lowest set bit of a mask that is not zero."""

    def codegen(context, builder, signature, args):
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), codegen


@intrinsic
def fma(typingctx, a, b, c):
    """A b + c, rounded once."""

    def codegen(context, builder, signature, args):
        return builder.fma(*args)

    return types.float64(types.float64, types.float64, types.float64), codegen
