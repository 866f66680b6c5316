"""Reads and writes messages as bytes: plain CDR (XCDR1; OMG DDS-XTYPES 1.3, section 7.4).

rclpy converts a whole message to Python objects before it calls a callback. That takes 20 µs for
the pose of a `geometry_msgs/PoseStamped`, 10 ms for 190 pairs, seconds for a million points. Most
of a message is numbers and texts. This module reads them from the bytes and writes them as bytes.
"""

from __future__ import annotations

import struct

import numpy as np

_ENCAPSULATION = 4  # header bytes (kind, options); alignment counts from the end of the header
_ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
_COUNT = {order: struct.Struct(f"{order}I") for order in "<>"}
_STAMP = {order: struct.Struct(f"{order}iI") for order in "<>"}
_HEAD = struct.Struct("<4siI")
_CUT = "the message ends too early"
_PADDING = (b"\0\0\0\0", b"\0\0\0", b"\0\0", b"\0")
"""Index: a text's length modulo 4. Each entry is the final zero, then zeros to a multiple of 4."""


def is_plain(data: bytes) -> bool:
    """Return whether a message is plain CDR; some middleware uses another serialisation."""
    return data[:2] in _ORDERS


def stamped(seconds: int, nanoseconds: int) -> bytes:
    """Return the beginning of a little-endian message whose first field is a time stamp."""
    return _HEAD.pack(b"\x00\x01\x00\x00", seconds, nanoseconds)


def count(number: int) -> bytes:
    """Return a little-endian uint32, such as the number of elements that follow."""
    return _COUNT["<"].pack(number)


def text(value: str) -> bytes:
    """Return a little-endian string for a multiple of 4 bytes, padded to the next multiple."""
    encoded = value.encode()
    length = len(encoded)
    return _COUNT["<"].pack(length + 1) + encoded + _PADDING[length % 4]


class Reader:
    """Reads a message field by field.

    Attributes:
        data: the message.
        at: where the next field begins, before alignment.
    """

    __slots__ = ("_count", "_order", "at", "data")

    def __init__(self, data: bytes) -> None:
        """Begin at the first field.

        Raises:
            ValueError: the message is not plain CDR.
        """
        order = _ORDERS.get(bytes(data[:2]))
        if order is None:
            raise ValueError("the message is not serialised as plain CDR")
        self.data = data
        self.at = _ENCAPSULATION
        self._order = order
        self._count = _COUNT[order].unpack_from

    def align(self, size: int) -> None:
        """Move on to the next position at which a value of `size` bytes may stand."""
        self.at += (_ENCAPSULATION - self.at) % size

    def byte(self) -> int:
        """Read an octet or a boolean.

        Raises:
            ValueError: the message ends before it.
        """
        self.at += 1
        try:
            return self.data[self.at - 1]
        except IndexError as error:
            raise ValueError(_CUT) from error

    def count(self) -> int:
        """Read a uint32: a number, or the number of elements that follow.

        Raises:
            ValueError: the message ends before it.
        """
        at = self.at + (_ENCAPSULATION - self.at) % 4
        self.at = at + 4
        try:
            return self._count(self.data, at)[0]
        except struct.error as error:
            raise ValueError(_CUT) from error

    def text(self) -> str:
        """Read a string.

        Raises:
            ValueError: the message ends within it, or it is not UTF-8.
        """
        length = self.count()
        at = self.at
        self.at = at + length
        if self.at > len(self.data):
            raise ValueError(_CUT)
        return self.data[at : at + length].rstrip(b"\0").decode()

    def skip(self, size: int, count: int) -> None:
        """Pass over an array of `count` values of `size` bytes."""
        if count:
            self.align(size)
            self.at += size * count

    def array(self, kind: str, count: int) -> np.ndarray:
        """Read `count` numbers of a numpy kind such as f8; the array shares the message's memory.

        Raises:
            ValueError: the message ends before them.
        """
        if not count:
            return np.empty(0, kind)
        size = int(kind[1:])
        self.align(size)
        found = np.frombuffer(self.data, f"{self._order}{kind}", count, self.at)
        self.at += size * count
        return found

    def doubles(self, count: int) -> tuple[float, ...]:
        """Read `count` float64 values; faster than `array` for a few.

        Raises:
            ValueError: the message ends before them.
        """
        at = self.at + (_ENCAPSULATION - self.at) % 8
        self.at = at + 8 * count
        try:
            return struct.unpack_from(f"{self._order}{count}d", self.data, at)
        except struct.error as error:
            raise ValueError(_CUT) from error

    def stamp_ns(self) -> int:
        """Read a time stamp, in nanoseconds.

        Raises:
            ValueError: the message ends before it.
        """
        at = self.at + (_ENCAPSULATION - self.at) % 4
        self.at = at + 8
        try:
            seconds, nanoseconds = _STAMP[self._order].unpack_from(self.data, at)
        except struct.error as error:
            raise ValueError(_CUT) from error
        return seconds * 1_000_000_000 + nanoseconds

    def stamp_s(self) -> float:
        """Read a time stamp, in seconds."""
        return self.stamp_ns() * 1e-9


def as_octahedral(normals: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 3) as points (n, 2) of the square from -1 to 1; (2, 2) for vector 0.

    The sphere is projected onto an octahedron, and the octahedron onto the square: the upper half
    onto the inner diamond, the lower half folded out to the corners (Cigolle et al. 2014).
    """
    size = np.abs(normals).sum(axis=1)
    flat = normals / np.where(size > 0.0, size, 1.0)[:, None]
    made = flat[:, :2].copy()
    below = flat[:, 2] < 0.0
    made[below] = (1.0 - np.abs(made[below, ::-1])) * np.where(made[below] < 0.0, -1.0, 1.0)
    made[size == 0.0] = 2.0
    return made


def from_octahedral(points: np.ndarray) -> np.ndarray:
    """Invert `as_octahedral`: return unit vectors (n, 3); 0 for points outside the square."""
    x, y = np.asarray(points, dtype=np.float64).T
    z = 1.0 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0.0)
    made = np.stack((x - np.copysign(fold, x), y - np.copysign(fold, y), z), axis=1)
    made /= np.linalg.norm(made, axis=1, keepdims=True)
    made[~((np.abs(x) <= 1.0) & (np.abs(y) <= 1.0))] = 0.0
    return made
