"""Signed distances of solids and parametric surfaces, against dense samples of the surface."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest
from ball_oracle import depths_in
from engine_bodies import IDENTITY, box, pose, sphere, translation
from engine_surfaces import bumps, curve, patch, sphere_patches

from proximity_monitor import engine
from proximity_monitor.engine import Status
from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.assembly.schedule import Schedule

TIGHT = 1e-12
HALF = np.array([0.6, 0.5, 0.4])
BOX = box(tuple(2.0 * HALF))


def phi_box(x):
    """Return the signed distances of points (k, 3) from the box."""
    q = np.abs(x) - HALF
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)


def phi_ball(x):
    return np.linalg.norm(x, axis=1) - 0.7


def phi_capsule(x):
    nearest = np.clip(x[:, 0], -0.5, 0.5)
    return np.linalg.norm(x - np.outer(nearest, (1.0, 0.0, 0.0)), axis=1) - 0.3


SOLIDS = {
    "box": (BOX, phi_box),
    "ball": (engine.points([[0.0, 0.0, 0.0]], radius=0.7), phi_ball),
    "capsule": (engine.polyline([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], radius=0.3), phi_capsule),
}
SURFACES = {
    "bumps": [bumps(3, 8)],
    "rational": [patch(4, (5, 4), (3, 2), decades=2.0)],
    "curve": [curve(5)],
    "sphere": sphere_patches(),
    "patches and a curve": [patch(6), curve(7, columns=2)],
}


def samples(element, count=150):
    """Return points (k, 3) of a patch or curve, and how far it may be from the nearest of them."""
    if isinstance(element, engine.Curve):
        points = element.evaluate(np.linspace(*element.domain, count * count))[:, None]
    else:
        grid = np.meshgrid(*(np.linspace(*each, count) for each in element.domain), indexing="ij")
        points = element.evaluate(*(each.ravel() for each in grid)).reshape(count, count, 3)
    steps = [np.linalg.norm(np.diff(points, axis=i), axis=2).max(initial=0.0) for i in (0, 1)]
    return points.reshape(-1, 3), sum(steps)


SAMPLES = {name: [samples(each) for each in made] for name, made in SURFACES.items()}


def placed(points, pose_of, pose_in):
    """Return points (k, 3) of one model in the frame of another."""
    world = points @ pose_of[:3, :3].T + pose_of[:3, 3]
    return (world - pose_in[:3, 3]) @ pose_in[:3, :3]


def check(found, least, spacing, depth_err=0.01):
    """Check bounds of a surface whose deepest sample is `least`, with no point `spacing` deeper."""
    assert found.lower <= least + TIGHT
    assert found.upper >= least - spacing - TIGHT
    assert found.lower <= found.upper
    if found.upper < 0.0:
        assert found.lower >= found.upper * (1.0 + depth_err) - TIGHT
    elif found.lower > 0.0:
        assert found.lower >= found.upper - 1e-9


@pytest.mark.parametrize("first", SOLIDS)
@pytest.mark.parametrize("second", SURFACES)
def test_depths_by_dense_samples(first, second):
    solid, phi = SOLIDS[first]
    surface = engine.ParametricSurface(SURFACES[second])
    rng = np.random.default_rng([len(first), len(second)])
    for spread in (0.1, 0.8, 2.0):
        pose_a, pose_b = pose(rng, 2.0), pose(rng)
        pose_b[:3, 3] = (
            pose_a[:3, 3] + spread * rng.normal(size=3) - pose_b[:3, :3] @ (surface.centre)
        )
        least, spacing = np.inf, 0.0
        for points, apart in SAMPLES[second]:
            least = min(least, phi(placed(points, pose_b, pose_a)).min())
            spacing = max(spacing, apart)
        found = engine.signed_distance(solid, pose_a, surface, pose_b)
        other = engine.signed_distance(surface, pose_b, solid, pose_a)
        check(found, least, spacing)
        check(other, least, spacing)
        assert found.lower == pytest.approx(other.lower, abs=0.01 * abs(least) + TIGHT)
        if found.upper < 0.0:
            at = placed(found.point_b[None], IDENTITY, pose_a)
            assert phi(at)[0] == pytest.approx(found.upper, abs=1e-9)
            assert np.linalg.norm(found.point_a - found.point_b) == pytest.approx(
                -found.upper, abs=1e-9
            )
            feature = found.feature_b
            element = SURFACES[second][feature.index]
            of = element.evaluate(*feature.parameters)[None]
            assert np.allclose(placed(of, pose_b, IDENTITY), found.point_b, atol=1e-12)


def test_what_lies_wholly_inside_is_seen_and_what_lies_around_is_not():
    ball = engine.ParametricSurface(sphere_patches())
    ball.deform(0.1 * ball.control_points)
    for x, expected in ((0.0, -0.4), (0.3, -0.4), (0.45, -0.25), (0.65, -0.05), (0.8, 0.1)):
        found = engine.signed_distance(ball, translation(x), BOX, IDENTITY)
        assert found.lower <= expected + TIGHT
        assert found.upper >= expected - TIGHT
        assert found.lower == pytest.approx(expected, rel=0.01)
        assert found.upper == pytest.approx(expected, rel=0.01)
    ball.deform(100.0 * ball.control_points)
    assert engine.signed_distance(ball, IDENTITY, BOX, IDENTITY).lower > 1.0


@pytest.mark.parametrize("count", [2, 400])
def test_a_part_inside_is_found_among_others(count):
    """Few parts are searched one by one, many parts by their bounding volumes."""
    rng = np.random.default_rng(count)
    small = 0.01 * np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0]), -1).reshape(2, 2, 3)
    places = rng.normal(size=(count, 3))
    places *= 3.0 / np.linalg.norm(places, axis=1)[:, None]
    outside = engine.ParametricSurface([engine.Patch(small + each) for each in places])
    places[-1] = -0.1, 0.2, 0.1
    inside = engine.ParametricSurface([engine.Patch(small + each) for each in places])
    assert engine.signed_distance(BOX, IDENTITY, outside, IDENTITY).lower > 0.0
    found = engine.signed_distance(BOX, IDENTITY, inside, IDENTITY)
    assert found.upper == pytest.approx(-0.3, rel=0.01)
    assert found.feature_b.index == count - 1
    many = engine.distances(BOX, [IDENTITY] * 2, inside, [IDENTITY] * 2, signed=True)
    assert np.allclose(many.upper, -0.3, rtol=0.01)
    assert np.allclose(many.lower, -0.3, rtol=0.02)


def test_an_assembly_says_what_its_pairs_say():
    models = [BOX, bumps(3, 8), engine.ParametricSurface(sphere_patches()), sphere(2, 0.3)]
    pairs = [[0, 1], [1, 0], [1, 3], [2, 1], [0, 3], [3, 2], [2, 0]]
    assembly, rng = engine.Assembly(models), np.random.default_rng(8)
    for spread in (0.3, 1.5):
        poses = [pose(rng, spread) for _ in models]
        found = assembly.distances(poses, pairs, signed=True)
        for k, (i, j) in enumerate(pairs):
            one = engine.signed_distance(models[i], poses[i], models[j], poses[j])
            assert found.lower[k] <= one.upper + TIGHT
            assert one.lower <= found.upper[k] + TIGHT
            assert (found.upper[k] < 0.0) == (one.upper < 0.0)
            assert found.lower[k] > -np.inf
        touching = assembly.distances(poses, pairs, signed=True, clearance=0.0)
        assert ((touching.upper <= 0.0) == (found.upper <= 0.0)).all()


def test_a_schedule_says_what_its_pairs_say():
    small = engine.ParametricSurface(sphere_patches())
    small.deform(0.2 * small.control_points)
    models = [BOX, bumps(3, 8), small, sphere(2, 0.3)]
    pairs = np.array([[0, 1], [1, 2], [1, 3], [2, 0], [3, 2], [0, 3]])
    answers, assembly = Answers(models, list("abcd")), engine.Assembly(models)
    rows = answers.add(
        pairs, np.array([models[i].is_solid or models[j].is_solid for i, j in pairs])
    )
    schedule, known = Schedule(answers, assembly), np.ones(4, np.bool_)
    schedule.begin(rows)
    rng = np.random.default_rng(12)
    for spread in (0.1, 0.4, 1.5):
        poses = np.array([pose(rng, spread) for _ in models])
        answers.move(np.arange(4), poses)
        for _ in range(2):  # the second time the bodies stand still, so depths are found closely
            schedule.update(rows, known, ~known, True)
            schedule.search(perf_counter() + 60.0, perf_counter)
        listed, left = schedule.report(perf_counter())
        assert left == 0
        assert len(listed) == len(pairs)
        for (i, j), row in zip(pairs, listed, strict=True):
            one = engine.signed_distance(models[i], poses[i], models[j], poses[j])
            assert row["lower"] <= one.upper + TIGHT
            assert one.lower <= row["upper"] + TIGHT
            assert (row["upper"] < 0.0) == (one.upper < 0.0)
            assert row["upper"] - row["lower"] <= 0.0101 * abs(one.lower) + TIGHT


def test_a_search_that_was_cut_goes_on_and_its_bounds_always_hold():
    surface = bumps(3, 8)
    there = translation(-0.5, -0.5)
    whole = engine.signed_distance(BOX, IDENTITY, surface, there, depth_err=1e-3)
    pair = engine.Pair(BOX, surface)
    for calls in range(10_000):  # noqa: B007 - the number of calls is what counts
        found = pair.signed_distance(IDENTITY, there, depth_err=1e-3, budget_s=0.0)
        assert found.lower <= whole.upper + TIGHT
        assert whole.lower <= found.upper + TIGHT
        if found.status is not Status.OUT_OF_TIME:
            break
    assert calls > 2
    assert found.lower >= found.upper * (1.0 + 1e-3) - TIGHT


@pytest.mark.long
def test_a_whole_region_that_is_deepest_does_not_keep_the_search_from_its_end():
    """A sheet in the middle of a box. To all digits, a sheet with waves would take for ever."""
    waves = 1e-3 * np.sin(np.arange(49.0)).reshape(7, 7)
    grid = np.meshgrid(np.linspace(-0.1, 0.1, 7), np.linspace(-0.1, 0.1, 7), indexing="ij")
    for heights in (0.0 * waves, waves):
        sheet = engine.Patch(np.stack((*grid, heights), axis=-1))
        points, spacing = samples(sheet)
        found = engine.signed_distance(BOX, IDENTITY, sheet, IDENTITY, depth_err=0.0)
        check(found, phi_box(points).min(), spacing, 1e-4)


def test_a_solid_with_a_hole():
    """The inside is guessed at the missing faces. Elsewhere it is as if none were missing."""
    whole = sphere(2)
    open_ = engine.TriangleMesh(whole.vertices, whole.faces[:-4], solid="robust")
    surface = patch(4, (5, 4), (3, 2))
    there = translation(0.2, 0.1, -0.1)
    points, spacing = samples(surface, 30)
    least = -depths_in(open_, IDENTITY)(points + there[:3, 3]).max()
    found = engine.signed_distance(open_, IDENTITY, surface, there)
    assert found.lower <= least + TIGHT
    assert found.upper >= least - spacing


def test_deviations_widen_the_depth():
    sheet = engine.Patch(np.array([[[0.0, 0, 0], [0.1, 0, 0]], [[0, 0.1, 0], [0.1, 0.1, 0]]]))
    thick = engine.Patch(sheet.control, deviation=0.01)
    plain = engine.signed_distance(BOX, IDENTITY, sheet, IDENTITY)
    found = engine.signed_distance(BOX, IDENTITY, thick, IDENTITY)
    assert found.lower <= plain.lower - 0.01
    assert found.upper >= plain.upper + 0.01


def test_two_surfaces_are_asked_for_their_distance():
    a, b = bumps(1, 6), engine.ParametricSurface(sphere_patches())
    for x in (0.0, 2.5):
        plain = engine.distance(a, IDENTITY, b, translation(x))
        signed = engine.signed_distance(a, IDENTITY, b, translation(x))
        assert (signed.lower, signed.upper) == (plain.lower, plain.upper)


SHEET = engine.Patch(np.array([[[-1.0, -1, 0], [-1, 1, 0]], [[1, -1, 0], [1, 1, 0]]]))
UP = engine.polyline([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])


def test_a_contact_has_a_point_and_the_shorter_way_apart():
    low = translation(0.1, 0.2, 0.35)
    found = engine.collide(SHEET, IDENTITY, BOX, translation(0.0, 0.0, 0.05))
    assert found.contacts.shape == (1, 2)
    assert found.contacts[0, 0] == 0
    assert found.points.shape == found.normals.shape == (1, 3)
    assert abs(found.points[0, 2]) < TIGHT
    assert abs(phi_box(found.points - (0.0, 0.0, 0.05))[0]) < TIGHT
    assert np.linalg.norm(found.normals[0]) == pytest.approx(1.0)
    found = engine.collide(SHEET, low, UP, IDENTITY)
    assert np.allclose(found.points, [[0.0, 0.0, 0.35]], atol=1e-12)
    assert np.allclose(np.abs(found.normals), [[0.0, 0.0, 1.0]], atol=1e-12)
    # The normal points from a to b. b is the line: its shorter way out of the sheet is upward.
    assert found.normals[0, 2] == 1.0
    ball = engine.points([[0.0, 0.0, 0.0]], radius=0.5)
    found = engine.collide(SHEET, low, ball, IDENTITY)
    assert np.allclose(found.normals, [[0.0, 0.0, -1.0]], atol=1e-12)
    assert not len(engine.collide(SHEET, translation(0.0, 0.0, 2.0), UP, IDENTITY).contacts)


def test_crossing_curves_are_parted_along_the_normal_of_both():
    a = engine.Curve(np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]]))
    b = engine.Curve(np.array([[0.0, -1, 0], [0, 1, 0]]))
    found = engine.collide(a, IDENTITY, b, IDENTITY)
    assert np.allclose(found.points, 0.0, atol=1e-12)
    assert np.allclose(np.abs(found.normals), [[0.0, 0.0, 1.0]], atol=1e-12)
