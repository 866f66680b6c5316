"""What saves numba a third of its time.

It would compile a kernel once for each integer that a call writes out, and for integers of each
size. No kernel needs that: LLVM puts in the constants where it inlines a call. And it compares its
options so often that how they are read matters.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core.compiler import Flags


def widened(compiled: Any) -> Any:
    """Have a kernel take the integers of all that call it as int64."""
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
