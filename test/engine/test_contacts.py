"""Points and normals of contacts, against those that known shapes must give."""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, soup, sphere, translation
from engine_oracles import triangles

from proximity_monitor import engine


def test_a_corner_in_a_face_is_pushed_out_through_it():
    """A box stands on its corner, which is a little below the top face of another box."""
    rng = np.random.default_rng(1)
    table, stone = box((4.0, 4.0, 1.0)), box((1.0, 1.0, 1.0))
    top = table.vertices[:, 2].max()
    tilt = np.eye(4)
    up = np.ones(3) / np.sqrt(3.0)
    right = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    tilt[:3, :3] = right, np.cross(up, right), up
    tilt[2, 3] = top - 0.001 - (stone.vertices @ tilt[:3, :3].T)[:, 2].min()
    for _ in range(5):
        world = pose(rng, 3.0)
        up = world[:3, 2]
        found = engine.collide(table, world, stone, world @ tilt, all_contacts=True)
        assert len(found.contacts) >= 3
        assert np.allclose(found.normals, up, atol=1e-12)
        other = engine.collide(stone, world @ tilt, table, world, all_contacts=True)
        assert np.allclose(other.normals, -up, atol=1e-12)


def test_each_contact_has_a_point_of_both_and_the_shorter_way_apart():
    rng = np.random.default_rng(2)
    a, b = soup(3, 150), sphere(1)
    count = 0
    for _ in range(8):
        pose_a, pose_b = pose(rng, 0.6), pose(rng, 0.6)
        found = engine.collide(a, pose_a, b, pose_b, all_contacts=True)
        assert found.points.shape == found.normals.shape == (len(found.contacts), 3)
        assert np.allclose(np.linalg.norm(found.normals, axis=1), 1.0, atol=1e-14)
        first, second = triangles(a, pose_a), triangles(b, pose_b)
        for (i, j), point, normal in zip(found.contacts, found.points, found.normals, strict=True):
            ways = {}
            for sign, corners in ((1.0, first[i]), (-1.0, second[j])):
                one = engine.TriangleMesh(corners, [[0, 1, 2]])
                assert engine.closest_points(one, IDENTITY, [point]).upper[0] < 1e-13
                n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
                n *= sign / np.linalg.norm(n)
                ways[(first[i] @ n).max() - (second[j] @ n).min()] = n
            assert np.allclose(normal, ways[min(ways)], atol=1e-9)
            count += 1
    assert count > 50


def test_touching_balls_are_parted_along_their_centres():
    rng = np.random.default_rng(3)
    for _ in range(10):
        p, q = rng.normal(size=(2, 3))
        apart = np.linalg.norm(q - p)
        a = engine.points([p], radius=0.6 * apart)
        b = engine.polyline([q, 2.0 * q - p], radius=0.5 * apart)
        found = engine.collide(a, IDENTITY, b, IDENTITY)
        assert np.allclose(found.normals, [(q - p) / apart], atol=1e-12)
        point = found.points[0]
        assert np.linalg.norm(point - p) <= 0.6 * apart * (1.0 + 1e-12)
        assert np.linalg.norm(point - q) <= 0.5 * apart * (1.0 + 1e-12)


@pytest.mark.parametrize("size", [1e-150, 1.0, 1e40])
def test_segments_are_parted_across_both(size):
    a = engine.polyline(size * np.array([[-1.0, 0, 0], [1, 0, 0]]))
    b = engine.polyline(size * np.array([[0.0, -1, 0], [0, 1, 0]]))
    found = engine.collide(a, IDENTITY, b, IDENTITY)
    assert np.allclose(np.abs(found.normals), [[0.0, 0.0, 1.0]])
    flat = engine.TriangleMesh(
        size * np.array([[-1.0, -1, 0], [2, -1, 0], [-1, 2, 0]]), [[0, 1, 2]]
    )
    upright = engine.polyline(size * np.array([[0.0, 0, -1], [0, 0, 1]]))
    assert np.allclose(engine.collide(flat, IDENTITY, upright, IDENTITY).normals, [[0, 0, 1]])
    assert np.allclose(engine.collide(upright, IDENTITY, flat, IDENTITY).normals, [[0, 0, -1]])


def test_points_at_one_place_have_no_normal():
    point = engine.points([[1.0, 2.0, 3.0]])
    found = engine.collide(point, IDENTITY, point, IDENTITY)
    assert found.points.tolist() == [[1.0, 2.0, 3.0]]
    assert found.normals.tolist() == [[0.0, 0.0, 0.0]]


def test_without_contact_there_is_neither():
    found = engine.collide(box(), IDENTITY, box(), translation(9.0))
    assert found.points.shape == found.normals.shape == (0, 3)


def test_no_volume_is_listed_as_a_contact():
    """Rounding of the radius may put a volume's bound between the limits of search and contact."""
    rng = np.random.default_rng(0)
    near = rng.uniform(-0.2, 0.2, (16, 3))
    far = np.array([1.5, 0.0, 0.0]) + rng.uniform(-1, 1, (4, 3)) * [0.0003, 0.001, 0.001]
    points = np.concatenate((near, far))
    cloud = engine.points(points)

    def ask(radius):
        pair = engine.Pair(cloud, engine.points([[0.0, 0.0, 0.0]], radius=radius), coherent=False)
        return pair, pair.collide(IDENTITY, IDENTITY, all_contacts=True)

    pair, _ = ask(1.6)
    bounds = pair._search.state.open.bounds[:6]
    asked = 0
    for bound in bounds[(bounds > 1.3) & (bounds < 1.6)]:
        for share in (8, 16, 26, 40):
            radius = float(bound) * (1.0 - share * 2.0**-53)
            _, found = ask(radius)
            touching = np.flatnonzero(np.linalg.norm(points, axis=1) <= radius)
            assert sorted(found.contacts[:, 0].tolist()) == touching.tolist()
            asked += 1
    assert asked


def test_what_counts_as_touching_has_a_contact():
    corners = np.array([[1e3, 0.0, 0.0], [1e3 + 1.0, 0.0, 0.0], [1e3, 1.0, 0.0]])
    a = engine.TriangleMesh(corners, [[0, 1, 2]])
    for apart in np.linspace(0.3, 1.1, 30) * 27 * 2.0**-53 * 1001.0:
        b = engine.TriangleMesh(corners + np.array((0.0, 0.0, apart)), [[0, 1, 2]])
        found = engine.collide(a, IDENTITY, b, IDENTITY, all_contacts=True)
        assert found.colliding == bool(len(found.contacts))
