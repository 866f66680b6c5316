"""Patches close up in spite of different knots, degrees and parameters, but not across gaps."""

from __future__ import annotations

import numpy as np
import pytest
from engine_surfaces import QUARTER, QUARTER_WEIGHTS, curve, sphere_patches, torus_patches

from proximity_monitor.engine import ModelError, ParametricSurface, Patch


def of(net):
    """Return the Bezier patch of homogeneous control points (n_u, n_v, 4)."""
    return Patch(net[..., :3] / net[..., 3:], weights=net[..., 3])


def homogeneous(part):
    weights = np.ones(part.control.shape[:2]) if part.weights is None else part.weights
    return np.concatenate((part.control * weights[..., None], weights[..., None]), axis=-1)


def halves(part, t):
    """Split a patch at a parameter u, by de Casteljau's algorithm; return both parts."""
    level = homogeneous(part)
    first, last = [level[0]], [level[-1]]
    while len(level) > 1:
        level = (1.0 - t) * level[:-1] + t * level[1:]
        first.append(level[0])
        last.append(level[-1])
    return of(np.array(first)), of(np.array(last[::-1]))


def raised(part):
    """Return the same patch, one degree higher in u."""
    net = homogeneous(part)
    share = (np.arange(len(net) + 1) / len(net))[:, None, None]
    zero = np.zeros_like(net[:1])
    return of(share * np.concatenate((zero, net)) + (1 - share) * np.concatenate((net, zero)))


def hurried(part):
    """Return the same patch with another parametrisation in u."""
    net = homogeneous(part)
    return of(net * 3.0 ** np.arange(len(net))[:, None, None])


def swapped(part):
    """Return the same patch with u and v swapped, so that the other side is out."""
    return of(homogeneous(part).transpose(1, 0, 2))


def turned(part):
    """Return the same patch with the same side out, but with its edges numbered differently."""
    return of(homogeneous(part).transpose(1, 0, 2)[::-1])


def replaced(change, which=5, parts=torus_patches):
    made = parts()
    changed = change(made[which])
    made[which : which + 1] = changed if isinstance(changed, tuple) else (changed,)
    return made


def one_patch():
    """Return a torus as a single patch, whose opposite edges coincide."""
    ring = [QUARTER @ np.array([[c, s], [-s, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    ring = np.concatenate([each[:2] for each in ring] + [ring[0][:1]])
    weights = np.append(np.tile(QUARTER_WEIGHTS[:2], 4), 1.0)
    knots = np.repeat([0.0, 1.0, 2.0, 3.0, 4.0], [3, 2, 2, 2, 3])
    control = np.empty((9, 9, 3))
    control[..., :2] = ring[:, None] * (2.0 + 0.5 * ring[None, :, :1])
    control[..., 2] = 0.5 * ring[None, :, 1]
    return [Patch(control, knots, knots, np.outer(weights, weights))]


def cube():
    """Return a cube of six bilinear patches."""
    made = []
    for axis in range(3):
        for side in (0.0, 1.0):
            square = np.zeros((2, 2, 3))
            square[1, :, (axis + 1) % 3] = square[:, 1, (axis + 2) % 3] = 1.0
            square[..., axis] = side
            made.append(Patch(square if side else square.transpose(1, 0, 2)))
    return made


def cusped():
    """Return closed patches whose derivatives by u vanish at both ends of u."""
    made = []
    for part in torus_patches():
        control = part.control.copy()
        control = np.concatenate((control[:1], control, control[-1:]))
        made.append(Patch(control, weights=np.ones(control.shape[:2])))
    return made


CLOSED = {
    "torus": torus_patches,
    "sphere": sphere_patches,
    "one patch": one_patch,
    "cube": cube,
    "curves beside it": lambda: [*cube(), curve(1)],
    "halves beside whole patches": lambda: replaced(lambda part: halves(part, 0.37)),
    "halves beside other halves": lambda: [
        half for i, part in enumerate(torus_patches()) for half in halves(part, 0.3 + 0.02 * i)
    ],
    "another degree": lambda: replaced(lambda part: raised(raised(part))),
    "another parameter": lambda: replaced(hurried),
    "other edges": lambda: replaced(turned, 2, sphere_patches),
    "all at once": lambda: [hurried(raised(half)) for part in replaced(turned)
                            for half in halves(part, 0.4)],
    "a cusp where edges begin": lambda: replaced(raised, parts=cusped),
}  # fmt: skip


@pytest.mark.parametrize("make", CLOSED.values(), ids=CLOSED)
@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_patches_that_close_up_may_be_a_solid(make, scale):
    model = ParametricSurface(make(), solid=True)
    assert model.is_solid
    model.deform(model.control_points * scale + scale)
    assert model.is_solid
    assert model.revision == 1


def moved(part):
    control = part.control.copy()
    control[0, 0] += 1e-6
    return Patch(control, weights=part.weights)


def bulging(part):
    """Return a patch with another edge between the same corners."""
    control = part.control.copy()
    control[1, 0] += 1e-6
    return Patch(control, weights=part.weights)


def heavier(part):
    weights = part.weights.copy()
    weights[1, 0] *= 1.00001
    return Patch(part.control, weights=weights)


OPEN = {
    "one patch missing": (
        torus_patches()[1:],
        "do not close up: 4 open edges, the first of patch 0 between ",
    ),
    "a pole missing": (sphere_patches()[:-1], "do not close up: 3 open edges"),
    "a corner": (replaced(moved), "do not close up: [48] open edges"),
    "an edge": (replaced(bulging), "do not close up: [248] open edges"),
    "a weight": (replaced(heavier), "do not close up: [248] open edges"),
    "half missing": (replaced(lambda part: halves(part, 0.5)[0]), "do not close up: 4 open edges"),
    "a side out": (replaced(swapped, 1), "opposite orientations at 8 edges"),
    "twice": (cube() + cube()[:1], "do not close up: 4 open edges"),
    "curves alone": ([curve(1)], "it consists only of curves"),
}


@pytest.mark.parametrize("patches, message", OPEN.values(), ids=OPEN)
def test_patches_that_do_not_are_refused(patches, message):
    with pytest.raises(ModelError, match=f"case: not a solid: .*{message}"):
        ParametricSurface(patches, name="case", solid=True)
    assert not ParametricSurface(patches).is_solid


def test_gaps_may_be_as_large_as_the_deviation():
    for make in (moved, bulging, heavier):
        ParametricSurface(replaced(make), deviation=1e-5, solid=True)


def test_what_tears_when_it_is_deformed_stays_as_it_was():
    model = ParametricSurface(torus_patches(), solid=True)
    digest = model.digest()
    points = model.control_points.copy()
    points[3] += 0.01
    with pytest.raises(ModelError, match="surface: not a solid: its patches do not close up"):
        model.deform(points)
    assert (model.digest(), model.revision) == (digest, 0)
    assert ParametricSurface(torus_patches()).deform(points) > 0.0


@pytest.mark.parametrize("solid", ["robust", 1])
def test_whether_it_is_a_solid_is_yes_or_no_or_found_out(solid):
    with pytest.raises(ModelError, match=r"surface: solid = .*: must be True, False or None"):
        ParametricSurface(cube(), solid=solid)
