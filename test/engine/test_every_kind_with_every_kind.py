"""Each kind against each kind: near, crossing, touching, almost so, about one axis, far away.

The first oracle is tessellations. Their `deviation` is their tolerance, so their bounds hold for
the models themselves. The second is samples of the tessellations, which no engine searches. Other
tests compare meshes with exact arithmetic.
"""

import itertools
import zlib

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, rotation
from scipy.spatial import cKDTree

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ParametricSurface, Patch, SolidOfRevolution, Status

TOLERANCE = 2e-4
RADIUS, LENGTH = 0.02, 0.1
WALL = np.array([[0.03, 0.0], [0.05, 0.04], [0.02, 0.1]])
BENT = np.array([[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.1, 0.1, 0.1]])
AXIS = [[0.0, 0.0, -0.5 * LENGTH], [0.0, 0.0, 0.5 * LENGTH]]
PLACES = {"random": 0.12, "crossing": 0.02, "far": 20.0}
HEIGHTS = {"concentric": 0.0, "higher": 0.03, "on top": 0.25}
SPACING = 6e-3


def bowl():
    """Return an open patch."""
    x, y = np.meshgrid(*2 * [np.linspace(-0.05, 0.05, 4)], indexing="ij")
    return ParametricSurface([Patch(np.stack((x, y, 8.0 * (x * x + y * y)), axis=2))])


MODELS = {
    "mesh": box((0.1, 0.08, 0.06)),
    "surface": bowl(),
    "revolution": SolidOfRevolution(
        [Curve(each) for each in ([[0, 0], WALL[0]], WALL, [WALL[-1], [0, 0.1]])]
    ),
    "rounded": engine.polyline(AXIS, radius=RADIUS),
    "curve": ParametricSurface([Curve(BENT)]),
    "polyline": engine.polyline(BENT),
    "points": engine.points(BENT),
}


def bezier(control, count):
    """Return points of a curve of degree 2, at equal steps of its parameter."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    return (1 - t) ** 2 * control[0] + 2 * t * (1 - t) * control[1] + t**2 * control[2]


def lathe(profile, around=48):
    """Return a closed mesh of a profile (n, 2) that runs from the axis to the axis."""
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    rho, z = np.asarray(profile)[1:-1].T
    rings = np.stack(
        (np.outer(rho, np.cos(turn)), np.outer(rho, np.sin(turn)), np.tile(z[:, None], around)), 2
    )
    vertices = [*rings.reshape(-1, 3), [0, 0, profile[0][1]], [0, 0, profile[-1][1]]]
    low, high = len(vertices) - 2, len(vertices) - 1
    faces = []
    for j, k in zip(range(around), np.roll(range(around), -1), strict=True):
        last = (len(rho) - 1) * around
        faces += [[low, k, j], [last + j, last + k, high]]
        for row in range(0, last, around):
            faces += [[row + j, row + k, row + around + k]]
            faces += [[row + j, row + around + k, row + around + j]]
    return engine.TriangleMesh(np.array(vertices), faces, deviation=TOLERANCE, solid=True)


def capsule():
    """Return points of a capsule's profile, whose chords err by less than the tolerance."""
    angle = np.linspace(-0.5 * np.pi, 0.0, 9)
    below = RADIUS * np.stack((np.cos(angle), np.sin(angle)), axis=1) - [0, 0.5 * LENGTH]
    below[0, 0] = 0.0
    return np.concatenate((below, below[::-1] * [1, -1]))


def shown(model):
    mesh = model.display_mesh(TOLERANCE)
    return engine.TriangleMesh(mesh.vertices, mesh.faces, deviation=TOLERANCE, solid=False)


TESSELLATED = MODELS | {
    "surface": shown(MODELS["surface"]),
    "curve": shown(MODELS["curve"]),
    "revolution": lathe([[0, 0], *bezier(WALL, 12), [0, 0.1]]),
    "rounded": lathe(capsule()),
}
"""Meshes within the tolerance of the models."""

NAMES = list(itertools.product(MODELS, MODELS))

CORES = TESSELLATED | {"rounded": engine.polyline(AXIS)}
"""For `distance`: a capsule, inside included, is as near as its axis minus the radius."""


def samples(mesh):
    """Return points (n, 3) of a mesh. Each of its points is within SPACING of one of them."""
    found = []
    for corners in mesh.vertices[mesh.faces]:
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max()
        count = int(np.ceil(longest / SPACING)) + 1
        u, v = np.meshgrid(*2 * [np.linspace(0.0, 1.0, count)])
        u, v = u[u + v <= 1.0 + 1e-9], v[u + v <= 1.0 + 1e-9]
        found.append(np.stack((1.0 - u - v, u, v), axis=1) @ corners)
    return np.unique(np.concatenate(found), axis=0)


SAMPLES = {name: samples(mesh) for name, mesh in CORES.items()}
TREES = {name: cKDTree(points) for name, points in SAMPLES.items()}


