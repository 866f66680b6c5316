"""Words and numbers of text files.

Python takes more for a number than the formats do: 1_0 is 10 to it, and so are the digits of other
scripts in a str. So numbers are read from bytes, and none with an underscore is one. What is not
finite is a number here; it is refused where it is a coordinate.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from .triangles import FormatError, Ints, Reals, Where, first, spans

_REAL = re.compile(rb"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf(inity)?)", re.IGNORECASE)
_COMMENT = re.compile(rb"(?<!\.)#")
_WHOLE = re.compile(rb"[+-]?\d{1,18}")


def without_mark(data: bytes) -> bytes:
    """A text without the byte-order mark that some editors write before UTF-8."""
    return data.removeprefix(b"\xef\xbb\xbf")


def without_comment(line: bytes) -> bytes:
    """A line up to its comment; 1.#INF is what some libraries write for infinity, no comment."""
    return _COMMENT.split(line, 1)[0] if b"#" in line else line


def shown(word: bytes) -> str:
    """A word of a file as messages print it."""
    return repr(word[:40].decode("ascii", "backslashreplace"))


def nowhere(_: int) -> str:
    """The place of something that needs none."""
    return ""


def reals(words: Sequence[bytes], where: Where = nowhere) -> Reals:
    """The numbers that words are; `where` names the place of a word that is none."""
    return _parsed(words, float, np.float64, where)


def wholes(words: Sequence[bytes], where: Where = nowhere) -> Ints:
    """The whole numbers that words are; `where` names the place of a word that is none."""
    return _parsed(words, int, np.int64, where)


def _parsed(words: Sequence[bytes], kind: Callable, dtype: type, where: Where) -> NDArray:
    try:
        if b"_" not in b"".join(words):
            return np.array(list(map(kind, words)), dtype=dtype)
    except (ValueError, OverflowError):
        pass
    legal, name = (_REAL, "number") if kind is float else (_WHOLE, "whole number")
    bad = next(i for i, word in enumerate(words) if not legal.fullmatch(word))
    raise FormatError(f"{where(bad)}{shown(words[bad])} is no {name}")


class Rows:
    """The words of rows, one row after the other.

    One list of all words takes a third of the time of a list for each row.

    Args:
        words: of all rows.
        sizes: how many words each row has.
        where: names the place of a row.
    """

    def __init__(self, words: list[bytes], sizes: Sequence[int] | Ints, where: Where) -> None:
        self.words = words
        self.sizes = np.array(sizes, dtype=np.int64)
        self.starts = np.cumsum(self.sizes) - self.sizes
        self.where = where

    def place(self, word: int) -> str:
        """Names the place of a word."""
        return self.where(int(np.searchsorted(self.starts, word, side="right")) - 1)

    def cut(self, begin: int, end: int) -> Rows:
        """Some of the rows."""
        starts = [*self.starts[begin : end + 1].tolist(), len(self.words)]
        words = self.words[starts[0] : starts[max(end - begin, 0)]]
        return Rows(words, self.sizes[begin:end], lambda i: self.where(begin + i))

    def reals(self) -> Reals:
        """The numbers that all words are."""
        return reals(self.words, self.place)

    def coordinates(self) -> Reals:
        """The first three numbers of each row (n, 3); all are read: a damaged colour is damage."""
        values = self.reals()
        short = first(self.sizes < 3)
        if short is not None:
            raise FormatError(f"{self.where(short)}a vertex with {self.sizes[short]} coordinates")
        return values[spans(self.starts, np.full_like(self.sizes, 3))].reshape(-1, 3)


def lines(data: bytes, *, comments: bool) -> tuple[Rows, list[int]]:
    """The lines that hold words (more than a comment, where there are any), and their numbers."""
    words: list[bytes] = []
    sizes: list[int] = []
    numbers: list[int] = []
    for number, line in enumerate(without_mark(data).splitlines(), 1):
        found = (without_comment(line) if comments else line).split()
        if found:
            words += found
            sizes.append(len(found))
            numbers.append(number)
    return Rows(words, sizes, lambda i: f"line {numbers[i]}: "), numbers
