"""Models and searches by address: kernels read their arrays from a table when they need them.

As a tuple, a tree of nine arrays is eighty numbers and a search is a hundred and thirty. Every
function called with both would take all of these as arguments. That cost a fifth of the compile
time and a twentieth of a query's time. Here a value is only a pointer to its first row in a table,
and reading an attribute loads the array from its row. A table does not change while a kernel runs.
LLVM is told so, and loads an attribute only once if that is enough.
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
    """Number of columns of a two-dimensional array; 0 for one dimension."""
    row: int
    """Row of the table that describes the array, or first row of a nested `Addressed`."""


class Addressed(types.Type):
    """Numba type for a NamedTuple of arrays that is given by the addresses of the arrays.

    Args:
        kind: the NamedTuple type; `implements` chooses kernels by it (see jit.py).
        layout: for each field, in the order of the table's rows: the dtype of the array and its
            number of columns (0 for one dimension); or an `Addressed` with rows of its own. Fields
            may be missing.
        readonly: whether no kernel writes to the arrays.

    Attributes:
        arrays: name, dtype and number of columns for each row of the table.
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
    """Return the value of type `kind` whose rows in a table start at `row`.

    `row` is a literal; `kind` is a type that `constant` made.
    """
    own, row = kind.instance_type, row.literal_value
    return begins_at(own, row, kind, types.int64, table)


def constant(own: Addressed) -> types.TypeRef:
    """Wrap a type so that kernels can use it as a constant."""
    return types.TypeRef(own)


def begins_at(own: Addressed, row: int, *arguments: types.Type) -> tuple:
    """Return signature and code of an intrinsic whose result is the value that starts at `row`.

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
