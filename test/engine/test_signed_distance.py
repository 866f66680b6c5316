"""Signed distances of solids, against formulas and brute force in numpy."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import trimesh
from engine_bodies import IDENTITY, box, from_trimesh, pose, sphere, torus, translation
from engine_oracles import pairwise_distances, triangles
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor import engine

TIGHT = 1e-12


def together(*parts: trimesh.Trimesh, name: str = "assembly") -> engine.TriangleMesh:
    """Several meshes as one model."""
    return from_trimesh(trimesh.util.concatenate(parts), name)


def turned(mesh: engine.TriangleMesh) -> engine.TriangleMesh:
    """The same mesh inside out."""
    return engine.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1], name=mesh.name)


def as_soup(mesh: engine.TriangleMesh) -> engine.TriangleMesh:
    """The same triangles, none of which share a vertex."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    return engine.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3), name="soup")


def icosphere(subdivisions: int, radius: float, x: float = 0.0) -> trimesh.Trimesh:
    made = trimesh.creation.icosphere(subdivisions, radius)
    made.apply_translation((x, 0.0, 0.0))
    return made


def cylinder(radius: float, height: float) -> engine.TriangleMesh:
    return from_trimesh(trimesh.creation.cylinder(radius, height, sections=24), "cylinder")


def winding_numbers(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Solid angles of all triangles (Van Oosterom and Strackee 1983) over 4 pi, unrounded."""
    a, b, c = (corners[None, :, i] - points[:, None] for i in range(3))
    x, y, z = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    volume = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
    below = x * y * z
    for p, q, r in ((a, b, z), (b, c, x), (c, a, y)):
        below = below + np.einsum("ijk,ijk->ij", p, q) * r
    return (2.0 * np.arctan2(volume, below)).sum(axis=1) / (4.0 * math.pi)


def depth_of(points: np.ndarray, corners: np.ndarray) -> float:
    """Depth of the deepest of points that lie inside a surface; 0 where none does."""
    inside = np.abs(winding_numbers(points, corners)) > 0.5
    if not inside.any():
        return 0.0
    degenerate = np.repeat(points[inside][:, None], 3, axis=1)
    return float(pairwise_distances(degenerate, corners).min(axis=1).max())


def expected_value(a, pose_a, b, pose_b) -> float:
    """The signed distance by brute force."""
    first, second = triangles(a, pose_a), triangles(b, pose_b)
    depth = max(
        depth_of(np.unique(first.reshape(-1, 3), axis=0), second),
        depth_of(np.unique(second.reshape(-1, 3), axis=0), first),
    )
    return -depth if depth > 0.0 else float(pairwise_distances(first, second).min())


def check(found: engine.Distance, expected: float, slack: float = TIGHT, far: float = 0.0) -> None:
    """The bounds hold the value and the witnesses, `far` from the origin, attain it."""
    assert found.lower - slack <= expected <= found.upper + slack
    slack = max(slack, 1e-15 * far)
    apart = float(np.linalg.norm(found.point_a - found.point_b))
    if found.upper < 0.0:
        assert -found.upper - slack <= apart <= -found.lower + slack
    else:
        assert apart <= found.upper + slack


def ask(a, pose_a, b, pose_b, **options) -> engine.Distance:
    """Both orders agree, up to rounding."""
    found = engine.signed_distance(a, pose_a, b, pose_b, **options)
    other = engine.signed_distance(b, pose_b, a, pose_a, **options)
    assert found.lower == pytest.approx(other.lower, abs=TIGHT)
    assert found.upper == pytest.approx(other.upper, abs=TIGHT)
    assert found.status is other.status
    return found


SOLIDS = {
    "box": box(),
    "sphere": sphere(1),
    "torus": torus(16),
    "cylinder": cylinder(0.4, 2.0),
    "plate": box((2.0, 2.0, 1e-3)),
    "needle": box((3.0, 1e-4, 1e-4)),
    "two spheres": together(icosphere(1, 0.6, -1.0), icosphere(1, 0.5, 1.0)),
    "overlapping boxes": together(
        trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.5, 2.0, 0.5))
    ),
    "hollow": together(icosphere(2, 1.5), trimesh.Trimesh(
        (inner := icosphere(1, 1.1)).vertices, inner.faces[:, ::-1]
    )),
}  # fmt: skip


PAIRS = list(itertools.combinations_with_replacement(SOLIDS, 2))


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_against_brute_force(first, second):
    """Every pair once, now one first and now the other."""
    if (len(first) + len(second)) % 2:
        first, second = second, first
    a, b = SOLIDS[first], SOLIDS[second]
    rng = np.random.default_rng([len(first), len(second)])
    for spread in (0.05, 0.3, 0.7, 1.5):
        pose_a, pose_b = pose(rng, 2.0), pose(rng)
        pose_b[:3, 3] = pose_a[:3, 3] + spread * rng.normal(size=3)
        found = engine.signed_distance(a, pose_a, b, pose_b)
        check(found, expected_value(a, pose_a, b, pose_b))
        assert found.upper - found.lower < TIGHT


@pytest.mark.parametrize("name", SOLIDS)
def test_the_side_of_a_point_agrees_with_its_solid_angles(name):
    """A tiny body asks for the side of its own place."""
    model = SOLIDS[name]
    probe = box((1e-9, 1e-9, 1e-9))
    rng = np.random.default_rng(3)
    places = rng.uniform(-1.0, 1.0, (40, 3)) * np.abs(model.vertices).max(axis=0)
    winding = winding_numbers(places, triangles(model))
    assert np.abs(winding - np.round(winding)).max() < 1e-6
    for place, number in zip(places, winding, strict=True):
        found = engine.signed_distance(model, IDENTITY, probe, translation(*place))
        assert (found.upper < 0.0) == (round(number) != 0)


@pytest.mark.parametrize("x", [0.0, 0.1, 0.35])
def test_a_box_within_a_box(x):
    outer, inner = box((1.0, 1.0, 1.0)), box((0.2, 0.2, 0.2))
    found = ask(inner, translation(x), outer, IDENTITY)
    # The deepest corner's nearest wall.
    assert found.upper == pytest.approx(-min(0.4, 0.5 - (x - 0.1)), abs=TIGHT)
    assert found.lower == pytest.approx(found.upper, abs=TIGHT)
    assert found.status is engine.Status.EXACT
    assert found.feature_a.kind == "vertex"


def test_concentric_spheres():
    outer, inner = sphere(2, 1.0), sphere(2, 0.5)
    rng = np.random.default_rng(1)
    for _ in range(5):
        here = pose(rng, 10.0)
        found = ask(outer, here, inner, here)
        check(found, expected_value(outer, here, inner, here))
        assert found.upper == pytest.approx(-0.5, abs=0.05)


def test_a_cylinder_within_a_pipe():
    """Clearance inside a bore counts as clear: the bore is not inside the solid."""
    pipe = from_trimesh(trimesh.creation.annulus(1.0, 1.5, 3.0, sections=32), "pipe")
    piston = cylinder(0.6, 1.0)
    rng = np.random.default_rng(2)
    here = pose(rng, 3.0)
    clear = ask(piston, here, pipe, here)
    assert clear.lower == pytest.approx(1.0 * math.cos(math.pi / 32) - 0.6, abs=0.01)
    inside = ask(cylinder(0.1, 1.0), here @ translation(1.25), pipe, here)
    assert inside.upper < 0.0
    check(inside, expected_value(cylinder(0.1, 1.0), here @ translation(1.25), pipe, here))


def test_a_body_in_a_cavity_is_clear():
    hollow = SOLIDS["hollow"]
    small = sphere(1, 0.2)
    clear = ask(hollow, IDENTITY, small, translation(0.3))
    assert 0.4 < clear.lower <= clear.upper < 0.6
    assert ask(hollow, IDENTITY, small, translation(1.3)).upper < 0.0


def test_only_one_part_lies_inside():
    parts = together(*(icosphere(1, 0.1, x) for x in (5.0, 0.0, -5.0)))
    for here in (0.0, 5.0, -5.0):
        found = ask(parts, translation(here), sphere(2, 1.0), IDENTITY)
        check(found, expected_value(parts, translation(here), sphere(2, 1.0), IDENTITY))
        assert found.upper < -0.8
    assert ask(parts, translation(2.5), sphere(2, 1.0), IDENTITY).lower > 1.0


def test_crossed_bars_have_no_depth():
    long, across = box((4.0, 0.2, 0.2)), box((0.2, 4.0, 0.2))
    found = ask(long, IDENTITY, across, translation(0.0, 0.0, 0.05))
    assert found.lower == 0.0 <= found.upper < TIGHT
    assert found.status is engine.Status.INTERSECTING


def test_touching_boxes():
    found = ask(box((1.0, 1.0, 1.0)), IDENTITY, box((1.0, 1.0, 1.0)), translation(1.0))
    assert -TIGHT < found.lower <= 0.0 <= found.upper < TIGHT
    assert found.status is engine.Status.INTERSECTING


@pytest.mark.parametrize("name", SOLIDS)
def test_a_model_upon_itself(name):
    """Every vertex lies on the other surface, or inside another part."""
    model = SOLIDS[name]
    found = engine.signed_distance(model, IDENTITY, model, IDENTITY)
    check(found, expected_value(model, IDENTITY, model, IDENTITY))


@pytest.mark.parametrize("gap", [1e-3, 1e-9, 1e-13])
def test_the_sign_next_to_the_surface(gap):
    a, b = box((1.0, 1.0, 1.0)), box((0.5, 0.5, 0.5))
    assert ask(a, IDENTITY, b, translation(0.75 + gap)).lower == pytest.approx(gap, abs=3e-14)
    overlap = ask(a, IDENTITY, b, translation(0.75 - gap))
    assert overlap.upper == pytest.approx(-gap, abs=3e-14)
    assert overlap.upper < 0.0


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_any_scale(size):
    outer = engine.TriangleMesh(size * sphere(2).vertices, sphere(2).faces)
    inner = engine.TriangleMesh(1e-3 * size * box().vertices, box().faces)
    for x in (0.0, 0.5, 0.9, 2.0):
        here = translation(1e8 * size + x * size)
        there = translation(1e8 * size)
        found = engine.signed_distance(inner, here, outer, there)
        shifted = translation(here[0, 3] - there[0, 3])
        check(found, expected_value(inner, shifted, outer, IDENTITY), TIGHT * size, 1e8 * size)
        assert (found.upper < 0.0) == (x < 1.0)


def test_rays_along_edges_and_through_vertices():
    """A grid of boxes on each other's axes: straight rays would graze edge after edge."""
    outer = from_trimesh(trimesh.creation.box((2, 2, 2)).subdivide().subdivide(), "grid")
    probe = box((1e-3, 1e-3, 1e-3))
    for x in np.linspace(-1.25, 1.25, 6):
        for y in (-0.5, 0.0, 0.25):
            found = engine.signed_distance(probe, translation(x, y, 0.5), outer, IDENTITY)
            assert (found.upper < 0.0) == (abs(x) < 1.0)


def test_inside_out_and_unmerged_models_answer_alike():
    a, b = torus(16), box()
    rng = np.random.default_rng(4)
    for _ in range(10):
        here = pose(rng, 0.5)
        found = engine.signed_distance(a, here, b, IDENTITY)
        for other in (turned(a), as_soup(a)):
            same = engine.signed_distance(other, here, b, IDENTITY)
            assert (same.lower, same.upper) == pytest.approx((found.lower, found.upper), abs=TIGHT)


@pytest.mark.parametrize("volume", ["rss", "lss", "pss", "hybrid"])
def test_every_kind_of_volume_answers_alike(volume):
    a = engine.TriangleMesh(torus(16).vertices, torus(16).faces, volume=volume)
    rng = np.random.default_rng(7)
    for _ in range(10):
        here = pose(rng, 0.5)
        found = engine.signed_distance(a, here, SOLIDS["box"], IDENTITY)
        check(found, expected_value(a, here, SOLIDS["box"], IDENTITY))


def test_a_refitted_model_is_seen_as_it_is():
    model = box((1.0, 1.0, 1.0))
    small = box((0.1, 0.1, 0.1))
    assert engine.signed_distance(model, IDENTITY, small, IDENTITY).upper < -0.4
    model.deform(model.vertices + np.array((3.0, 0.0, 0.0)))
    assert engine.signed_distance(model, IDENTITY, small, IDENTITY).lower > 2.4
    flat = model.vertices * (1.0, 1.0, 0.0)
    model.deform(flat)
    assert not model.is_solid
    found = engine.signed_distance(model, translation(-3.0), small, IDENTITY)
    assert found.lower == 0.0 <= found.upper < TIGHT  # no corner of the sheet lies in the box


def test_degenerate_triangles_change_nothing():
    plain = box()
    faces = np.concatenate((plain.faces, [[0, 0, 1], [2, 2, 2], [0, 1, 2], [2, 1, 0]]))
    with_sheet = engine.TriangleMesh(plain.vertices, faces, name="sheet")
    found = engine.signed_distance(with_sheet, IDENTITY, sphere(1, 0.2), IDENTITY)
    check(found, expected_value(with_sheet, IDENTITY, sphere(1, 0.2), IDENTITY))
    assert found.upper < 0.0


poses = st.integers(0, 2**32 - 1).map(np.random.default_rng)
pairs = st.tuples(st.sampled_from(sorted(SOLIDS)), st.sampled_from(sorted(SOLIDS)))


@settings(max_examples=60, deadline=None)
@given(pairs, poses, st.floats(0.0, 2.0))
def test_symmetry_and_common_motion(names, rng, spread):
    a, b = (SOLIDS[name] for name in names)
    pose_a, pose_b, common = pose(rng, spread), pose(rng, spread), pose(rng, 3.0)
    found = ask(a, pose_a, b, pose_b)
    moved = engine.signed_distance(a, common @ pose_a, b, common @ pose_b)
    assert (moved.lower, moved.upper) == pytest.approx((found.lower, found.upper), abs=1e-11)


@settings(max_examples=60, deadline=None)
@given(pairs, poses, st.floats(0.0, 2.0))
def test_agrees_with_distance(names, rng, spread):
    """Where the surfaces are apart: their distance, or a depth that is no less."""
    a, b = (SOLIDS[name] for name in names)
    pose_a, pose_b = pose(rng, spread), pose(rng, spread)
    found = engine.signed_distance(a, pose_a, b, pose_b)
    surfaces = engine.distance(a, pose_a, b, pose_b)
    if surfaces.lower > 0.0:
        assert abs(found.upper) >= surfaces.lower
        if found.lower > 0.0:
            assert (found.lower, found.upper) == (surfaces.lower, surfaces.upper)
    else:
        assert found.lower <= 0.0


@settings(max_examples=80, deadline=None)
@given(
    pairs,
    poses,
    st.floats(0.0, 1.5),
    st.one_of(st.just(0.0), st.floats(0.0, 1.0), st.just(math.inf)),
    st.one_of(st.just(0.0), st.floats(0.0, 1.0), st.just(math.inf)),
    st.one_of(st.none(), st.just(0.0), st.floats(0.0, 1e-3)),
)
def test_bounds_hold_under_any_tolerance_and_budget(names, rng, spread, rel, absolute, budget):
    a, b = (SOLIDS[name] for name in names)
    pose_a, pose_b = pose(rng, spread), pose(rng, spread)
    exact = engine.signed_distance(a, pose_a, b, pose_b)
    loose = engine.signed_distance(
        a, pose_a, b, pose_b, rel_err=rel, abs_err=absolute, budget_s=budget
    )
    assert loose.lower <= exact.upper
    assert exact.lower <= loose.upper
    if budget is None:
        assert (loose.lower > 0.0) == (exact.lower > 0.0)
        share = rel * abs(exact.upper) if exact.upper != 0.0 else 0.0
        assert loose.upper - loose.lower <= max(share, absolute) + TIGHT


def test_no_time_at_all_still_bounds():
    for x in (0.0, 0.9, 1.6, 5.0):
        found = engine.signed_distance(
            sphere(3), IDENTITY, sphere(3, 0.6), translation(x), budget_s=0.0
        )
        exact = engine.signed_distance(sphere(3), IDENTITY, sphere(3, 0.6), translation(x))
        assert found.lower <= exact.lower <= exact.upper <= found.upper
        assert found.status in (engine.Status.OUT_OF_TIME, exact.status)


def test_the_deepest_vertex_is_found_without_testing_them_all():
    a, b = sphere(5), sphere(5)
    found = engine.signed_distance(a, IDENTITY, b, translation(1.0, 0.2, 0.1))
    assert found.upper < 0.0
    assert found.primitive_tests < 0.1 * (len(a.vertices) + len(b.vertices))


def test_boxes_that_share_an_edge_are_a_solid():
    """Four faces meet there, two either way."""
    second = trimesh.creation.box((1, 1, 1))
    second.apply_translation((1.0, 1.0, 0.0))
    stairs = together(trimesh.creation.box((1, 1, 1)), second)
    found = engine.signed_distance(stairs, IDENTITY, box((0.1, 0.1, 0.1)), translation(1.0, 1.0))
    assert found.upper == pytest.approx(-0.45, abs=TIGHT)
