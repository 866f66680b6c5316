"""Models and searches by address: kernels read their arrays out of a table where they need them.

As a tuple, a tree of nine arrays is eighty numbers and a search a hundred and thirty, and each
function that is called with both would take all of them: a fifth of the time that compiling took,
and a twentieth of a query's. Here a value is nothing but where its rows of a table begin, and an
attribute is read there. A table does not change while a kernel runs. LLVM is told so, and reads an
attribute once where that is enough.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, register_model
from numba.np.numpy_support import from_dtype

from .memory import array_over


class _Field(NamedTuple):
    kind: types.Type
    columns: int
    """Of an array with two dimensions; else 0."""
    row: int
    """Of the table: where the array is told of, or what holds several begins."""


class Addressed(types.Type):
    """A NamedTuple type of arrays, by their addresses.

    Args:
        kind: that type; by it kernels are chosen (see jit.py).
        layout: for each of its fields, as they follow one another in a table, the dtype of the
            array and how many columns it has, 0 where it has one dimension; or an `Addressed` that
            has rows of its own there. Some fields may be missing.
        readonly: whether no kernel writes to the arrays.

    Attributes:
        arrays: name, dtype and columns of each row of a table.
    """

    def __init__(self, kind: type, layout: Mapping[str, Any], readonly: bool = False) -> None:
        self.instance_class = kind
        self.fields: dict[str, _Field] = {}
        self.arrays: list[tuple[str, np.dtype, int]] = []
        for name, own in layout.items():
            row = len(self.arrays)
            if isinstance(own, Addressed):
                self.fields[name] = _Field(own, 0, row)
                self.arrays += own.arrays
                continue
            dtype, columns = np.dtype(own[0]), own[1]
            array = types.Array(from_dtype(dtype), 2 if columns else 1, "C", readonly)
            self.fields[name] = _Field(array, columns, row)
            self.arrays.append((name, dtype, columns))
        digest = crc32(repr((readonly, self.fields)).encode())
        super().__init__(f"{kind.__name__} {digest:08x}")


@register_model(Addressed)
class _Model(models.PrimitiveModel):
    def __init__(self, dmm, kind):
        super().__init__(dmm, kind, cgutils.intp_t.as_pointer())


@infer_getattr
class _Attributes(AttributeTemplate):
    key = Addressed

    def generic_resolve(self, own, name):
        return own.fields[name].kind if name in own.fields else None


@lower_getattr_generic(Addressed)
def _attribute(context, builder, own, begin, name):
    kind, columns, row = own.fields[name]
    at = _row(builder, begin, row)
    if isinstance(kind, Addressed):
        return at
    address, rows = builder.load(at), builder.load(_after(builder, at, 1))
    for each in (address, rows):
        each.set_metadata("invariant.load", builder.module.add_metadata([]))
    return array_over(context, builder, kind, address, rows, columns)


@intrinsic(prefer_literal=True)
def arrays_at(typingctx, kind, row, table):
    """What the rows of a table from a constant one on hold; the kind is a constant, `constant`."""
    own, row = kind.instance_type, row.literal_value
    return begins_at(own, row, kind, types.int64, table)


def constant(own: Addressed) -> types.TypeRef:
    """A type as kernels may have it for a constant."""
    return types.TypeRef(own)


def begins_at(own: Addressed, row: int, *arguments: types.Type) -> tuple:
    """What an intrinsic returns that is of a type by a table's rows from that one on.

    The table (n, 2) is the last of the intrinsic's arguments.
    """

    def codegen(context, builder, signature, args):
        data = context.make_array(signature.args[-1])(context, builder, args[-1]).data
        return _row(builder, data, row)

    return own(*arguments), codegen


def _row(builder, begin, row):
    return _after(builder, begin, 2 * row) if row else begin


def _after(builder, begin, count):
    return builder.gep(begin, [ir.Constant(cgutils.intp_t, count)], inbounds=True)
