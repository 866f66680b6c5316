"""A kind of model that proximity_monitor does not know, as another package would add it: a ball."""

import hashlib

import numpy as np

from proximity_monitor import engine
from proximity_monitor.engine.models.model import Feature


class Ball(engine.Model):
    """A ball. The kernels search `_core`: a point swept by a ball."""

    kind = "ball"

    def __init__(self, centre, radius, name="ball", **how):
        self.name = name
        self.size = radius
        self._core = engine.points([centre], radius=radius, name=name, **how)

    @property
    def _hierarchy(self):
        return self._core._hierarchy

    @property
    def control_points(self):
        return self._core.control_points

    def deform(self, points):
        return self._core.deform(points)

    def display_mesh(self, tolerance):
        mesh = self._core.display_mesh(tolerance)
        return mesh._replace(normals=(mesh.vertices - self.centre) / self.size)

    @staticmethod
    def feature(element, parameters):
        return Feature("ball", element, parameters[:0])

    def digest(self):
        numbers = np.append(self.control_points[0], (self.size, self.deviation))
        return hashlib.sha256(b"ball" + numbers.tobytes()).hexdigest()[:16]

    def describe(self, length):
        return f"a ball {length(2.0 * self.size)} across"


def read_ball(data, file, how):
    """Read a ball from text: three coordinates and a radius."""
    *centre, radius = (float(number) * how.unit * how.scale for number in data.split())
    return Ball(centre, radius, deviation=how.deviation, volume=how.volume, solid=how.solid)
