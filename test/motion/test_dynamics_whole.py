"""Bodies searched whole by dynamics: curved ones, which rest on several contacts, and soft ones."""

import dataclasses
import math
import re

import numpy as np
import pytest
from dynamics_bodies import DOWN, IMPULSE, STEP_S, at, box_arrays, moving, nearest, on_floor

from proximity_monitor import motion, scene
from proximity_monitor.engine import Curve, SolidOfRevolution, TriangleMesh, shapes
from proximity_monitor.motion.dynamics import Dynamics, Forces, RigidBody, World
from proximity_monitor.motion.dynamics.memory import Contacts, Memory, Seen
from proximity_monitor.motion.dynamics.pieces import cut
from proximity_monitor.motion.together import Together

MARGIN = IMPULSE.margin
HALF = math.sqrt(0.5)


def torus(large, small):
    rim = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    points = [(large + small * x, small * z) for x, z in rim]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    return SolidOfRevolution([Curve(points, knots, [1, HALF] * 4 + [1])], name="ring")


def disc(radius, height):
    """A disc whose upper side is z = 0."""
    points = [(0, -height), (radius, -height), (radius, 0), (0, 0)]
    return SolidOfRevolution([Curve(points, [0, 0, 1, 2, 3, 3])], name="disc")


def test_what_is_curved_is_one_piece_and_what_is_flat_is_cut():
    ring = torus(0.05, 0.008)
    assert cut(ring).models == [ring]
    flat = on_floor([]).bodies[0].model
    assert len(cut(flat).models) == 12
    assert cut(flat, deforming=True).models == [flat]
    ball = shapes.sphere(0.1)  # a swept point; its triangles are only a picture
    assert cut(ball).models == [ball]


def test_a_ball_rolls_on_its_own_surface():
    world = on_floor([moving(shapes.sphere(0.5), at((0, 0, 0.5003)), (0.4, 0.1, 0))], friction=0.5)
    for _ in range(60):
        world.step()
        assert nearest(world) > 0.0
    assert world.poses()[0, 2, 3] == pytest.approx(0.5 + MARGIN, abs=0.1 * MARGIN)
    assert world.poses()[0, 0, 3] > 0.03


@pytest.mark.parametrize("soft", [False, True])
def test_what_a_surface_may_be_off_is_kept_free(soft):
    deviation = 5.0 * MARGIN
    if soft:
        model = shapes.sphere(0.05, deviation=deviation)
    else:
        model = TriangleMesh(*box_arrays(0.1, 0.1, 0.1), deviation=deviation)
    thing = moving(model, at((0.0, 0.0, 0.05 + 1.3 * deviation)))
    if soft:
        rest = model.control_points
        thing = dataclasses.replace(thing, shape=lambda t: rest)
    world = on_floor([thing])
    for _ in range(60):
        world.step()
        assert world.clearance() <= nearest(world) - 2.0 * deviation
    assert world.poses()[0, 2, 3] == pytest.approx(0.05 + deviation + MARGIN, abs=0.5 * MARGIN)
    assert world.stops == 0


@pytest.mark.parametrize("of_both", [0.0, 1.0])
@pytest.mark.parametrize(
    ("thing", "low"),
    [
        (lambda off: shapes.sphere(0.05, deviation=off), 0.05),
        (lambda off: shapes.capsule(0.05, 0.1, deviation=off), 0.1),
        (lambda off: shapes.cone(0.05, 0.02, 0.1, deviation=off), 0.05),
    ],
    ids=["ball", "capsule", "cone"],
)
def test_bodies_of_either_kind_rest_where_a_surface_may_be_off(thing, low, of_both):
    off = 10.0 * MARGIN
    model = thing(of_both * off)
    floor = RigidBody("floor", shapes.box((1.0, 1.0, 0.1), deviation=off), at((0.0, 0.0, -0.05)))
    away = (1.0 + of_both) * off
    body = moving(model, at((0.0, 0.0, low + away + 2.0 * MARGIN)))
    world = World([body, floor], Forces(DOWN, IMPULSE, friction=0.3), STEP_S)
    for _ in range(12):
        world.step()
        left = nearest(world) - 2.0 * away  # the upper bound includes the deviations
        assert left > 0.0
    assert left < 1.5 * MARGIN
    assert world.stops == 0
    assert world.touched is None


def test_a_ring_that_fell_aslant_lies_on_either_side():
    """A search finds one pair of nearest points per pair of bodies; earlier contacts stay."""
    ring = moving(torus(0.05, 0.008), at((0.0, 0.0, 0.07), (1, 0.3, 0), 0.8))
    plate = RigidBody("plate", disc(0.5, 0.02), at((0.05, 0.02, 0.0)))
    world = World([ring, plate], Forces(DOWN, IMPULSE, friction=0.3), STEP_S)
    energy = world.energy()
    for _ in range(200):
        world.step()
        assert world.clearance() >= MARGIN / 8.0
        assert world.energy() <= energy + 1e-9
        energy = world.energy()
    pose = world.poses()[0]
    assert abs(pose[2, 2]) > 0.9999  # it lies flat
    assert pose[2, 3] == pytest.approx(0.008 + MARGIN, abs=MARGIN)
    points = world._contacts.points[:, 0]
    assert np.linalg.norm(points[:, None] - points, axis=2).max() > 0.07
    assert len({tuple(key) for key in world._contacts.keys}) == len(world._contacts)
    assert world.stops == 0
    assert nearest(world) > 0.0