def sampled_distance(names, pose_a, pose_b):
    """Return the distance of the samples."""
    placed = SAMPLES[names[1]] @ pose_b[:3, :3].T + pose_b[:3, 3]
    return TREES[names[0]].query((placed - pose_a[:3, 3]) @ pose_a[:3, :3])[0].min()


def test_tessellations_are_as_near_as_they_say():
    for name in ("surface", "curve", "revolution", "rounded"):
        mesh, here = TESSELLATED[name], np.eye(4)
        assert mesh.is_solid == MODELS[name].is_solid
        corners = mesh.vertices[mesh.faces]
        inner = [
            corners.mean(axis=1),
            *(0.5 * (corners[:, i] + corners[:, i - 1]) for i in range(3)),
        ]
        far = engine.closest_points(MODELS[name], here, np.concatenate(inner), signed=True)
        assert np.abs(far.lower).max() < TOLERANCE


def check(found, lower, upper):
    """Check that two pairs of bounds of one number overlap."""
    assert found.lower <= found.upper
    assert found.lower <= upper + 1e-12
    assert found.upper >= lower - 1e-12


def ask_all(a, pose_a, b, pose_b):
    """Return the distance; check that `within`, `collide` and the witness points agree with it."""
    found = engine.distance(a, pose_a, b, pose_b, budget_s=10.0)
    assert 0.0 <= found.lower <= found.upper
    if found.status is Status.EXACT:
        assert found.upper - found.lower <= 1e-11
    if found.upper > 0.0:
        apart = np.linalg.norm(found.point_a - found.point_b)
        assert abs(apart - found.upper) <= 1e-12
    assert engine.within(a, pose_a, b, pose_b, found.upper).within
    if found.lower > 1e-10:
        assert not engine.within(a, pose_a, b, pose_b, found.lower - 1e-10).within
    touch = engine.collide(a, pose_a, b, pose_b).colliding
    assert touch or found.upper > 0.0
    assert not (touch and found.lower > 1e-11)
    return found


def seeded(names, seed=""):
    """Return the random numbers of a pair, the same in each run."""
    return np.random.default_rng(zlib.crc32((" ".join(names) + seed).encode()))


def check_all(names, pose_a, pose_b):
    """Compare every answer about a pair with those about its tessellations; return the distance."""
    a, b = (MODELS[name] for name in names)
    core_a, core_b = (CORES[name] for name in names)
    radii = RADIUS * names.count("rounded")
    found = ask_all(a, pose_a, b, pose_b)
    about = engine.distance(core_a, pose_a, core_b, pose_b)
    check(found, max(about.lower - radii, 0.0), max(about.upper - radii, 0.0))
    sampled = sampled_distance(names, pose_a, pose_b) - radii
    off = core_a.deviation + core_b.deviation
    check(found, sampled - off - 2.0 * SPACING, max(sampled + off, 0.0))
    signed = engine.signed_distance(a, pose_a, b, pose_b)
    about = engine.signed_distance(*(
        each for name, at in zip(names, (pose_a, pose_b), strict=True)
        for each in (TESSELLATED[name], at)
    ))  # fmt: skip
    check(signed, about.lower, about.upper)
    if signed.upper < 0.0 and signed.status is not Status.OUT_OF_TIME:
        assert signed.upper - signed.lower <= 0.0101 * -signed.lower + 1e-11
    return found


@pytest.mark.parametrize("names", NAMES, ids=" and ".join)
def test_as_near_and_as_deep_as_a_tessellation(names):
    rng = seeded(names)
    for place in PLACES.values():
        pose_a, pose_b = pose(rng, 0.05), np.eye(4)
        pose_b[:3, :3] = rotation(rng)
        way = rng.normal(size=3)
        pose_b[:3, 3] = pose_a[:3, 3] + place * way / np.linalg.norm(way)
        check_all(names, pose_a, pose_b)


