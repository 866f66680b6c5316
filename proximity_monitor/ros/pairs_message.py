"""All pairs of a tick in numbers: ``~/pairs``, a `sensor_msgs/PointCloud2` of one point per pair.

It lists the pairs of ``~/closest_points`` in the same order, but takes a small part of the time
that texts take: numpy writes the columns, and a reader uses them as they are. The type describes
its own fields, and every viewer and converter of clouds reads it. Numbers stand for bodies and
texts; ``~/scene`` explains them. The checksum says whether a ``~/scene`` is of the same scene.

=========================  =======================================================================
``header``                 the tick's stamp, the fixed frame
``x, y, z``                the closest point on A, metres; NaN without a pose, as all lengths here
``x_b, y_b, z_b``          the closest point on B, metres
``lower, upper``           certified bounds, metres
``session_min``, ``session_min_lower``  the smallest upper and lower bounds since the last reset
``stamp``                  the older stamp of the two bodies' poses, seconds
``age_s``                  seconds since the numbers answered the poses of that time; 0 if they
                           answer the present ones
``u_a, v_a, w_a``          for a pair at warn or stop: parameters of A's point on its element
``u_b, v_b, w_b``          the same for B's point; NaN if the kind of element does not need them
``a, b``                   positions among ``bodies`` of ``~/scene``
``checksum``               the checksum of ``~/scene``
``element_a, element_b``   which element the points lie on, such as a triangle's number; -1: unknown
``on_a, on_b``             the kind of element: a position among ``words`` of ``~/scene``, plus 1
``silent_a, silent_b``     why the body is silent: a position among ``words``, plus 1; 0: it is not
``level``                  0 clear, 1 warn, 2 stop, 3 stale
``status``                 0 exact, 1 within tolerance, 2 bounded, 3 intersecting, 4 overlapping,
                           5 unknown pose
=========================  =======================================================================
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from sensor_msgs.msg import PointField

from proximity_monitor import cdr
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.state import (
    NO_POSE_YET,
    NO_RECENT_POSE,
    STATUSES,
    PairStates,
    PairStatus,
)

_COLUMNS = {
    "<f8": "x y z x_b y_b z_b lower upper session_min session_min_lower stamp age_s"
    " u_a v_a w_a u_b v_b w_b",
    "<u4": "a b checksum",
    "<i4": "element_a element_b",
    "<u2": "on_a on_b silent_a silent_b",
    "u1": "level status",
}
_ROW = np.dtype([(name, kind) for kind, names in _COLUMNS.items() for name in names.split()])
_TYPES = {
    "<f8": PointField.FLOAT64,
    "<u4": PointField.UINT32,
    "<i4": PointField.INT32,
    "<u2": PointField.UINT16,
    "u1": PointField.UINT8,
}
_FIELDS = cdr.count(len(_ROW.names)) + b"".join(
    cdr.text(name) + cdr.count(_ROW.fields[name][1]) + bytes((_TYPES[kind], 0, 0, 0)) + cdr.count(1)
    for kind, names in _COLUMNS.items()
    for name in names.split()
)
_LEVELS = tuple(Level)
_UNKNOWN = STATUSES.index(PairStatus.UNKNOWN)
_NEAR = (_LEVELS.index(Level.WARN), _LEVELS.index(Level.STOP))


def checksum(names: Sequence[str]) -> int:
    """Return the CRC-32 of the names of all bodies in the scene's order, one per line."""
    return zlib.crc32("\n".join(names).encode())


