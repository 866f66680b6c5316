"""Ranges of derivatives, the basis of proofs around near points; and searches these shorten."""

import numpy as np
import pytest
from engine_bodies import from_python
from engine_surfaces import patch, torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.kernels.surface import evaluate, ranges
from proximity_monitor.engine.models import parts as division
from proximity_monitor.study import shapes

jet_at, ranges_of = from_python(evaluate.jet_at), from_python(ranges.ranges_of)
SAMPLES = np.linspace(0.0, 1.0, 7)


def net_of(tree, piece):
    """Return the control points of a whole piece, laid out as a cell's: projected, homogeneous."""
    rows = tree.nets[piece["net"] :][: 4 * piece["room"]].reshape(4, -1)
    return np.concatenate((rows[:3] / rows[3], rows)).reshape(-1)


def across(vectors, d):
    """Return the parts of vectors (k, 3) perpendicular to a unit vector."""
    return vectors - np.outer(vectors @ d, d)


@pytest.mark.parametrize("parts", [1, 16, 512])
@pytest.mark.parametrize("decades", [0.0, 0.5, None])
def test_ranges_hold_every_derivative(decades, parts, monkeypatch):
    """Rational pieces have ranges, too. If their weights differ too much, these are infinite."""
    monkeypatch.setattr(division, "_PIECES", parts)
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
        for name, found in (("u", du), ("v", dv)):
            near, spread, middle, half = (
                getattr(bounds, f"{k}_{name}") for k in ("across", "spread", "middle", "half")
            )
            assert (np.abs(found @ d - middle) <= half + 1e-12).all()
            assert (np.linalg.norm(across(found, d) - near, axis=1) <= spread + 1e-12).all()
        finite += np.isfinite(bounds.spread_u)
        for name, found in zip(("uu", "uv", "vv"), seconds, strict=True):
            middle, half = getattr(bounds, f"middle_{name}"), getattr(bounds, f"half_{name}")
            assert (np.abs(found @ d - middle) <= half + 1e-12).all()
    assert finite == 12 or (parts < 512 and decades == 0.5)
    if parts == 512 and decades is None:  # small pieces have small ranges
        assert bounds.spread_u < 0.6 * np.linalg.norm(bounds.across_u)


POSES = np.array(
    [
        [
            [-0.2573415402408934, -0.39182408989373607, -0.8833171651481649, -1.99698451214241],
            [-0.9556444984224142, 0.2386979598393783, 0.17253079899974688, 0.4465342913513474],
            [0.14324428191525523, 0.8885365307895138, -0.4358714364937425, 0.9985680213137367],
            [0.0, 0.0, 0.0, 1.0],
        ],
        [
            [-0.7142485004949803, -0.10576862244515822, -0.6918540872515866, -1.070518390601944],
            [0.6399305811667931, -0.4990156562816988, -0.5843562492805874, 1.4527000561438854],
            [-0.283439465897399, -0.8601141629410594, 0.42410576025326285, -1.3417399175780995],
            [0.0, 0.0, 0.0, 1.0],
        ],
    ]
)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("pose", POSES)
def test_points_on_edges_of_triangles_end_a_search(pose, turned):
    """Both triangles at the edge have a proof, whose direction is not tilted along them."""
    ring = engine.ParametricSurface(torus_patches())
    ball = engine.TriangleMesh(*shapes.sphere(1.0), name="sphere")
    asked = (ring, np.eye(4), ball, pose)
    answer = engine.distance(*(asked[2:] + asked[:2] if turned else asked))
    assert answer.status is engine.Status.EXACT
    assert (answer.feature_a if turned else answer.feature_b).kind == "edge"
    assert answer.bound_tests < 20_000  # 8,000; without the proofs more than 120,000


@pytest.mark.parametrize("weight", [1e-6, 1e-8, 1e-10, 1e-13, 1e-16, 1e-20])
def test_a_segment_within_the_last_bits_of_its_parameter(weight):
    """Most of it lies between neighbouring float64 parameters; a proof there is of another part."""
    segment = engine.Curve([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], weights=[1.0, weight])
    for x in np.random.default_rng(1).uniform(0.05, 0.95, 8):
        for height in (0.0, 1e-11, 1e-8, 1e-6, 1e-2):
            place = [[x, height, 0.0]]
            found = engine.distance(segment, np.eye(4), engine.points(place), np.eye(4))
            assert found.lower <= height + 1e-15
            assert found.upper >= height - 1e-15
            assert found.bound_tests < 20_000
            nearest = engine.closest_points(segment, np.eye(4), place)
            assert nearest.lower[0] <= height + 1e-15
            assert nearest.upper[0] >= height - 1e-15
