"""Two solids of revolution: fat arcs hold the profile, and searches over the arcs are right."""

import itertools
import math
from importlib.resources import files

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose, translation
from test_revolution import ball, cylinder, torus, vase

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution, Status

TURNED = np.diag([1.0, -1.0, -1.0, 1.0])


def wavy(degree, rational, seed=0, count=14):
    """Return a solid whose profile has random bumps and runs from the axis back to the axis."""
    rng = np.random.default_rng(seed)
    rho = rng.uniform(0.2, 0.6, count)
    rho[[0, -1]] = 0.0
    knots = np.concatenate(
        (np.zeros(degree + 1), np.arange(1, count - degree), np.full(degree + 1, count - degree))
    )
    weights = np.exp(rng.uniform(-1.0, 1.0, count)) if rational else None
    return SolidOfRevolution(
        [Curve(np.column_stack((rho, np.linspace(0.0, 1.5, count))), knots, weights)]
    )


def patches(solid):
    """Return the solid as a surface of patches. A search then knows neither profile nor axis."""
    return engine.ParametricSurface.of(
        solid.nets, name=solid.name, deviation=solid.deviation, solid=None
    )


SOLIDS = {
    "vase": vase(),
    "torus": torus(1.0, 0.3),
    "thin ring": torus(1.0, 1e-4),
    "ball": ball(0.5),
    "cylinder": cylinder(0.4, 1.0),
    "wavy": wavy(3, rational=False),
    "rational": wavy(2, rational=True, seed=1),
    "many spans": wavy(3, rational=False, seed=2, count=203),
    "degree 7": wavy(7, rational=True, seed=3),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_arcs_hold_the_profile(name):
    """No point of a part is farther from its arc than the arc's error; derivative limits hold."""
    solid = SOLIDS[name]
    hierarchy = solid._hierarchy
    shares = np.linspace(0.0, 1.0, 17)
    chosen = np.random.default_rng(0).permutation(len(hierarchy.arcs))[:60]
    for arc in hierarchy.arcs[[0, *chosen]]:
        inside = range(len(hierarchy.curves)) if arc["curve"] < 0 else [arc["curve"]]
        if arc["curve"] < 0 and arc != hierarchy.arcs[0]:
            continue
        held = [_points(solid, hierarchy.curves[k], arc, shares, 0)[:, 0] for k in inside]
        assert _from_arc(arc, np.concatenate(held)).max() <= arc["error"]
        if arc["curve"] >= 0:
            wider = np.linspace(-0.5, 1.5, 33)
            found = _points(solid, hierarchy.curves[arc["curve"]], arc, wider, 3)
            lengths = np.linalg.norm(found[:, 1:], axis=2)
            assert (lengths <= arc["limits"] * (1.0 + 1e-6) + 1e-12).all()
    assert (
        hierarchy.arcs["error"][hierarchy.arcs["child"] < 0].max() <= 1.01e-5 * solid.profile.size
    )


def _points(solid, curve, arc, shares, order):
    """Return points and derivatives (k, order + 1, 2) of a part of a piece, by its parameter."""
    t = arc["low"] + shares * (arc["high"] - arc["low"])
    t = np.clip(t, 0.0, 1.0)
    width = curve["high"] - curve["low"]
    # Stay off knots, at which the derivatives may be those of the next piece.
    at = curve["low"] + np.clip(t, 1e-9, 1.0 - 1e-9) * width
    net = solid.profile.nets[curve["patch"]]
    found = net.derivatives(at, np.zeros(len(at)), order)[:, :, 0, :2]
    return found * width ** np.arange(order + 1)[:, None]


def _from_arc(arc, points):
    """Return how far points are from an arc, metres, within the angle between the arc's ends."""
    half = np.hypot(*arc["half"])
    if half == 0.0:
        return np.hypot(*(points - arc["middle"]).T)
    along = arc["half"] / half
    across = np.array([-along[1], along[0]])
    x, y = (points - arc["middle"]) @ along, (points - arc["middle"]) @ across
    if arc["sine"] == 0.0:
        return np.hypot(np.maximum(np.abs(x) - half, 0.0), y)
    radius = half / abs(arc["sine"])
    y = np.sign(arc["sine"]) * y + radius * arc["cosine"]
    ends = np.hypot(np.abs(x) - half, y - radius * arc["cosine"])
    within = np.abs(x) * arc["cosine"] <= y * abs(arc["sine"])
    return np.where(within, np.abs(np.hypot(x, y) - radius), ends)


@pytest.mark.long
@pytest.mark.parametrize(("one", "other"), list(itertools.combinations_with_replacement(SOLIDS, 2)))
def test_as_their_patches(one, other):
    """Random poses in either order: near, far and crossing. The oracle is the solids' patches."""
    a, b = SOLIDS[one], SOLIDS[other]
    rng = np.random.default_rng(len(one) + 7 * len(other))
    for place in (0.2, 0.8, 1.6, 6.0):
        at_a, at_b = pose(rng), pose(rng, place)
        expected = engine.distance(patches(a), at_a, patches(b), at_b)
        for found in (
            engine.distance(a, at_a, b, at_b),
            engine.distance(b, at_b, a, at_a),
            engine.distance(a, at_a, b, at_b, rel_err=1e-3),
        ):
            assert found.lower <= expected.upper + 1e-12
            assert found.upper >= expected.lower - 1e-12
        close = engine.distance(a, at_a, b, at_b)
        assert close.upper - close.lower <= 1e-10 * (1.0 + close.upper)
        gap = np.linalg.norm(close.point_a - close.point_b)
        assert abs(gap - close.upper) < 1e-10


def test_continua_and_poles():
    """If whole circles or whole spheres are nearest, bounds still meet, and are never wrong."""
    ring, wide = torus(1.0, 0.3), torus(2.0, 0.2)
    for a, b, at, expected, width in (
        (ring, wide, IDENTITY, 0.5, 1e-11),  # concentric
        (ring, ring, translation(0, 0, 1.0), 0.4, 1e-11),  # coaxial
        (ball(0.5), ring, IDENTITY, 0.2, 1e-11),
        (ball(0.5), ball(0.25), IDENTITY, 0.25, 1e-11),  # nested: nearest in every direction
        (cylinder(0.4, 1.0), cylinder(0.3, 1.0), translation(1.0, 0, 0), 0.3, 1e-11),  # parallel
        (cylinder(0.4, 1.0), cylinder(0.4, 1.0), translation(0, 0, 1.25), 0.25, 1e-11),  # faces
        (vase(), ball(0.1), translation(0, 0, -0.35), 0.25, 1e-11),  # pole to pole
        (ball(0.5), ball(0.5), TURNED @ translation(0, 0, 1.0 + 1e-12), 1e-12, 2e-12),
    ):
        found = engine.distance(a, IDENTITY, b, at)
        assert found.lower <= expected + 1e-15 and found.upper >= expected - 1e-12
        assert found.upper - found.lower < width


@pytest.mark.parametrize("gap", [1e-2, 1e-6, 1e-10, 0.0, -1e-6])
def test_interlocked_and_near_contact(gap):
    """Two interlocked rings nearly touch on their inner sides."""
    ring = torus(1.0, 0.3)
    at = np.eye(4)
    at[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    at[0, 3] = 1.4 - gap
    expected = engine.distance(patches(ring), IDENTITY, patches(ring), at)
    found = engine.distance(ring, IDENTITY, ring, at)
    assert found.lower <= expected.upper + 1e-12 and found.upper >= expected.lower - 1e-12
    assert found.upper - found.lower <= 1e-10


def test_straight_pieces_in_a_row():
    """Several pieces form one straight line, but a search for nearest points looks at one piece."""
    models = files("proximity_monitor.scene") / "bundled" / "chess" / "models"
    table = engine.load(models / "table.json")
    pair = engine.Pair(table, table)
    pair.distance(IDENTITY, translation(100.0, 0.0, 0.0))
    at = np.eye(4)
    at[:3] = [
        [0.01584110206802403, -0.9198458152960557, -0.3919601198688521, 56.21622507403139],
        [0.7206425818886372, 0.282249237163882, -0.6332532173540737, 52.946058187186296],
        [0.6931257668375557, -0.2724317239286587, 0.667351202248943, 72.96456904338966],
    ]
    assert pair.distance(IDENTITY, at, abs_err=0.076).bound_tests < 2000


@pytest.mark.parametrize("name", ["torus", "thin ring", "cylinder"])
@pytest.mark.parametrize("tipped", ["rational", "degree 7"])
def test_where_a_profile_ends_on_the_axis(name, tipped):
    """A tip on the axis lies in all sectors, so no sector is farther away than another."""
    a, b = SOLIDS[name], SOLIDS[tipped]
    rng = np.random.default_rng(1)
    for _ in range(25):
        way = rng.normal(size=3)
        at = pose(rng)
        tip = at[:3, :3] @ (0.0, 0.0, 1.5 if way @ at[:3, 2] < 0.0 else 0.0)
        at[:3, 3] = a.centre + rng.uniform(1.0, 1.4) * a.radius * way / np.linalg.norm(way) - tip
        found = engine.distance(a, IDENTITY, b, at)
        assert found.status in (Status.EXACT, Status.INTERSECTING)
        assert found.bound_tests < 6000


@pytest.mark.parametrize("name", ["torus", "ball", "cylinder", "rational", "degree 7"])
def test_one_direction_proves_a_rough_answer(name):
    """If both bulge towards each other, nothing is divided: the first guess is the nearest pair."""
    at = translation(3.0, 0.2, 0.1)
    rough = engine.distance(SOLIDS["vase"], IDENTITY, SOLIDS[name], at, abs_err=1e-2)
    exact = engine.distance(SOLIDS["vase"], IDENTITY, SOLIDS[name], at)
    assert rough.bound_tests == 1
    assert rough.lower <= exact.upper and exact.lower <= rough.upper
    assert abs(rough.upper - exact.upper) < 1e-12


def test_ratios_of_size():
    """A tiny ball beside a huge torus, near the origin and far from it."""
    large, small = torus(1000.0, 300.0), ball(1e-3)
    at = translation(1300.5, 0, 0)
    found = engine.distance(large, IDENTITY, small, at)
    assert found.lower <= 0.499 <= found.upper
    assert found.upper - found.lower < 1e-8
    far = translation(1e5, -1e5, 1e5)
    moved = engine.distance(large, far, small, far @ at)
    assert moved.lower <= 0.499 + 1e-9 and moved.upper >= 0.499 - 1e-9


def test_cut_and_resumed():
    """A search that is cut again and again ends with the same answer. Its bounds always hold."""
    a, b = SOLIDS["vase"], SOLIDS["wavy"]
    at = pose(np.random.default_rng(5), 1.3)
    whole = engine.distance(a, IDENTITY, b, at)
    pair = engine.Pair(a, b)
    for _ in range(10_000):
        found = pair.distance(IDENTITY, at, budget_s=0.0)
        assert found.lower <= whole.upper and found.upper >= whole.lower
        if found.status is not Status.OUT_OF_TIME:
            break
    assert found.status is Status.EXACT
    assert abs(found.upper - whole.upper) < 1e-12


def test_all_questions():
    """Questions that list nearest pairs search the patches. One pair's memory serves both kinds."""
    a, b = SOLIDS["vase"], ball(0.5)
    at = translation(1.5, 0, 0.4)
    pair = engine.Pair(a, b)
    exact = pair.distance(IDENTITY, at)
    assert pair.within(IDENTITY, at, exact.upper + 1e-6).within
    assert not pair.within(IDENTITY, at, exact.lower - 1e-6).within
    assert not pair.collide(IDENTITY, at).colliding
    listed = pair.distance(IDENTITY, at, manifold=True)
    assert abs(listed.upper - exact.upper) < 1e-10
    again = pair.distance(IDENTITY, at)
    assert again.feature_a.kind == "profile" and abs(again.upper - exact.upper) < 1e-12
    crossing = pair.collide(IDENTITY, translation(0.7, 0, 0.4), all_contacts=True)
    assert crossing.colliding
    many = engine.distances(a, np.tile(IDENTITY, (5, 1, 1)), b, np.tile(at, (5, 1, 1)))
    assert np.abs(many.upper - exact.upper).max() < 1e-10
    bodies = engine.Assembly([a, b, SOLIDS["torus"], engine.points([[0.7, 0, 3]], radius=0.1)])
    places = np.stack([IDENTITY, at, translation(-2.0, 0, 0), IDENTITY])
    pairs = list(itertools.combinations(range(4), 2))
    together = bodies.distances(places, pairs)
    for k, (i, j) in enumerate(pairs):
        alone = engine.distance(bodies.models[i], places[i], bodies.models[j], places[j])
        assert abs(together.upper[k] - alone.upper) < 1e-9
    signed = bodies.distances(places, pairs, signed=True)
    assert np.abs(signed.upper - together.upper).max() < 1e-9


def test_coherent_and_deforming():
    """Along a path of poses and shapes, each answer is that of a fresh search."""
    a, b = vase(), torus(0.8, 0.2)
    pair = engine.Pair(a, b)
    shapes = [vase(0.6 + 0.05 * k).control_points for k in range(3)]
    for k in range(30):
        if k % 5 == 0:
            a.deform(shapes[(k // 5) % 3])
        at = translation(0.05 * k, 0.3, 1.0 - 0.1 * k)
        turn = 0.1 * k
        at[1:3, 1:3] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
        found, fresh = pair.distance(IDENTITY, at), engine.distance(a, IDENTITY, b, at)
        assert abs(found.upper - fresh.upper) < 1e-10
        assert found.lower <= fresh.upper and fresh.lower <= found.upper


@pytest.mark.parametrize("inner", [-0.2, -0.02, 0.0])
def test_control_points_beyond_the_axis(inner):
    """Only the curve must stay off the axis. Bounds are as close as if control points did, too."""
    bend = Curve([[0.3, 0.0], [0.6, 0.3], [inner, 0.5], [0.2, 0.9], [0.0, 0.9]])
    made = SolidOfRevolution([Curve([[0, 0], [0.3, 0]]), bend])
    rng = np.random.default_rng(8)
    for _ in range(4):
        at_a, at_b = pose(rng), pose(rng, 1.2)
        found = engine.distance(made, at_a, SOLIDS["vase"], at_b)
        expected = engine.distance(patches(made), at_a, patches(SOLIDS["vase"]), at_b)
        assert found.lower <= expected.upper + 1e-12
        assert found.upper >= expected.lower - 1e-12
        assert found.upper - found.lower <= 1e-11
        assert found.bound_tests < 500


def test_poses_that_leap_begin_anew():
    """After a leap, the elements that were nearest before say nothing about the new pose."""
    models = files("proximity_monitor.scene") / "bundled" / "chess" / "models"
    table, rng = engine.load(models / "table.json"), np.random.default_rng(4)
    size = np.abs(table.control_points).max()
    poses = np.array([pose(rng) for _ in range(100)])
    ways = rng.normal(size=(len(poses), 3))
    ways *= size * rng.uniform(0.8, 3.0, (len(poses), 1)) / np.linalg.norm(ways, axis=1)[:, None]
    poses[:, :3, 3] = ways
    here = np.tile(IDENTITY, (len(poses), 1, 1))
    alone = [engine.distance(table, IDENTITY, table, at, abs_err=1e-3 * size) for at in poses]
    found = engine.distances(table, here, table, poses, abs_err=1e-3 * size)
    tests = sum(each.bound_tests for each in alone)
    assert found.bound_tests.sum() < 1.5 * tests  # four times as many if they do not begin anew
    pair = engine.Pair(table, table, coherent=False)
    found = [pair.distance(IDENTITY, at, abs_err=1e-3 * size).bound_tests for at in poses]
    assert sum(found) < 2.5 * tests


@pytest.mark.parametrize("gap", [2e-13, 1e-13, 0.0, -1e-13])
def test_ends_that_lie_on_each_other(gap):
    """The gap is below the error allowed of an exact answer, so no lower bound is searched for."""
    a, b = cylinder(0.06, 0.088), cylinder(0.06, 0.272)
    at = pose(np.random.default_rng(0), 0.3)
    spin = translation(0, 0, 0.088 + gap)
    spin[:2, :2] = [[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]]
    found = engine.distance(a, at, b, at @ spin)
    assert found.status in (Status.EXACT, Status.INTERSECTING)
    assert found.lower == 0.0 and found.upper < 5e-13
    assert found.bound_tests < 1000