class PairsMessage:
    """Makes the message, and remembers the words that its numbers stand for.

    Attributes:
        words: the texts so far; a new reason or a new kind of element is appended.
    """

    def __init__(self, names: Sequence[str], frame: str) -> None:
        """Begin without words.

        Args:
            names: the names of all bodies, in the scene's order.
            frame: the fixed frame.
        """
        self.words: list[str] = []
        self._names = tuple(names)
        self._checksum = checksum(names)
        self._frame = cdr.text(frame)

    def serialised(
        self,
        pairs: PairStates,
        levels: Mapping[int, Level],
        *,
        stamp: Time,
        pose_stamp_ns: Callable[[str], int | None],
        silent: Mapping[str, str],
    ) -> bytes:
        """Return the message of a tick.

        Args:
            pairs: the pairs that the tick lists, with the names of all bodies.
            levels: by the pair's index in the scene.
            stamp: the tick's stamp.
            pose_stamp_ns: returns the stamp of a body's pose, by name.
            silent: the reason for each silent body.
        """
        rows = np.zeros(len(pairs), _ROW)
        first, second = pairs.bodies.T
        for i, side in enumerate(("", "_b")):
            for k, axis in enumerate("xyz"):
                rows[axis + side] = pairs.points[:, i, k]
        for name in ("lower", "upper", "age_s", "status"):
            rows[name] = getattr(pairs, name)
        for name in ("session_min", "session_min_lower"):
            known = getattr(pairs, name)
            rows[name] = np.where(np.isinf(known), np.nan, known)
        rows["a"], rows["b"], rows["checksum"] = first, second, self._checksum
        self._tell_levels(rows, pairs, levels)
        told = (pose_stamp_ns(name) for name in self._names)
        stamps = np.array([np.nan if ns is None else ns * 1e-9 for ns in told])
        unknown = pairs.status == _UNKNOWN
        rows["stamp"] = np.where(unknown, np.nan, np.fmin(stamps[first], stamps[second]))
        rows["age_s"][unknown] = np.nan
        self._tell_silent(rows, pairs, silent, unknown)
        self._tell_elements(rows, pairs)
        size = cdr.count(_ROW.itemsize * len(rows))
        return b"".join(
            (
                cdr.stamped(stamp.sec, stamp.nanosec),
                self._frame,
                cdr.count(1),  # height
                cdr.count(len(rows)),  # width
                _FIELDS,
                bytes(4),  # little-endian, and padding
                cdr.count(_ROW.itemsize),
                size,  # of the one row
                size,  # of the data
                rows.tobytes(),
                b"\0",  # not dense: numbers may be NaN
            )
        )

    def _code(self, word: str) -> int:
        """Return the number that stands for a word."""
        if word not in self.words:
            self.words.append(word)
        return self.words.index(word) + 1

    def _tell_levels(
        self, rows: np.ndarray, pairs: PairStates, levels: Mapping[int, Level]
    ) -> None:
        """Write the levels that are not clear, which are few; the rows hold 0, clear, already."""
        clear = Level.CLEAR
        unclear = {i: level for i, level in levels.items() if level is not clear}
        for row in np.flatnonzero(np.isin(pairs.positions, list(unclear))).tolist():
            rows["level"][row] = _LEVELS.index(unclear[int(pairs.positions[row])])

    def _tell_silent(
        self, rows: np.ndarray, pairs: PairStates, reasons: Mapping[str, str], unknown: np.ndarray
    ) -> None:
        if not pairs.silent.any():
            return
        told = (reasons.get(name) for name in self._names)
        codes = np.array([0 if reason is None else self._code(reason) for reason in told])
        otherwise = np.where(unknown, self._code(NO_POSE_YET), self._code(NO_RECENT_POSE))
        for i, name in enumerate(("silent_a", "silent_b")):
            code = codes[pairs.bodies[:, i]]
            rows[name] = np.where(pairs.silent[:, i], np.where(code, code, otherwise), 0)

    def _tell_elements(self, rows: np.ndarray, pairs: PairStates) -> None:
        """Write which elements the points of pairs at warn and stop lie on, and where."""
        rows["element_a"] = rows["element_b"] = -1
        for name in ("u_a", "v_a", "w_a", "u_b", "v_b", "w_b"):
            rows[name] = np.nan
        known = np.isin(rows["level"], _NEAR) & (pairs.elements[:, 0] >= 0)
        for row in np.flatnonzero(known).tolist():
            for i, side in enumerate("ab"):
                kind = pairs.kinds[pairs.bodies[row, i]]
                found = kind.feature(int(pairs.elements[row, i]), pairs.parameters[row, i])
                rows[f"on_{side}"][row] = self._code(found.kind)
                rows[f"element_{side}"][row] = found.index
                for axis, value in zip("uvw", found.parameters.tolist(), strict=False):
                    rows[f"{axis}_{side}"][row] = value
