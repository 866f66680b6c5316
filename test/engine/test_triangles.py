"""Distances of single triangles against exact rational arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import IDENTITY, from_python, pose
from engine_oracles import (
    exact_motion,
    exact_squared_distance,
    exactly_moved,
    magnitude,
    root,
)
from triangle_cases import KINDS

from proximity_monitor import engine
from proximity_monitor.engine.kernels.elements import edges, triangles

edge_pairs, segments = from_python(edges.edge_pairs), from_python(triangles.segments)

CASES = 60
FACE = [[0, 1, 2]]
ACCURACY = 4e-15
"""Largest error of a bound, as a share of the larger triangle's coordinates."""


def models(a, b):
    return engine.TriangleMesh(a, FACE), engine.TriangleMesh(b, FACE)


def ask(a, b):
    first, second = models(a, b)
    return engine.distance(first, IDENTITY, second, IDENTITY)


def coordinates(a, b):
    return float(np.linalg.norm(np.concatenate((a, b)), axis=1).max())


def cases(kind):
    rng = np.random.default_rng(list(KINDS).index(kind))
    for case in range(CASES):
        a, b = KINDS[kind](rng)
        yield f"{kind} {case}: {a.tolist()} {b.tolist()}", a, b


def place(placement, rng, b):
    """Return two poses, and b moved such that the pair stays nearly as hard as it was."""
    if placement == "at the origin":
        return IDENTITY, IDENTITY, b
    pose_a, turn = pose(rng, 3.0), pose(rng, rng.choice((0.0, 1.0)))
    b = (b - turn[:3, 3]) @ turn[:3, :3]
    pose_b = pose_a @ turn
    if placement == "six digits":
        pose_a, pose_b = np.round(pose_a, 6), np.round(pose_b, 6)
    return pose_a, pose_b, b


@pytest.mark.long
@pytest.mark.parametrize("placement", ["at the origin", "moved", "six digits"])
@pytest.mark.parametrize("kind", KINDS)
def test_both_bounds_are_within_their_share_of_the_exact_distance(kind, placement):
    """The bounds hold without any tolerance, wherever the triangles are, and they are tight."""
    rng = np.random.default_rng(1)
    worst = 0.0
    for case, a, b in cases(kind):
        pose_a, pose_b, b = place(placement, rng, b)
        squared = exact_squared_distance(a, exactly_moved(exact_motion(pose_a, pose_b), b))
        first, second = models(a, b)
        found = engine.distance(first, pose_a, second, pose_b)
        assert Fraction(found.lower) ** 2 <= squared <= Fraction(found.upper) ** 2, case
        exact, share = root(squared), magnitude(first, second, pose_a, pose_b)
        error = max(Fraction(found.upper) - exact, exact - Fraction(found.lower))
        worst = max(worst, float(error) / share)
        assert worst <= ACCURACY, case
    print(f"{kind}, {placement}: the bounds err by at most {worst:.2g} of the coordinates")


@pytest.mark.parametrize("kind", KINDS)
def test_status_says_whether_they_touch(kind):
    for case, a, b in cases(kind):
        squared = exact_squared_distance(a, b)
        found = ask(a, b)
        if squared == 0:
            assert found.status is engine.Status.INTERSECTING, case
        elif float(root(squared)) > ACCURACY * coordinates(a, b):
            assert found.status is engine.Status.EXACT, case
            assert found.lower > 0.0, case


@pytest.mark.parametrize("kind", KINDS)
def test_witness_points_lie_on_the_triangles_and_attain_the_bound(kind):
    for case, a, b in cases(kind):
        found = ask(a, b)
        rounding = 4e-15 * coordinates(a, b)
        for corners, point, feature in (
            (a, found.point_a, found.feature_a),
            (b, found.point_b, found.feature_b),
        ):
            weights = feature.parameters
            assert feature.index == 0, case
            assert weights.min() >= 0.0, case
            assert abs(weights.sum() - 1.0) <= 1e-15, case
            assert np.abs(weights @ corners - point).max() <= rounding, case
        apart = np.linalg.norm(found.point_a - found.point_b)
        assert apart <= found.upper + rounding, case
        assert apart >= found.lower - rounding, case


@pytest.mark.parametrize("angle", [10.0**-k for k in range(2, 16)])
def test_nearly_parallel_edges_that_cross_above_each_other(angle):
    """Two long edges cross, one above the other. The gap is known, whatever their angle."""
    gap = 0.25
    a = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    b = np.array([[-1.0, -angle, gap], [1.0, angle, gap], [0.0, 0.0, 1.0]])
    found = ask(a, b)
    assert found.lower <= gap <= found.upper
    assert found.upper - gap <= ACCURACY * coordinates(a, b)
    assert found.status is engine.Status.EXACT


@pytest.mark.parametrize("angle", [10.0**-k for k in range(2, 16)])
def test_nearly_parallel_edges_whose_nearest_points_are_their_ends(angle):
    a = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, -1.0]])
    b = np.array([[2.0, 0.0, 0.0], [3.0, angle, 0.0], [2.5, 0.0, 1.0]])
    found = ask(a, b)
    assert found.lower <= 1.0 <= found.upper
    assert np.allclose(found.point_a, a[1], atol=1e-15)
    assert np.allclose(found.point_b, b[0], atol=1e-15)
    assert found.feature_a.kind == found.feature_b.kind == "vertex"


