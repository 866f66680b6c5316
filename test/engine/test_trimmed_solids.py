"""Solids of trimmed patches: a drilled block and an obliquely cut cylinder, against formulas."""

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
from engine_bodies import IDENTITY, translation
from engine_surfaces import revolved
from test_closed import cube, swapped
from test_surface_solids import ball, check, check_sides
from test_trim import circle, frame, polygon

from proximity_monitor import engine
from proximity_monitor.engine import ModelError, ParametricSurface
from proximity_monitor.engine.models import loops as examining
from proximity_monitor.engine.models.closed import find_joints
from proximity_monitor.engine.models.loops import examine
from proximity_monitor.engine.models.trim import Trim, TrimCurve

BORE = 0.2
UNIT = (0.0, 0.0), (1.0, 1.0)
SLOPE = 0.3


def drilled(wall=BORE):
    """Return the unit cube with a hole along z, as ten patches; two of them are trimmed."""
    made = cube()
    for i, face in enumerate(made):
        if np.ptp(face.control[..., 2]) == 0.0:
            hole = Trim([frame(*UNIT), circle(np.array([0.5, 0.5]), BORE)], *UNIT)
            made[i] = engine.Patch(face.control, trim=hole)
    bore = revolved(np.array([[wall, 0.0], [wall, 1.0]]), np.ones(2))
    return made + [
        engine.Patch(each.control + np.array([0.5, 0.5, 0.0]), weights=each.weights)
        for each in map(swapped, bore)
    ]


def phi_drilled(x):
    q = np.abs(x - 0.5) - 0.5
    box = np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
    hole = BORE - np.hypot(x[:, 0] - 0.5, x[:, 1] - 0.5)
    over = np.hypot(hole, np.maximum(q[:, 2], 0.0))
    return np.where(hole > 0.0, over, np.maximum(box, hole))


def near_drilled(rng):
    """Return points at random, near the wall of the hole, and near its edges."""
    angle, aside = rng.uniform(0.0, 2.0 * np.pi, 120), 10.0 ** rng.uniform(-8, -1, (2, 120))
    aside *= rng.choice([-1.0, 1.0], (2, 120))
    r = BORE + aside[0]
    z = np.where(np.arange(120) < 60, rng.uniform(0.0, 1.0, 120), 1.0 + aside[1])
    rim = np.stack((0.5 + r * np.cos(angle), 0.5 + r * np.sin(angle), z), axis=1)
    return np.concatenate((rng.uniform(-0.5, 1.5, (100, 3)), rim))


def test_sides_of_a_drilled_block_are_those_of_a_formula():
    model, rng = ParametricSurface(drilled(), solid=True), np.random.default_rng(3)
    assert find_joints(model.nets, 0.0).gap < 1e-11
    points = near_drilled(rng)
    check_sides(model, phi_drilled, points)
    again = pickle.loads(pickle.dumps(model))
    assert again.is_solid
    assert again.digest() == model.digest()
    check_sides(again, phi_drilled, points[:20])
    check_sides(ParametricSurface(drilled(), solid=None), phi_drilled, points[:20])
    inside_out = ParametricSurface([swapped_trim(each) for each in drilled()], solid=True)
    check_sides(inside_out, phi_drilled, points)


def swapped_trim(patch):
    """Return the same patch with u and v exchanged, so that its normal is reversed."""
    if patch.trim is None:
        return swapped(patch)
    loops = [frame(*UNIT), circle(np.array([0.5, 0.5]), BORE)]
    return engine.Patch(patch.control.transpose(1, 0, 2), trim=Trim(loops, *UNIT))


@pytest.mark.long
def test_largest_balls_in_a_drilled_block():
    block = ParametricSurface(drilled(), solid=True)
    for radius, place, expected in (
        (0.1, (0.85, 0.5, 0.5), -0.2),  # all of the ball is inside
        (0.3, (0.5, 0.5, 0.5), -0.1),  # the overlap is the ring around the hole
        (0.3, (1.2, 0.5, 0.5), -0.1),
        (0.1, (0.5, 0.5, 0.5), 0.1),  # clear of the wall
        (0.1, (0.5, 0.5, 1.15), math.hypot(0.2, 0.15) - 0.1),  # nearest to the hole's edge
    ):
        check(engine.signed_distance(block, IDENTITY, ball(radius), translation(*place)), expected)
        check(engine.signed_distance(ball(radius), translation(*place), block, IDENTITY), expected)


