"""A part's triangles as they are drawn. All browsers share them, because they take long to make."""

from __future__ import annotations

from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from proximity_monitor.display.detail import has_levels
from proximity_monitor.display.geometry import (
    SHARP,
    SMOOTH,
    borders,
    face_normals,
    feature_edges,
    shared,
    smoothed,
)
from proximity_monitor.display.received import Part


class Shape:
    """Triangles that share corners, in a part's own frame and the page's units."""

    def __init__(self, part: Part, scale: float, before: Shape | None, *, detailed: bool) -> None:
        """Make the triangles share corners: where the surface is smooth, or all equal ones if flat.

        Args:
            part: the part, with its triangles.
            scale: units of the page per metre.
            before: the part's previous shape, if it had one.
            detailed: whether the shape may have levels of detail. It then needs normals at corners,
                not at triangles, because otherwise coarser levels would look different.
        """
        soup = part.corners * scale
        self.low, self.high = soup.min(axis=0), soup.max(axis=0)
        self._normals = part.normals
        self.flat = part.normals is None and not (detailed and has_levels(len(soup) // 3))
        """Whether each triangle is shaded by its own normal."""
        self.corners: np.ndarray
        """(k, 3)"""
        self.triangles: np.ndarray
        """(n, 3) of corners."""
        if not self.flat:
            normals, sharp = part.normals, SMOOTH
            if normals is None:
                normals, sharp = np.repeat(face_normals(soup), 3, axis=0), SHARP
            self.corners, self.triangles = smoothed(soup, normals, sharp)
            return
        if before is None or not before.shares(soup):
            self._first, self.triangles = shared(soup)
        else:
            self._first, self.triangles = before._first, before.triangles
        self.corners = soup[self._first]

    def shares(self, soup: np.ndarray) -> bool:
        """Return whether triangles with these corners (3n, 3) share corners as the ones here do."""
        if not self.flat or len(soup) != 3 * len(self.triangles):
            return False
        return np.array_equal(soup[self._first][self.triangles.reshape(-1)], soup)

    @cached_property
    def edges(self) -> np.ndarray:
        """The edges (m, 2, 3) that are sharp or open."""
        soup = self.corners[self.triangles]
        if self._normals is None:
            return feature_edges(soup.reshape(-1, 3))
        curves = ~self._normals.any(axis=1).reshape(-1, 3).any(axis=1)
        return np.concatenate((self.corners[borders(self.triangles)], soup[curves, :2]))


_SHAPES: WeakKeyDictionary[Part, tuple[float, Shape]] = WeakKeyDictionary()


def shape_of(part: Part, scale: float, before: Shape | None = None, *, detailed: bool) -> Shape:
    """Return the shape of a part, made once for all browsers; arguments as in `Shape`."""
    known = _SHAPES.get(part)
    if known is None or known[0] != scale:
        known = _SHAPES[part] = scale, Shape(part, scale, before, detailed=detailed)
    return known[1]