def found_at(*rows):
    """Return what is seen of three pairs, with a contact for each row (pair, number, x)."""
    pair, number, x = np.array(rows, dtype=float).reshape(-1, 3).T
    points = np.zeros((len(x), 2, 3))
    points[:, :, 0] = x[:, None]
    points[:, 0, 2] = MARGIN
    keys = np.column_stack((pair, 0.0 * pair, number)).astype(np.int64)
    up = np.tile([0.0, 0.0, 1.0], (len(x), 1))
    contacts = Contacts(keys[:, :2].copy(), points, up, np.full(len(x), MARGIN), keys)
    return Seen(np.zeros(3), np.zeros(3), np.ones(3), contacts, points.copy())


def test_a_step_that_failed_is_tried_again_with_what_it_met():
    """It learns new contacts of pairs that came too near and are searched whole."""
    memory = Memory(np.array([True, True, False]), np.full(3, 0.01), MARGIN)
    before = found_at((0, 7, 0.0))
    failed = found_at((0, 7, 0.0), (0, 8, 0.05), (1, 9, 0.1), (2, 10, 0.2))
    learnt = memory.learn(before, failed, np.array([True, False, True]))
    assert learnt.contacts.keys[:, [0, 2]].tolist() == [[0, 7], [0, 8]]
    assert learnt.local[:, 0, 0].tolist() == [0.0, 0.05]
    nothing = memory.learn(before, failed, np.zeros(3, bool))
    assert nothing is before
    # Searched again at the start of the step, the pair has its nearest points and the learnt ones.
    fields = [np.array(column) for column in (*before.contacts, before.local)]
    older = memory.join(tuple(fields), (learnt.contacts, learnt.local), np.full(3, 3 * MARGIN))
    assert fields[4][:, 2].tolist() == [7]  # the contact at the same place keeps its number
    assert older[4][:, 2].tolist() == [8]


def test_a_plate_that_grows_lifts_what_lies_on_it():
    plate, thick = disc(0.1, 0.02), 0.02
    rest = plate.control_points

    def shape(t):
        """Return the control points: the top rises by 1.2 mm in 0.4 s, then stays."""
        return rest + [0.0, 0.0, 0.003 * min(t, 0.4)] * (rest[:, 2:] > -0.5 * thick)

    ring = moving(torus(0.05, 0.008), at((0.0, 0.0, 0.0083)))
    bodies = [ring, RigidBody("plate", plate, at((0.0, 0.0, 0.0)), shape=shape)]
    world = World(bodies, Forces(DOWN, IMPULSE, friction=0.3), STEP_S)
    heights = []
    for _ in range(240):
        world.step()
        heights.append(world.poses()[0][2, 3])
        assert world.clearance() > 0.0
    assert heights[-1] == pytest.approx(0.0012 + 0.008 + MARGIN, abs=MARGIN)
    assert world.time_s == pytest.approx(0.6)
    world.restart()
    assert plate.control_points == pytest.approx(rest, abs=1e-15)
    for height in heights[:40]:
        world.step()
        assert world.poses()[0][2, 3] == height


def test_bodies_that_grow_into_each_other_are_told():
    ball = shapes.sphere(0.05)
    rest = ball.control_points
    sinks = RigidBody(
        "ball", ball, at((0.0, 0.0, 0.052)), shape=lambda t: rest - [0.0, 0.0, 0.01 * (t > 0.004)]
    )
    crate = moving(shapes.box((1.0, 1.0, 0.1)), at((0.0, 0.0, -0.05)), name="crate")
    forces = Forces(contacts=IMPULSE)
    made = Dynamics([crate, sinks], forces, substep_s=STEP_S)
    assert "stopped" not in made.describe()
    assert made.trouble == Together([made]).trouble == ""
    made.poses(0.02)
    assert made.trouble.startswith("dynamics: 'crate' and 'ball' touched, so they are stuck; use")
    assert Together([made]).trouble == made.trouble
    assert re.search("stopped [0-9]+ times", made.describe())
    told = made.trouble
    made.poses(0.0)
    assert (made.world.stops, made.world.touched) == (0, None), "they begin again, apart"
    assert "stopped" not in made.describe()
    assert made.trouble == told, "it went wrong, and would again"


@pytest.mark.long
def test_the_bundled_solid_rings_fall_and_lie_in_the_tray():
    described = scene.load_scene(scene.bundled("interlocked-rings"))
    models = {body.name: scene.load_model(body, described.unit) for body in described.bodies}
    made = motion.from_scene(described, models)
    names = [f"ring_{k}" for k in range(1, 13)]
    assert made.bodies == tuple(names)
    assert made.describe().splitlines()[1] == "deform: 1 body, breathe at 0.25 Hz"
    rest = models["ring_4"].control_points
    for t in np.arange(0.05, 0.5, 0.05):
        poses = made.poses(t)
        assert made.world.clearance() > 0.0
        # Shape and poses are of the simulated time. The model of the scene is not deformed.
        grown = math.exp(0.05 * math.sin(0.5 * math.pi * made.world.time_s))
        assert made.control_points(t)["ring_4"] == pytest.approx(grown * rest, abs=1e-15)
    assert models["ring_4"].revision == 0
    # Rings that meet a body in two places do not hang in the air; the impact may cause a few stops.
    assert made.world.stops <= 5
    assert made.world.energy() < 3.0
    for name in names:
        assert 0.0 < poses[name][2, 3] < 0.15
