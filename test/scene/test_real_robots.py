"""The robots of example-robot-data, against their makers' Denavit-Hartenberg tables."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from proximity_monitor.engine.poses import check_pose
from proximity_monitor.scene import SceneError, load_scene, paths
from proximity_monitor.scene.opening import load_models


def installed(name):
    try:
        return paths.model_path(f"package://example-robot-data/robots/{name}", Path(os.sep))
    except SceneError:
        pytest.skip("needs example-robot-data: pip install example-robot-data")


def robot_scene(tmp_path, urdf, options=""):
    path = tmp_path / "scene.yaml"
    path.write_text(f"version: 1\nunit: m\nrobots:\n  - {{name: robot, urdf: {urdf}{options}}}\n")
    return load_scene(path)


def screw(a, alpha, d, theta, *, modified):
    """Return the Denavit-Hartenberg transform, in Craig's order if `modified`."""
    ca, sa, ct, st = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
    along_x = np.array([[1, 0, 0, a], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
    along_z = np.array([[ct, -st, 0, 0], [st, ct, 0, 0], [0, 0, 1, d], [0, 0, 0, 1]])
    return along_x @ along_z if modified else along_z @ along_x


QUARTER = math.pi / 2
PANDA = [
    (0, 0, 0.333), (0, -QUARTER, 0), (0, QUARTER, 0.316), (0.0825, QUARTER, 0),
    (-0.0825, -QUARTER, 0.384), (0, QUARTER, 0), (0.088, QUARTER, 0),
]  # fmt: skip
UR5 = [
    (0, QUARTER, 0.089159), (-0.425, 0, 0), (-0.39225, 0, 0), (0, QUARTER, 0.10915),
    (0, -QUARTER, 0.09465), (0, 0, 0.0823),
]  # fmt: skip
UR5_JOINTS = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]


@pytest.mark.parametrize("seed", range(5))
def test_the_panda_stands_where_its_maker_says(tmp_path, seed):
    (robot,) = robot_scene(tmp_path, installed("panda_description/urdf/panda.urdf")).robots
    angles = np.random.default_rng(seed).uniform(-1.5, 1.5, 7)
    expected = np.eye(4)
    poses = robot.poses({f"panda_joint{i + 1}": angle for i, angle in enumerate(angles)})
    for i, ((a, alpha, d), angle) in enumerate(zip(PANDA, angles, strict=True), 1):
        expected = expected @ screw(a, alpha, d, angle, modified=True)
        np.testing.assert_allclose(poses[f"robot_panda_link{i}"], expected, atol=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_the_ur5_stands_where_its_maker_says(tmp_path, seed):
    (robot,) = robot_scene(tmp_path, installed("ur_description/urdf/ur5_robot.urdf")).robots
    angles = np.random.default_rng(seed).uniform(-math.pi, math.pi, 6)
    expected = np.diag([-1.0, -1.0, 1.0, 1.0])  # the description turns the base by half a turn
    for (a, alpha, d), angle in zip(UR5, angles, strict=True):
        expected = expected @ screw(a, alpha, d, angle, modified=False)
    kinematics = robot.kinematics
    names = {f"{name}_joint": angle for name, angle in zip(UR5_JOINTS, angles, strict=True)}
    poses = kinematics.poses(kinematics.values(names))
    tool = poses[kinematics.links.index("tool0")]
    np.testing.assert_allclose(tool, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("urdf", "meshes", "links"),
    [
        ("panda_description/urdf/panda.urdf", "collision", 11),
        ("panda_description/urdf/panda.urdf", "visual", 11),
        ("ur_description/urdf/ur5_robot.urdf", "collision", 8),  # one more box at the flange
        ("ur_description/urdf/ur5_robot.urdf", "visual", 7),
    ],
)
def test_real_robots_load_with_all_their_meshes(tmp_path, urdf, links, meshes):
    scene = robot_scene(tmp_path, installed(urdf), f", meshes: {meshes}")
    models = load_models(scene)
    assert len(models) == links
    assert all(0.005 < model.radius < 0.6 for model in models.values())
    for pose in scene.robots[0].poses({}).values():
        check_pose(pose)
