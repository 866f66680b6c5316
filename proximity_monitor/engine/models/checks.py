"""Checks of the arrays of a model, and the error that names what is wrong with them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_real, as_reals
from ..kernels.base.rounding import LARGEST_COORDINATE


class ModelError(ValueError):
    """A model's file or arrays are not what they should be; the message names which and where."""


def checked_vertices(vertices: ArrayLike, name: str, what: str = "vertices") -> NDArray[np.float64]:
    """Return a read-only copy of points (n, 3), n >= 1, in metres.

    Messages call the model `name` and its points `what`.

    Raises:
        ModelError: it is no such array; a coordinate is not finite, or beyond 1e45 m.
    """
    array = as_reals(vertices, f"{name}: {what}", error=ModelError).copy()
    if array.ndim != 2 or array.shape[1] != 3:
        raise ModelError(f"{name}: {what}: shape {array.shape}, expected (n, 3)")
    if len(array) == 0:
        raise ModelError(f"{name}: {what}: must not be empty")
    bad = ~(np.abs(array) <= LARGEST_COORDINATE).all(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise ModelError(
            f"{name}: {what}[{first}] = {array[first].tolist()}: every coordinate must be finite "
            f"and at most {LARGEST_COORDINATE:g} m ({int(bad.sum())} such {what})"
        )
    array.setflags(write=False)
    return array


def checked_length(value: float, name: str, what: str) -> float:
    """Return a length in metres as a float.

    Raises:
        ModelError: it is no number from 0 to 1e45.
    """
    try:
        length = as_real(value, what)
    except TypeError:
        length = math.nan
    if not 0.0 <= length <= LARGEST_COORDINATE:
        raise ModelError(f"{name}: {what} = {value!r}: must be from 0 to {LARGEST_COORDINATE:g} m")
    return length


def checked_faces(faces: ArrayLike, vertex_count: int, name: str) -> NDArray[np.int32]:
    """Return a read-only int32 copy of triangles (m, 3), m >= 1: the indices of their vertices.

    Raises:
        ModelError: it is no such array; an index is that of no vertex.
    """
    try:
        given = np.asarray(faces)
    except ValueError as error:
        raise ModelError(f"{name}: faces: not an array: {error}") from None
    if given.size == 0:
        raise ModelError(f"{name}: faces: must not be empty; a model needs at least one triangle")
    if given.ndim != 2 or given.shape[1] != 3:
        raise ModelError(f"{name}: faces: shape {given.shape}, expected (m, 3)")
    if given.dtype.kind not in "iu":
        raise ModelError(f"{name}: faces: dtype {given.dtype}, expected integers")
    bad = ((given < 0) | (given >= vertex_count)).any(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise ModelError(
            f"{name}: faces[{first}] = {given[first].tolist()}: not all are vertices; there are "
            f"{vertex_count} vertices, numbered from 0 ({int(bad.sum())} such faces)"
        )
    array = np.array(given, dtype=np.int32, order="C")
    array.setflags(write=False)
    return array
