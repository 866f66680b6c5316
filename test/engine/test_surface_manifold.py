"""Manifolds, solution sets and all contacts if parametric surfaces take part.

Continua are known analytically: each of their samples must lie in a pair of regions. The bounds of
pairs are compared with samples of both regions.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from engine_bodies import box
from engine_surfaces import bumps, revolved, sphere_patches, torus_patches
from test_trimmed import CENTRE, PLATE, RADIUS

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ParametricSurface, Patch, Status

HERE = np.eye(4)
SQUARE = Patch(np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], float))
TORUS, SPHERE = ParametricSurface(torus_patches()), ParametricSurface(sphere_patches())


def moved(x, y=0.0, z=0.0):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def scaled(surface, factor):
    """Return a surface scaled by a factor."""
    made = [Patch(factor * net.control, weights=net.weights) for net in surface.nets]
    return ParametricSurface(made)


def cylinder(radius):
    return ParametricSurface(revolved([[radius, -1.0], [radius, 1.0]], [1.0, 1.0]))


def point_of(surface, patch, at):
    return surface.nets[patch].derivatives(*np.atleast_2d(at).T, 0)[:, 0, 0]


def held(manifold, side, patches, at, slack=1e-12):
    """Return which pairs (k, n) hold points on one side, by patches (n,) and parameters (n, 2)."""
    ranges = (manifold.ranges_a, manifold.ranges_b)[side]
    faces = (manifold.faces_a, manifold.faces_b)[side]
    low, high = np.moveaxis((manifold.rectangles_a, manifold.rectangles_b)[side], 1, 0)
    rows = faces[:, None] == patches
    for axis in range(2):
        rows &= (low[:, None, axis] <= at[:, axis] + slack) & (
            at[:, axis] <= high[:, None, axis] + slack
        )
    begun = np.concatenate((np.zeros((1, len(patches)), int), rows.cumsum(axis=0)))
    return begun[ranges[:, 1]] > begun[ranges[:, 0]]


def covers(manifold, patches_a, at_a, patches_b, at_b):
    """Return which pairs of points lie in a pair of regions."""
    one = held(manifold, 0, np.asarray(patches_a), np.asarray(at_a))
    return (one & held(manifold, 1, np.asarray(patches_b), np.asarray(at_b))).any(axis=0)


def check_bounds(answer, a, b, pose_b, count=40):
    """Check the bounds of some pairs of single regions against samples of the regions."""
    m, rng = answer.manifold, np.random.default_rng(1)
    assert (m.lower <= np.minimum(m.upper, answer.upper)).all()
    assert answer.lower <= m.lower.min() + 1e-15
    for k in rng.permutation(len(m))[:count]:
        points = []
        for surface, ranges, faces, rectangles in (
            (a, m.ranges_a, m.faces_a, m.rectangles_a),
            (b, m.ranges_b, m.faces_b, m.rectangles_b),
        ):
            row = ranges[k, 0]
            at = rectangles[row, 0] + rng.random((64, 2)) * np.ptp(rectangles[row], axis=0)
            points.append(point_of(surface, faces[row], at))
        apart = np.linalg.norm(
            points[0][:, None] - points[1] @ pose_b[:3, :3].T - pose_b[:3, 3], axis=2
        )
        assert m.lower[k] <= apart.min() + 1e-13
        if (m.ranges_a[k, 1] == m.ranges_a[k, 0] + 1) & (m.ranges_b[k, 1] == m.ranges_b[k, 0] + 1):
            assert apart.min() <= m.upper[k] + np.linalg.norm(np.ptp(points[0], axis=0))


def grid(patches, u, v):
    """Return patches (n,) and parameters (n, 2) of all combinations."""
    p, u, v = np.meshgrid(patches, u, v, indexing="ij")
    return p.ravel(), np.column_stack((u.ravel(), v.ravel()))


def on_tori():
    """Yield the circle at which two stacked tori are nearest, by each patch row at that circle."""
    u = np.linspace(0.0, 1.0, 60)
    for of_a, v_a in ((0, 1.0), (4, 0.0)):
        for of_b, v_b in ((8, 1.0), (12, 0.0)):
            yield *grid(of_a + np.arange(4), u, v_a), *grid(of_b + np.arange(4), u, v_b)


def alike(patches, u, v, shift=(0.0, 0.0)):
    """Yield the same parameters on both models, but for a shift of the first."""
    p, at = grid(patches, u, v)
    yield p, at - shift, p, at


EVEN = np.linspace(0.0, 1.0, 23)
CONTINUA = {
    "parallel planes": (
        SQUARE, SQUARE, moved(0.2, 0.3, 0.5), {}, 0.5,
        lambda: alike([0], 0.8 * EVEN, 0.7 * EVEN, (-0.2, -0.3)),
    ),
    "coaxial tori": (TORUS, TORUS, moved(0.0, 0.0, 1.0), {}, 0.4, on_tori),
    "concentric cylinders": (
        cylinder(1.0), cylinder(0.5), moved(0.0, 0.0, 0.5), {"rel_err": 1e-2}, 0.5,
        lambda: alike(range(4), EVEN, 0.75 * EVEN, (0.0, -0.25)),
    ),
    "offset spheres": (
        SPHERE, scaled(SPHERE, 0.75), HERE, {"rel_err": 0.2}, 0.25,
        lambda: alike(range(8), EVEN, EVEN),
    ),
    "parallel lines": (
        Curve([[0.0, 0, 0], [2, 0, 0]]), Curve([[1.0, 1, 0], [3, 1, 0]]), HERE, {}, 1.0,
        lambda: [
            (0 * EVEN, np.column_stack((0.5 + 0.5 * EVEN, 0 * EVEN)),
             0 * EVEN, np.column_stack((0.5 * EVEN, 0 * EVEN)))
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "order"),
    [
        *((name, "depth_first") for name in CONTINUA),
        pytest.param("parallel planes", "priority", marks=pytest.mark.long),  # it compiles long
    ],
)
def test_all_of_a_continuum_is_in_the_solution_set(name, order):
    a, b, pose_b, tolerance, known, samples = CONTINUA[name]
    plain = engine.distance(a, HERE, b, pose_b, **tolerance)
    found = engine.distance(a, HERE, b, pose_b, manifold=True, order=order, **tolerance)
    assert found.status is plain.status
    assert found.lower <= known <= found.upper
    check_bounds(found, a, b, pose_b)
    (whole,) = found.solution_set
    for sample in samples():
        assert covers(found.manifold, *sample).all()
        assert covers(whole, *sample).all()


def test_regions_shrink_with_the_tolerance_and_with_that_of_parameters():
    """The measure is the regions' share of all pairs of parameters; each ranges from 0 to 1."""

    def share(**how):
        m = engine.distance(
            cylinder(1.0), HERE, cylinder(0.5), moved(0.0, 0.0, 0.5), manifold=True, **how
        ).manifold
        sizes = [
            np.ptp(rectangles[ranges[:, 0]], axis=1).prod(axis=1)
            for ranges, rectangles in ((m.ranges_a, m.rectangles_a), (m.ranges_b, m.rectangles_b))
        ]
        return (sizes[0] * sizes[1]).sum()

    shares = [share(rel_err=tolerance) for tolerance in (0.01, 1e-3, 2e-4)]
    assert shares[2] < 0.6 * shares[1] < 0.3 * shares[0]
    assert share(rel_err=0.01, param_err=0.05) < 0.5 * shares[0]
    long = engine.distance(TORUS, HERE, TORUS, moved(0, 0, 1.0), rel_err=0.1, manifold=True)
    short = engine.distance(TORUS, HERE, TORUS, moved(0, 0, 1.0), rel_err=0.1, param_err=0.05)
    assert len(long.manifold) < 10 < len(short.manifold)
    rectangles = short.manifold.rectangles_a[short.manifold.ranges_a[:, 0]]
    assert np.ptp(rectangles, axis=1).max() <= 0.05 + 1e-12
    for sample in on_tori():
        assert covers(long.manifold, *sample).all()
        assert covers(short.manifold, *sample).all()


