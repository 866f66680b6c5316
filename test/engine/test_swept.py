"""Models swept by a ball, and models that deviate: every question, against answers of the cores."""

import math
from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import pose, soup, sphere, translation
from engine_oracles import exact_mesh_distance, magnitude, pairwise_distances, root, triangles
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor import engine
from proximity_monitor.engine import Status
from proximity_monitor.engine.assembly.answers import Answers

ROUNDING = 1e-14
"""Largest difference of an exact answer's bounds, as a share of the coordinates."""


def core_of(model):
    """Return the same triangles without a swept radius."""
    return engine.TriangleMesh(model.vertices, model.faces)


def swept(rng, kind, radius, deviation=0.0):
    if kind == "sphere":
        return engine.points(rng.normal(size=(1, 3)), radius=radius)
    if kind == "cloud":
        return engine.points(rng.normal(size=(200, 3)), radius=radius)
    if kind == "capsules":
        return engine.polyline(rng.normal(size=(12, 3)).cumsum(axis=0), radius=radius)
    given = soup(int(rng.integers(1 << 30)), 40)
    return engine.TriangleMesh(given.vertices, given.faces, radius=radius, deviation=deviation)


def true_distance(a, pose_a, b, pose_b) -> Fraction:
    """Return the distance of two swept models, exact but for a root to 40 digits."""
    cores = root(exact_mesh_distance(core_of(a), core_of(b), pose_b, pose_a))
    return max(cores - Fraction(a.swept_radius) - Fraction(b.swept_radius), Fraction(0))


def test_spheres_are_spheres_to_the_last_digits():
    """Spheres of radius 0.5 m are 5 mm apart, in every direction."""
    ball = engine.points([[0.0, 0.0, 0.0]], radius=0.5)
    rng = np.random.default_rng(1)
    for _ in range(50):
        way = rng.normal(size=3)
        there = pose(rng)
        there[:3, 3] = 1.005 * way / np.linalg.norm(way)
        answer = engine.distance(ball, pose(rng), ball, there)
        assert answer.status is Status.EXACT
        assert abs(answer.lower - 0.005) < ROUNDING and abs(answer.upper - 0.005) < ROUNDING
        assert np.linalg.norm(answer.point_a) == pytest.approx(0.5, abs=ROUNDING)
        between = np.linalg.norm(answer.point_a - answer.point_b)
        assert between == pytest.approx(0.005, abs=ROUNDING)


KINDS = ("sphere", "cloud", "capsules", "mesh")


@pytest.mark.long
@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    kinds=st.tuples(st.sampled_from(KINDS), st.sampled_from(KINDS)),
    radii=st.tuples(st.sampled_from([0.0, 1e-9, 0.1, 0.7]), st.sampled_from([0.0, 0.3, 50.0])),
    apart=st.sampled_from([0.0, 1e-12, 1e-6, 1e-3, 1.0, 100.0]),
    rel_err=st.sampled_from([0.0, 0.1]),
    abs_err=st.sampled_from([0.0, 1e-3]),
)
def test_distances_are_those_of_the_cores_less_the_radii(
    seed, kinds, radii, apart, rel_err, abs_err
):
    rng = np.random.default_rng(seed)
    a, b = (swept(rng, kind, radius) for kind, radius in zip(kinds, radii, strict=True))
    pose_a, pose_b = pose(rng, 5.0), pose(rng, 5.0)
    # Move b along the line between the nearest points until the wanted gap is left.
    way = rng.normal(size=3)
    pose_b[:3, 3] += way / np.linalg.norm(way) * (60.0 + sum(radii))
    first = engine.distance(a, pose_a, b, pose_b)
    way = first.point_b - first.point_a
    pose_b[:3, 3] -= way / np.linalg.norm(way) * (first.upper - apart)
    true = true_distance(a, pose_a, b, pose_b)
    size = magnitude(a, b, pose_a, pose_b) + sum(radii)
    answer = engine.distance(a, pose_a, b, pose_b, rel_err=rel_err, abs_err=abs_err)
    assert Fraction(answer.lower) <= true <= Fraction(answer.upper)
    between = np.linalg.norm(answer.point_a - answer.point_b)
    assert between == pytest.approx(answer.upper, abs=ROUNDING * size)
    allowed = max(float(true) * rel_err, abs_err) + ROUNDING * size
    assert answer.upper - float(true) <= allowed
    if rel_err == abs_err == 0.0:
        assert answer.upper - answer.lower <= 2.0 * ROUNDING * size
    for clearance in (float(true) * 0.999, float(true) * 1.001 + 4.0 * ROUNDING * size):
        found = engine.within(a, pose_a, b, pose_b, clearance)
        assert Fraction(found.lower) <= true <= Fraction(found.upper)
        if not found.within:
            assert Fraction(clearance) < true and found.lower > clearance
        elif clearance < float(true) - 4.0 * ROUNDING * size:
            raise AssertionError("farther, and within")
    colliding = engine.collide(a, pose_a, b, pose_b).colliding
    assert colliding or true > 0
    assert not colliding or true <= ROUNDING * size


