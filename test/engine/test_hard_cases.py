"""Meshes that are hard for floating point, against exact arithmetic, and FCL if it is accurate.

Single triangles are in `test_triangles`. Every case runs with every kind of bounding volume and in
every order of search, and every kind of volume runs in every order. Not every triple runs: volumes
and order affect each other only through the bounds of a case.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from engine_bodies import (
    IDENTITY,
    ORDERS,
    SMALL,
    VOLUMES,
    Fcl,
    box,
    covering,
    of,
    plate,
    pose,
    sphere,
    torus,
    translation,
)
from engine_oracles import (
    exact_mesh_distance,
    exact_soup_distance,
    exact_squared_distance,
    magnitude,
    root,
    triangles,
)

from proximity_monitor import engine
from proximity_monitor.engine import Status

ACCURACY = 4e-15
"""Share of the larger model's coordinates by which a bound may differ from the exact distance."""

Question = tuple[engine.TriangleMesh, np.ndarray, engine.TriangleMesh, np.ndarray]

CUBE = box((1.0, 1.0, 1.0))


def scaled(mesh: engine.TriangleMesh, *factors: float) -> engine.TriangleMesh:
    return engine.TriangleMesh(mesh.vertices * factors, mesh.faces, name=mesh.name)


def together(rng: np.random.Generator, a, b, relative) -> Question:
    """Return both models moved by a common motion, and b by `relative` before that."""
    common = pose(rng, 1.0)
    return a, common, b, common @ relative


def apart_by(gap: float, a, pose_a, b, pose_b) -> Question:
    """Move b towards a, along their shortest connection, until `gap` is left."""
    for _ in range(20):
        found = engine.distance(a, pose_a, b, pose_b)
        way = found.point_a - found.point_b
        pose_b = pose_b.copy()
        pose_b[:3, 3] += way * (1.0 - gap / np.linalg.norm(way))
    return a, pose_a, b, pose_b


def flat_fan(slices: int = 12, thickness: float = 1e-8) -> engine.TriangleMesh:
    """Return slivers around a point, each a hundred million times as long as wide."""
    angles = thickness * np.arange(slices + 1)
    rim = np.column_stack((np.cos(angles), np.sin(angles), angles * angles))
    faces = [[0, k, k + 1] for k in range(1, slices + 1)]
    return engine.TriangleMesh(np.concatenate(([[0.0, 0.0, 0.0]], rim)), faces, name="fan")


def crumbs() -> engine.TriangleMesh:
    """Return triangles, segments and points; triangles repeat corners or have them on a line."""
    rng = np.random.default_rng(21)
    vertices = rng.normal(size=(30, 3))
    vertices[20:] = 0.5 * (vertices[:10] + vertices[10:20])
    k = np.arange(10)
    faces = np.concatenate(
        [
            np.column_stack((k, k, k)),
            np.column_stack((k, k + 10, k + 10)),
            np.column_stack((k, k + 10, k + 20)),
            np.column_stack((k, (k + 1) % 10, k + 10)),
        ]
    )
    return engine.TriangleMesh(vertices, faces, name="crumbs")


def _rng() -> np.random.Generator:
    return np.random.default_rng(22)


def _far(a, b) -> Question:
    a, pose_a, b, pose_b = together(_rng(), a, b, translation(1.5, 1.25, 0.75))
    for each in (pose_a, pose_b):
        each[:3, 3] += 1e8 * np.array([1.0, -0.7, 0.4])
    return a, pose_a, b, pose_b


def _needle_and_segment() -> Question:
    """Return a segment that ends far from a needle; only the segment's line meets the needle."""
    needle = np.array([[2.0**-94, 0.0, -(2.0**-94)], [1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]])
    other = np.array([[2.0, -4.0, 2.0], [0.1, -0.2, 0.1], [0.5, -1.0, 1.5]])
    face = [[0, 1, 2]]
    return engine.TriangleMesh(needle, face), IDENTITY, engine.TriangleMesh(other, face), IDENTITY


