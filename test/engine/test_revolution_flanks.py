"""Flanks of cones and cylinders against each other and against boxes: lines of nearest points."""

import itertools
import math

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.engine import Status, shapes


def turned(angle, axis):
    """Return the rotation (3, 3) about an axis of the frame."""
    made, (i, j) = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
    made[i, i] = made[j, j] = math.cos(angle)
    made[j, i] = math.sin(angle)
    made[i, j] = -made[j, i]
    return made


def on_flank(low, high, height, share, upward, spin, gap=0.0):
    """Return the pose at which a point of a cone's flank is `gap` above the origin.

    The flank is level there, with the cone above it if `upward`, else below. `spin` is the angle
    of its line to x.
    """
    line, normal = np.array([high - low, 0.0, height]), np.array([height, 0.0, low - high])
    line, normal = line / np.linalg.norm(line), normal / np.linalg.norm(normal)
    at = np.array([low + share * (high - low), 0.0, (share - 0.5) * height])
    own = np.stack((line, np.cross(normal, line), normal), axis=1)
    there = turned(spin, 2) @ np.diag([1.0, -1.0, -1.0] if upward else [1.0, 1.0, 1.0])
    made = np.eye(4)
    made[:3, :3] = there @ own.T
    made[:3, 3] = [0.0, 0.0, gap] - made[:3, :3] @ at
    return made


def check(a, pose_a, b, pose_b, gap):
    for found in (engine.distance(a, pose_a, b, pose_b), engine.distance(b, pose_b, a, pose_a)):
        assert found.status is Status.EXACT
        assert found.lower - 2e-14 <= gap <= found.upper + 2e-14
        assert found.upper - found.lower < 1e-11
        assert found.bound_tests < 10_000


FLANKS = {
    "cones": ((0.9, 0.1, 0.7), (0.8, 0.13, 1.7)),
    "equal cones": ((0.7, 0.1, 1.2), (0.7, 0.1, 1.2)),
    "cone and cylinder": ((0.9, 0.0, 1.5), (0.4, 0.4, 1.1)),
}


@pytest.mark.parametrize("gap", [1e-10, 3e-8, 5e-6])
@pytest.mark.parametrize("name", FLANKS)
def test_flank_to_flank(name, gap):
    one, other = FLANKS[name]
    a, b = shapes.cone(*one), shapes.cone(*other)
    for share, spin in itertools.product((0.3, 0.7), (0.0, math.pi, 0.6)):
        below = on_flank(*one, share, False, 0.0)
        check(a, below, b, on_flank(*other, 0.5, True, spin, gap), gap)


@pytest.mark.parametrize("gap", [1e-10, 7e-10, 1e-8, 1e-6])
@pytest.mark.parametrize("contact", ["face", "edge", "corner"])
def test_box_on_a_flank(contact, gap):
    cone, box = shapes.cone(0.9, 0.1, 1.2), shapes.box((0.4, 0.5, 0.6))
    rotation = {
        "face": np.eye(3),
        "edge": turned(0.4, 0),
        "corner": turned(0.4, 0) @ turned(0.7, 1),
    }[contact]
    corners = np.array(list(itertools.product((-0.2, 0.2), (-0.25, 0.25), (-0.3, 0.3))))
    for spin in (0.0, 0.3, 1.2):
        at = np.eye(4)
        at[:3, :3] = turned(spin, 2) @ rotation
        heights = corners @ at[2, :3]
        lowest = corners[heights < heights.min() + 1e-9].mean(axis=0)
        at[:3, 3] = [0.0, 0.0, gap] - at[:3, :3] @ lowest
        check(cone, on_flank(0.9, 0.1, 1.2, 0.4, False, 0.0), box, at, gap)


@pytest.mark.parametrize("gap", [1e-9, 1e-6, 1e-3])
def test_box_in_a_hollow_cone(gap):
    """An edge of the box is along a line of the flank that surrounds it."""
    cone, box = shapes.cone(0.9, 0.1, 1.2), shapes.box((0.2, 0.3, 0.24))
    at = np.eye(4)
    at[:3, :3] = turned(0.4, 0)
    corners = np.array(list(itertools.product((-0.1, 0.1), (-0.15, 0.15), (-0.12, 0.12))))
    heights = corners @ at[2, :3]
    highest = corners[heights > heights.max() - 1e-9].mean(axis=0)
    at[:3, 3] = [0.0, 0.0, -gap] - at[:3, :3] @ highest
    there = on_flank(0.9, 0.1, 1.2, 0.4, False, 0.0)
    check(cone, there, box, at, gap)
    assert engine.distance(cone, there, box, at).bound_tests < 100
