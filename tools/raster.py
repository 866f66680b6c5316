"""A small orthographic renderer: depth buffer, section cuts, feature edges, ambient occlusion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

INK = np.array([0.16, 0.19, 0.24])
# Unit vectors in the view's frame (right, up, towards the eye), with the strength of each lamp.
LAMPS = (((-0.45, 0.62, 0.64), 0.60), ((0.80, 0.15, 0.58), 0.22), ((0.0, -0.8, 0.6), 0.12))


@dataclass(frozen=True)
class Camera:
    """Rows of `axes` are right, up and towards the eye; a pixel is `pixel` world units wide."""

    axes: np.ndarray
    corner: np.ndarray  # (2,) the picture's upper left corner, in the view's right and up
    pixel: float
    width: int
    height: int

    @classmethod
    def fit(cls, points: np.ndarray, azimuth: float, elevation: float, frame) -> Camera:
        """Look at points (n, 3) from azimuth and elevation (degrees) so that they fill a frame.

        Args:
            points: the points that must be in the picture.
            azimuth: degrees, 0 from +x, 90 from +y.
            elevation: degrees above the horizon.
            frame: width and height in pixels, then left, right, top and bottom margin.
        """
        width, height, left, right, top, bottom = frame
        a, e = math.radians(azimuth), math.radians(elevation)
        eye = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
        side = np.array([-math.sin(a), math.cos(a), 0.0])
        axes = np.vstack((side, np.cross(eye, side), eye))
        flat = points @ axes[:2].T
        low, high = flat.min(axis=0), flat.max(axis=0)
        room = np.array([width - left - right, height - top - bottom])
        pixel = float(((high - low) / room).max())
        spare = 0.5 * (room - (high - low) / pixel)
        corner = np.array([low[0], high[1]]) + pixel * np.array([-left - spare[0], top + spare[1]])
        return cls(axes, corner, pixel, width, height)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return pixel column, pixel row and height towards the eye of points (n, 3)."""
        seen = points @ self.axes.T
        return np.column_stack(
            (
                (seen[:, 0] - self.corner[0]) / self.pixel,
                (self.corner[1] - seen[:, 1]) / self.pixel,
                seen[:, 2],
            )
        )


