"""The scene: its file, its bodies and the pairs to watch."""

from proximity_monitor.scene.description import (
    UNITS,
    Body,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Point,
    Primitive,
    Robot,
    Scene,
    Sphere,
    Thresholds,
    Torus,
    Unit,
    WatchedPair,
)
from proximity_monitor.scene.file import load_scene
from proximity_monitor.scene.paths import bundled
from proximity_monitor.scene.poses import pose_matrix
from proximity_monitor.scene.primitives import load_model
from proximity_monitor.scene.report import SceneError

__all__ = [
    "UNITS",
    "Body",
    "Box",
    "Capsule",
    "Cone",
    "Cylinder",
    "Point",
    "Primitive",
    "Robot",
    "Scene",
    "SceneError",
    "Sphere",
    "Thresholds",
    "Torus",
    "Unit",
    "WatchedPair",
    "bundled",
    "load_model",
    "load_scene",
    "pose_matrix",
]
