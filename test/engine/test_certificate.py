"""What proofs of convexity rest on, ranges of derivatives; and the searches that they shorten."""

import numpy as np
import pytest
from engine_bodies import from_python
from engine_surfaces import patch, torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.kernels.surface import evaluate, ranges
from proximity_monitor.engine.models import surface_tree
from proximity_monitor.study import shapes

jet_at, ranges_of = from_python(evaluate.jet_at), from_python(ranges.ranges_of)
SAMPLES = np.linspace(0.0, 1.0, 7)


def net_of(tree, piece):
    """The control points of a whole piece as those of a cell: projected, and then homogeneous."""
    rows = tree.nets[piece["net"] :][: 4 * piece["room"]].reshape(4, -1)
    return np.concatenate((rows[:3] / rows[3], rows)).reshape(-1)


@pytest.mark.parametrize("parts", [1, 16, 512])
@pytest.mark.parametrize("decades", [0.0, 0.5, None])
def test_ranges_hold_every_derivative(decades, parts, monkeypatch):
    """Of rational pieces too; where weights differ too much they are infinite."""
    monkeypatch.setattr(surface_tree, "_PIECES", parts)
    patches = torus_patches() if decades is None else [patch(3, decades=decades)]
    tree, rng = engine.ParametricSurface(patches)._hierarchy.tree, np.random.default_rng(4)
    finite = 0
    for piece in tree.pieces[:12]:
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        net = net_of(tree, piece)
        centre = net.reshape(7, -1)[:3, : piece["points"]].mean(axis=1)
        bounds = ranges_of(piece, net, 0, tuple(d), tuple(centre))
        jets = np.array([jet_at(piece, tree.nets, s, t) for s in SAMPLES for t in SAMPLES])
        _, du, dv, *seconds = jets.transpose(1, 0, 2)
        for middle, spread, found in (
            (bounds.along_u, bounds.spread_u, du),
            (bounds.along_v, bounds.spread_v, dv),
        ):
            assert (np.linalg.norm(found - middle, axis=1) <= spread + 1e-12).all()
        finite += np.isfinite(bounds.spread_u)
        for name, found in zip(("uu", "uv", "vv"), seconds, strict=True):
            middle, half, most = (
                getattr(bounds, f"{k}_{name}") for k in ("middle", "half", "most")
            )
            assert (np.abs(found @ d - middle) <= half + 1e-12).all()
            assert (np.linalg.norm(found, axis=1) <= most + 1e-12).all()
    assert finite == 12 or (parts < 512 and decades == 0.5)
    if parts == 512 and decades is None:  # ranges of small pieces are small
        assert bounds.spread_v < 0.6 * np.linalg.norm(bounds.along_v)


@pytest.mark.parametrize("turned", [False, True])
def test_points_that_triangles_share_end_a_search(turned):
    """The nearest point lies on an edge, then at a corner: each triangle there has its proof."""
    ring = engine.ParametricSurface(torus_patches())
    ball = engine.TriangleMesh(*shapes.sphere(1.0), name="sphere")
    for offset in ((-1.99698451, 0.44653429, 0.99856802), (0.4, 0.3, 1.9), (2.05, 0.4, 1.3)):
        pose = np.eye(4)
        pose[:3, 3] = offset
        models, poses = (ring, ball), (np.eye(4), pose)
        if turned:
            models, poses = models[::-1], poses[::-1]
        answer = engine.distance(models[0], poses[0], models[1], poses[1])
        assert answer.status is engine.Status.EXACT
        # Without these proofs, and with ways that are tilted along a triangle, 10^5 and more.
        assert answer.bound_tests < 40_000
