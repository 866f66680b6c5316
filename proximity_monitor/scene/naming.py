"""Names of bodies, which may be any text, and the words that stand for them in ROS names.

`rooted` compares topics, because one topic can be written in more than one way. `counted` puts a
number of things into words.
"""

from __future__ import annotations

import re
import unicodedata
from hashlib import sha256

EVERYTHING = "all"
"""The name that means every body in `pairs`, unless a body, robot or group has that name."""

_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_UNFIT = re.compile(r"[^a-z0-9]+")
_LONGEST = 160
"""A word of at most this many characters is used as it is; DDS allows 255 for a whole topic."""

_KEPT = 40
"""How many characters of any other name its word keeps."""

_LENGTH = 200
"""How many characters a name may have, according to the schema of scene files."""


def safe(name: str) -> str:
    """Return a word for a name, to be part of a topic or of a parameter's name.

    A word of letters, digits and underscores that begins with a letter is returned as it is. Any
    other name loses its accents and signs and gets eight hexadecimal digits of its hash at the end:
    ``Schraube M8×40`` becomes ``schraube_m840_34f32161``.
    """
    if _WORD.fullmatch(name) and len(name) <= _LONGEST:
        return name
    plain = unicodedata.normalize("NFKD", name.lower()).encode("ascii", "ignore").decode()
    kept = _UNFIT.sub("_", plain).strip("_")[:_KEPT].rstrip("_")
    kept = kept if kept and kept[0].isalpha() else f"part_{kept}".rstrip("_")
    return f"{kept}_{sha256(name.encode()).hexdigest()[:8]}"


def rooted(topic: str) -> str:
    """Return a topic's full name in a node without a namespace, to compare topics.

    ``joints`` and ``/joints`` are the same topic there. ``~/joints`` is returned as it is, because
    it depends on the node's name.
    """
    return topic if topic.startswith(("/", "~")) else f"/{topic}"


def fitting(text: str, end: str = "") -> str:
    """Return a body's name for a text from CAD: the text itself if it is allowed as a name.

    A name is one line of 1 to 200 characters. A pair is written ``A - B``, so no name contains a
    hyphen between spaces.

    Args:
        text: any text.
        end: a suffix of the name, which stays whole if the text is shortened.
    """
    plain = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    while " - " in plain:
        plain = plain.replace(" - ", "-")
    return (plain[: _LENGTH - len(end)].strip() or "part") + end


def counted(number: int, one: str, many: str) -> str:
    """Return e.g. ``1 body`` or ``2 bodies``."""
    return f"{number} {one if number == 1 else many}"