def test_how_deep_a_sheet_reaches_into_a_drilled_block():
    block = ParametricSurface(drilled(), solid=True)
    for side, depth in ((0.19, 0.0), (0.6, 0.15), (2.0, 0.15)):  # diagonally it is deeper
        half = 0.5 * side
        sheet = [[[x, y, 0.5] for y in (0.5 - half, 0.5 + half)] for x in (0.5 - half, 0.5 + half)]
        found = engine.signed_distance(block, IDENTITY, engine.Patch(sheet), IDENTITY)
        if depth == 0.0:
            check(found, BORE - math.hypot(half, half))
        else:
            assert found.upper <= -depth
            check(found, -deepest(half))


def deepest(half):
    """Return how deep the deepest point of a square in the middle plane is in the block."""
    x, y = np.meshgrid(*2 * [np.linspace(0.5 - half, 0.5 + half, 801)])
    points = np.stack((x.ravel(), y.ravel(), np.full(x.size, 0.5)), axis=1)
    return -phi_drilled(points).min()


def test_gaps_are_charged_or_refused_with_their_place():
    wide = drilled(BORE + 1e-3)
    with pytest.raises(ModelError, match=r"do not close up: .*, 0.001 m from the nearest other"):
        ParametricSurface(wide, solid=True)
    surface = ParametricSurface(wide, solid=None)
    assert not surface.is_solid
    assert "do not close up" in surface.not_solid
    tolerant = ParametricSurface(wide, solid=True, deviation=1e-3)
    assert 1e-3 <= find_joints(tolerant.nets, 1e-3).gap < 4e-3
    points = near_drilled(np.random.default_rng(5))
    found = engine.closest_points(tolerant, IDENTITY, points, signed=True)
    expected = phi_drilled(points)
    assert (found.lower <= expected + 1e-12).all()
    assert (found.upper >= expected - 1e-12).all()
    corners = polygon((0.2, 0.2), (0.8, 0.2), (0.5, 0.8))
    lone = cube()
    lone[2] = engine.Patch(lone[2].control, trim=Trim([corners], *UNIT))
    with pytest.raises(ModelError, match="7 open edges"):
        ParametricSurface(lone, solid=True)


def test_loops_must_not_cross():
    two = [circle(np.array([0.4, 0.5]), 0.2), circle(np.array([0.6, 0.5]), 0.2)]
    eight = polygon((0.2, 0.2), (0.8, 0.8), (0.8, 0.2), (0.2, 0.8))
    there_and_back = polygon((0.2, 0.2), (0.8, 0.2), (0.5, 0.2))
    for loops in (two, [eight], [there_and_back]):
        assert "cross or touch" in examine(Trim(loops, *UNIT)).reason
    whole = cube()
    whole[2] = engine.Patch(whole[2].control, trim=Trim(two, *UNIT))
    with pytest.raises(ModelError, match="not a solid: patch 2: its trimming loops cross"):
        ParametricSurface(whole, solid=True)


def test_loops_are_turned_so_that_what_they_leave_is_on_their_left():
    centre = np.array([0.5, 0.5])
    ring, hole = circle(centre, 0.3), circle(centre, 0.1)
    turned = [each._replace(control=each.control[::-1]) for each in reversed(ring)]
    assert examine(Trim([ring, hole], *UNIT)).turned == [False, True]
    assert examine(Trim([hole, turned, frame(*UNIT)], *UNIT)).turned == [False, False, False]
    # Two arcs that meet in cusps, like a sickle's blade.
    bow = TrimCurve(np.array([[0.1, 0.5], [0.5, 0.5], [0.9, 0.9]]))
    string = TrimCurve(np.array([[0.9, 0.9], [0.6, 0.6], [0.3, 0.5], [0.1, 0.5]]))
    found = examine(Trim([[bow, string]], *UNIT))
    assert found.reason == ""
    assert found.turned == [False]


@pytest.mark.parametrize("radius", [1e-6, 1e-7, 1e-8, 2e-9])
def test_a_tiny_loop_has_a_proven_side(radius, monkeypatch):
    """A few divisions prove the sign of a small area; a search that needs many does not end."""
    made, split = [], examining.split

    def counted(*given):
        made.append(given)
        assert len(made) <= 1000, "the search does not end"
        return split(*given)

    monkeypatch.setattr(examining, "split", counted)
    ring = circle(np.array([0.4, 0.6]), radius)
    back = [each._replace(control=each.control[::-1]) for each in reversed(ring)]
    assert examine(Trim([ring], *UNIT))[:2] == ("", [False])
    assert examine(Trim([back], *UNIT))[:2] == ("", [True])


