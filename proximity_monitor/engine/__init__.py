"""Certified minimum distances between models: the library, usable without ROS.

Lengths are metres, poses 4×4 float64 matrices from model to world. Every answer holds certified
bounds: `lower <= true distance <= upper`.
"""

from .agenda import Agenda, Questions
from .answers import Answers, Carried
from .assembly import Assembly
from .broad_phase import BroadPhase
from .load import load
from .mesh import ModelError, TriangleMesh, points, polyline
from .pair import Pair
from .poses import check_pose
from .query import closest_points, collide, distance, distances, signed_distance, within
from .result import (
    Clearance,
    ClosestPoints,
    Collision,
    Distance,
    Distances,
    Feature,
    Manifold,
    Status,
)
from .tree import check_tree

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
