"""Scenes from outside the repository; each is available only if its data is installed."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import partial
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from numpy.typing import NDArray

from proximity_monitor.study.recorded import falling_tori, find_falling_tori
from proximity_monitor.study.scenes import StudyScene, Track, identities, rotation_poses
from proximity_monitor.study.shapes import Mesh

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
"""Folder of the recorded data unless --data or PROXIMITY_MONITOR_DATA says otherwise."""

PANDA_LINKS = (*(f"link{i}" for i in range(8)), "hand")


def available(data: Path | None) -> dict[str, Callable[[], StudyScene]]:
    """Return the scenes whose data can be found, by name.

    Args:
        data: the folder that holds the folder `falling_tori`; None: look in the usual places.

    Raises:
        FileNotFoundError: `data` or PROXIMITY_MONITOR_DATA names a folder without it.
    """
    found = {}
    if folder := find_falling_tori(data, DATA):
        found["falling-tori"] = partial(falling_tori, folder)
    if urdf := panda_description():
        meshes = urdf.parents[1] / "meshes"
        found["panda/collision"] = partial(panda, urdf, meshes / "collision", ".stl")
        if importlib.util.find_spec("collada"):  # trimesh needs it to read .dae files
            found["panda/visual"] = partial(panda, urdf, meshes / "visual", ".dae")
    return found


def panda_description() -> Path | None:
    """Return the robot's description in `example-robot-data`, or None if that is not installed.

    The package holds only data, so it is not imported.
    """
    try:
        files = metadata.files("example-robot-data") or []
    except metadata.PackageNotFoundError:
        return None
    for file in files:
        if file.parts[-3:] == ("panda_description", "urdf", "panda.urdf"):
            return Path(file.locate())
    return None


def panda(urdf: Path, folder: Path, suffix: str) -> StudyScene:
    """Return the links of a Panda arm, all seven joints swinging: pairs that no joint connects."""
    steps = 384
    share = np.linspace(0.0, 1.0, steps)
    parents = {}
    poses = {"panda_link0": identities(steps)}
    for i, joint in enumerate(ElementTree.parse(urdf).iter("joint")):
        parent, child = (joint.find(key).get("link") for key in ("parent", "child"))
        parents[child] = parent
        origin = joint.find("origin")
        here = poses[parent] @ _origin(origin.get("xyz"), origin.get("rpy"))
        if joint.get("type") == "revolute":
            low, high = (float(joint.find("limit").get(key)) for key in ("lower", "upper"))
            axis = np.array(joint.find("axis").get("xyz").split(), float)
            swing = np.sin(2.0 * np.pi * (i + 1) * share + i)
            angle = 0.5 * (low + high) + 0.4 * (high - low) * swing
            here = here @ rotation_poses(axis, angle)
        poses[child] = here
    meshes = {name: _mesh(folder / (name + suffix)) for name in PANDA_LINKS}
    tracks = []
    for i, a in enumerate(PANDA_LINKS):
        for b in PANDA_LINKS[i + 2 :]:
            tracks.append(Track(a, b, poses[f"panda_{a}"], poses[f"panda_{b}"]))
    return StudyScene(meshes, tracks, quick_blocks=2)


def _origin(xyz: str, rpy: str) -> NDArray[np.float64]:
    """Return a URDF joint's origin: rotations about the fixed x, y and z axes, in this order."""
    pose = np.eye(4)
    for axis, angle in zip(np.eye(3), map(float, rpy.split()), strict=True):
        pose = rotation_poses(axis, np.array([angle]))[0] @ pose
    pose[:3, 3] = [float(value) for value in xyz.split()]
    return pose


def _mesh(path: Path) -> Mesh:
    mesh = trimesh.load(path, force="mesh")
    return np.array(mesh.vertices, float), np.array(mesh.faces, np.int32)
