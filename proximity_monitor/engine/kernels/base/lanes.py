"""LLVM operations that numba has no name for.

Comparing sixteen float32 at once into a bit mask, and counting its trailing zeros: which lanes
survive. The smallest of sixteen. How far points reach along a direction. And the fused
multiply-add.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .jit import inlined


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
def smallest(typingctx, values, first, mask):
    """The smallest of those of values[first:first + 16], none NaN, whose bit of the mask is set.

    Infinity where none is.
    """
    if not (isinstance(values, types.Array) and values.dtype == types.float32):
        return None

    def codegen(context, builder, signature, args):
        array = context.make_array(signature.args[0])(context, builder, args[0])
        vector = ir.VectorType(ir.FloatType(), 16)
        start = builder.gep(array.data, [args[1]])
        loaded = builder.load(builder.bitcast(start, vector.as_pointer()))
        loaded.align = 4
        bits = builder.bitcast(
            builder.trunc(args[2], ir.IntType(16)), ir.VectorType(ir.IntType(1), 16)
        )
        none = ir.Constant(vector, [float("inf")] * 16)
        loaded = builder.select(bits, loaded, none)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.FloatType(), [vector]),
            "llvm.vector.reduce.fmin.v16f32",
        )
        return builder.call(function, [loaded], fastmath=("nnan",))

    return types.float32(values, types.int64, types.int64), codegen


def _least(signature):
    """Code for the least sum of products of some numbers with the rows of points."""
    vector = ir.VectorType(ir.DoubleType(), 16)
    step = 16

    def spread(builder, value):
        lanes = builder.insert_element(
            ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
        )
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), step), [0] * step)
        return builder.shuffle_vector(lanes, lanes, zeros)

    def codegen(context, builder, signature, args):
        array = context.make_array(signature.args[0])(context, builder, args[0])
        _, first, room, *direction = args
        direction = [spread(builder, value) for value in direction]
        least = cgutils.alloca_once_value(builder, ir.Constant(vector, [float("inf")] * step))
        flags = "contract", "nnan"
        count = builder.udiv(room, ir.Constant(room.type, step))
        with cgutils.for_range(builder, count) as loop:
            at = builder.add(first, builder.mul(loop.index, ir.Constant(room.type, step)))
            total = None
            for lanes in direction:
                loaded = builder.load(
                    builder.bitcast(builder.gep(array.data, [at]), vector.as_pointer())
                )
                loaded.align = 8
                product = builder.fmul(loaded, lanes, flags=flags)
                total = product if total is None else builder.fadd(total, product, flags=flags)
                at = builder.add(at, room)
            known = builder.load(least)
            below = builder.fcmp_ordered("<", total, known, flags=flags)
            builder.store(builder.select(below, total, known), least)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.DoubleType(), [vector]),
            "llvm.vector.reduce.fmin.v16f64",
        )
        return builder.call(function, [builder.load(least)], fastmath=("nnan",))

    return signature, codegen


def _over_rows(points, coordinates):
    """The signature of such an intrinsic, or None where the points are none."""
    if not (isinstance(points, types.Array) and points.dtype == types.float64):
        return None
    return types.float64(points, types.int64, types.int64, *[types.float64] * coordinates)


@intrinsic
def least_along(typingctx, points, first, room, x, y, z):
    """The least product of a direction, no number of which is NaN, with any of the points.

    Their coordinates are three rows of `room` float64, a multiple of 16, that begin at
    points[first].
    """
    signature = _over_rows(points, 3)
    return signature and _least(signature)


@intrinsic
def least_beyond(typingctx, points, first, room, x, y, z, w):
    """The same of four rows, the last of which are weights.

    Of homogeneous coordinates (x, y, z, -c) gives weights times how far points lie beyond the plane
    at c along a direction.
    """
    signature = _over_rows(points, 4)
    return signature and _least(signature)


@intrinsic
def lowest(typingctx, mask):
    """Number of the lowest set bit of a mask that is not zero."""

    def codegen(context, builder, signature, args):
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), codegen


@inlined
def has_three(mask):
    """Whether more than two bits of a mask are set."""
    mask &= mask - 1
    return (mask & (mask - 1)) != 0


@intrinsic
def fma(typingctx, a, b, c):
    """A b + c, rounded once."""

    def codegen(context, builder, signature, args):
        return builder.fma(*args)

    return types.float64(types.float64, types.float64, types.float64), codegen