CASES: dict[str, Callable[[], Question]] = {
    "parallel plates": lambda: (plate(3), IDENTITY, plate(3), translation(0.1, 0.2, 0.125)),
    "parallel plates, turned": lambda: together(
        _rng(), plate(3), plate(3), translation(0.1, 0.2, 1e-3)
    ),
    "plates in one plane": lambda: (plate(3), IDENTITY, plate(3), translation(1.0 + 2.0**-40, 0.3)),
    "plates in one plane, turned": lambda: together(
        _rng(), plate(3), plate(3), translation(1.25, 0.3)
    ),
    "fans of slivers": lambda: together(
        _rng(), flat_fan(), flat_fan(), translation(0.2, 0.0, 1e-9)
    ),
    "slivers over a plate": lambda: together(
        _rng(), scaled(plate(3), 1.0, 1e-8, 1.0), plate(3), translation(0.3, -0.1, 0.2)
    ),
    "segments and points": lambda: (crumbs(), pose(_rng(), 2.0), SMALL["polyline"], IDENTITY),
    "segments and a torus": lambda: (crumbs(), pose(_rng(), 2.0), SMALL["torus"], IDENTITY),
    "needle and segment": _needle_and_segment,
    "gap of 1e-12": lambda: (CUBE, IDENTITY, CUBE, translation(1.0 + 1e-12, 0.3, 0.2)),
    "gap of 1e-12, turned": lambda: apart_by(
        1e-12, torus(8), pose(_rng()), box(), translation(2.0, 0.6, 0.7)
    ),
    "gap of 1e-13, turned": lambda: apart_by(
        1e-13, sphere(1), pose(_rng()), torus(8), translation(2.0, 1.6, 0.7)
    ),
    "a millionth in size": lambda: (
        scaled(torus(8), 1e-6), pose(_rng()), scaled(box(), 1e-6),
        translation(1.7e-6, 0.4e-6, 0.6e-6),
    ),
    "a million in size": lambda: (
        scaled(torus(8), 1e6), pose(_rng()), scaled(box(), 1e6), translation(1.7e6, 0.4e6, 0.6e6),
    ),
    "1e8 away from the origin": lambda: _far(torus(8), box()),
    "1e8 away from the origin, in contact": lambda: _far(torus(8), torus(8)),
    "a million times larger": lambda: (
        scaled(torus(8), 1e6), IDENTITY, torus(8), translation(1.3e6 + 2.0, 0.0, 1.0),
    ),
    "a million times smaller": lambda: together(
        _rng(), torus(8), scaled(sphere(1), 1e-6), translation(1.3, 2e-6, 1e-6)
    ),
    "1e30 times larger": lambda: (
        torus(8), pose(_rng()), scaled(box(), 1e30), translation(0.51e30, 0.2e30),
    ),
    "1e30 times smaller": lambda: together(
        _rng(), torus(8), scaled(sphere(1), 1e-30), translation(0.2, 0.3, 0.4)
    ),
    "boxes that share a vertex": lambda: (CUBE, IDENTITY, CUBE, translation(1.0, 1.0, 1.0)),
    "boxes that share an edge": lambda: (CUBE, IDENTITY, CUBE, translation(1.0, 0.0, 1.0)),
    "boxes that share a face": lambda: (CUBE, IDENTITY, CUBE, translation(0.0, 0.0, 1.0)),
    "edges that touch": lambda: (
        CUBE, IDENTITY, scaled(CUBE, 1.0, 1.0, 3.0), translation(1.0, 1.0),
    ),
    "vertex on a face": lambda: (
        CUBE, IDENTITY,
        engine.TriangleMesh([[0.5, 0.25, 0.125], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0]], [[0, 1, 2]]),
        IDENTITY,
    ),
    **{
        f"the same {name} twice": lambda mesh=mesh: together(_rng(), mesh, mesh, IDENTITY)
        for name, mesh in SMALL.items()
    },
}  # fmt: skip

TOUCHING = (
    "boxes that share a vertex", "boxes that share an edge", "boxes that share a face",
    "edges that touch", "vertex on a face",
)  # fmt: skip
"""Cases in contact, at a distance of exactly zero."""

FOLLOWED_BY_FCL = (
    "parallel plates", "parallel plates, turned", "plates in one plane",
    "plates in one plane, turned", "gap of 1e-12", "a million in size", "1e8 away from the origin",
)  # fmt: skip
"""Cases for which FCL errs by at most 1e-8 of the coordinates. For models of 1e-6 it errs by 5 % of
their size, and for slivers it is not accurate either."""


