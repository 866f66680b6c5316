"""On which side of its curves a solid of revolution is."""

import itertools

import numpy as np
import pytest
from engine_bodies import sampled

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution
from proximity_monitor.engine.models.orientation import area_leftward, runs_leftward
from proximity_monitor.engine.models.profile import checked_profile


@pytest.mark.parametrize("skew", [1.0, 1e-2, 1e-3, 1e-6, 1e6])
def test_which_side_is_inside_does_not_depend_on_weights(skew):
    wall = [[1, 1], [3, 0.5], [1, 0]]
    inner = Curve([[1, 0], [1.3, 0.5], [1, 1]])
    for curves, leftward in (
        ([inner, Curve(wall, weights=[1, skew, skew**2])], False),
        (
            [Curve(wall[::-1], weights=[skew**2, skew, 1]), Curve([[1, 1], [1.3, 0.5], [1, 0]])],
            True,
        ),
    ):
        made = SolidOfRevolution(curves)
        assert made.profile.leftward is leftward
        # Its patches face outward, so a compound with another solid contains both.
        disc = engine.shapes.cylinder(1.5, 0.1)
        both = engine.shapes.compound(
            [engine.shapes.Part(each, np.eye(4), (1.0, 1.0, 1.0)) for each in (made, disc)]
        )
        inside = engine.closest_points(both, np.eye(4), np.array([[1.4, 0, 0.5]]), signed=True)
        assert inside.lower[0] < -0.2


def test_the_side_of_random_stars_with_random_weights():
    random = np.random.default_rng(8)
    for i in range(60):
        degrees = random.integers(1, 6, random.integers(3, 6))
        steps = np.cumsum(random.uniform(0.05, 1.0, degrees.sum()))
        angles = 2.0 * np.pi * np.append(0.0, steps) / steps[-1]
        radius = random.uniform(*((0.2, 1.0) if i % 2 else (0.999, 1.0)), len(angles) - 1)
        points = np.append(radius, radius[0])[:, None] * np.stack(
            [np.cos(angles), np.sin(angles)], axis=1
        )
        points[-1] = points[0]
        starts = np.append(0, np.cumsum(degrees))
        if i % 3 == 0:
            points, starts = points[::-1], starts[-1] - starts[::-1]
        nets = [
            Curve(
                points[low : high + 1] + np.array([2.0, 0.0]),
                weights=10.0 ** random.uniform(-5.0, 5.0, high - low + 1),
            ).nets[0]
            for low, high in itertools.pairwise(starts)
        ]
        assert checked_profile(nets, "star").leftward is (i % 3 != 0)


def test_the_area_of_curves_that_are_not_rational():
    """It is that of a fine polygon, and tells the side as the proof for all curves does."""
    random = np.random.default_rng(9)
    for degree in (1, 2, 3, 5, 15):
        angles = np.linspace(0.0, 2.0 * np.pi, 3 * degree + 1)
        points = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        points *= random.uniform(0.9, 1.0, (len(angles), 1))
        points[-1] = points[0]
        if degree % 2:
            points = points[::-1]
        points = points + np.array([2.0, 0.0])
        curves = [Curve(points[k * degree : (k + 1) * degree + 1]) for k in range(3)]
        profile = checked_profile([curve.nets[0] for curve in curves], "star")
        x, y = sampled(curves, 5000).T
        polygon = 0.5 * (x[:-1] * y[1:] - x[1:] * y[:-1]).sum()
        assert area_leftward(profile.pieces) == pytest.approx(polygon, rel=1e-6)
        assert profile.leftward is runs_leftward(profile.pieces, profile.size, False)
        assert profile.leftward is (degree % 2 == 0)
