"""The monitor's messages, read from their bytes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from proximity_monitor.cdr import Reader, from_octahedral
from proximity_monitor.display.state import (
    LEVELS,
    STALE,
    STATUSES,
    STOP,
    WARN,
    PairNames,
    Pairs,
    SceneInfo,
)
from proximity_monitor.scene.state import silence

_KINDS = {2: "u1", 4: "u2", 5: "i4", 6: "u4", 8: "f8"}
"""Types of the numbers in a cloud, by the codes of `sensor_msgs/PointField`."""

_POINTS = ("x", "y", "z", "x_b", "y_b", "z_b")
_READ = {
    *_POINTS, "lower", "upper", "age_s", "stamp", "status", "level", "a", "b", "checksum",
    "silent_a", "silent_b", "on_a", "on_b", "element_a", "element_b",
    "u_a", "v_a", "w_a", "u_b", "v_b", "w_b",
}  # fmt: skip


class OfAnotherSceneError(ValueError):
    """A message belongs to another scene than the known one."""


def read_pairs(data: bytes, scene: SceneInfo) -> tuple[float, Pairs]:
    """Read ~/pairs, a serialised PointCloud2.

    Returns:
        The stamp of the tick in seconds, and its pairs.

    Raises:
        OfAnotherSceneError: the message's bodies are not those of `scene`.
        ValueError: the message is not what a monitor publishes.
    """
    reader = Reader(data)
    stamp_s = reader.stamp_s()
    reader.text()
    height, count = reader.count(), reader.count()
    rows = _rows(reader, height * count)
    try:
        if (rows["checksum"] != scene.checksum).any():
            raise OfAnotherSceneError("~/pairs and ~/scene are of different scenes")
        bodies = np.stack((rows["a"], rows["b"]), axis=1)
        names = _names(scene.names, bodies.astype("<u4").tobytes())
        if (rows["status"] >= len(STATUSES)).any() or (rows["level"] >= len(LEVELS)).any():
            raise ValueError("a pair in ~/pairs has an unknown level or status")
        status, level = rows["status"].astype(np.int8), rows["level"].astype(np.int8)
        lower, upper, age, stamp = (
            rows[name].astype(np.float64) for name in ("lower", "upper", "age_s", "stamp")
        )
        points = np.stack([rows[name] for name in _POINTS], axis=1).reshape(-1, 2, 3)
        silent, mute = _silent(rows, names, level, scene.words)
        features = _features(rows, level, scene.words)
    except IndexError as error:
        raise ValueError(f"~/pairs cannot be interpreted: {error}") from error
    return stamp_s, Pairs(
        names, lower, upper, points, status, level, age, stamp, silent, features, mute
    )


def _rows(reader: Reader, count: int) -> np.ndarray:
    """Return the points of a cloud as records (count,), laid out as the cloud says."""
    names, kinds, offsets = [], [], []
    for _ in range(reader.count()):
        names.append(reader.text())
        offsets.append(reader.count())
        kind = reader.byte()
        reader.count()  # how many numbers: one
        kinds.append(_KINDS.get(kind))
    order = ">" if reader.byte() else "<"
    size = reader.count()
    reader.count()  # bytes of a row
    if missing := _READ.difference(names):
        raise ValueError(f"~/pairs lacks the fields {', '.join(sorted(missing))}")
    if None in kinds or reader.count() != size * count:
        raise ValueError("the fields of ~/pairs have unexpected types or sizes")
    formats = [f"{order}{kind}" for kind in kinds]
    layout = {"names": names, "formats": formats, "offsets": offsets, "itemsize": size}
    return np.frombuffer(reader.data, np.dtype(layout), count, reader.at)


@lru_cache(maxsize=16)
def _names(bodies: Sequence[str], places: bytes) -> PairNames:
    """Return the names of the pairs: the same object for equal pairs, which most ticks share."""
    known, count = _known(bodies), len(bodies)
    a, b = np.frombuffer(places, "<u4").reshape(-1, 2).T.astype(np.int64)
    if len(a) and max(a.max(), b.max()) >= count:
        raise IndexError("it refers to a body that the scene does not have")
    return tuple(
        known.get(code) or known.setdefault(code, (bodies[code // count], bodies[code % count]))
        for code in (a * count + b).tolist()
    )


@lru_cache(maxsize=2)
def _known(bodies: Sequence[str]) -> dict[int, tuple[str, str]]:
    """Return a cache of the scene's pair names, so that each tick uses the same objects."""
    return {}


