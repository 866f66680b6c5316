"""Bodies in contact: they rest, slide, bounce and collide as textbooks say, and gain no energy."""

import numpy as np
import pytest
from dynamics_bodies import DOWN, IMPULSE, STEP_S, G, at, ball, box, floor, moving, on_floor, run

from proximity_monitor.motion.dynamics import ContactLaw, Forces, RigidBody, World

MARGIN = IMPULSE.margin
LEAST = MARGIN / 8.0
"""In no state are surfaces nearer than this."""


def gained(energies):
    """Return the largest rise of the energy from one step to the next, joules."""
    return np.diff(energies).max()


def rounding(energies):
    """Return what one step may add, a billionth of the energy, if no motion can pay for it."""
    return 1e-9 * np.abs(energies).max()


@pytest.mark.long
@pytest.mark.parametrize("forces", [{}, {"friction": 0.5}], ids=["smooth", "rough"])
def test_a_box_comes_to_rest_and_stays(forces):
    world = on_floor([moving(box(0.1, 0.2, 0.1), at((0.1, -0.3, 0.052)))], **forces)
    energies, least = run(world, 1.0)
    resting = world.poses()[0].copy()
    more, later = run(world, 2.0)
    assert gained(np.concatenate((energies, more))) <= rounding(energies)
    assert min(least, later) >= LEAST
    assert np.abs(world.poses()[0] - resting).max() < 1e-6
    assert LEAST <= world.poses()[0, 2, 3] - 0.05 <= 1.25 * MARGIN


@pytest.mark.parametrize("slope", [0.28, 0.32])
def test_friction_holds_a_box_below_its_angle_and_brakes_it_above(slope):
    # Gravity is tilted instead of the floor: tan(angle) = slope, friction 0.3.
    angle = np.arctan(slope)
    pull = G * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    body = moving(box(0.3, 0.2, 0.05), at((0.0, 0.0, 0.025 + MARGIN)))
    world = World([body, floor()], Forces(pull, IMPULSE, friction=0.3), STEP_S)
    run(world, 1.0)
    pace = G * (np.sin(angle) - 0.3 * np.cos(angle))
    if slope < 0.3:
        assert abs(world.poses()[0, 0, 3]) < 1e-5
    else:
        assert world.poses()[0, 0, 3] == pytest.approx(0.5 * pace, rel=0.02)


def test_a_sliding_box_stops_after_its_closed_form_length():
    body = moving(box(0.3, 0.2, 0.02), at((0.0, 0.0, 0.01 + MARGIN)), (1.5, 0.0, 0.0))
    world = on_floor([body], friction=0.4)
    energies, _ = run(world, 1.0)
    assert world.poses()[0, 0, 3] == pytest.approx(1.5**2 / (2.0 * 0.4 * G), rel=0.02)
    assert gained(energies) <= rounding(energies)


def test_without_friction_a_box_slides_on():
    body = moving(box(0.3, 0.2, 0.02), at((-1.0, 0.0, 0.01 + MARGIN)), (1.5, 0.0, 0.0))
    world = on_floor([body])
    run(world, 1.0)
    assert world.poses()[0, 0, 3] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.long
def test_a_perfectly_elastic_ball_keeps_its_energy():
    world = on_floor([moving(ball(0.05), at((0.0, 0.0, 0.55)))], restitution=1.0)
    energies, least = run(world, 6.0)
    height = world.state.centre[:, 2].max()
    assert gained(energies) <= rounding(energies)
    assert energies[-1] == pytest.approx(energies[0], rel=1e-9)
    assert least >= LEAST
    assert height <= 0.55


def test_restitution_is_the_share_of_the_speed_that_is_kept():
    world = on_floor([moving(ball(0.05), at((0.0, 0.0, 0.55)))], restitution=0.6)
    heights = []
    for _ in range(2000):
        before = world.state.velocity[0, 2]
        world.step()
        if before < 0.0 < world.state.velocity[0, 2]:
            heights.append(0.0)
        if len(heights) == 2:
            break
        if heights:
            heights[-1] = max(heights[-1], world.state.centre[0, 2])
    assert len(heights) == 2
    # The ball may turn round within one step of the surface, so at most v h above it.
    low = 0.05 + MARGIN
    drop, room = 0.5 - MARGIN, STEP_S * np.sqrt(2.0 * G * 0.5)
    assert heights[0] - low == pytest.approx(0.36 * drop, abs=room)


@pytest.mark.parametrize("restitution", [None, 0.5, 1.0])
def test_two_balls_collide_as_newton_says(restitution):
    first = moving(ball(0.05), at((-0.1, 0.0, 0.0)), (1.0, 0.0, 0.0), name="first")
    second = moving(ball(0.05), at((0.1, 0.0, 0.0)), name="second")
    world = World([first, second], Forces(contacts=IMPULSE, restitution=restitution), STEP_S)
    momentum = world.momentum()[0]
    energies, least = run(world, 0.4)
    e = restitution or 0.0
    assert world.state.velocity[:, 0] == pytest.approx([(1 - e) / 2, (1 + e) / 2], abs=1e-3)
    assert world.momentum()[0] == pytest.approx(momentum, abs=1e-12)
    assert gained(energies) <= rounding(energies)
    assert least >= LEAST


