"""Certified minimum distances between models: the library, usable without ROS.

Lengths are metres. Poses are 4×4 float64 matrices from model to world. Every answer holds certified
bounds: `lower <= true distance <= upper`. `questions.decision` and `questions.result` describe what
`within`, `collide` and `closest_points` return.
"""

from .assembly.assembly import Assembly
from .assembly.batch import distances
from .files.geomdl import save_geomdl
from .files.load import load, load_placements
from .files.step import Placement
from .models import shapes
from .models.checks import ModelError
from .models.mesh import TriangleMesh
from .models.model import Model
from .models.patch import Curve, Patch
from .models.revolution import SolidOfRevolution
from .models.shapes import points, polyline
from .models.surface import ParametricSurface
from .questions.closest import closest_points
from .questions.pair import Pair
from .questions.query import collide, distance, signed_distance, within
from .questions.result import Distance, Status

__all__ = [
    "Assembly",
    "Curve",
    "Distance",
    "Model",
    "ModelError",
    "Pair",
    "ParametricSurface",
    "Patch",
    "Placement",
    "SolidOfRevolution",
    "Status",
    "TriangleMesh",
    "closest_points",
    "collide",
    "distance",
    "distances",
    "load",
    "load_placements",
    "points",
    "polyline",
    "save_geomdl",
    "shapes",
    "signed_distance",
    "within",
]