@pytest.mark.parametrize(
    "a, b, pose_b",
    [
        (bumps(1), bumps(2), moved(0.4, 0.1, 2.5)),
        (SPHERE, TORUS, moved(0.4, 0.1, 2.5)),
        (bumps(1), SPHERE, moved(1.9, 1.6, 1.5)),  # not near its pole, where u hardly matters
    ],
)
def test_a_nearest_pair_that_stands_alone_is_known_to_its_parameters(a, b, pose_b):
    plain = engine.distance(a, HERE, b, pose_b)
    assert plain.manifold is None
    assert plain.solution_set is None
    for param_err in (1e-3, 1e-5):
        found = engine.distance(a, HERE, b, pose_b, param_err=param_err)
        assert found.status is Status.EXACT
        assert max(found.lower, plain.lower) <= min(found.upper, plain.upper)
        assert found.bound_tests < 4 * plain.bound_tests
        (alone,) = found.solution_set
        assert len(alone) == len(found.manifold) < 200
        check_bounds(found, a, b, pose_b)
        for extents, feature in zip(
            alone.extents(), (found.feature_a, found.feature_b), strict=True
        ):
            low, high = extents[feature.index]
            assert (low <= feature.parameters).all()
            assert (feature.parameters <= high).all()
            assert (high - low <= 16.0 * param_err).all()