class Picture:
    """The picture drawn so far: per pixel the height towards the eye, the colour, the normal."""

    def __init__(self, camera: Camera) -> None:
        """Start with an empty picture."""
        shape = (camera.height, camera.width)
        self.camera = camera
        self.near = np.full(shape, -np.inf)
        self.normal = np.zeros((*shape, 3))
        self.colour = np.ones((*shape, 3))
        self.body = np.full(shape, -1)
        self._bodies = 0

    def add(self, vertices, faces, colour, cut=None, cut_colour=None) -> None:
        """Draw a closed mesh, (n, 3) in the world and (m, 3), in one colour (3,).

        Args:
            vertices: in world units.
            faces: with outward normals.
            colour: of the mesh's surface.
            cut: a plane (4,): points p with ``cut[:3] @ p > cut[3]`` are cut away.
            cut_colour: of the section.
        """
        camera = self.camera
        plane = np.array([0.0, 0.0, 0.0, 1.0]) if cut is None else np.asarray(cut, dtype=float)
        screen = camera.project(vertices)
        beyond = vertices @ plane[:3] - plane[3]
        edges = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
        normal = np.cross(edges[:, 0], edges[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        normal = normal @ camera.axes.T
        near = np.full(self.near.shape, -np.inf)
        face = np.full(self.near.shape, -1)
        _fill(screen[faces], beyond[faces], near, face)
        hit = face >= 0
        seen = np.zeros_like(self.normal)
        seen[hit] = normal[face[hit]]
        tint = np.broadcast_to(np.asarray(colour, dtype=float), seen.shape).copy()
        inside = hit & (seen[..., 2] < 0.0)
        if cut is not None and inside.any():
            # A ray that first meets the back of a closed surface entered the solid at the section.
            rows, columns = np.nonzero(inside)
            facing = camera.axes @ plane[:3]
            x = camera.corner[0] + (columns + 0.5) * camera.pixel
            y = camera.corner[1] - (rows + 0.5) * camera.pixel
            near[inside] = (plane[3] - x * facing[0] - y * facing[1]) / facing[2]
            seen[inside] = facing
            hatch = (columns + rows) % 14 < 2
            tint[inside] = np.where(hatch[:, None], 0.86, 1.0) * np.asarray(cut_colour)
        front = hit & (near > self.near)
        self.near[front] = near[front]
        self.normal[front] = seen[front]
        self.colour[front] = tint[front]
        self.body[front] = self._bodies + (inside[front] * 1000)
        self._bodies += 1

    def shaded(self, background) -> np.ndarray:
        """Return the finished picture (height, width, 3) in 0..1 over a background (3,)."""
        hit = self.body >= 0
        light = np.full(hit.shape, 0.42)
        for direction, strength in LAMPS:
            unit = np.asarray(direction) / np.linalg.norm(direction)
            light += strength * np.maximum(self.normal @ unit, 0.0)
        shade = np.where(hit, light * (1.0 - 0.55 * self._occlusion()), 1.0)
        picture = np.where(hit[..., None], self.colour * shade[..., None], background)
        ink = self._edges()[..., None]
        return np.clip(picture * (1.0 - ink) + INK * ink, 0.0, 1.0)

    def _occlusion(self) -> np.ndarray:
        """Return how much of the surroundings of each pixel stands higher than it, 0..1."""
        floor = self.near[np.isfinite(self.near)].min(initial=0.0)
        near = np.where(np.isfinite(self.near), self.near, floor - 1e9)
        total, count = np.zeros(near.shape), 0
        for reach in (4, 9, 18, 34):
            for angle in np.linspace(0.0, math.tau, 8, endpoint=False) + 0.1 * reach:
                shift = (round(reach * math.sin(angle)), round(reach * math.cos(angle)))
                rise = (np.roll(near, shift, axis=(0, 1)) - near) / (reach * self.camera.pixel)
                total += np.clip(rise - 0.35, 0.0, 1.0) * (rise < 6.0)
                count += 1
        return np.clip(1.6 * total / count, 0.0, 1.0)

    def _edges(self) -> np.ndarray:
        """Return the strength of ink where the surface bends sharply or ends, 0..1."""
        ink = np.zeros(self.near.shape)
        near = np.where(np.isfinite(self.near), self.near, -1e9)
        for axis in (0, 1):
            before = (slice(None),) * axis + (slice(None, -1),)
            after = (slice(None),) * axis + (slice(1, None),)
            drawn = (self.body[before] >= 0) | (self.body[after] >= 0)
            bend = 1.0 - np.sum(self.normal[before] * self.normal[after], axis=-1)
            tilt = np.maximum(self.normal[before][..., 2], self.normal[after][..., 2])
            step = np.abs(near[before] - near[after]) * np.maximum(tilt, 0.05) / self.camera.pixel
            ends = (self.body[before] != self.body[after]) | (step > 4.0)
            line = drawn * np.where(ends, 0.75, np.where(bend > 0.12, 0.42, 0.0))
            ink[before] = np.maximum(ink[before], line)
            ink[after] = np.maximum(ink[after], line)
        return ink


@njit(cache=True)
def _fill(screen, beyond, near, face):
    """Draw triangles (m, 3, 3) into the buffers; `beyond` (m, 3) is positive if cut away."""
    height, width = near.shape
    for k in range(len(screen)):
        (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = screen[k]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if area == 0.0 or min(beyond[k, 0], beyond[k, 1], beyond[k, 2]) > 0.0:
            continue
        first = max(0, math.ceil(min(y0, y1, y2) - 0.5))
        last = min(height - 1, math.floor(max(y0, y1, y2) - 0.5))
        left = max(0, math.ceil(min(x0, x1, x2) - 0.5))
        right = min(width - 1, math.floor(max(x0, x1, x2) - 0.5))
        for row in range(first, last + 1):
            for column in range(left, right + 1):
                x, y = column + 0.5, row + 0.5
                v = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
                w = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
                u = 1.0 - v - w
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                z = u * z0 + v * z1 + w * z2
                if z <= near[row, column]:
                    continue
                if u * beyond[k, 0] + v * beyond[k, 1] + w * beyond[k, 2] > 0.0:
                    continue
                near[row, column] = z
                face[row, column] = k