def test_a_loop_of_very_many_lines_has_a_side():
    angles = 2.0 * np.pi * np.arange(4200) / 4200
    ring = polygon(*(0.5 + 0.3 * np.column_stack([np.cos(angles), np.sin(angles)])))
    assert examine(Trim([ring], *UNIT))[:2] == ("", [False])


def slanted(parts):
    """Return a cylinder of radius 1 from z = 0 to 1 + SLOPE x. Its upper edge is of quintics."""
    knots = np.repeat([0.0, 0.5 * np.pi], 3), np.repeat([0.0, 2.0], 2)
    made, size = [], 1.5
    for turn, each in enumerate(revolved(np.array([[1.0, 0.0], [1.0, 2.0]]), np.ones(2))):
        ends = 0.5 * np.pi * np.linspace(1.0, 0.0, parts + 1)
        curves = [TrimCurve(upper(a, b, turn)) for a, b in pairwise(ends)]
        right, left = curves[0].control[0], curves[-1].control[-1]
        sides = [((0.0, 0.0), (right[0], 0.0)), ((right[0], 0.0), right), (left, (0.0, 0.0))]
        lines = [TrimCurve(np.array(each)) for each in sides]
        trim = Trim([[*lines[:2], *curves, lines[2]]], (0.0, 0.0), (right[0], 2.0), arcs=(1, 0))
        made.append(engine.Patch(each.control, *knots, each.weights, trim=trim))
    low, high = (-size, -size), (size, size)
    knots = np.repeat([-size, size], 2), np.repeat([-size, size], 2)
    for slope, base, flip in ((0.0, 0.0, True), (SLOPE, 1.0, False)):
        control = [[[x, y, base + slope * x] for y in (-size, size)] for x in (-size, size)]
        control = np.array(control)
        if flip:  # its normal points down
            control = control.transpose(1, 0, 2)
        trim = Trim([circle(np.zeros(2), 1.0)], low, high)
        made.append(engine.Patch(control, *knots, trim=trim))
    return made


def upper(begin, end, turn):
    """Return the quintic (6, 2) with values, slopes and bends of 1 + SLOPE cos at both angles."""
    h, points = end - begin, np.empty((6, 2))
    for first, angle, step in ((0, begin, h), (5, end, -h)):
        at = angle + 0.5 * np.pi * turn
        z, dz, ddz = 1.0 + SLOPE * math.cos(at), -SLOPE * math.sin(at), -SLOPE * math.cos(at)
        values = [z, z + dz * step / 5.0, z + 0.4 * dz * step + ddz * step * step / 20.0]
        for k, value in enumerate(values):
            points[abs(first - k)] = angle + step * k / 5.0, value
    return points


@pytest.mark.long
def test_an_edge_across_a_cylinder_is_compared_by_its_bends():
    model = ParametricSurface(slanted(8), solid=True)
    gap = find_joints(model.nets, 0.0).gap
    assert 1e-11 < gap < 1e-6
    up = np.array([-SLOPE, 0.0, 1.0]) / math.hypot(SLOPE, 1.0)

    def inside(x):
        high = (x - (0.0, 0.0, 1.0)) @ up
        return np.maximum.reduce([np.hypot(x[:, 0], x[:, 1]) - 1.0, high, -x[:, 2]])

    rng = np.random.default_rng(8)
    angle, aside = rng.uniform(0.0, 2.0 * np.pi, 200), 1e-4 * rng.normal(size=(200, 3))
    rim = np.stack((np.cos(angle), np.sin(angle), 1.0 + SLOPE * np.cos(angle)), axis=1) + aside
    points = np.concatenate((rng.uniform(-1.5, 1.5, (200, 3)), rim))
    found, expected = engine.closest_points(model, IDENTITY, points, signed=True), inside(points)
    told = np.abs(expected) > 1e-6
    assert (np.sign(found.lower[told]) == np.sign(expected[told])).all()
    assert (np.sign(found.upper[told]) == np.sign(expected[told])).all()
    deep = told & (expected < 0.0)  # in a convex solid the depth is that to the nearest face
    assert found.upper[deep] == pytest.approx(expected[deep], abs=1e-9)
    check(engine.signed_distance(model, IDENTITY, ball(0.2), translation(0.0, 0.0, -0.1)), -0.1)
    coarse = ParametricSurface(slanted(1), solid=None)
    assert not coarse.is_solid
