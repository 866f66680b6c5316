"""Certified minimum distances between models: the library, usable without ROS.

Lengths are metres, poses 4×4 float64 matrices from model to world. Every answer holds certified
bounds: `lower <= true distance <= upper`.
"""

from .assembly.agenda import Agenda, Questions
from .assembly.answers import Answers, Carried
from .assembly.assembly import Assembly
from .assembly.batch import distances
from .assembly.broad_phase import BroadPhase
from .files.load import load
from .models import shapes
from .models.checks import ModelError
from .models.mesh import TriangleMesh
from .models.model import DisplayMesh, Feature, Model
from .models.shapes import points, polyline
from .models.tree import check_tree
from .poses import check_pose
from .questions.closest import closest_points
from .questions.pair import Pair
from .questions.query import collide, distance, signed_distance, within
from .questions.result import (
    Clearance,
    ClosestPoints,
    Collision,
    Distance,
    Distances,
    Manifold,
    Status,
)

__all__ = [
    "Agenda",
    "Answers",
    "Assembly",
    "BroadPhase",
    "Carried",
    "Clearance",
    "ClosestPoints",
    "Collision",
    "DisplayMesh",
    "Distance",
    "Distances",
    "Feature",
    "Manifold",
    "Model",
    "ModelError",
    "Pair",
    "Questions",
    "Status",
    "TriangleMesh",
    "check_pose",
    "check_tree",
    "closest_points",
    "collide",
    "distance",
    "distances",
    "load",
    "points",
    "polyline",
    "shapes",
    "signed_distance",
    "within",
]