def test_surfaces_that_cross_do_so_in_the_solution_set():
    upright = Patch(np.array([[[0.5, 0, -0.5], [0.5, 1, -0.5]], [[0.5, 0, 0.5], [0.5, 1, 0.5]]]))
    found = engine.distance(SQUARE, HERE, upright, HERE, param_err=0.03)
    assert found.status is Status.INTERSECTING
    (line,) = found.solution_set
    v = np.linspace(0.0, 1.0, 50)
    at = np.column_stack((0.5 + 0.0 * v, v))
    assert covers(line, 0 * v, at, 0 * v, at).all()
    for extents in line.extents():
        assert np.ptp(extents[0], axis=0)[0] < 0.1


def test_equal_minima_are_groups_of_their_own():
    two = engine.points([[0.25, 0.25, 0.5], [0.7, 0.8, 0.5]])
    for a, b in ((SQUARE, two), (two, SQUARE)):
        found = engine.distance(a, HERE, b, HERE, param_err=1e-4)
        groups = found.solution_set
        assert len(groups) == 2
        side = 0 if a is SQUARE else 1
        lows = sorted(tuple(group.extents()[side][0][0]) for group in groups)
        assert np.allclose(lows, [(0.25, 0.25), (0.7, 0.8)], atol=1e-3)
        assert all(group.extents()[1 - side] == {} for group in groups)
        points = {tuple(group.faces(0)[1 - side]) for group in groups}
        assert points == {(0,), (1,)}


def test_a_surface_and_a_mesh_that_face_each_other():
    """A plate of two triangles above the square: the solution is where they overlap along z."""
    z = 0.3
    plate = engine.TriangleMesh(
        [[0.2, 0.2, z], [1.5, 0.2, z], [1.5, 0.6, z], [0.2, 0.6, z]], [[0, 1, 2], [0, 2, 3]]
    )
    u, v = np.meshgrid(np.linspace(0.2, 1.0, 9), np.linspace(0.2, 0.6, 9))
    at = np.column_stack((u.ravel(), v.ravel()))
    second = (at[:, 1] - 0.2) > 0.4 / 1.3 * (at[:, 0] - 0.2)
    for a, b in ((SQUARE, plate), (plate, SQUARE)):
        found = engine.distance(a, HERE, b, HERE, param_err=0.1)
        side = 0 if a is SQUARE else 1
        m = found.manifold
        regions = held(m, side, np.zeros(len(at), int), at)
        for face in range(2):
            of_face = np.array([face in m.faces(k)[1 - side] for k in range(len(m))])
            assert regions[of_face][:, second == face].any(axis=0).all()
        low, high = m.extents()[side][0]
        assert (low >= (0.05, 0.05)).all()
        assert high[1] <= 0.75
        assert len(found.solution_set) == 1