@pytest.mark.long
def test_a_tumbling_box_never_gains_energy_nor_sinks():
    body = moving(
        box(0.1, 0.2, 0.3),
        at((0.0, 0.0, 0.5), (1.0, 2.0, 3.0), 0.7),
        (0.5, 0.0, 0.0),
        (9.0, 5.0, 2.0),
    )
    for forces in ({}, {"friction": 0.3}, {"friction": 0.3, "restitution": 0.8}):
        world = on_floor([body], **forces)
        energies, least = run(world, 2.5)
        assert gained(energies) <= rounding(energies)
        assert least >= LEAST
        assert world.stops == 0


def test_a_stack_stands():
    heights = [0.05 + MARGIN, 0.15 + 2 * MARGIN, 0.25 + 3 * MARGIN]
    boxes = [moving(box(0.1, 0.1, 0.1), at((0, 0, z)), name=f"box_{z}") for z in heights]
    world = on_floor(boxes, friction=0.5)
    energies, least = run(world, 2.0)
    assert gained(energies) <= 1e-6 * energies[0]  # what sweeps that end early leave
    assert energies.max() <= energies[0] * (1.0 + 1e-6)
    assert least >= LEAST
    assert np.abs(world.state.centre[:3, 2] - heights).max() < 3 * MARGIN
    assert np.abs(world.state.centre[:3, :2]).max() < 1e-4


@pytest.mark.parametrize("speed", [10.0, 100.0, 1000.0])
def test_nothing_passes_through_a_thin_plate(speed):
    plate = RigidBody("plate", box(0.5, 0.5, 0.002), np.eye(4))
    shot = moving(ball(0.01, bands=6), at((0.013, 0.007, 0.3)), (0.0, 0.0, -speed))
    world = World([shot, plate], Forces(contacts=IMPULSE), STEP_S)
    _, least = run(world, 0.5 + 0.3 / speed)
    assert world.state.centre[0, 2] > 0.011
    assert least >= LEAST


def test_the_same_world_moves_the_same_bit_by_bit():
    def make():
        bodies = [
            moving(box(0.1, 0.1, 0.1), at((0.0, 0.0, 0.1), (1, 1, 0), 0.4), name="low"),
            moving(box(0.1, 0.2, 0.1), at((0.03, 0.0, 0.3), (0, 1, 1), 0.9), name="high"),
        ]
        return on_floor(bodies, friction=0.4, restitution=0.3)

    one, other = make(), make()
    run(one, 0.6)
    run(other, 0.6)
    assert one.searches > 0
    assert np.array_equal(one.poses(), other.poses())
    other.restart()
    run(other, 0.6)
    assert np.array_equal(one.poses(), other.poses())


@pytest.mark.long
def test_a_penalty_holds_a_box_on_springs():
    law = ContactLaw("penalty", 0.002, 1e3)
    body = moving(box(0.1, 0.2, 0.1), at((0.0, 0.0, 0.06)))
    world = on_floor([body], contacts=law)
    energies, least = run(world, 1.0)
    # The shorter a step is beside the springs' period, the better they keep the energy.
    assert gained(energies) <= 1e-3 * energies[0]
    assert energies.max() <= energies[0] * (1.0 + 1e-9)
    assert least >= law.margin / 32.0
    world = on_floor([body], contacts=law, linear_damping=8.0, angular_damping=8.0)
    run(world, 2.0)
    place = world.poses()[0, 2, 3]
    run(world, 0.5)
    assert world.poses()[0, 2, 3] == pytest.approx(place, abs=1e-5)
    # 2 kg on several springs of 1 kN/m: less than 2 mm deep.
    assert 0.05 + law.margin / 32.0 < place < 0.05 + law.margin


def test_bodies_that_touch_at_the_start_are_refused_by_name():
    body = moving(box(0.1, 0.1, 0.1), at((0.0, 0.0, 0.05)), name="crate")
    with pytest.raises(
        ValueError, match="'crate' and 'floor' touch, or nearly touch, at the start"
    ):
        on_floor([body])


def test_gravity_alone_moves_free_bodies_beside_a_contact():
    resting = moving(box(0.1, 0.1, 0.1), at((0.0, 0.0, 0.05 + MARGIN)), name="resting")
    falling = moving(box(0.1, 0.1, 0.1), at((1.0, 0.0, 3.0)), name="falling")
    world = on_floor([resting, falling])
    run(world, 0.5)
    assert world.state.centre[1] == pytest.approx([1.0, 0.0, 3.0 + 0.125 * DOWN[2]])