@cache
def question(name: str) -> tuple[Question, Fraction]:
    """Return a case and its exact squared distance."""
    a, pose_a, b, pose_b = CASES[name]()
    return (a, pose_a, b, pose_b), exact_mesh_distance(a, b, pose_b, pose_a)


def share_of(size: float, found: engine.Distance, squared: Fraction) -> float:
    """Return the error of the worse bound as a share of `size`; check that both bounds hold."""
    assert Fraction(found.lower) ** 2 <= squared <= Fraction(found.upper) ** 2
    exact = root(squared)
    error = float(max(Fraction(found.upper) - exact, exact - Fraction(found.lower)))
    return error / size


@pytest.mark.long
@pytest.mark.parametrize(("name", "volume", "order"), covering(CASES, VOLUMES, ORDERS))
def test_hard_case(name, volume, order):
    (a, pose_a, b, pose_b), squared = question(name)
    size = magnitude(a, b, pose_a, pose_b)
    first, second = of(a, volume), of(b, volume)
    found = engine.distance(first, pose_a, second, pose_b, order=order)
    error = share_of(size, found, squared)
    print(f"{name}, {volume}, {order}: the bounds err by at most {error:.2g} of the coordinates")
    assert error <= ACCURACY
    assert np.isfinite([found.point_a, found.point_b]).all()
    swapped = engine.distance(second, pose_b, first, pose_a, order=order)
    # The rotations are orthogonal only up to rounding, so b's frame is not quite a's.
    assert swapped.lower <= found.upper + ACCURACY * size
    assert found.lower <= swapped.upper + ACCURACY * size
    if squared == 0:
        assert found.status is Status.INTERSECTING
        assert engine.collide(first, pose_a, second, pose_b).colliding
    elif float(root(squared)) > 2.0 * ACCURACY * size:
        assert found.status is Status.EXACT
        assert found.lower > 0.0
        assert not engine.collide(first, pose_a, second, pose_b).colliding


@pytest.mark.parametrize("name", TOUCHING)
def test_contact_at_exactly_zero(name):
    (a, pose_a, b, pose_b), squared = question(name)
    assert squared == 0
    assert engine.within(a, pose_a, b, pose_b, 0.0).within
    found = engine.collide(a, pose_a, b, pose_b, all_contacts=True)
    assert set(map(tuple, found.contacts.tolist())) == {
        (i, j)
        for i, p in enumerate(triangles(a, pose_a).tolist())
        for j, q in enumerate(triangles(b, pose_b).tolist())
        if exact_squared_distance(p, q) == 0
    }


@pytest.mark.parametrize("exponent", [-290, -100, -76, -40, -6, 6, 15, 16, 30, 44])
def test_no_contact_is_missed_at_any_size(exponent):
    """The plane that cuts the model is 1e6 times larger, or as large as coordinates may be."""
    scale = 10.0**exponent
    a = scaled(torus(8), scale)
    far = min(1e6, 1e44 / scale) * scale
    corners = [[0.0, -far, -far], [0.0, far, -far], [0.0, far, far], [0.0, -far, far]]
    b = engine.TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]])
    for first, second in ((a, b), (b, a), (torus(8) if far > 1.0 else a, b)):
        expected = {
            (i, j)
            for i, p in enumerate(triangles(first).tolist())
            for j, q in enumerate(triangles(second).tolist())
            if exact_squared_distance(p, q) == 0
        }
        assert expected
        found = engine.collide(first, IDENTITY, second, IDENTITY, all_contacts=True)
        assert found.colliding
        assert expected <= set(map(tuple, found.contacts.tolist()))
        assert engine.closest_points(first, IDENTITY, second.vertices).upper.max() < 4.0 * far + 4.0


@pytest.mark.parametrize("name", SMALL)
def test_identical_models_at_identical_poses(name):
    """If the pose is turned, RᵀR is not quite the identity, and the exact distance is 1e-16."""
    mesh = SMALL[name]
    for spread in (None, 0.0, 1.0, 1e8):
        where = IDENTITY if spread is None else pose(_rng(), spread)
        found = engine.distance(mesh, where, mesh, where)
        assert found.status is Status.INTERSECTING
        assert found.lower == 0.0
        assert found.upper <= ACCURACY * magnitude(mesh, mesh)
        contacts = engine.collide(mesh, where, mesh, where, all_contacts=True).contacts
        assert {(i, i) for i in range(len(mesh.faces))} <= set(map(tuple, contacts.tolist()))


