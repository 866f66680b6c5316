"""Labels in the picture: none covers another label, a closest point, or its own point.

viser draws a label wherever it is told to. So this module finds a place on the screen: beside the
label's point, or farther away with a thin line to it. A label without a free place is left out.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display.view import View

CHARACTER, LINE, MARGIN = 8.0, 18.0, 10.0
"""Pixels at scale 1: about the width of a character, the height of a line, both side margins."""

TIP = 7.0
"""Pixels that stay free around a closest point."""

AWAY = (12.0, 34.0, 62.0, 96.0)
"""Pixels between a point and the nearest side of its label, in the order of the attempts."""

LED = 20.0
"""If a label's nearest side is farther than this from its point, in pixels, a line joins them."""

LONGEST = 24
"""Maximum characters of a part's name in a label; a longer name loses its middle."""

GLYPHS = "0123456789.-… nm/adeilopst∞●▲△■□✖?"
"""All characters of clearances and signs. A browser draws a character that is new to it only in a
later frame, and the label shows its old text until then. So these are drawn at the start."""

EVERY_S = 0.1
"""Minimum seconds between two searches for places, each of which takes some milliseconds."""

_SIDES = np.array(
    [(0, -1), (1, -1), (-1, -1), (1, 0), (-1, 0), (0, 1), (1, 1), (-1, 1)], float
)  # up first; y points down


class Label(NamedTuple):
    """A label that needs a place."""

    text: str
    at: np.ndarray
    """(3,) the point to which it belongs, in the page's units."""
    scale: float = 1.0


def short(name: str, longest: int = LONGEST) -> str:
    """Return a name, without its middle if it is longer than `longest` characters."""
    half = (longest - 1) // 2
    return name if len(name) <= longest else f"{name[:half]}…{name[len(name) - half :]}"


def extent(label: Label) -> np.ndarray:
    """Return roughly the width and height of a label on the screen, in pixels."""
    lines = label.text.split("\n")
    wide = max(sum(1.0 if ord(c) < 0x2E80 else 1.8 for c in line) for line in lines)  # CJK: wide
    return label.scale * np.array([CHARACTER * wide + MARGIN, LINE * len(lines) + 4.0])


def places(labels: Sequence[Label], view: View, keep_free: np.ndarray) -> list[np.ndarray | None]:
    """Return the middle of each label on the screen, or None if there is no room for the label.

    Args:
        labels: the labels, the most important first.
        view: the view in which they are seen.
        keep_free: (n, 3) points that no label may cover, besides each label's own point.
    """
    if not labels:
        return []
    anchors, depth = view.project(np.array([label.at for label in labels]))
    tips, tip_depth = view.project(keep_free.reshape(-1, 3))
    tips = tips[tip_depth > 0.0]
    taken = np.column_stack((tips - TIP, tips + TIP))  # boxes: left, top, right, bottom
    found: list[np.ndarray | None] = []
    for label, anchor, deep in zip(labels, anchors, depth, strict=True):
        size = extent(label)
        tries = np.concatenate([anchor + _SIDES * (size / 2.0 + away) for away in AWAY])
        boxes = np.column_stack((tries - size / 2.0, tries + size / 2.0))
        own = np.concatenate((anchor - TIP, anchor + TIP))
        free = ~_overlap(boxes, np.vstack((taken, own))).any(axis=1)
        free &= (boxes[:, :2] >= 0.0).all(axis=1) & (boxes[:, 2:] <= view.size).all(axis=1)
        if deep <= 0.0 or not free.any():
            found.append(None)
            continue
        best = int(np.argmax(free))
        found.append(tries[best])
        taken = np.vstack((taken, boxes[best]))
    return found


def _overlap(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether boxes (n, 4) overlap others (m, 4), as (n, m)."""
    apart = (boxes[:, None, :2] >= others[None, :, 2:]) | (
        boxes[:, None, 2:] <= others[None, :, :2]
    )
    return ~apart.any(axis=2)


class Labels:
    """The labels of one page, and the lines that lead from them to their points."""

    def __init__(self, api: viser.SceneApi, under: str, every_s: float = EVERY_S) -> None:
        """Begin without labels.

        Args:
            api: takes the nodes.
            under: the node below which the labels are added.
            every_s: minimum seconds between two searches for places.
        """
        self._every_s, self._due_s = every_s, -math.inf
        self._api = api
        self._under = under
        self._nodes: list[viser.LabelHandle] = []
        self._drawn: tuple = ()
        nothing = np.zeros((1, 2, 3), np.float32)
        self._leaders = api.add_line_segments(
            f"{under}/leaders", nothing, (90, 95, 105), thickness=1.0, thickness_units="screen",
            visible=False,
        )  # fmt: skip
        api.add_label(f"{under}/glyphs", GLYPHS, visible=False)

    def show(
        self, labels: Sequence[Label], view: View, keep_free: np.ndarray, at_once: bool = False
    ) -> None:
        """Show the labels that have room, the most important first; at most every `every_s`."""
        now_s = time.monotonic()
        if now_s < self._due_s and not at_once:
            return
        drawn = ([(label.text, *label.at) for label in labels], _rounded(view))
        if drawn == self._drawn:
            return
        self._drawn, self._due_s = drawn, now_s + self._every_s
        found = places(labels, view, keep_free)
        leaders, put = [], [i for i, place in enumerate(found) if place is not None]
        at = np.array([labels[i].at for i in put]).reshape(-1, 3)
        steps = np.array([found[i] for i in put]).reshape(-1, 2) - view.project(at)[0]
        shifted = zip(view.shift(at, steps), np.abs(steps), strict=True)
        positions = dict(zip(put, shifted, strict=True))
        for i, (label, place) in enumerate(zip(labels, found, strict=True)):
            node = self._node(i)
            node.visible = place is not None
            if place is None:
                continue
            if node.text != label.text:
                node.text = label.text
            if node.font_screen_scale != label.scale:
                node.font_screen_scale = label.scale
            node.position, step = positions[i]
            if (step - extent(label) / 2.0).max() > LED:
                leaders.append((label.at, node.position))
        for node in self._nodes[len(labels) :]:
            node.visible = False
        self._leaders.visible = bool(leaders)
        if leaders:
            self._leaders.points = np.array(leaders, np.float32)

    def clear(self) -> None:
        """Remove all labels, because a label with a new text shows the old one for some frames."""
        for node in self._nodes:
            node.remove()
        self._nodes, self._drawn = [], ()
        self._leaders.visible = False

    def _node(self, i: int) -> viser.LabelHandle:
        if i == len(self._nodes):
            name = f"{self._under}/label_{i}"
            self._nodes.append(self._api.add_label(name, "", anchor="center-center"))
        return self._nodes[i]


def _rounded(view: View) -> tuple:
    return (*view.position, *view.axes.ravel().round(5), view.focal, *view.size)
