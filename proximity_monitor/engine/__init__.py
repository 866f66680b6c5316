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
from .models.mesh import ModelError, TriangleMesh, points, polyline
from .models.tree import check_tree
from .poses import check_pose
from .questions.closest import closest_points
from .questions.decision import Clearance, Collision
from .questions.pair import Pair
from .questions.query import collide, distance, signed_distance, within
from .questions.result import (
    ClosestPoints,
    Distance,
    Distances,
    Feature,
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
    "Distance",
    "Distances",
    "Feature",
    "Manifold",
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
    "signed_distance",
    "within",
]
