"""Bodies that touch nothing, against closed forms."""

import numpy as np
import pytest
from dynamics_bodies import DOWN, STEP_S, at, box, box_arrays, moving, on_floor

from proximity_monitor.engine import TriangleMesh
from proximity_monitor.engine.models.model import DisplayMesh
from proximity_monitor.motion.dynamics import Forces, RigidBody, World
from proximity_monitor.motion.dynamics.mass import mass_properties

SIZE = (0.1, 0.2, 0.35)


def test_mass_of_a_box_anywhere():
    vertices, faces = box_arrays(*SIZE)
    turn = at((3.0, -2.0, 5.0), (1.0, 2.0, 3.0), 0.7)
    placed = vertices @ turn[:3, :3].T + turn[:3, 3]
    found = mass_properties(DisplayMesh(placed, faces), 800.0)
    x, y, z = np.square(SIZE)
    mass = 800.0 * np.prod(SIZE)
    expected = mass / 12.0 * turn[:3, :3] @ np.diag([y + z, x + z, x + y]) @ turn[:3, :3].T
    assert found.mass == pytest.approx(mass, rel=1e-12)
    assert found.centre == pytest.approx(turn[:3, 3], abs=1e-13)
    assert found.inertia == pytest.approx(expected, abs=1e-12 * mass)
    area = 2.0 * (0.1 * 0.2 + 0.2 * 0.35 + 0.1 * 0.35)
    assert found.thickness == pytest.approx(np.prod(SIZE) / area)


@pytest.mark.parametrize("kind", ["inward", "soup"])
def test_mass_takes_either_orientation_and_unshared_vertices(kind):
    vertices, faces = box_arrays(*SIZE)
    expected = mass_properties(DisplayMesh(vertices, faces), 1.0)
    if kind == "inward":
        faces = faces[:, ::-1]
    else:
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(36).reshape(12, 3)
    found = mass_properties(DisplayMesh(vertices, faces), 1.0)
    assert found.mass == pytest.approx(expected.mass)
    assert found.inertia == pytest.approx(expected.inertia)


@pytest.mark.parametrize("kind", ["open", "turned", "flat"])
def test_a_body_without_a_volume_is_refused_by_name(kind):
    vertices, faces = box_arrays(*SIZE)
    if kind == "open":
        faces = faces[1:]
    elif kind == "turned":
        faces[0] = faces[0][::-1]
    else:
        vertices = vertices * (1.0, 1.0, 0.0)
    body = moving(TriangleMesh(vertices, faces), np.eye(4), name="lid")
    with pytest.raises(ValueError, match=r"dynamics\.bodies\.lid: .* encloses no volume"):
        World([body], Forces(), STEP_S)


def test_free_fall_is_exact():
    velocity = np.array([1.0, -2.0, 3.0])
    world = World([moving(box(*SIZE), np.eye(4), velocity)], Forces(gravity=DOWN), STEP_S)
    for _ in range(400):
        world.step()
    expected = velocity + 0.5 * DOWN
    assert world.poses()[0, :3, 3] == pytest.approx(expected, abs=1e-12)


def test_without_gravity_nothing_falls():
    world = World([moving(box(*SIZE), np.eye(4), (1.0, 0.0, 0.0))], Forces(), STEP_S)
    for _ in range(400):
        world.step()
    assert world.poses()[0, :3, 3] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


def test_a_tumbling_box_keeps_energy_and_angular_momentum():
    # A spin about the middle axis is unstable: the body flips over and over.
    world = World([moving(box(*SIZE), np.eye(4), spin=(0.01, 9.0, 0.02))], Forces(), STEP_S)
    energy, (_, momentum) = world.energy(), world.momentum()
    turned = []
    for _ in range(4000):
        world.step()
        turned.append(world.poses()[0, 1, 1])
    assert min(turned) < -0.9  # it did flip
    assert world.energy() == pytest.approx(energy, rel=1e-11)
    assert np.array_equal(world.momentum()[1], momentum)


def test_a_symmetric_top_precesses_at_its_closed_form():
    # The axis of a square prism precesses about L at |L| / I, with I the inertia across the axis.
    def error(step_s):
        world = World(
            [moving(box(0.2, 0.2, 0.05), np.eye(4), spin=(2.0, 0.0, 6.0))], Forces(), step_s
        )
        _, momentum = world.momentum()
        mass = 1000.0 * 0.2 * 0.2 * 0.05
        across = mass / 12.0 * (0.2**2 + 0.05**2)
        for _ in range(round(1.0 / step_s)):
            world.step()
        size = np.linalg.norm(momentum)
        goes = at((0.0, 0.0, 0.0), momentum, size / across)[:3, :3]
        return np.linalg.norm(world.poses()[0, :3, 2] - goes[:, 2])

    coarse, fine = error(0.004), error(0.002)
    assert fine < 1e-4
    assert coarse / fine == pytest.approx(4.0, rel=0.02)  # second order


@pytest.mark.parametrize("speed", [1.0, 600.0, 17000.0])
def test_a_spin_about_a_principal_axis_is_exact_however_fast(speed):
    world = World([moving(box(*SIZE), np.eye(4), spin=(0.0, 0.0, speed))], Forces(), 0.01)
    for _ in range(10):
        world.step()
    turn = at((0.0, 0.0, 0.0), angle=0.1 * speed)
    assert world.poses()[0] == pytest.approx(turn, abs=1e-12 * (100.0 + speed))


def test_a_fast_tumbling_box_keeps_its_energy_and_its_way():
    spin = np.array([30.0, 600.0, 20.0])  # six radians in a step of ten milliseconds
    poses = []
    for step_s in (0.01, 0.00001):
        world = World([moving(box(*SIZE), np.eye(4), spin=spin)], Forces(), step_s)
        energy = world.energy()
        for _ in range(round(0.01 / step_s)):
            world.step()
        assert world.energy() == pytest.approx(energy, rel=1e-11)
        poses.append(world.poses()[0])
    assert poses[0] == pytest.approx(poses[1], abs=0.01)


def test_damping_decays_as_named():
    body = moving(box(*SIZE), np.eye(4), (2.0, 0.0, 0.0), (0.0, 0.0, 3.0))
    world = World([body], Forces(linear_damping=0.5), STEP_S)
    _, momentum = world.momentum()
    for _ in range(400):
        world.step()
    assert world.state.velocity[0, 0] == pytest.approx(2.0 * np.exp(-0.5))
    assert np.array_equal(world.momentum()[1][2], momentum[2])


def test_without_contacts_bodies_pass_through_and_no_distance_is_asked_for():
    body = moving(box(*SIZE), at((0.0, 0.0, 1.0)))
    world = World([body, RigidBody("plate", box(1.0, 1.0, 0.1), np.eye(4))], Forces(DOWN), STEP_S)
    for _ in range(400):
        world.step()
    assert world.poses()[0, 2, 3] == pytest.approx(1.0 - 0.5 * 9.81)
    assert world.searches == 0


def test_without_friction_none_is_computed():
    counts = []
    for forces in ({}, {"friction": 0.3}):
        world = on_floor([moving(box(*SIZE), at((0.0, 0.0, 0.176)))], **forces)
        for _ in range(40):
            world.step()
        assert world.searches > 0
        counts.append(world.rubbings)
    assert counts[0] == 0 < counts[1]