@pytest.mark.long
@pytest.mark.parametrize("order", ["depth_first", "priority", "breadth_first"])
@pytest.mark.parametrize("volume", ["rss", "obb"])
def test_manifolds_and_contacts_hold_every_pair(order, volume):
    rng = np.random.default_rng(7)
    a, b = rng.normal(size=(150, 3)), rng.normal(size=(150, 3)) + np.array([4, 0, 0])
    for radius, deviation in ((0.8, 0.0), (0.1, 0.0), (0.1, 0.05)):
        face = np.tile(np.arange(150)[:, None], 3)
        first = engine.TriangleMesh(a, face, radius=radius, deviation=deviation, volume=volume)
        second = engine.TriangleMesh(b, face, radius=radius, volume=volume)
        cores = pairwise_distances(triangles(first), triangles(second))
        found = engine.distance(first, np.eye(4), second, np.eye(4), order=order, manifold=True)
        least = max(cores.min() - 2 * radius, 0.0)
        assert found.lower <= max(least - deviation, 0.0) and least + deviation <= found.upper
        listed = {
            (int(i), int(j))
            for k in range(len(found.manifold))
            for i in found.manifold.faces(k)[0]
            for j in found.manifold.faces(k)[1]
        }
        may = cores - 2 * radius - deviation <= least + deviation
        assert set(map(tuple, np.argwhere(may).tolist())) == listed
        assert (found.manifold.lower <= found.upper).all()
        contacts = engine.collide(first, np.eye(4), second, np.eye(4), all_contacts=True).contacts
        touching = np.argwhere(cores <= 2 * radius + deviation)
        assert sorted(map(tuple, contacts.tolist())) == sorted(map(tuple, touching.tolist()))


def test_a_deviation_widens_every_bound():
    rng = np.random.default_rng(3)
    plain = sphere(3)
    mesh = engine.TriangleMesh(plain.vertices, plain.faces, deviation=0.01)
    probe = engine.points([[0.0, 0.0, 0.0]])
    for gap in (1.0, 0.1, 0.009, 0.0):
        there = translation(*(rng.normal(size=3)))
        there[:3, 3] *= (1.0 + gap) / np.linalg.norm(there[:3, 3])
        true = np.linalg.norm(there[:3, 3]) - 1.0  # from the sphere that the mesh stands for
        without = engine.distance(plain, np.eye(4), probe, there)
        found = engine.distance(mesh, np.eye(4), probe, there)
        assert found.lower == pytest.approx(max(without.lower - 0.01, 0.0), abs=1e-14)
        assert found.upper == pytest.approx(without.upper + 0.01, abs=1e-14)
        assert found.lower <= true <= found.upper
        nearest = engine.closest_points(mesh, np.eye(4), there[None, :3, 3])
        assert nearest.lower[0] <= true <= nearest.upper[0]
        if found.lower > 0.0:
            assert not engine.within(mesh, np.eye(4), probe, there, found.lower * 0.999).within
        assert engine.within(mesh, np.eye(4), probe, there, found.upper).within


def test_cut_searches_go_on_and_coherent_ones_stay_right():
    rng = np.random.default_rng(11)
    a, b = swept(rng, "cloud", 0.05), swept(rng, "capsules", 0.2)
    pair = engine.Pair(a, b)
    for step in range(40):
        there = pose(np.random.default_rng(5))
        there[:3, 3] = (4.0 - 0.05 * step, 0.3, 0.0)
        true = float(true_distance(a, np.eye(4), b, there))
        while True:
            answer = pair.distance(np.eye(4), there, budget_s=1e-6)
            assert answer.lower <= true * (1 + 1e-15) and true <= answer.upper
            if answer.status is not Status.OUT_OF_TIME:
                break
        assert answer.upper - answer.lower < 1e-13


