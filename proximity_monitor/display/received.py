"""The monitor's messages, read from their bytes."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from proximity_monitor.display.cdr import Cursor
from proximity_monitor.display.state import LEVELS, STATUSES, Pairs, shared

_LEVEL = {name.encode(): i for i, name in enumerate(LEVELS)}
_STATUS = {name.encode(): i for i, name in enumerate(STATUSES)}
_SILENT = re.compile(r"no (recent|new|\w+ yet)\b.* of .*")
_NOWHERE = b"nan nan nan"


def read_pairs(data: bytes) -> tuple[float, Pairs]:
    """Read ~/closest_points, a serialised DiagnosticArray.

    Returns:
        The stamp of the tick in seconds, and its pairs.

    Raises:
        ValueError: it is not what a monitor publishes.
    """
    cursor = Cursor(data)
    stamp_s = cursor.stamp_s()
    cursor.text()
    names, silent, told = [], [], []
    for _ in range(cursor.count()):
        cursor.byte()
        a, _, b = cursor.text().partition(" - ")
        names.append((a, b))
        message = cursor.text()
        found = _SILENT.search(message)
        silent.append(found[0] if found else "")
        cursor.text()
        told.append(_values(cursor))
    try:
        numbers = np.array(
            [
                (*map(float, (t[b"lower_m"], t[b"upper_m"], t[b"age_s"], t[b"stamp"])),
                 _code(_STATUS, t[b"status"]), _code(_LEVEL, t[b"state"]))
                for t in told
            ]
        ).reshape(-1, 6)  # fmt: skip
        points = b" ".join(t[key] or _NOWHERE for t in told for key in (b"point_a", b"point_b"))
        places = np.array(points.split(), float).reshape(-1, 2, 3)
    except KeyError as error:
        raise ValueError(f"a pair of ~/closest_points has no {error}") from error
    lower, upper, age, stamp, status, level = numbers.T
    return stamp_s, Pairs(
        shared(tuple(names)), lower, upper, places, status.astype(np.int8), level.astype(np.int8),
        age, stamp, tuple(silent),
    )  # fmt: skip


def _code(codes: Mapping[bytes, int], word: bytes) -> int:
    code = codes.get(word)
    if code is None:
        raise ValueError(f"{word.decode()} of a pair of ~/closest_points is not known")
    return code


def _values(cursor: Cursor) -> dict[bytes, bytes]:
    """Read the named values of a pair: nearly all bytes are here, so nothing is decoded."""
    data, count, found = cursor.data, cursor.count, {}
    for _ in range(count()):
        length = count()
        at = cursor.at
        cursor.at = at + length
        key = data[at : at + length - 1]
        length = count()
        at = cursor.at
        cursor.at = at + length
        found[key] = data[at : at + length - 1]
    return found


def read_poses(data: bytes) -> tuple[float, np.ndarray]:
    """Read ~/poses, a serialised PoseArray.

    Returns:
        The stamp in seconds, and the poses (m, 7): x y z, quaternion w x y z.

    Raises:
        ValueError: it is not what a monitor publishes.
    """
    cursor = Cursor(data)
    stamp_s = cursor.stamp_s()
    cursor.text()
    count = cursor.count()
    numbers = cursor.array("f8", 7 * count).reshape(-1, 7)
    return stamp_s, np.ascontiguousarray(numbers[:, [0, 1, 2, 6, 3, 4, 5]])


class Part:
    """A body as ~/parts shows it."""

    def __init__(self, pose: np.ndarray | None, colour: np.ndarray, corners: np.ndarray) -> None:
        """Keep `pose` (7,) or None, `colour` (4,) and the triangles' corners (3n, 3), metres."""
        self.pose = pose
        self.colour = colour
        self.corners = corners


def read_parts(data: bytes) -> list[Part]:
    """Read ~/parts, a serialised MarkerArray with one marker a body in the scene's order.

    Raises:
        ValueError: it is not what a monitor publishes.
    """
    cursor = Cursor(data)
    return [_part(cursor) for _ in range(cursor.count())]


def _part(cursor: Cursor) -> Part:
    cursor.stamp_s()
    cursor.text()  # frame_id
    cursor.text()  # ns
    cursor.count()  # id
    cursor.count()  # type
    added = cursor.count() == 0
    pose = cursor.array("f8", 7)[[0, 1, 2, 6, 3, 4, 5]]
    cursor.skip(8, 3)  # scale
    colour = cursor.array("f4", 4)
    cursor.skip(4, 2)  # lifetime
    cursor.byte()  # frame_locked
    count = cursor.count()
    corners = cursor.array("f8", 3 * count).reshape(-1, 3)
    cursor.skip(4, 4 * cursor.count())  # colours of the points
    cursor.text()  # texture_resource
    cursor.stamp_s()  # the texture: header, format and data
    cursor.text()
    cursor.text()
    cursor.skip(1, cursor.count())
    cursor.skip(4, 2 * cursor.count())  # its coordinates
    cursor.text()  # text
    cursor.text()  # mesh_resource
    cursor.text()  # mesh_file: name and data
    cursor.skip(1, cursor.count())
    cursor.byte()  # mesh_use_embedded_materials
    return Part(pose if added else None, colour, corners)