def about_one_axis(names, pose_a, height, angle, upside_down):
    """Return a pose of the second model with the z axis of the first; 0 in height is its centre."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turn = turn @ np.diag([1.0, -1.0, -1.0]) if upside_down else turn
    made, (low, high) = np.eye(4), (MODELS[name].centre[2] for name in names)
    made[:3, :3], made[2, 3] = turn, low + height - turn[2, 2] * high
    return pose_a @ made


@pytest.mark.parametrize("names", NAMES, ids=" and ".join)
def test_about_one_axis(names):
    """The nearest points of solids of revolution are then whole circles, of boxes whole faces."""
    rng = seeded(names)
    for height in HEIGHTS.values():
        for upside_down in (False, True):
            pose_a = pose(rng, 0.05)
            pose_b = about_one_axis(names, pose_a, height, rng.uniform(0.0, 6.3), upside_down)
            found = check_all(names, pose_a, pose_b)
            assert found.upper - found.lower <= 1e-5
            if height < HEIGHTS["on top"]:
                continue
            # Move the second model until it touches the first: the distance shrinks by no more.
            assert found.status is Status.EXACT and found.lower > 0.01
            pose_b[:3, 3] += found.point_a - found.point_b
            touching = check_all(names, pose_a, pose_b)
            assert touching.lower <= 1e-15 and touching.upper <= 1e-11
            a, b = (MODELS[name] for name in names)
            assert engine.within(a, pose_a, b, pose_b, 1e-10).within


def almost_touching(names, gap, seed=""):
    """Return poses of two models about `gap` apart, and a lower bound of their distance.

    The second model is moved towards the first along the line of the nearest points. The distance
    shrinks by at most that motion. `gap`, up to rounding, is an upper bound.
    """
    a, b = (MODELS[name] for name in names)
    rng = seeded(names, seed)
    pose_a, pose_b = pose(rng, 0.05), pose(rng)
    way = rng.normal(size=3)
    pose_b[:3, 3] = pose_a[:3, 3] + 0.25 * way / np.linalg.norm(way)
    start = engine.distance(a, pose_a, b, pose_b)
    line = start.point_a - start.point_b
    length = np.linalg.norm(line)
    assert start.status is Status.EXACT and length > 0.01
    pose_b[:3, 3] += line * (1.0 - gap / length)
    return pose_a, pose_b, start.lower - (length - gap) - 1e-15


@pytest.mark.parametrize("names", NAMES, ids=" and ".join)
@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-11])
def test_almost_touching(names, gap):
    a, b = (MODELS[name] for name in names)
    pose_a, pose_b, least = almost_touching(names, gap)
    found = ask_all(a, pose_a, b, pose_b)
    check(found, least, gap + 1e-15)
    assert found.status is Status.EXACT
    assert found.upper - found.lower <= 1e-12
    assert found.bound_tests < 20_000
    assert engine.within(a, pose_a, b, pose_b, 1.001 * gap + 1e-11).within
    assert not engine.within(a, pose_a, b, pose_b, 0.4 * gap).within
    assert not engine.collide(a, pose_a, b, pose_b).colliding
    check(engine.signed_distance(a, pose_a, b, pose_b), least, gap + 1e-15)


def test_an_edge_almost_touches_a_bulging_solid():
    """A plane between the two proves the answers, also beside a corner of the profile."""
    a, b = (MODELS[name] for name in ("mesh", "revolution"))
    for seed in ("92", "392", "715", "932", "1001", "1187", "1393"):
        pose_a, pose_b, least = almost_touching(("mesh", "revolution"), 1e-11, seed)
        for share in (0.1, 0.4, 0.9):
            found = engine.within(a, pose_a, b, pose_b, share * 1e-11)
            assert not found.within and found.bound_tests < 1000
        found = engine.distance(a, pose_a, b, pose_b)
        check(found, least, 1.001e-11)
        assert found.status is Status.EXACT and found.bound_tests < 1000


@pytest.mark.parametrize("names", [("mesh", "curve"), ("revolution", "polyline")], ids=" and ".join)
@pytest.mark.parametrize("gap", [1e-9, 1e-11])
def test_almost_touching_where_elements_join(names, gap):
    """At edges between triangles, and at the ring where the profile has a corner."""
    for seed in map(str, range(8)):
        a, b = (MODELS[name] for name in names)
        pose_a, pose_b, _ = almost_touching(names, gap, seed)
        found = engine.distance(a, pose_a, b, pose_b, budget_s=10.0)
        assert found.status is Status.EXACT
        assert found.bound_tests < 2000


CUBE = engine.shapes.box((0.2, 0.2, 0.2))


@pytest.mark.parametrize(
    ("model", "distance", "signed"),
    [
        (CUBE, 0.1, -0.1),
        (engine.shapes.cylinder(0.1, 0.4), 0.1, -0.1),
        (engine.shapes.sphere(0.1), 0.0, -0.1),
        (engine.shapes.capsule(0.1, 0.4), 0.0, -0.1),
        (engine.TriangleMesh(CUBE.vertices, CUBE.faces, radius=0.02), 0.08, -0.12),
    ],
    ids=["box", "cylinder", "ball", "capsule", "swept box"],
)
def test_what_lies_inside_is_as_far_from_what_a_model_consists_of(model, distance, signed):
    """A model is its boundary, or all that is near a core: see the table in docs/models.md."""
    middle = engine.points([[0.0, 0.0, 0.0]])
    found = engine.distance(model, IDENTITY, middle, IDENTITY)
    assert found.upper == pytest.approx(distance, abs=1e-12)
    assert engine.collide(model, IDENTITY, middle, IDENTITY).colliding is (distance == 0.0)
    deep = engine.signed_distance(model, IDENTITY, middle, IDENTITY, depth_err=1e-6)
    assert deep.lower <= signed + 1e-12
    assert deep.upper == pytest.approx(signed, rel=1e-5)
    nearest = engine.closest_points(model, IDENTITY, [[0.0, 0.0, 0.0]], signed=True)
    assert nearest.upper[0] == pytest.approx(signed, abs=1e-12)
