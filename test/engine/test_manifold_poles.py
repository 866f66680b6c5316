"""Where the nearest points may be if one of them is a pole, where one parameter does not matter."""

from __future__ import annotations

import numpy as np
import pytest
from engine_surfaces import revolved, sphere_patches
from test_surface_manifold import HERE, check_bounds, covers, moved

from proximity_monitor.engine import ParametricSurface, Patch, Status, distance

SPHERE = ParametricSurface(sphere_patches())
CONE = ParametricSurface(revolved([[0.0, 0.0], [1.0, 2.0]], [1.0, 1.0]))
"""Its apex is at v = 0, at the origin."""


def plane(z):
    return Patch(np.array([[[-1.0, -1, z], [-1, 1, z]], [[1, -1, z], [1, 1, z]]]))


@pytest.mark.parametrize("param_err", [0.1, 1e-3, 1e-6])
def test_a_sphere_between_two_planes(param_err):
    planes = ParametricSurface([plane(-1.5), plane(1.5)])
    found = distance(SPHERE, HERE, planes, HERE, param_err=param_err)
    assert found.status is Status.EXACT
    assert found.lower <= 0.5 <= found.upper
    assert len(found.manifold) < 1000
    check_bounds(found, SPHERE, planes, HERE)
    groups = found.solution_set
    assert len(groups) == 2
    u = np.linspace(0.0, 1.0, 40)
    for patch in range(8):
        upper = patch >= 4
        at = np.column_stack((u, np.full(40, float(upper))))
        middle = np.full((40, 2), 0.5)
        patches = np.full(40, patch)
        assert covers(found.manifold, patches, at, np.full(40, int(upper)), middle).all()
    for group in groups:
        on_sphere, on_plane = group.extents()
        assert len(on_sphere) == 4
        for low, high in on_sphere.values():
            assert high[1] - low[1] <= 2.0 * max(param_err, 1e-5)
        for low, high in on_plane.values():
            assert (high - low <= 4.0 * max(param_err, 1e-5)).all()


@pytest.mark.parametrize("swapped", [False, True])
def test_the_apex_of_a_cone_above_a_plane(swapped):
    """The parameters are swapped in one of both: the apex is then at u = 0."""
    nets = [(net.control, net.weights) for net in CONE.nets]
    if swapped:
        nets = [(control.swapaxes(0, 1), weights.T) for control, weights in nets]
    cone = ParametricSurface([Patch(control, weights=weights) for control, weights in nets])
    found = distance(cone, moved(0.0, 0.0, 0.3), plane(0.0), HERE, param_err=1e-6)
    assert found.status is Status.EXACT
    assert found.lower <= 0.3 <= found.upper
    assert len(found.manifold) < 1000
    around = np.linspace(0.0, 1.0, 40)
    for patch in range(4):
        at = np.column_stack((around, 0.0 * around))
        at = at[:, ::-1] if swapped else at
        assert covers(
            found.manifold, np.full(40, patch), at, np.zeros(40), np.full((40, 2), 0.5)
        ).all()