def test_features_name_vertex_edge_and_face():
    a = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    above = ask(a, [[0.0, 0.0, 0.5], [0.2, 0.0, 1.0], [0.0, 0.2, 1.0]])
    assert (above.feature_a.kind, above.feature_b.kind) == ("face", "vertex")
    assert np.allclose(above.point_a, 0.0)
    beside = ask(a, [[-0.5, -1.5, -1.0], [0.5, -1.5, 1.0], [0.0, -3.0, 0.0]])
    assert (beside.feature_a.kind, beside.feature_b.kind) == ("edge", "edge")
    assert np.allclose(beside.point_a, (0.0, -1.0, 0.0))
    assert np.allclose(beside.point_b, (0.0, -1.5, 0.0))


@pytest.mark.parametrize("exponent", [-120, -75, -60, -52, -50, -40, -20, -6, 6, 20, 40, 44])
@pytest.mark.parametrize("kind", ["apart", "close", "tiny_gap", "zero_area", "shared_edge"])
def test_tiny_and_huge_triangles(kind, exponent):
    """Products of six lengths must not vanish or overflow; at worst, only the bounds widen."""
    rng = np.random.default_rng(exponent % 1000)
    for _ in range(20):
        a, b = (t * 10.0**exponent for t in KINDS[kind](rng))
        squared = exact_squared_distance(a, b)
        found = ask(a, b)
        assert Fraction(found.lower) ** 2 <= squared <= Fraction(found.upper) ** 2
        if exponent >= -20:
            error = abs(Fraction(found.upper) - root(squared))
            assert float(error) <= ACCURACY * coordinates(a, b)


def test_a_corner_above_a_face_at_every_scale():
    a = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    b = np.array([[0.0, 0.0, 0.5], [0.2, 0.0, 1.0], [0.0, 0.2, 1.0]])
    for exponent in range(-149, 149):
        scale = 2.0**exponent  # exact, so the distance is known
        found = ask(a * scale, b * scale)
        assert found.lower <= 0.5 * scale <= found.upper, exponent


@pytest.mark.parametrize("kind", KINDS)
def test_edges_in_parallel_have_the_nearest_points_of_edges_one_by_one(kind):
    s, t, squared, touching = np.empty((4, edges.LANES))
    for case, a, b in cases(kind):
        a, b = ([tuple(corner) for corner in each.tolist()] for each in (a, b))
        edges_a, edges_b = (
            [tuple(np.subtract(each[(i + 1) % 3], each[i]).tolist()) for i in range(3)]
            for each in (a, b)
        )
        edge_pairs(*map(tuple, (a, edges_a, b, edges_b)), s, t, squared, touching)
        for i in range(3):
            for j in range(3):
                k = 3 * i + j
                _, _, alone = segments(a[i], edges_a[i], b[j], edges_b[j])
                if squared[k] < touching[k]:
                    continue  # the engine recomputes such a pair with `segments`
                size = coordinates(np.array(a), np.array(b))
                assert abs(np.sqrt(squared[k]) - np.sqrt(alone)) <= 1e-15 * size, case
                ends = [
                    np.add(c, np.multiply(w, e))
                    for c, w, e in ((a[i], s[k], edges_a[i]), (b[j], t[k], edges_b[j]))
                ]
                attained = np.linalg.norm(ends[1] - ends[0])
                assert abs(attained - np.sqrt(squared[k])) <= 1e-15 * size, case
                assert min(s[k], t[k]) >= 0.0 and max(s[k], t[k]) <= 1.0, case


def test_points_of_a_sliver_that_crosses_a_tiny_triangle_attain_the_bound():
    tiny = [
        [-110.23169006265377, -82.29229886283471, 109.84435218189563],
        [-110.23169206265376, -82.29229936283471, 109.84435218189563],
        [-110.23169256265376, -82.29229836283471, 109.84435018189563],
    ]
    sliver = [
        [483392.794129903, -333120.6025338054, -131165.40415192753],
        [-40459.50344492837, 27710.405091541576, 11065.020211639603],
        [40239.04006280306, -27874.98968976714, -10845.33150727579],
    ]
    a, b = (engine.TriangleMesh(each, [[0, 1, 2]]) for each in (tiny, sliver))
    for one, other in ((a, b), (b, a)):
        found = engine.distance(one, np.eye(4), other, np.eye(4))
        assert np.linalg.norm(found.point_a - found.point_b) <= found.upper
    rng = np.random.default_rng(1)
    for length, size in ((1e9, 1e-6), (1e15, 3.0)):
        for _ in range(20):
            small = rng.normal(size=(3, 3)) * size
            middle, way = small.T @ rng.dirichlet((3, 3, 3)), rng.normal(size=3)
            way *= length / np.linalg.norm(way)
            ends = middle - way * rng.uniform(0.3, 1), middle + way * rng.uniform(0.3, 1)
            large = np.array([*ends, rng.normal(size=3) * length])
            found = engine.distance(
                engine.TriangleMesh(small, [[0, 1, 2]]), np.eye(4),
                engine.TriangleMesh(large, [[0, 1, 2]]), np.eye(4),
            )  # fmt: skip
            assert np.linalg.norm(found.point_a - found.point_b) <= found.upper
