"""Ask every kind of query under numba's bounds check of indices (see test_bounds_check)."""

import gc

import numpy as np
from engine_bodies import IDENTITY, ORDERS, box, pose, soup, sphere, torus, translation
from engine_surfaces import sphere_patches
from triangle_cases import KINDS

from proximity_monitor import engine
from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.assembly.broad_phase import BroadPhase
from proximity_monitor.engine.kernels.base import ahead
from proximity_monitor.engine.kernels.base.tables import model_table

gc.disable()  # garbage collection takes a tenth of the compile time
ahead.not_here()  # no worker processes: other tests use the other processor
rng = np.random.default_rng(1)
models = [
    box(),
    sphere(2),
    torus(16),
    soup(1, 1),
    soup(2, 16),
    soup(3, 17),
    soup(4, 257),
    engine.points(rng.normal(size=(33, 3))),
    engine.points(np.ones((40, 3))),
    engine.polyline(rng.normal(size=(20, 3))),
]
models += [
    engine.TriangleMesh(corners, [[0, 1, 2]]) for make in KINDS.values() for corners in make(rng)
]
for first, a in enumerate(models[:10]):
    for b in models[first % 5 :: 5]:
        pair = engine.Pair(a, b)
        for far in (0.0, 1.0, 1e20):
            here = pose(rng, far)
            pair.distance(here, IDENTITY)
            for order in ORDERS:
                pair.distance(here, IDENTITY, order=order, manifold=True, budget_s=1e-5)
                pair.distance(here, IDENTITY, order=order)
            pair.distance(here, IDENTITY, rel_err=0.1, manifold=True)
            pair.distance(here, IDENTITY, rel_err=0.1, abs_err=1e-3)
            for _ in range(3):
                pair.distance(here, IDENTITY, budget_s=1e-5)
            pair.within(here, IDENTITY, 0.5)
            pair.collide(here, IDENTITY, all_contacts=True)
    points = np.concatenate((rng.normal(size=(20, 3)), 1e20 * rng.normal(size=(3, 3))))
    engine.closest_points(a, pose(rng, 1.0), points, normals=True, threads=2)
    engine.closest_points(a, pose(rng, 1.0), points, max_distance=0.5, budget_s=0.0)
    engine.closest_points(a, pose(rng, 1.0), points, normals=True, signed=True)
    swept = engine.TriangleMesh(
        a.vertices, a.faces[:-1] if len(a.faces) > 1 else a.faces, radius=0.1, solid="robust"
    )
    engine.closest_points(swept, pose(rng, 1.0), points, normals=True, signed=True)
    poses = np.array([pose(rng, 1.0) for _ in range(10)])
    engine.distances(a, poses, models[first - 1], poses[::-1], threads=2)
    engine.distances(a, poses, models[first - 1], poses[::-1], signed=True, clearance=0.1)
found = engine.collide(soup(5, 200, 3.0), IDENTITY, soup(6, 200, 3.0), IDENTITY, all_contacts=True)
assert len(found.contacts) > 2048

assembly = engine.Assembly(models)
poses = np.array([pose(rng, 1.0) for _ in models])
pairs = np.array([(i, j) for i in range(len(models)) for j in range(i)])
asked = assembly.distances(poses, pairs, threads=2)
assembly.distances(poses, pairs, hints=2**20 + asked.hints, clearance=0.5, budget_s=1e-3)

answers, everyone = Answers(models, [each.name for each in models]), np.arange(len(models))
rows = answers.add(pairs, np.arange(len(pairs)) % 2 == 0)
answers.move(everyone, poses)
answers.keep(
    rows,
    np.stack((asked.lower, asked.upper), axis=1),
    np.stack((asked.points_a, asked.points_b), axis=1),
)
answers.drop(rows[::2])
answers.move(everyone, poses[::-1])
answers.intervals(rows[1::2])
broad = BroadPhase()
for size in (2, 600, 300):
    centres = rng.uniform(size=(size, 3))
    broad.near(centres, np.full(size, 0.3), np.arange(size) % 3 > 0, np.arange(0, size, 1))
    broad.near(centres[::-1], np.full(size, 0.3), np.ones(size, bool), np.arange(0, size, 2))

crowd = engine.TriangleMesh(
    np.concatenate([box().vertices + 3.0 * k for k in range(40)]),
    np.concatenate([box().faces + 8 * k for k in range(40)]),
)
solids = [box(), sphere(2), torus(16), crowd]
for a in solids:
    for b in solids:
        pair = engine.Pair(a, b)
        for far in (0.0, 0.01, 1.0, 1e20):
            for budget in (0.0, 2e-5, 2e-5, None):
                pair.signed_distance(pose(rng, far), IDENTITY, budget_s=budget)
        pair.signed_distance(IDENTITY, IDENTITY, rel_err=0.1)
        a.deform(0.9 * a.vertices)
        pair.signed_distance(IDENTITY, IDENTITY, abs_err=0.1)

net = np.stack((*np.meshgrid(*[np.linspace(-1.0, 1.0, 6)] * 2), rng.normal(size=(6, 6))), axis=2)
knots = [0, 0, 0, 0, 0.3, 0.6, 1, 1, 1, 1]
surfaces = [
    engine.Patch(net, knots, knots),
    engine.Patch(net[:, :3], knots, None, rng.uniform(0.5, 2.0, (6, 3))),
    engine.Curve(net[2], knots),
]
for a in surfaces:
    for b in (*surfaces, solids[1]):
        pair = engine.Pair(a, b)
        for far in (0.0, 0.01, 1.0, 1e20):
            for budget in (0.0, 2e-5, 2e-5, None):
                pair.distance(pose(rng, far), IDENTITY, rel_err=1e-3, budget_s=budget)
        engine.signed_distance(solids[1], IDENTITY, a, pose(rng, 0.1))
    engine.closest_points(a, IDENTITY, rng.normal(size=(20, 3)), normals=True)

closed = engine.ParametricSurface(sphere_patches(), solid=True)
pair = engine.Pair(closed, closed)
for far in (0.0, 0.5, 1.99, 3.0):
    for budget in (0.0, 2e-5, None):
        pair.signed_distance(translation(far), IDENTITY, budget_s=budget)
engine.closest_points(closed, IDENTITY, rng.normal(size=(20, 3)), signed=True)

# Prove that the check is on: a leaf whose triangle does not exist raises IndexError.
hierarchy = models[0]._hierarchy
children = hierarchy.tree.children.copy()
children[16:] = ~np.int32(2**30)
hierarchy.table = model_table(hierarchy.numbers, hierarchy.tree._replace(children=children))
try:
    engine.distance(models[0], IDENTITY, models[1], pose(rng, 3.0))
except IndexError:
    print("every index was in bounds")
