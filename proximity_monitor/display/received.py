"""The monitor's messages, read from their bytes."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from proximity_monitor.cdr import Reader, from_octahedral
from proximity_monitor.display.state import LEVELS, STATUSES, Pairs, shared

_LEVEL = {name.encode(): i for i, name in enumerate(LEVELS)}
_STATUS = {name.encode(): i for i, name in enumerate(STATUSES)}
_SILENT = re.compile(r"no (recent|new|[\w ]+ yet)\b.* of .*")
_NOWHERE = b"nan nan nan"


def read_pairs(data: bytes) -> tuple[float, Pairs]:
    """Read ~/closest_points, a serialised DiagnosticArray.

    Returns:
        The stamp of the tick in seconds, and its pairs.

    Raises:
        ValueError: it is not what a monitor publishes.
    """
    reader = Reader(data)
    stamp_s = reader.stamp_s()
    reader.text()
    names, silent, told = [], [], []
    for _ in range(reader.count()):
        reader.byte()
        a, _, b = reader.text().partition(" - ")
        names.append((a, b))
        message = reader.text()
        found = _SILENT.search(message)
        silent.append(found[0] if found else "")
        reader.text()
        told.append(_values(reader))
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
    features = {
        i: (t[b"feature_a"].decode(), t[b"feature_b"].decode())
        for i, t in enumerate(told)
        if b"feature_a" in t and b"feature_b" in t
    }
    return stamp_s, Pairs(
        shared(tuple(names)), lower, upper, places, status.astype(np.int8), level.astype(np.int8),
        age, stamp, tuple(silent), features,
    )  # fmt: skip


def _code(codes: Mapping[bytes, int], word: bytes) -> int:
    code = codes.get(word)
    if code is None:
        raise ValueError(f"{word.decode()} of a pair of ~/closest_points is not known")
    return code


def _values(reader: Reader) -> dict[bytes, bytes]:
    """Read the named values of a pair without decoding, because they are most of the bytes."""
    data, count, found = reader.data, reader.count, {}
    for _ in range(count()):
        length = count()
        at = reader.at
        reader.at = at + length
        key = data[at : at + length - 1]
        length = count()
        at = reader.at
        reader.at = at + length
        found[key] = data[at : at + length - 1]
    return found


def read_poses(data: bytes) -> tuple[float, np.ndarray]:
    """Read ~/poses, a serialised PoseArray.

    Returns:
        The stamp in seconds, and the poses (m, 7): x y z, quaternion w x y z.

    Raises:
        ValueError: it is not what a monitor publishes.
    """
    reader = Reader(data)
    stamp_s = reader.stamp_s()
    reader.text()
    count = reader.count()
    numbers = reader.array("f8", 7 * count).reshape(-1, 7)
    return stamp_s, np.ascontiguousarray(numbers[:, [0, 1, 2, 6, 3, 4, 5]])


class Part:
    """A body as ~/parts shows it."""

    def __init__(
        self,
        pose: np.ndarray | None,
        colour: np.ndarray,
        corners: np.ndarray,
        normals: np.ndarray | None = None,
    ) -> None:
        """Keep what is told.

        Args:
            pose: (7,), or None.
            colour: (4,) red, green, blue, opacity.
            corners: (3n, 3) of the triangles, metres.
            normals: (3n, 3) unit normals of the surface there; None: all triangles are flat.
        """
        self.pose = pose
        self.colour = colour
        self.corners = corners
        self.normals = normals


def read_parts(data: bytes) -> list[Part]:
    """Read ~/parts, a serialised MarkerArray with one marker a body in the scene's order.

    Raises:
        ValueError: it is not what a monitor publishes.
    """
    reader = Reader(data)
    return [_part(reader) for _ in range(reader.count())]


def _part(reader: Reader) -> Part:
    reader.stamp_s()
    reader.text()  # frame_id
    reader.text()  # ns
    reader.count()  # id
    reader.count()  # type
    added = reader.count() == 0
    pose = reader.array("f8", 7)[[0, 1, 2, 6, 3, 4, 5]]
    reader.skip(8, 3)  # scale
    colour = reader.array("f4", 4)
    reader.skip(4, 2)  # lifetime
    reader.byte()  # frame_locked
    count = reader.count()
    corners = reader.array("f8", 3 * count).reshape(-1, 3)
    reader.skip(4, 4 * reader.count())  # colours of the points
    reader.text()  # texture_resource
    reader.stamp_s()  # the texture: header, format and data
    reader.text()
    reader.text()
    reader.skip(1, reader.count())
    told = reader.array("f4", 2 * reader.count()).reshape(-1, 2)  # its coordinates
    normals = from_octahedral(told) if count and len(told) == count else None
    reader.text()  # text
    reader.text()  # mesh_resource
    reader.text()  # mesh_file: name and data
    reader.skip(1, reader.count())
    reader.byte()  # mesh_use_embedded_materials
    return Part(pose if added else None, colour, corners, normals)
