"""Convert arguments of questions, numbers and arrays, to the types that the kernels take.

A kernel is compiled for the types that it is called with. So every real number becomes a float, and
every collection of real numbers becomes a float64 array. Anything else is refused by name.
"""

from __future__ import annotations

import operator
from typing import SupportsFloat, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

_REAL_KINDS = "iuf"


def as_real(value: SupportsFloat, name: str) -> float:
    """Return a real number as a float.

    It may be a number of Python or numpy, a fraction, or an array without dimensions.

    Raises:
        TypeError: text, None, a truth value, a complex number, an array with dimensions.
    """
    if type(value) is float:
        return value
    given = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if isinstance(given, np.generic | np.ndarray):
        real = given.ndim == 0 and given.dtype.kind in _REAL_KINDS
    else:
        kind = type(given)
        real = hasattr(kind, "__float__") or hasattr(kind, "__index__")
        real = real and not isinstance(given, bool | complex)
    if real:
        try:
            return float(given)
        except (TypeError, ValueError, ArithmeticError, RuntimeError) as error:
            raise TypeError(f"{name} = {value!r}: not a real number: {error}") from None
    raise TypeError(f"{name} = {value!r}: expected a real number, got {type(value).__name__}")


def check_tolerance(name: str, value: SupportsFloat) -> float:
    """Return the value as a float that is not negative; infinity is allowed.

    Raises:
        TypeError: it is no real number.
        ValueError: it is negative or NaN.
    """
    number = value if type(value) is float else as_real(value, name)
    if not number >= 0.0:
        raise ValueError(f"{name} = {number!r}: must be a number of at least 0")
    return number


def as_count(value: int, name: str, least: int = 1) -> int:
    """Return a count as an int, no less than `least`.

    Raises:
        TypeError: it is no whole number.
        ValueError: it is less than `least`.
    """
    try:
        if isinstance(value, bool):
            raise TypeError
        count = operator.index(value)
    except TypeError:
        text = f"{name} = {value!r}: expected a whole number, got {type(value).__name__}"
        raise TypeError(text) from None
    if count < least:
        raise ValueError(f"{name} = {count}: must be at least {least}")
    return count


def as_reals(
    values: ArrayLike,
    name: str,
    what: str = "an array of numbers",
    error: type[ValueError] = ValueError,
) -> NDArray[np.float64]:
    """Return real numbers as a C-contiguous, writable float64 array; copy only if necessary.

    Raises:
        error: the values are not `what`.
    """
    if _is_plain(values, np.float64):
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":  # fractions, or things that are no numbers
            numbers = [as_real(each, "an element") for each in array.ravel()]
            array = np.array(numbers, np.float64).reshape(array.shape)
    except (TypeError, ValueError) as cause:
        raise error(f"{name}: not {what}: {cause}") from None
    if array.dtype.kind not in _REAL_KINDS:
        raise error(f"{name}: not {what}: dtype {array.dtype}, expected real numbers")
    return np.require(array, np.float64, "CAWE")


def _is_plain(values: ArrayLike, kind: type[np.generic]) -> TypeGuard[NDArray]:
    """Tell whether no conversion is needed: asking numpy for one takes a microsecond."""
    return type(values) is np.ndarray and values.dtype == kind and values.flags.carray


def as_tolerances(value: ArrayLike, name: str, count: int) -> NDArray[np.float64] | float:
    """Return one tolerance as a float, or several as a float64 array (count,); none negative.

    Raises:
        TypeError: a single value is no real number.
        ValueError: an array has another shape or another dtype; a value is negative or NaN.
    """
    if type(value) is float or not np.ndim(value):
        return check_tolerance(f"{name}[0]", as_real(value, name))
    given = as_reals(value, name)
    if given.shape != (count,):
        raise ValueError(f"{name}: shape {given.shape}, expected a number or ({count},)")
    if not (given >= 0.0).all():
        first = int(np.flatnonzero(~(given >= 0.0))[0])
        check_tolerance(f"{name}[{first}]", float(given[first]))
    return given


def as_integers(
    values: ArrayLike, name: str, columns: int, kind: type[np.integer] = np.int32
) -> NDArray[np.integer]:
    """Return whole numbers as a C-contiguous, writable array (k, columns) of the dtype `kind`.

    Raises:
        ValueError: the values are no integers of this shape, or `kind` cannot hold one of them.
    """
    given = _whole(values, name, (columns,))
    if _is_plain(given, kind):
        return given
    array = np.require(given, kind, "CAWE")
    if (array != given).any():
        first = int(np.flatnonzero((array != given).any(axis=1))[0])
        raise ValueError(f"{name}[{first}] = {given[first].tolist()}: out of range for an index")
    return array


def _whole(values: ArrayLike, name: str, row: tuple[int, ...]) -> NDArray[np.integer]:
    """Return whole numbers as an array (k, *row), in the integer dtype that they have."""
    try:
        given = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name}: not an array: {error}") from None
    if given.size == 0:
        return np.empty((0, *row), np.int32)
    if given.dtype.kind not in "iu" or given.ndim != 1 + len(row) or given.shape[1:] != row:
        expected = ", ".join(map(str, ("k", *row))) + ("" if row else ",")
        raise ValueError(f"{name}: {given.dtype} {given.shape}, expected integers ({expected})")
    return given