@pytest.mark.parametrize("name", ["gap of 1e-12", "gap of 1e-12, turned", "gap of 1e-13, turned"])
def test_tiny_gaps_are_seen(name):
    (a, pose_a, b, pose_b), squared = question(name)
    assert 0.5e-13 < float(root(squared)) < 2e-12
    assert not engine.collide(a, pose_a, b, pose_b).colliding
    assert not engine.within(a, pose_a, b, pose_b, 0.5e-13).within
    assert engine.within(a, pose_a, b, pose_b, 3e-12).within


@pytest.mark.parametrize("name", FOLLOWED_BY_FCL)
def test_fcl_agrees(name):
    (a, pose_a, b, pose_b), squared = question(name)
    size = magnitude(a, b, pose_a, pose_b) + float(np.abs(pose_a[:3, 3]).max())
    expected = float(root(squared))
    assert Fcl(a, b).distance(pose_a, pose_b) == pytest.approx(expected, abs=1e-8 * size)


def test_the_way_to_a_common_point_does_not_matter():
    """All slivers of both fans meet in one corner, and nowhere else."""
    a = flat_fan()
    b = engine.TriangleMesh(a.vertices * (-1.0, 1.0, 1.0), a.faces)
    for k in range(8):
        turn = pose(np.random.default_rng(k))
        found = engine.distance(a, turn, b, turn)
        assert found.lower == 0.0
        assert found.upper <= ACCURACY
        assert found.status is Status.INTERSECTING


def random_floats(seed: int, low: float, high: float, count: int = 14) -> engine.TriangleMesh:
    """Return triangles with coordinates whose exponents are random between `low` and `high`."""
    rng = np.random.default_rng(seed)
    shape = 3 * count, 3
    corners = rng.choice((-1.0, 1.0), shape) * 10.0 ** rng.uniform(low, high, shape)
    return engine.TriangleMesh(corners, np.arange(3 * count).reshape(-1, 3), name="floats")


@pytest.mark.parametrize("volume", VOLUMES)
@pytest.mark.parametrize(("low", "high"), [(-15, 15), (-45, 45), (-320, -290), (14, 44)])
def test_random_floats_of_all_magnitudes(low, high, volume):
    """Nothing crashes, hangs or becomes NaN, and even here the bounds hold."""
    rng = np.random.default_rng(31)
    for seed in range(3):
        a, b = random_floats(seed, low, high), random_floats(seed + 100, low, high)
        squared = floats_distance(seed, low, high)
        a, b = of(a, volume), of(b, volume)
        for order in ORDERS:
            found = engine.distance(a, IDENTITY, b, IDENTITY, order=order)
            assert Fraction(found.lower) ** 2 <= squared <= Fraction(found.upper) ** 2
            exact = root(squared)
            error = max(Fraction(found.upper) - exact, exact - Fraction(found.lower))
            # For almost vanishing coordinates, only the smallest possible margin remains.
            assert error <= ACCURACY * magnitude(a, b) + 2e-45
        turned = pose(rng, min(10.0**high, 1e44))
        found = engine.distance(a, turned, b, pose(rng))
        assert 0.0 <= found.lower <= found.upper < np.inf
        clearance = engine.within(a, turned, b, IDENTITY, found.upper)
        contacts = engine.collide(a, IDENTITY, b, IDENTITY, all_contacts=True).contacts
        nearest = engine.closest_points(a, turned, b.vertices)
        for numbers in (
            found.point_a, found.point_b, clearance.point_a, clearance.point_b,
            nearest.lower, nearest.upper, nearest.points,
        ):  # fmt: skip
            assert np.isfinite(numbers).all()
        assert (len(contacts) > 0) == engine.collide(a, IDENTITY, b, IDENTITY).colliding
        many = engine.distances(a, np.array([turned] * 3), b, np.array([IDENTITY] * 3))
        assert (many.lower <= many.upper).all()


@cache
def floats_distance(seed: int, low: float, high: float) -> Fraction:
    a, b = random_floats(seed, low, high), random_floats(seed + 100, low, high)
    return exact_soup_distance(a, b)
