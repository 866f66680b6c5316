"""A cursor over a serialised message.

rclpy makes Python objects of everything in a message before a callback sees it: 10 ms for 190 pairs
and seconds for a million points. The page needs the numbers, and takes them from the bytes.
"""

from __future__ import annotations

import struct

import numpy as np

_ENCAPSULATION = 4  # bytes before the body: kind and options; alignment counts from their end
_PLAIN = {b"\x00\x00": ">", b"\x00\x01": "<"}
_CUT = "the message ends too early"


class Cursor:
    """Reads plain CDR (XCDR1) from the start of a message on."""

    def __init__(self, data: bytes) -> None:
        """Begin at the first field.

        Raises:
            ValueError: another serialisation, as another middleware may choose.
        """
        order = _PLAIN.get(bytes(data[:2]))
        if order is None:
            raise ValueError("the message is not serialised as plain CDR")
        self.data = data
        self.at = _ENCAPSULATION
        self._order = order
        self._count = struct.Struct(f"{order}I").unpack_from

    def align(self, size: int) -> None:
        """Go on to where a value of `size` bytes may stand."""
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
        """Read a uint32: a number, or how many elements follow.

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
        """Read a string."""
        length = self.count()
        at = self.at
        self.at = at + length
        return self.data[at : at + length - 1].decode()

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

    def stamp_s(self) -> float:
        """Read a time stamp, in seconds."""
        seconds = self.count()
        return seconds + self.count() * 1e-9
