"""The bundled engine: sound meshes, nothing touches at any crank angle, clearances as designed.

FCL, which shares no code with `proximity_monitor.engine`, measures. The expected values follow only
from the radii in tools/make_engine_scene.py.
"""

import itertools
import math

import fcl
import numpy as np
import pytest
import trimesh

from proximity_monitor import engine, motion, scene

BORE, PISTON, BEARING, JOURNAL = 0.037010, 0.036990, 0.022515, 0.022495
SPACING = 0.084
# A polygon of 64 sides inside one of 80: their arrangement repeats every 1.125 degrees.
REPEAT = math.tau / math.lcm(64, 80)


@pytest.fixture(scope="module")
def engine_scene():
    return scene.load_scene(scene.bundled("engine"))


@pytest.fixture(scope="module")
def meshes(engine_scene):
    """The files as they are, read by trimesh, in millimetres."""
    return {
        body.name: trimesh.load(body.model, process=False, force="mesh")
        for body in engine_scene.bodies
    }


@pytest.fixture(scope="module")
def poses_at(engine_scene):
    moved = motion.from_scene(engine_scene)
    fixed = {body.name: body.pose for body in engine_scene.bodies if not body.moving}
    return lambda angle: fixed | moved.poses(angle / math.tau * moved.period_s)


class Oracle:
    """FCL on the scene's bodies, in metres."""

    def __init__(self, meshes):
        self.bodies = {}
        for name, mesh in meshes.items():
            model = fcl.BVHModel()
            model.beginModel(len(mesh.vertices), len(mesh.faces))
            model.addSubModel(np.asarray(mesh.vertices) * 1e-3, np.asarray(mesh.faces))
            model.endModel()
            self.bodies[name] = fcl.CollisionObject(model, fcl.Transform())

    def place(self, poses):
        for name, pose in poses.items():
            self.bodies[name].setTransform(fcl.Transform(pose[:3, :3], pose[:3, 3]))

    def touching(self, a, b):
        request, result = fcl.CollisionRequest(), fcl.CollisionResult()
        return fcl.collide(self.bodies[a], self.bodies[b], request, result) > 0

    def distance(self, a, b):
        request, result = fcl.DistanceRequest(), fcl.DistanceResult()
        return fcl.distance(self.bodies[a], self.bodies[b], request, result)


@pytest.fixture(scope="module")
def oracle(meshes):
    return Oracle(meshes)


def bearing_clearance(angle):
    """Return the clearance (m) of a 64-sided journal at an angle in an 80-sided bearing."""
    rest = angle % REPEAT
    return BEARING - JOURNAL * math.cos(min(rest, REPEAT - rest))


def running_fits(angle):
    """Return the clearance (m) of every pair whose clearance follows from the radii."""
    fits = {(f"piston_{k}", "block"): BORE - PISTON for k in (1, 2, 3, 4)}
    fits["crankshaft", "block"] = bearing_clearance(angle)
    fits["piston_2", "piston_3"] = SPACING - 2.0 * PISTON
    return fits


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("block", 8_000, 20_000), ("crankshaft", 5_000, 15_000), ("piston_1", 2_000, 5_000)],
)
def test_meshes_are_closed_and_face_outwards(meshes, name, least, most):
    mesh = meshes[name]
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert least <= len(mesh.faces) <= most
    assert mesh.area_faces.min() > 1e-3


def test_the_scene_watches_what_can_meet(engine_scene):
    watched = {frozenset((pair.a, pair.b)) for pair in engine_scene.pairs}
    pistons = [f"piston_{k}" for k in (1, 2, 3, 4)]
    expected = {frozenset((p, other)) for p in pistons for other in ("block", "crankshaft")}
    expected |= {frozenset(two) for two in itertools.pairwise(pistons)}
    assert watched == expected | {frozenset(("crankshaft", "block"))}


def test_nothing_touches_at_any_crank_angle(engine_scene, oracle, poses_at):
    smallest = {}
    for angle in np.radians(np.arange(0.5, 360.0, 15.0)):
        oracle.place(poses_at(angle))
        for pair in engine_scene.pairs:
            assert not oracle.touching(pair.a, pair.b), (pair, angle)
            found = oracle.distance(pair.a, pair.b)
            assert found > pair.thresholds.stop, (pair, angle)
            both = frozenset((pair.a, pair.b))
            smallest[both] = min(found, smallest.get(both, math.inf))
    for k in (1, 2, 3, 4):
        assert 0.002 < smallest[frozenset((f"piston_{k}", "crankshaft"))] < 0.0025


@pytest.mark.parametrize("degrees", [0.0, 0.5625, 41.3, 137.0, 290.11])
def test_running_clearances_are_the_radii_s(oracle, poses_at, degrees):
    angle = math.radians(degrees)
    oracle.place(poses_at(angle))
    for (a, b), expected in running_fits(angle).items():
        assert oracle.distance(a, b) == pytest.approx(expected, abs=1e-12), (a, b)


@pytest.mark.parametrize("degrees", [0.5625, 137.0])
def test_the_engine_finds_the_running_clearances(engine_scene, poses_at, degrees):
    models = {b.name: scene.load_model(b, engine_scene.unit) for b in engine_scene.bodies}
    angle = math.radians(degrees)
    poses = poses_at(angle)
    for (a, b), expected in running_fits(angle).items():
        found = engine.distance(models[a], poses[a], models[b], poses[b])
        assert found.status is engine.Status.EXACT
        assert found.lower <= expected + 1e-12
        assert found.upper == pytest.approx(expected, abs=1e-12), (a, b)


def test_a_warning_comes_and_goes_once_a_turn(engine_scene, oracle, poses_at):
    (pair,) = (p for p in engine_scene.pairs if {p.a, p.b} == {"piston_1", "crankshaft"})
    warned = []
    for degrees in range(0, 360, 5):
        oracle.place(poses_at(math.radians(degrees)))
        warned.append(oracle.distance(pair.a, pair.b) <= pair.thresholds.warn)
    assert sum(a != b for a, b in zip(warned, warned[1:] + warned[:1], strict=True)) == 2
    assert 45 <= 5 * sum(warned) <= 65