def test_assembly_and_refit_know_the_radii():
    rng = np.random.default_rng(13)
    models = [swept(rng, kind, 0.1) for kind in ("cloud", "capsules", "mesh", "sphere")]
    poses = np.stack([pose(rng, 8.0) for _ in models])
    pairs = np.argwhere(np.triu(np.ones((4, 4)), 1))
    assembly = engine.Assembly(models)
    models[0].deform(models[0].vertices * 1.1)
    found = assembly.distances(poses, pairs)
    for k, (i, j) in enumerate(pairs):
        single = engine.distance(models[i], poses[i], models[j], poses[j])
        assert (found.lower[k], found.upper[k]) == (single.lower, single.upper)
        np.testing.assert_array_equal(found.points_a[k], single.point_a)
        true = true_distance(models[i], poses[i], models[j], poses[j])
        assert single.lower <= true <= single.upper
    batch = engine.distances(models[1], poses[[1, 1]], models[3], poses[[3, 3]])
    assert batch.lower[0] == found.lower[pairs.tolist().index([1, 3])]
    np.testing.assert_array_equal(batch.points_a[0], batch.points_a[1])


def test_a_sphere_that_spins_stays_where_it_is():
    """Bounds are carried for the cores: a spin loses nothing, and points stay nearest."""
    ball, other = engine.points([[0, 0, 0]], radius=0.5), engine.points([[0, 0, 0]], radius=0.25)
    answers = Answers([ball, other], ["ball", "other"])
    row = answers.add(np.array([[0, 1]]), np.zeros(1, bool))
    poses = np.stack((np.eye(4), translation(1.0)))
    answers.move(np.arange(2), poses)
    found = engine.distance(ball, poses[0], other, poses[1])
    cores = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    answers.keep(row, np.array([[found.lower, found.upper]]), cores)
    rng = np.random.default_rng(17)
    for _ in range(20):
        poses[0] = pose(rng)
        answers.move(np.arange(2), poses)
        carried = answers.intervals(row)
        assert carried.still[0] and not carried.same[0]
        assert carried.lower[0] <= 0.25 <= carried.upper[0]
        assert carried.upper[0] - carried.lower[0] < 1e-11
        np.testing.assert_allclose(carried.points[0], [[0.5, 0, 0], [0.75, 0, 0]], atol=1e-15)


@pytest.mark.long
@settings(deadline=None, max_examples=100)
@given(
    seed=st.integers(0, 2**32 - 1),
    motion=st.sampled_from([0.0, 1e-9, 1e-3, 0.3, 3.0]),
    deviation=st.sampled_from([0.0, 0.02]),
)
def test_carried_bounds_hold_wherever_swept_bodies_move(seed, motion, deviation):
    rng = np.random.default_rng(seed)
    a, b = swept(rng, "mesh", 0.3, deviation), swept(rng, "capsules", 0.2)
    poses = np.stack((pose(rng, 3.0), pose(rng, 3.0)))
    answers = Answers([a, b], ["a", "b"])
    row = answers.add(np.array([[0, 1]]), np.zeros(1, bool))
    answers.move(np.arange(2), poses)
    found = engine.distance(core_of(a), poses[0], core_of(b), poses[1])
    bounds = engine.distance(a, poses[0], b, poses[1])
    answers.keep(
        row, np.array([[bounds.lower, bounds.upper]]), np.array([[found.point_a, found.point_b]])
    )
    turn = rng.normal(size=3) * motion
    step = pose(rng) if motion == 3.0 else np.eye(4)
    step[:3, 3] = turn
    poses[1] = poses[1] @ step
    answers.move(np.arange(2), poses)
    carried = answers.intervals(row)
    true = float(true_distance(a, poses[0], b, poses[1]))
    assert carried.lower[0] <= max(true - deviation, 0.0)
    assert true + deviation <= carried.upper[0] * (1.0 + 1e-15)


def test_spheres_and_capsules_overlap_by_their_penetration():
    """If one is inside the other, the answer is minus the diameter of the largest ball in both."""
    ball, small = engine.points([[0, 0, 0]], radius=0.5), engine.points([[0, 0, 0]], radius=0.1)
    capsule = engine.polyline([[0, 0, -1], [0, 0, 1]], radius=0.2)
    rng = np.random.default_rng(19)
    for a, b, offset, true in (
        (ball, small, 0.55, -0.05),
        (ball, small, 0.2, -0.2),
        (ball, small, 0.0, -0.2),
        (capsule, ball, 0.6, -0.1),
        (capsule, ball, 0.1, -0.4),
        (capsule, small, 0.75, 0.45),
    ):
        start = pose(rng, 3.0)
        for first, second, pose_a, pose_b in (
            (a, b, start, start @ translation(offset)),
            (b, a, start @ translation(offset), start),
        ):
            found = engine.signed_distance(first, pose_a, second, pose_b)
            assert found.status is Status.EXACT
            assert found.lower <= true + 1e-15 and true - 1e-15 <= found.upper
            assert found.upper - found.lower < 1e-12