def test_a_pin_in_a_hole_is_nearest_all_around_the_edge():
    pin = ParametricSurface(revolved(np.array([[1.9, -3.0], [1.9, 3.0]]), np.ones(2)))
    pose = moved(*CENTRE)
    u = np.linspace(0.0, 1.0, 15)
    for how in ({"abs_err": 1e-3}, {"abs_err": 1e-3, "param_err": 0.25}):
        found = engine.distance(PLATE, HERE, pin, pose, manifold=True, **how)
        for patch in range(4):
            at = np.column_stack((u, np.full(len(u), 0.5)))
            edge = CENTRE + point_of(pin, patch, at)[:, :2] / 1.9 * RADIUS
            patches = np.full(len(u), patch)
            assert covers(found.manifold, 0 * patches, edge, patches, at).all()
    low, high = found.manifold.extents()[0][0]
    assert (low <= CENTRE - RADIUS).all()
    assert (high >= CENTRE + RADIUS).all()
    assert (high - low < 2.0 * RADIUS + 1.0).all()


def test_a_cut_search_has_all_that_is_left_and_goes_on():
    pair, found = engine.Pair(TORUS, TORUS), []
    while not found or found[-1].status is Status.OUT_OF_TIME:
        found.append(pair.distance(HERE, moved(0, 0, 1.0), param_err=0.1, budget_s=0.0))
        assert len(found) < 20_000
    assert len(found) > 3
    whole = engine.distance(TORUS, HERE, TORUS, moved(0, 0, 1.0), param_err=0.1)
    assert found[-1].status is whole.status is Status.EXACT
    assert len(found[-1].manifold) == len(whole.manifold)
    for answer in found[:: max(len(found) // 4, 1)]:  # later searches do not change them
        for sample in on_tori():
            assert covers(answer.manifold, *sample).all()


def test_parameters_are_asked_for_where_there_are_some():
    mesh = box()
    with pytest.raises(ValueError, match="neither 'box' nor 'box' is a parametric surface"):
        engine.distance(mesh, HERE, mesh, moved(3.0), param_err=1e-3)
    with pytest.raises(ValueError, match="param_err"):
        engine.distance(SQUARE, HERE, SQUARE, moved(3.0), param_err=-1.0)
    assert engine.distance(mesh, HERE, mesh, moved(3.0), manifold=True).solution_set


def test_spheres_that_cross_have_contacts_all_along_the_circle():
    pose_b = moved(1.0)
    found = engine.collide(SPHERE, HERE, SPHERE, pose_b, all_contacts=True)
    assert found.complete
    assert np.allclose(found.points[:, 0], 0.5, atol=1e-12)
    assert np.allclose(np.linalg.norm(found.points, axis=1), 1.0, atol=1e-12)
    angle = np.linspace(0.0, 2 * math.pi, 400)
    circle = math.sqrt(0.75) * np.column_stack((0 * angle, np.cos(angle), np.sin(angle)))
    apart = np.linalg.norm(circle[:, None] + (0.5, 0, 0) - found.points, axis=2).min(axis=1)
    assert apart.max() < 0.2  # a piece is an eighth of a quarter circle long
    for k in range(len(found.contacts)):
        for element, offset in zip(found.contacts[k], ((0, 0, 0), (1.0, 0, 0)), strict=True):
            one = ParametricSurface([_alone(SPHERE, element)])
            near = engine.closest_points(one, HERE, found.points[k : k + 1] - offset)
            assert near.upper[0] < 4e-12
    # The normal is that of the sphere along which the pieces part sooner.
    outward = found.points, found.points - (1.0, 0.0, 0.0)
    same = [np.abs((found.normals * each).sum(axis=1) - 1.0) < 1e-9 for each in outward]
    other = np.abs((found.normals * outward[1]).sum(axis=1) + 1.0) < 1e-9
    assert (same[0] | other).all()
    manifold = engine.distance(SPHERE, HERE, SPHERE, pose_b, manifold=True)
    assert manifold.status is Status.INTERSECTING
    assert len(manifold.manifold) >= len(found.contacts)
    apart = engine.collide(SPHERE, HERE, SPHERE, moved(2.001), all_contacts=True)
    assert apart.complete
    assert len(apart.contacts) == 0


def _alone(surface, patch):
    net = surface.nets[patch]
    return Patch(net.control, weights=net.weights)


def test_what_coincides_touches_in_each_piece_and_its_neighbours():
    a = bumps(1)
    found = engine.collide(a, HERE, a, HERE, all_contacts=True)
    # Along seven spans, each piece touches itself and two neighbours, one at either end.
    beside = [3 * 7 * parts - 2 for parts in a._hierarchy.parts[0]]
    assert len(found.contacts) == beside[0] * beside[1]
    assert found.complete


@pytest.mark.long
def test_contacts_that_a_budget_cuts_go_on_to_the_same_end():
    whole = engine.collide(TORUS, HERE, TORUS, moved(1.0, 0.0, 0.1), all_contacts=True)
    assert whole.complete
    assert not engine.collide(TORUS, HERE, TORUS, moved(1.0, 0.0, 0.1)).contacts[1:].size
    pair, found = engine.Pair(TORUS, TORUS), []
    while not found or not found[-1].complete:
        found.append(pair.collide(HERE, moved(1.0, 0.0, 0.1), all_contacts=True, budget_s=0.0))
        assert len(found) < 10_000
    assert len(found) > 3
    known = [set(map(tuple, each.contacts.tolist())) for each in found]
    assert known[-1] == set(map(tuple, whole.contacts.tolist()))
    assert all(one <= other for one, other in itertools.pairwise(known))  # none is lost


def test_triangles_and_pieces_that_meet():
    """A box through a square: each triangle that meets it has a contact, in either order."""
    cube = box((0.3, 0.3, 0.3))
    pose = moved(0.52, 0.49, 0.02)
    found = engine.collide(SQUARE, HERE, cube, pose, all_contacts=True)
    turned = engine.collide(cube, pose, SQUARE, HERE, all_contacts=True)
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    sheet = engine.TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]])
    truth = engine.collide(sheet, HERE, cube, pose, all_contacts=True)
    assert found.complete
    assert set(found.contacts[:, 1]) == set(turned.contacts[:, 0]) == set(truth.contacts[:, 1])
    assert np.abs(found.points[:, 2]).max() < 1e-12
    inside = np.abs(found.points[:, :2] - (0.52, 0.49)).max(axis=1)
    assert np.allclose(inside, 0.15, atol=1e-12)
    assert np.allclose(np.linalg.norm(found.normals, axis=1), 1.0)