def _silent(
    rows: np.ndarray, names: PairNames, level: np.ndarray, words: Sequence[str]
) -> tuple[tuple[str, ...], Mapping[int, tuple[str, ...]]]:
    """Return, for each pair, why its bodies are silent, and by row which bodies are silent."""
    found, mute = [""] * len(rows), {}
    stale = np.flatnonzero(level == STALE)
    codes = zip(rows["silent_a"][stale].tolist(), rows["silent_b"][stale].tolist(), strict=True)
    words = tuple(words)
    for i, of in zip(stale.tolist(), codes, strict=True):
        found[i], mute[i] = _silence(names[i], of, words)
    return tuple(found), mute


@lru_cache(maxsize=1 << 15)
def _silence(
    pair: tuple[str, str], codes: tuple[int, int], words: tuple[str, ...]
) -> tuple[str, tuple[str, ...]]:
    """Return why a pair's bodies are silent, and which are; cached, as ticks repeat it."""
    told = {
        name: _word(code, words, "no news") for name, code in zip(pair, codes, strict=True) if code
    }
    return silence(told, told), tuple(told)


def _features(
    rows: np.ndarray, level: np.ndarray, words: Sequence[str]
) -> Mapping[int, tuple[str, str]]:
    """Return by row on what the closest points lie, for pairs at warn or stop that tell it."""
    near = (level == WARN) | (level == STOP)
    found = {}
    for i in np.flatnonzero(near & (rows["element_a"] >= 0)).tolist():
        row, told = rows[i], []
        for side in "ab":
            where = [row[f"{axis}_{side}"] for axis in "uvw"]
            numbers = (f"{value:.9g}" for value in where if not np.isnan(value))
            kind = _word(row[f"on_{side}"], words, "element")
            told.append(" ".join((kind, str(row[f"element_{side}"]), *numbers)))
        found[i] = (told[0], told[1])
    return found


def _word(code: int, words: Sequence[str], otherwise: str) -> str:
    """Return the word for a code; a new word may come a moment later, with the next ~/scene."""
    return words[code - 1] if 0 < code <= len(words) else otherwise


def read_poses(data: bytes) -> tuple[float, np.ndarray]:
    """Read ~/poses, a serialised PoseArray.

    Returns:
        The stamp in seconds, and the poses (m, 7): x y z, quaternion w x y z.

    Raises:
        ValueError: the message is not what a monitor publishes.
    """
    reader = Reader(data)
    stamp_s = reader.stamp_s()
    reader.text()
    count = reader.count()
    numbers = reader.array("f8", 7 * count).reshape(-1, 7)
    return stamp_s, np.ascontiguousarray(numbers[:, [0, 1, 2, 6, 3, 4, 5]])


class Part:
    """A body as ~/parts shows it: pose, colour and triangles."""

    def __init__(
        self,
        pose: np.ndarray | None,
        colour: np.ndarray,
        corners: np.ndarray,
        normals: np.ndarray | None = None,
        solid: bool = True,
        deviation: float = 0.0,
    ) -> None:
        """Keep the values.

        Args:
            pose: (7,), or None.
            colour: (4,) red, green, blue, opacity.
            corners: (3n, 3) of the triangles, metres.
            normals: (3n, 3) unit normals of the surface there; None: all triangles are flat.
            solid: whether the body has an inside; it has no meaning for points and lines.
            deviation: metres; how far the triangles are at most from the body; inf: not known.
        """
        self.pose = pose
        self.colour = colour
        self.corners = corners
        self.normals = normals
        self.solid = solid
        self.deviation = deviation

    def looks_like(self, other: Part) -> bool:
        """Return whether both have the same triangles and normals."""
        if (self.normals is None) != (other.normals is None):
            return False
        same = self.normals is None or np.array_equal(self.normals, other.normals)
        return same and np.array_equal(self.corners, other.corners)


def read_parts(data: bytes) -> list[Part]:
    """Read ~/parts, a serialised MarkerArray with a marker for each body in the scene's order.

    Raises:
        ValueError: the message is not what a monitor publishes.
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
    reader.stamp_s()  # the texture: header (stamp, frame_id), format and data
    reader.text()
    reader.text()
    reader.skip(1, reader.count())
    told = reader.array("f4", 2 * reader.count()).reshape(-1, 2)  # its coordinates
    normals = from_octahedral(told) if count and len(told) == count else None
    told_of = reader.text()
    reader.text()  # mesh_resource
    reader.text()  # mesh_file: name and data
    reader.skip(1, reader.count())
    reader.byte()  # mesh_use_embedded_materials
    try:
        of = json.loads(told_of)
        solid, deviation = (
            bool(of["solid"]),
            math.inf if of["off_m"] is None else float(of["off_m"]),
        )
    except (TypeError, KeyError, ValueError) as error:
        raise ValueError(f"a body in ~/parts cannot be interpreted: {error}") from error
    return Part(pose if added else None, colour, corners, normals, solid, deviation)
