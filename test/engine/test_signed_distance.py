"""Signed distances of solids, against formulas and brute force in numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from ball_oracle import winding_numbers
from depth_cases import (
    PAIRS,
    PERCENT,
    SOLIDS,
    TIGHT,
    as_soup,
    ask,
    ball,
    check,
    check_brute,
    cylinder,
    icosphere,
    together,
    turned,
)
from engine_bodies import (
    IDENTITY,
    Fcl,
    box,
    from_trimesh,
    pose,
    sphere,
    torus,
    translation,
)
from engine_oracles import pairwise_distances, triangles

from proximity_monitor import engine
from proximity_monitor.engine import Status


@pytest.mark.long
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_against_brute_force(first, second):
    """Each pair once, in alternating order. Some bodies are nested, and some have cavities."""
    if (len(first) + len(second)) % 2:
        first, second = second, first
    a, b = SOLIDS[first], SOLIDS[second]
    rng = np.random.default_rng([len(first), len(second)])
    spread = (0.05, 0.3, 0.7, 1.5)[(len(first) + len(second)) % 4]
    pose_a, pose_b = pose(rng, 2.0), pose(rng)
    pose_b[:3, 3] = pose_a[:3, 3] + spread * rng.normal(size=3)
    check_brute(a, pose_a, b, pose_b, engine.signed_distance(a, pose_a, b, pose_b))


# Answers that a formula gives


@pytest.mark.parametrize("offset", [0.0, 0.05])
def test_crossed_bars(offset):
    """No vertex of either lies inside the other."""
    long, across = box((4.0, 0.2, 0.2)), box((0.2, 4.0, 0.2))
    check(ask(long, IDENTITY, across, translation(0.3, 0.1, offset)), offset - 0.2)


@pytest.mark.parametrize("subdivisions", [0, 1, 3])
def test_plates_overlap_by_as_much_however_fine_their_mesh_is(subdivisions):
    plate = trimesh.creation.box((100.0, 100.0, 1.0))
    for _ in range(subdivisions):
        plate = plate.subdivide()
    model, rng = from_trimesh(plate, "plate"), np.random.default_rng(subdivisions)
    for shift in (0.0, 0.37):
        here = pose(rng, 3.0)
        found = ask(model, here, model, here @ translation(shift, 2.0 * shift, 0.5))
        check(found, -0.5, 1e-10)
        assert found.upper == pytest.approx(-0.5, abs=1e-10)


def test_a_cube_twice_is_as_deep_as_its_edge():
    found = ask(box((1.0, 1.0, 1.0)), IDENTITY, box((1.0, 1.0, 1.0)), IDENTITY)
    check(found, -1.0)
    assert found.status is Status.EXACT


@pytest.mark.parametrize("overlap", [1e-9, 1e-6, 1e-3, 0.1, 1.0])
def test_spheres_overlap_by_as_much_as_they_are_pushed_into_each_other(overlap):
    rng = np.random.default_rng(5)
    first, second = pose(rng, 2.0), np.eye(4)
    way = rng.normal(size=3)
    second[:3, 3] = first[:3, 3] + (1.0 - overlap) * way / np.linalg.norm(way)
    found = ask(ball(), first, ball(), second)
    check(found, -overlap, 1e-14)
    assert found.status is Status.EXACT
    mesh = sphere(5)
    inside = 2.0 - 2.0 * np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1), axis=1).min()
    found = engine.signed_distance(mesh, IDENTITY, mesh, translation(2.0 - inside - overlap))
    assert -PERCENT * (overlap + inside) <= found.lower <= found.upper < 0.0
    assert found.upper <= -0.99 * overlap + inside or overlap < inside


@pytest.mark.parametrize("x", [0.0, 0.1, 0.3])
def test_a_box_within_a_box_is_as_deep_as_it_is_thick(x):
    found = ask(box((0.2, 0.2, 0.3)), translation(x), box((1.0, 1.0, 1.0)), IDENTITY)
    check(found, -0.2)


def test_concentric_spheres():
    outer, inner = sphere(2, 1.0), sphere(2, 0.5)
    rng = np.random.default_rng(1)
    thick = 2.0 * np.linalg.norm(inner.vertices[inner.faces].mean(axis=1), axis=1).min()
    for _ in range(3):
        here = pose(rng, 10.0)
        found = ask(outer, here, inner, here)
        assert found.lower * PERCENT <= -thick <= found.upper + 1e-3


def test_a_cylinder_within_a_pipe():
    """Clearance inside a bore counts as clear: the bore is not inside the solid."""
    pipe = from_trimesh(trimesh.creation.annulus(1.0, 1.5, 3.0, sections=32), "pipe")
    piston = cylinder(0.6, 1.0)
    rng = np.random.default_rng(2)
    here = pose(rng, 3.0)
    clear = ask(piston, here, pipe, here)
    assert clear.lower == pytest.approx(1.0 * math.cos(math.pi / 32) - 0.6, abs=0.01)
    inside = ask(cylinder(0.1, 1.0), here @ translation(1.25), pipe, here)
    check(inside, -0.2 * math.cos(math.pi / 24), 2e-3)


def test_a_body_in_a_cavity_is_clear():
    hollow = together(icosphere(2, 1.5), trimesh.Trimesh(
        (hole := icosphere(1, 1.1)).vertices, hole.faces[:, ::-1]
    ))  # fmt: skip
    small = sphere(1, 0.2)
    clear = ask(hollow, IDENTITY, small, translation(0.3))
    assert 0.4 < clear.lower <= clear.upper < 0.6
    assert ask(hollow, IDENTITY, small, translation(1.3)).upper < -0.2


def test_only_one_part_lies_inside():
    parts = together(*(icosphere(1, 0.1, x) for x in (5.0, 0.0, -5.0)))
    for here in (0.0, 5.0, -5.0):
        found = ask(parts, translation(here), sphere(2, 1.0), IDENTITY)
        assert -0.2 < found.lower <= found.upper < -0.15
    assert ask(parts, translation(2.5), sphere(2, 1.0), IDENTITY).lower > 1.0


def test_touching_boxes():
    for y in (0.0, 0.3):
        found = ask(box((1.0, 1.0, 1.0)), IDENTITY, box((1.0, 1.0, 1.0)), translation(1.0, y))
        assert -TIGHT < found.lower <= 0.0 <= found.upper < TIGHT
        assert found.status is Status.INTERSECTING


@pytest.mark.long
@pytest.mark.parametrize("name", SOLIDS)
def test_a_model_upon_itself(name):
    model = SOLIDS[name]
    found = engine.signed_distance(model, IDENTITY, model, IDENTITY)
    check_brute(model, IDENTITY, model, IDENTITY, found)
    assert found.upper < 0.0


@pytest.mark.parametrize("gap", [1e-3, 1e-9, 1e-12])
def test_the_sign_next_to_the_surface(gap):
    a, b = box((1.0, 1.0, 1.0)), box((0.5, 0.5, 0.5))
    assert ask(a, IDENTITY, b, translation(0.75 + gap)).lower == pytest.approx(gap, abs=3e-14)
    check(ask(a, IDENTITY, b, translation(0.75 - gap)), -gap, 3e-13)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_any_scale(size):
    """The bodies are also far from the origin, where poses are rounded."""
    outer = engine.TriangleMesh(size * sphere(2).vertices, sphere(2).faces)
    inner = engine.TriangleMesh(1e-3 * size * box().vertices, box().faces)
    for x in (0.0, 0.5, 0.9, 2.0):
        there = translation(1e8 * size)
        found = engine.signed_distance(inner, translation(1e8 * size + x * size), outer, there)
        if x < 1.0:
            check(found, -0.6e-3 * size, 1e-6 * size)
        else:
            assert found.lower > 0.9 * size


# What the points mean


def test_the_points_are_those_of_the_surfaces_next_to_the_balls_centre():
    a, b = box((1.0, 1.0, 1.0)), sphere(3, 0.4)
    rng = np.random.default_rng(11)
    for _ in range(10):
        here, there = pose(rng, 1.0), pose(rng)
        there[:3, 3] = here[:3, 3] + 0.5 * rng.normal(size=3)
        found = engine.signed_distance(a, here, b, there)
        if found.upper >= 0.0:
            continue
        for model, at, point in ((a, here, found.point_a), (b, there, found.point_b)):
            assert (
                pairwise_distances(
                    np.repeat(point[None, None], 3, axis=1), triangles(model, at)
                ).min()
                < 1e-12
            )


def test_faces_that_are_pushed_into_each_other_tell_which_way_is_out():
    found = engine.signed_distance(
        box((1.0, 1.0, 1.0)), IDENTITY, box((1.0, 1.0, 1.0)), translation(0.9, 0.2)
    )
    np.testing.assert_allclose(found.point_a - found.point_b, [0.1, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_no_translation_that_parts_solids_is_shorter(seed):
    """For convex solids, FCL tells how far along a direction they must move to be clear."""
    rng = np.random.default_rng(seed)
    shapes = box(), sphere(1), cylinder(0.6, 1.0)
    a, b = (
        engine.TriangleMesh(shapes[k].vertices * rng.uniform(0.3, 1.5, 3), shapes[k].faces)
        for k in rng.integers(3, size=2)
    )
    here, there = pose(rng), pose(rng, 0.4)
    depth = -engine.signed_distance(a, here, b, there).upper
    assert depth > 0.0
    peer = Fcl(a, b)
    for way in [*np.eye(3), *-np.eye(3), *rng.normal(size=(10, 3))]:
        way = way / np.linalg.norm(way)
        inside, outside = 0.0, 20.0  # convex solids overlap in one interval of translations
        for _ in range(36):
            step = 0.5 * (inside + outside)
            shifted = there.copy()
            shifted[:3, 3] += step * way
            apart = not peer.collide(here, shifted)
            apart = apart and engine.signed_distance(a, here, b, shifted).lower > -1e-9
            inside, outside = (inside, step) if apart else (step, outside)
        assert outside >= depth - 1e-9


# Changes that leave answers as they are


@pytest.mark.parametrize("name", SOLIDS)
def test_the_side_of_a_point_agrees_with_its_solid_angles(name):
    """A tiny body probes the side of the place where it is."""
    model = SOLIDS[name]
    probe = box((1e-9, 1e-9, 1e-9))
    rng = np.random.default_rng(3)
    places = rng.uniform(-1.0, 1.0, (25, 3)) * np.abs(model.vertices).max(axis=0)
    winding = winding_numbers(places, triangles(model))
    assert np.abs(winding - np.round(winding)).max() < 1e-6
    for place, number in zip(places, winding, strict=True):
        found = engine.signed_distance(model, IDENTITY, probe, translation(*place))
        assert (found.upper < 0.0) == (round(number) != 0)


def test_rays_along_edges_and_through_vertices():
    """The probes lie on grid lines of a box: a straight ray would graze edge after edge."""
    outer = from_trimesh(trimesh.creation.box((2, 2, 2)).subdivide().subdivide(), "grid")
    probe = box((1e-3, 1e-3, 1e-3))
    for x in np.linspace(-1.25, 1.25, 6):
        for y in (-0.5, 0.0, 0.25):
            found = engine.signed_distance(probe, translation(x, y, 0.5), outer, IDENTITY)
            assert (found.upper < 0.0) == (abs(x) < 1.0)


def test_inside_out_and_unmerged_models_answer_alike():
    a, b = torus(16), box()
    rng = np.random.default_rng(4)
    for _ in range(5):
        here = pose(rng, 0.5)
        found = engine.signed_distance(a, here, b, IDENTITY)
        for other in (turned(a), as_soup(a)):
            same = engine.signed_distance(other, here, b, IDENTITY)
            assert max(same.lower, found.lower) <= min(same.upper, found.upper) + TIGHT
            check(same, same.upper)


@pytest.mark.parametrize("volume", ["rss", "lss", "pss", "hybrid", "obb", "aabb"])
def test_every_kind_of_volume_answers_alike(volume):
    a = engine.TriangleMesh(torus(16).vertices, torus(16).faces, volume=volume)
    rng = np.random.default_rng(7)
    for _ in range(5):
        here = pose(rng, 0.5)
        found = engine.signed_distance(a, here, SOLIDS["box"], IDENTITY)
        same = engine.signed_distance(torus(16), here, SOLIDS["box"], IDENTITY)
        assert max(same.lower, found.lower) <= min(same.upper, found.upper) + TIGHT
        check(found, found.upper)


def test_a_deformed_model_is_seen_as_it_is():
    model = box((1.0, 1.0, 1.0))
    small = box((0.1, 0.1, 0.1))
    check(engine.signed_distance(model, IDENTITY, small, IDENTITY), -0.1)
    model.deform(model.vertices + np.array((3.0, 0.0, 0.0)))
    assert engine.signed_distance(model, IDENTITY, small, IDENTITY).lower > 2.4
    flat = model.vertices * (1.0, 1.0, 0.0)
    model.deform(flat)
    assert not model.is_solid
    found = engine.signed_distance(model, translation(-3.0), small, IDENTITY)
    check(found, -0.05)  # the depth of the sheet's deepest points in the box


def test_degenerate_triangles_change_nothing():
    plain = box()
    faces = np.concatenate((plain.faces, [[0, 0, 1], [2, 2, 2], [0, 1, 2], [2, 1, 0]]))
    with_sheet = engine.TriangleMesh(plain.vertices, faces, name="sheet")
    found = ask(with_sheet, IDENTITY, sphere(1, 0.2), translation(0.0, 0.3))
    check_brute(plain, IDENTITY, sphere(1, 0.2), translation(0.0, 0.3), found)
    assert found.upper < 0.0