def test_contacts_of_what_loops_leave():
    """A pin touches the edge of a hole on one side. There are no contacts inside the hole."""
    pin = ParametricSurface(revolved(np.array([[1.9, -3.0], [1.9, 3.0]]), np.ones(2)))
    found = engine.collide(PLATE, HERE, pin, moved(CENTRE[0] + 0.3, CENTRE[1]), all_contacts=True)
    assert len(found.contacts)
    away = found.points[:, :2] - CENTRE
    assert (np.linalg.norm(away, axis=1) >= RADIUS - 1e-9).all()
    assert np.allclose(np.linalg.norm(away - (0.3, 0.0), axis=1), 1.9, atol=1e-9)
    assert np.abs(found.points[:, 2]).max() < 1e-12
    # The pin's circle lies beyond the hole's edge at smaller angles than this.
    reach = math.acos((RADIUS**2 - 1.9**2 - 0.3**2) / (2 * 1.9 * 0.3))
    angle = np.abs(np.arctan2(away[:, 1], away[:, 0] - 0.3))
    assert angle.max() == pytest.approx(reach, abs=0.2)
    assert found.complete


def test_balls_touch_all_pieces_that_they_reach():
    ball = engine.points([[0.5, 0.5, 0.3]], radius=0.5)
    found = engine.collide(SQUARE, HERE, ball, HERE, all_contacts=True)
    begin = np.arange(8) / 8.0  # the square is cut into eight by eight pieces
    away = np.maximum(np.maximum(begin - 0.5, 0.5 - (begin + 0.125)), 0.0)
    assert len(found.contacts) == (np.hypot(*np.meshgrid(away, away)) <= 0.4).sum()
    assert found.complete
