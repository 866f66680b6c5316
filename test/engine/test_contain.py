"""Signs of many pairs in one call: open wherever models may overlap, and nowhere else."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from engine_bodies import box, from_trimesh, pose, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine.assembly import assembly
from proximity_monitor.engine.assembly.query import Query
from proximity_monitor.engine.kernels.base import state as index

OUT_OF_TIME = tuple(engine.Status).index(engine.Status.OUT_OF_TIME)


def shells() -> engine.TriangleMesh:
    """Return a ball with a cavity, and two small balls beside it."""
    parts = [trimesh.creation.icosphere(1, size) for size in (1.0, 0.8, 0.1, 0.1)]
    parts[1].invert()
    parts[2].apply_translation((1.5, 0.0, 0.0))
    parts[3].apply_translation((0.0, 1.5, 0.0))
    return from_trimesh(trimesh.util.concatenate(parts), "shells")


BALL = sphere(2, 0.3)
MODELS = (
    box(),
    sphere(2),
    torus(16),
    shells(),
    BALL,
    engine.TriangleMesh(BALL.vertices, BALL.faces, solid=False),
    engine.TriangleMesh(sphere(2).vertices, sphere(2).faces[9:], solid="robust"),
    engine.points(np.random.default_rng(1).normal(0.0, 0.2, (9, 3))),
    engine.points(np.random.default_rng(2).normal(0.0, 0.2, (1000, 3))),
)
PAIRS = np.array(list(itertools.combinations(range(len(MODELS)), 2)), np.int32)
HOLED = 6


def rows(poses, clearance=np.inf, budget_s=None, threads=1):
    count = len(PAIRS)
    wanted = np.tile([0.0, 0.0, clearance], (count, 1))
    hints = np.full((count, 2), -1, np.int32)
    signed = np.ones(count, np.bool_)
    query = Query(poses, PAIRS, wanted, hints, signed)
    return engine.Assembly(MODELS).rows(query, budget_s, threads)


@pytest.mark.long
def test_a_sign_is_open_where_the_models_may_overlap_alone():
    rng = np.random.default_rng(4)
    overlapping = 0
    for spread in (0.1, 0.3, 0.6, 1.0) * 4:
        poses = np.array([pose(rng, spread) for _ in MODELS])
        found = rows(poses)
        np.testing.assert_array_equal(found, rows(poses, threads=2))
        for (a, b), row in zip(PAIRS, found, strict=True):
            true = engine.signed_distance(MODELS[a], poses[a], MODELS[b], poses[b])
            if row[index.LOWER] == -np.inf:
                assert row[index.STATUS] == OUT_OF_TIME
                assert true.lower <= 0.0 or HOLED in (a, b)
            else:
                assert true.lower > 0.0
                assert row[index.LOWER] == pytest.approx(true.lower, abs=1e-12)
            assert true.lower <= row[index.UPPER]
            overlapping += true.upper < 0.0
    assert overlapping > 50


def test_what_the_upper_bound_decides_counts_as_ended():
    poses = np.array([pose(np.random.default_rng(5), 0.2) for _ in MODELS])
    decided = 0
    for row in rows(poses, clearance=0.5):
        if row[index.LOWER] == -np.inf:
            assert (row[index.STATUS] != OUT_OF_TIME) == (row[index.UPPER] <= 0.5)
            decided += row[index.UPPER] <= 0.5
    assert decided > 5


def test_what_is_cut_has_no_sign():
    """A cut search bounds the surfaces' distance alone; whether models overlap stays open."""
    poses = np.array([pose(np.random.default_rng(6), 0.2) for _ in MODELS])
    for row in rows(poses, budget_s=0.0):
        assert np.isnan(row[index.STATUS]) or row[index.LOWER] == -np.inf or row[index.LOWER] > 0.0


@pytest.mark.parametrize("steps", [0, 1])
def test_signs_are_settled_step_by_step(steps, monkeypatch):
    """Without any step, it stays open whether a part of one model is inside the other."""
    poses = np.array([pose(np.random.default_rng(7), 1.0) for _ in MODELS])
    whole, settle, cut = rows(poses), assembly.settle_signs, []

    def settle_some(*given):
        *before, _, progress, scratch, answers = given
        reached = settle(*before, steps, progress, scratch, answers)
        cut.append(reached < given[6])
        return reached

    monkeypatch.setattr(assembly, "settle_signs", settle_some)
    found = rows(poses)
    if steps:
        assert sum(cut) > 100, "of one point after the other"
        np.testing.assert_array_equal(found, whole)
    else:
        left = found[:, index.LOWER] != whole[:, index.LOWER]
        assert left.any()
        assert (found[left, index.LOWER] == -np.inf).all()
        assert (found[left, index.STATUS] == OUT_OF_TIME).all()


def test_walls_that_solids_share_count_from_both_sides():
    """A sheet drawn from both sides counts from both, too. A search leaves out one of its faces."""
    cube = trimesh.creation.box((1.0, 1.0, 1.0))
    mirrored = trimesh.Trimesh(cube.vertices * (-1.0, 1.0, 1.0), cube.faces[:, ::-1])
    cubes = [(cube, mirrored)[i % 2].copy().apply_translation((i, 0, 0)) for i in range(3)]
    rows_of_cubes = trimesh.util.concatenate(cubes)
    sheet = [[1.3, -2.0, -2.0], [1.3, 2.0, -2.0], [1.3, 0.0, 2.0]]
    vertices = np.concatenate((rows_of_cubes.vertices, sheet))
    n = len(rows_of_cubes.vertices)
    faces = np.concatenate((rows_of_cubes.faces, [[n, n + 1, n + 2], [n, n + 2, n + 1]]))
    block = engine.TriangleMesh(vertices, faces)
    assert block.is_solid and len(block._hierarchy.coincident.twins) == 2 * 2 + 1
    probe = engine.points([[0.0, 0.0, 0.0]])
    bodies = engine.Assembly([block, probe])
    rng = np.random.default_rng(4)
    poses, wanted = np.stack((np.eye(4), np.eye(4))), np.array([[0.0, 0.0, np.inf]])
    hints, pairs = np.full((1, 2), -1, np.int32), np.array([[0, 1]], np.int32)
    inside = 0
    for _ in range(300):
        poses[1, :3, 3] = place = rng.uniform((-1.0, -0.7, -0.7), (3.0, 0.7, 0.7))
        within = bool((np.abs(place - (1.0, 0.0, 0.0)) < (1.5, 0.5, 0.5)).all())
        inside += within
        query = Query(poses, pairs, wanted, hints, np.ones(1, np.bool_))
        found = bodies.rows(query, None, 1)
        assert (found[0, index.LOWER] > 0.0) is not within
        signed = engine.signed_distance(block, poses[0], probe, poses[1])
        assert (signed.upper < 0.0) is within and (signed.lower > 0.0) is not within
    assert 50 < inside < 250
