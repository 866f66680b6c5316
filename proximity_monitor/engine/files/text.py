"""Words and numbers of text files.

Python accepts more numbers than the formats do: 1_0 means 10, and a str may hold the digits of
other scripts. So numbers are parsed from bytes, and a word with an underscore is refused. Infinity
and NaN are numbers here; the readers refuse them as coordinates.
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
    """Return a text without the byte-order mark that some editors write before UTF-8."""
    return data.removeprefix(b"\xef\xbb\xbf")


def without_comment(line: bytes) -> bytes:
    """Return a line up to its comment; 1.#INF is no comment: some libraries write it for inf."""
    return _COMMENT.split(line, 1)[0] if b"#" in line else line


def shown(word: bytes) -> str:
    """Return a word of a file in the form that messages print."""
    return repr(word[:40].decode("ascii", "backslashreplace"))


def nowhere(_: int) -> str:
    """Return an empty place, for words whose place need not be named."""
    return ""


def reals(words: Sequence[bytes], where: Where = nowhere) -> Reals:
    """Parse words as numbers; `where` names the place of a word that is none."""
    return _parsed(words, float, np.float64, where)


def wholes(words: Sequence[bytes], where: Where = nowhere) -> Ints:
    """Parse words as whole numbers; `where` names the place of a word that is none."""
    return _parsed(words, int, np.int64, where)


def _parsed(words: Sequence[bytes], kind: Callable, dtype: type, where: Where) -> NDArray:
    try:
        if b"_" not in b"".join(words):
            return np.array(list(map(kind, words)), dtype=dtype)
    except (ValueError, OverflowError):
        pass
    legal, name = (_REAL, "number") if kind is float else (_WHOLE, "whole number")
    bad = next(i for i, word in enumerate(words) if not legal.fullmatch(word))
    raise FormatError(f"{where(bad)}{shown(words[bad])} is not a {name}")


class Rows:
    """The words of rows, concatenated.

    One list of all words takes a third of the time of a list for each row.

    Args:
        words: the words of all rows.
        sizes: how many words each row has.
        where: names the place of a row.
    """

    def __init__(self, words: list[bytes], sizes: Sequence[int] | Ints, where: Where) -> None:
        self.words = words
        self.sizes = np.array(sizes, dtype=np.int64)
        self.starts = np.cumsum(self.sizes) - self.sizes
        self.where = where

    def place(self, word: int) -> str:
        """Return the place of a word: that of its row."""
        return self.where(int(np.searchsorted(self.starts, word, side="right")) - 1)

    def cut(self, begin: int, end: int) -> Rows:
        """Return the rows from `begin` to before `end`."""
        starts = [*self.starts[begin : end + 1].tolist(), len(self.words)]
        words = self.words[starts[0] : starts[max(end - begin, 0)]]
        return Rows(words, self.sizes[begin:end], lambda i: self.where(begin + i))

    def reals(self) -> Reals:
        """Parse all words as numbers."""
        return reals(self.words, self.place)

    def coordinates(self) -> Reals:
        """Return the first three numbers of each row (n, 3).

        All words are parsed, so a damaged colour is an error too.
        """
        values = self.reals()
        short = first(self.sizes < 3)
        if short is not None:
            raise FormatError(
                f"{self.where(short)}a vertex has {self.sizes[short]} coordinates, expected 3"
            )
        return values[spans(self.starts, np.full_like(self.sizes, 3))].reshape(-1, 3)


def lines(data: bytes, *, comments: bool) -> tuple[Rows, list[int]]:
    """Return the lines that hold words, and their line numbers.

    If `comments`, comments are removed first; a line with only a comment holds no words.
    """
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
