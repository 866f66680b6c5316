"""The clearances in 3D: a line for each pair between its closest points, labels, contact stars.

The pattern of a line shows its state without colour: solid while clear, dashed at warn, solid and
thick at stop, dotted while stale. A gap in the middle shows that the budget cut the search, so that
only bounds are known.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import viser

from proximity_monitor.display import inks
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.labels import Label, short
from proximity_monitor.display.signs import clearance, ramp, sign, uncertain
from proximity_monitor.display.state import STALE, STOP, UNKNOWN, WARN, Pairs, SceneInfo

LABELS = 10
"""Maximum number of pairs with a label: the nearest ones."""

ALWAYS = 3
"""How many of the nearest pairs have a label even if they are clear."""

OWN = 4
"""How many of the nearest pairs of the body at the gizmo have a label even if they are clear."""

THIN, THICK, DOT = 2.0, 5.0, 9.0
"""Pixels: width of thin and of thick lines, and size of the closest points."""

_SHORT = 1e-3
"""A closest point is drawn as a line of this share of the gap: a dot at any zoom."""


def pattern(level: int, unsure: bool) -> np.ndarray:
    """Return the drawn stretches of a line as (n, 2) fractions of its length."""
    if level == WARN:
        dashes = np.array([(i / 9.0, (i + 0.6) / 9.0) for i in range(9)])
    elif level == STALE:
        dashes = np.array([(i / 24.0, (i + 0.3) / 24.0) for i in range(24)])
    else:
        dashes = np.array([(0.0, 1.0)])
    if not unsure:
        return dashes
    halves = [np.clip(dashes, 0.0, 0.38), np.clip(dashes, 0.62, 1.0)]
    both = np.concatenate(halves)
    return both[both[:, 1] > both[:, 0]]


def shown_rows(pairs: Pairs, choice: Choice) -> np.ndarray:
    """Return the rows to draw, the nearest first: all that are not clear, and the nearest others.

    All pairs of the body at the gizmo are drawn. Ignored pairs and pairs without a pose are left
    out. A highlighted pair is drawn alone.
    """
    if choice.pair is not None:
        row = pairs.places.get(choice.pair)
        rows = [] if row is None or pairs.status[row] == UNKNOWN else [row]
        return np.array(rows, int)
    wanted = pairs.status != UNKNOWN
    for name in choice.ignored:
        if name in pairs.places:
            wanted[pairs.places[name]] = False
    rows = np.flatnonzero(wanted)
    rows = rows[np.argsort(pairs.lower[rows], kind="stable")]
    near = np.arange(len(rows)) < choice.lines
    if choice.body is not None:
        near |= np.array([choice.body in pairs.names[i] for i in rows], bool)
    return rows[near | (pairs.level[rows] != 0) | pairs.touching[rows]]


class Lines:
    """The scene nodes for the lines of all pairs."""

    def __init__(self, server: viser.ViserServer, scale: float, size: float) -> None:
        """Add the nodes, with nothing to show; `scale`: units per metre, `size`: of the scene."""
        api = server.scene
        self._scale = scale
        self._star = 0.02 * size * _STAR
        nothing = np.zeros((1, 2, 3), np.float32)
        self._lines = {
            width: api.add_line_segments(
                f"/distances/{name}", nothing, nothing.astype(np.uint8), thickness=width,
                thickness_units="screen", visible=False,
            )
            for name, width in (("thin", THIN), ("thick", THICK), ("points", DOT))
        }  # fmt: skip
        self.labels: list[Label] = []
        """The labels of drawn pairs: those of the body at the gizmo first, then the nearest."""
        self.tips = np.zeros((0, 3))
        """(n, 3) the drawn closest points, in the page's units."""

    def show(self, pairs: Pairs, scene: SceneInfo, choice: Choice) -> None:
        """Draw the pairs of a tick."""
        rows = shown_rows(pairs, choice)
        points = pairs.points[rows] * self._scale
        colours = np.array(
            [
                ramp(
                    float(pairs.lower[i]),
                    scene.thresholds_of(pairs.names[i]),
                    touching=bool(pairs.touching[i]),
                    stale=bool(pairs.level[i] == STALE),
                )
                for i in rows
            ],
            np.uint8,
        ).reshape(-1, 3)
        segments = {width: [] for width in self._lines}
        painted = {width: [] for width in self._lines}
        for (p, q), colour, i in zip(points, colours, rows, strict=True):
            loud = pairs.level[i] == STOP or pairs.touching[i] or choice.pair is not None
            width = THICK if loud else THIN
            if pairs.touching[i]:
                drawn = (p + q) / 2.0 + self._star
                if pairs.upper[i] < 0.0:
                    drawn = np.concatenate((drawn, [(p, q)]))
            else:
                drawn = p + (q - p) * pattern(pairs.level[i], uncertain(pairs, i))[..., None]
                dots = np.array([(p, p + _SHORT * (q - p)), (q, q + _SHORT * (p - q))])
                segments[DOT].append(dots)
                painted[DOT].append(np.broadcast_to(colour, dots.shape))
            segments[width].append(drawn)
            painted[width].append(np.broadcast_to(colour, drawn.shape))
        for width, line in self._lines.items():
            _set_lines(line, segments[width], painted[width])
        self.tips = points.reshape(-1, 3)
        self.labels = [
            Label(_told(pairs, rows[k], scene), points[k].mean(axis=0))
            for k in labelled(pairs, rows, choice.body)
        ]


def labelled(pairs: Pairs, rows: np.ndarray, body: str | None) -> np.ndarray:
    """Return which of the drawn rows have a label, as places in `rows`, the most important first.

    Args:
        pairs: the pairs of a tick.
        rows: (k,) from `shown_rows`.
        body: the body at the gizmo. Its nearest pairs come first, because the person who moves it
            looks there.
    """
    own = np.flatnonzero(np.isin(rows, pairs.rows_of.get(body, ())))[:OWN]
    urgent = (np.arange(len(rows)) < ALWAYS) | (pairs.level[rows] != 0) | pairs.touching[rows]
    urgent[own] = False
    return np.concatenate((own, np.flatnonzero(urgent)))[:LABELS]


def _told(pairs: Pairs, i: int, scene: SceneInfo) -> str:
    a, b = map(short, pairs.names[i])
    return f"{sign(pairs, i, scene).glyph} {clearance(pairs, i, scene.unit)}\n{a} - {b}"


def _set_lines(
    line: viser.LineSegmentsHandle, segments: Sequence[np.ndarray], colours: Sequence[np.ndarray]
) -> None:
    line.visible = bool(segments)
    if segments:
        line.points = np.concatenate(segments).astype(np.float32)
        line.colors = inks.sent(np.concatenate(colours))


def _star() -> np.ndarray:
    """Return six line segments through the origin, (6, 2, 3)."""
    spokes = np.array(
        [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.7, 0.7, 0), (0, 0.7, 0.7), (0.7, 0, 0.7)]
    )
    return np.stack((-spokes, spokes), axis=1)


_STAR = _star()