def test_a_sphere_inside_or_half_inside_a_solid_is_not_clear():
    rng = np.random.default_rng(23)
    box = engine.TriangleMesh(*_cube())
    ball = engine.points([[0, 0, 0]], radius=0.05)
    for x in np.linspace(0.0, 0.7, 29):
        start = pose(rng, 3.0)
        found = engine.signed_distance(box, start, ball, start @ translation(x, 0.1, -0.2))
        true = max(x - 0.55, -0.1)  # the largest ball in both is no larger than the sphere
        assert found.lower <= true + 1e-13 and true - 1e-13 <= found.upper
        if true > 0.0:
            assert found.upper - found.lower < 1e-13
        else:
            assert found.upper <= 1e-13
        if x < 0.49:
            assert found.upper < 0.0  # the centre is inside: overlap is certain


def _cube():
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def test_a_surface_in_a_sphere_is_as_deep_as_its_deepest_point():
    ball, point = engine.points([[0, 0, 0]], radius=0.5), engine.points([[0, 0, 0]])
    for x, true in ((0.6, 0.1), (0.3, -0.2), (0.0, -0.5)):
        found = engine.signed_distance(ball, np.eye(4), point, translation(x))
        assert found.lower <= true <= found.upper and found.upper - found.lower < 1e-13


def test_a_ball_that_is_to_be_a_surface_has_no_inside():
    ball = engine.points([[0, 0, 0]], radius=0.5)
    shell = engine.TriangleMesh(ball.vertices, ball.faces, radius=0.5, solid=False)
    assert ball.is_solid and not ball.not_solid
    assert not shell.is_solid and "solid=False" in shell.not_solid
    found = engine.signed_distance(shell, np.eye(4), shell, translation(0.7))
    assert (found.lower, found.upper) == (0.0, 0.0)
    assert engine.signed_distance(ball, np.eye(4), shell, translation(0.7)).upper < 0.0


def test_a_deviation_leaves_the_sign_open_where_it_decides():
    box, thing = engine.TriangleMesh(*_cube(), deviation=0.01), engine.TriangleMesh(*_cube())
    for x, clear, overlapping in (
        (1.02, True, False), (1.005, False, False), (0.995, False, False), (0.9, False, True),
    ):  # fmt: skip
        turn = np.eye(4)
        turn[:3, 3] = x, 0.3, 0.2
        found = engine.signed_distance(box, np.eye(4), thing, turn)
        assert (found.lower > 0.0) is clear and (found.upper < 0.0) is overlapping
        assert found.lower <= x - 1.01


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf, "0.5", None, True, 1e46])
@pytest.mark.parametrize("what", ["radius", "deviation"])
def test_lengths_that_are_none_are_refused_by_name(what, value):
    with pytest.raises(engine.ModelError, match=f"ball: {what} = "):
        engine.TriangleMesh(np.eye(3), [[0, 1, 2]], name="ball", **{what: value})


@pytest.mark.parametrize("tolerance", [{"rel_err": 1.0}, {"abs_err": 1e-3}, {"rel_err": 0.3}])
@pytest.mark.parametrize("share", [0.3, 0.9, 1.1, 1.4, 3.0])
def test_a_search_ends_where_the_deviation_is_about_the_gap(share, tolerance):
    """No tolerance decides the sign there. Formerly, one search followed another without end."""
    cube, deviation = engine.TriangleMesh(*_cube()), 4e-4
    rough, gap = engine.TriangleMesh(*_cube(), deviation=deviation), share * deviation
    beside, pair = translation(1.0 + gap), engine.Assembly([rough, cube])
    poses = np.stack((np.eye(4), beside))
    both = pair.distances(poses, [(0, 1)], signed=True, **tolerance)
    bounds = [(both.lower[0], both.upper[0])]
    for budget_s in (None, 0.05):
        found = engine.signed_distance(
            rough, poses[0], cube, beside, budget_s=budget_s, **tolerance
        )
        bounds.append((found.lower, found.upper))
    for lower, upper in bounds:
        assert lower <= gap - deviation and gap + deviation <= upper
        assert (lower > 0.0) == (share > 1.0)
