"""Names of bodies, which may be any text, and what stands for them where ROS wants a word.

Topics, too, have more than one name.
"""

from __future__ import annotations

import re
import unicodedata
from hashlib import sha256

EVERYTHING = "all"
"""The name that stands for every body in pairs, unless something has that name."""

_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_UNFIT = re.compile(r"[^a-z0-9]+")
_LONGEST = 160
"""A word may have so many characters as it is; DDS allows a topic 255 with all around it."""

_KEPT = 40
"""Characters of another name that its word keeps."""

_LENGTH = 200
"""Characters that a name may have, as the schema of scene files says."""


def safe(name: str) -> str:
    """Return a word for a name, to be part of a topic or of a parameter's name.

    A word of letters, digits and underscores with a letter in front stands for itself. Another text
    keeps what is left of it without accents and signs, and ends with eight digits that are its own:
    ``Schraube M8×40`` is ``schraube_m840_34f32161``.
    """
    if _WORD.fullmatch(name) and len(name) <= _LONGEST:
        return name
    plain = unicodedata.normalize("NFKD", name.lower()).encode("ascii", "ignore").decode()
    kept = _UNFIT.sub("_", plain).strip("_")[:_KEPT].rstrip("_")
    kept = kept if kept and kept[0].isalpha() else f"part_{kept}".rstrip("_")
    return f"{kept}_{sha256(name.encode()).hexdigest()[:8]}"


def rooted(topic: str) -> str:
    """Return a topic's full name as a node without a namespace has it, to compare topics.

    ``joints`` and ``/joints`` are one there. ``~/joints`` stays: it depends on the node's name.
    """
    return topic if topic.startswith(("/", "~")) else f"/{topic}"


def fitting(text: str, end: str = "") -> str:
    """Return the name of a body for a text of CAD, which is that text wherever a body may have it.

    A name is one line of 1 to 200 characters. A pair is told as ``A - B``, so no name has a
    hyphen between spaces.

    Args:
        text: any.
        end: is put behind it, and stays whole where the text is shortened.
    """
    plain = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    while " - " in plain:
        plain = plain.replace(" - ", "-")
    return (plain[: _LENGTH - len(end)].strip() or "part") + end
