"""Sections, labels and clicks: their geometry, without a browser."""

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from ticks import scene_and_frame

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.display import events as event_list
from proximity_monitor.display.events import Events
from proximity_monitor.display.geometry import (
    between,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
)
from proximity_monitor.display.labels import Label, extent, places, short
from proximity_monitor.display.matrix import PARTS, matrix
from proximity_monitor.display.picking import first_hit, kept
from proximity_monitor.display.section import LINES, Plane, behind, cut, hatching
from proximity_monitor.display.session import Session
from proximity_monitor.display.state import (
    STOP,
    WARN,
    Body,
    Frame,
    Pairs,
)
from proximity_monitor.display.view import View, facing


def box():
    """Return vertices and triangles of the cube from -1 to 1; the triangles face outwards."""
    vertices = np.indices((2, 2, 2)).reshape(3, -1).T * 2.0 - 1.0
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def area(vertices, triangles):
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0


def planes(rng, count):
    for _ in range(count):
        normal = rng.normal(size=3)
        yield Plane(rng.uniform(-0.5, 0.5, 3), normal / np.linalg.norm(normal))


def test_a_section_cuts_a_mesh_into_two_that_make_the_whole():
    vertices, triangles = box()
    for plane in planes(np.random.default_rng(1), 40):
        near = cut(vertices, triangles, plane)
        far = cut(vertices, triangles, Plane(plane.middle, -plane.normal))
        kept = near.vertices[near.triangles]
        assert ((kept - plane.middle) @ plane.normal).max() < 1e-12
        whole = area(near.vertices, near.triangles) + area(far.vertices, far.triangles)
        assert whole == pytest.approx(24.0)
        np.testing.assert_allclose((near.outline - plane.middle) @ plane.normal, 0.0, atol=1e-12)
        start, end = np.moveaxis(near.outline - plane.middle, 1, 0)
        assert (np.cross(start, end) @ plane.normal).sum() > -1e-12  # its inside is to the left
        # The cut triangles face outwards like the uncut ones.
        a, b, c = np.moveaxis(kept, 1, 0)
        outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), kept.mean(axis=1))
        assert (outward > -1e-12).all()


@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_a_plane_through_corners_and_faces_cuts_neither_nothing_nor_twice(corner):
    vertices, triangles = box()
    plane = Plane(np.array([0, 0, corner]), np.array([0, 0, 1.0]))
    found = cut(vertices, triangles, plane)
    assert area(found.vertices, found.triangles) == pytest.approx(24.0 if corner else 12.0)
    diagonal = Plane(np.zeros(3), np.array([1, -1, 0]) / np.sqrt(2.0))
    found = cut(vertices, triangles, diagonal)
    assert area(found.vertices, found.triangles) == pytest.approx(12.0)


def test_hatching_fills_the_section_and_nothing_else():
    vertices, triangles = box()
    for plane in planes(np.random.default_rng(2), 20):
        outline = cut(vertices, triangles, plane).outline
        spacing = 3.5 / LINES
        lines = hatching(outline, plane, spacing, 0.3)
        ends = lines.reshape(-1, 3)
        assert (np.abs(ends) < 1.0 + 1e-9).all()
        np.testing.assert_allclose((ends - plane.middle) @ plane.normal, 0.0, atol=1e-9)
        # A convex body's section is convex: triangles from an inner point to its outline fill it.
        inner = outline.reshape(-1, 3).mean(axis=0)
        filled = np.linalg.norm(np.cross(outline[:, 0] - inner, outline[:, 1] - inner), axis=1)
        filled = filled.sum() / 2.0
        drawn = spacing * np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum()
        assert drawn == pytest.approx(filled, rel=0.02, abs=0.02)


def test_hatching_leaves_out_what_is_open():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)], float) - 0.5
    corners = np.column_stack((square, np.zeros(5)))
    outline = np.stack((corners[:-1], corners[1:]), axis=1)
    plane = Plane(np.zeros(3), np.array([0, 0, 1.0]))
    assert len(hatching(outline, plane, 0.1, 0.4)) > 5
    opened = hatching(outline[1:], plane, 0.1, 0.4)
    assert len(opened) < len(hatching(outline, plane, 0.1, 0.4))
    assert (np.abs(opened[..., :2]) < 0.5 + 1e-9).all()


def test_shells_that_overlap_are_hatched_as_one():
    vertices, triangles = box()
    both = np.concatenate((vertices, vertices + np.array([1.0, 0, 0])))
    plane = Plane(np.array([0.5, 0, 0.01]), np.array([0, 0, 1.0]))

    def hatched(*shells):
        outline = cut(both, np.concatenate(shells), plane).outline
        lines = hatching(outline, plane, 0.05, 0.4)
        return 0.05 * np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum()

    assert hatched(triangles, triangles + 8) == pytest.approx(6.0, rel=0.02)
    inner = triangles[:, ::-1] + 8  # facing inwards: a cavity where it is inside the first shell
    assert hatched(triangles, inner) == pytest.approx(4.0, rel=0.02)


def test_edges_end_at_the_plane():
    plane = Plane(np.zeros(3), np.array([0, 0, 1.0]))
    edges = np.array([[(0, 0, -1), (0, 0, 3)], [(0, 0, 1), (0, 0, 2)], [(1, 0, -2), (1, 0, -1)]])
    np.testing.assert_allclose(
        behind(edges.astype(float), plane), [[(0, 0, -1), (0, 0, 0)], [(1, 0, -2), (1, 0, -1)]]
    )


def test_the_camera_looks_across_the_gap_whatever_its_direction():
    rng = np.random.default_rng(3)
    for _ in range(50):
        ends, position = rng.normal(size=(2, 3)), rng.normal(size=3)
        across = facing(ends, position)
        assert abs(across @ (ends[1] - ends[0])) < 1e-12
        assert np.linalg.norm(across) == pytest.approx(1.0)
    along = np.array([[0, 0, 0], [0, 0, 1.0]])
    assert facing(along, np.array([0, 0, 9.0]))[2] == 0.0
    np.testing.assert_allclose(facing(np.zeros((2, 3)), np.array([2.0, 0, 0])), (1, 0, 0))


VIEW = View.looking(np.array([0.0, -3.0, 0.0]), np.zeros(3))


def test_a_point_is_seen_where_it_is_shifted_to():
    points = np.random.default_rng(4).uniform(-0.5, 0.5, (20, 3))
    pixels = np.random.default_rng(5).uniform(-90, 90, (20, 2))
    before, depth = VIEW.project(points)
    after, same = VIEW.project(VIEW.shift(points, pixels))
    np.testing.assert_allclose(after - before, pixels, atol=1e-9)
    np.testing.assert_allclose(same, depth)


@pytest.mark.parametrize("name", ["die", "很长的零件名称" * 9, "Zylinderkopfdeckel " * 9])
def test_labels_lie_neither_on_each_other_nor_on_a_tip_and_the_first_are_kept(name):
    rng = np.random.default_rng(6)
    tips = rng.uniform(-0.15, 0.15, (30, 3))
    told = [Label(f"■ 0.020 mm\n{short(name)} - {short(name)}", tip) for tip in tips]
    found = places(told, VIEW, tips)
    assert found[0] is not None
    pairs = zip(found, told, strict=True)
    boxes = [(p - extent(x) / 2, p + extent(x) / 2) for p, x in pairs if p is not None]
    assert 3 < len(boxes) < 30
    for (low, high), (low_2, high_2) in combinations(boxes, 2):
        assert (low >= high_2).any() or (low_2 >= high).any()
    for low, high in boxes:
        at, _ = VIEW.project(tips)
        assert not ((at > low) & (at < high)).all(axis=1).any()
        assert (low >= 0.0).all() and (high <= VIEW.size).all()


def test_what_is_behind_the_camera_has_no_label():
    behind_it = np.array([0.0, -5.0, 0.1])
    assert places([Label("a", behind_it)], VIEW, np.zeros((0, 3))) == [None]


def test_a_ray_meets_the_nearest_triangle_or_none():
    vertices, triangles = box()
    low, high = np.full(3, -1.0), np.full(3, 1.0)

    def hit(origin, direction):
        return first_hit(
            np.array(origin, float), np.array(direction, float), low, high, vertices[triangles]
        )

    assert hit((0.2, 0.3, 5), (0, 0, -1)) == pytest.approx(4.0)
    assert hit((0.2, 0.3, 5), (0, 0, -2)) == pytest.approx(2.0)
    assert hit((0.2, 0.3, 0), (0, 0, -1)) == pytest.approx(1.0)
    assert np.isinf(hit((0.2, 0.3, 5), (0, 0, 1)))
    assert np.isinf(hit((1.2, 0.3, 5), (0, 0, -1)))


def pose_of(rng):
    turn = rng.normal(size=4)
    return np.concatenate((rng.normal(size=3), turn / np.linalg.norm(turn)))


def test_turns_and_their_vectors_agree():
    rng = np.random.default_rng(9)
    for _ in range(50):
        first, second = pose_of(rng), pose_of(rng)
        point = rng.normal(size=3)
        np.testing.assert_allclose(
            rotate(multiply(first[3:], second[3:]), point),
            rotate(first[3:], rotate(second[3:], point)),
        )
        vector = to_rotation_vector(first[3:])
        assert np.linalg.norm(vector) <= np.pi
        again = from_rotation_vector(vector)
        np.testing.assert_allclose(again * np.sign(again @ first[3:]), first[3:], atol=1e-12)
        np.testing.assert_allclose(between(first, second, 0.0), first)
        there = between(first, second, 1.0)
        np.testing.assert_allclose(np.abs(there[3:] @ second[3:]), 1.0)
    np.testing.assert_array_equal(from_rotation_vector(np.zeros(3)), (1, 0, 0, 0))


def at(stamp_s, lower, level, names=(("a", "b"), ("c", "a"), ("b", "c"))):
    bound = np.array(lower, float)
    n = len(names)
    told = Pairs(
        names, bound, bound, np.zeros((n, 2, 3)), np.zeros(n, np.int8), np.array(level, np.int8),
        np.zeros(n), np.zeros(n), ("",) * n,
    )  # fmt: skip
    return Frame(stamp_s, np.zeros((0, 7)), told)


def test_each_change_of_state_is_an_event_and_nothing_else():
    scene, _ = scene_and_frame()
    events = Events()
    assert not events.note(at(0.0, (1, 1, 1), (0, 0, 0)), scene)
    assert not events.note(at(1.0, (0.9, 0.8, 0.7), (0, 0, 0)), scene)
    assert events.note(at(2.0, (0.05, 0.8, 0.01), (WARN, 0, STOP)), scene)
    assert [(e.stamp_s, e.pair, e.before.word, e.after.word) for e in events.all] == [
        (2.0, ("a", "b"), "clear", "warn"),
        (2.0, ("b", "c"), "clear", "STOP"),
    ]
    # A pair that is no longer listed is beyond its range.
    assert events.note(at(3.0, (0.05, 0.8), (WARN, 0), (("a", "b"), ("c", "a"))), scene)
    assert [(e.pair, e.before.word, e.after.word) for e in events.all[2:]] == [
        (("b", "c"), "STOP", "clear")
    ]
    assert events.at(2).pair == ("b", "c")
    assert events.at(3) is None


def test_pairs_that_come_into_range_and_leave_it_are_events_if_they_are_not_clear():
    scene, _ = scene_and_frame()
    events, (ab, ca, bc) = Events(), (("a", "b"), ("c", "a"), ("b", "c"))
    events.note(at(0.0, (1,), (0,), (ab,)), scene)
    assert not events.note(at(1.0, (1, 1), (0, 0), (ca, bc)), scene)
    assert events.note(at(2.0, (0.01, 1, 0.05), (STOP, 0, WARN), (ab, ca, bc)), scene)
    assert [(e.pair, e.after.word) for e in events.all] == [(ab, "STOP"), (bc, "warn")]
    assert events.note(at(3.0, (0.05, 1), (WARN, 0), (bc, ca)), scene)
    assert [(e.pair, e.after.word) for e in events.all[2:]] == [(ab, "clear")]
    assert events.note(at(4.0, (), (), ()), scene)
    assert events.note(at(5.0, (0.01,), (STOP,), (ca,)), scene)
    assert [(e.pair, e.after.word) for e in events.all[3:]] == [(bc, "clear"), (ca, "STOP")]


def test_the_oldest_events_go_and_that_is_known(monkeypatch):
    monkeypatch.setattr(event_list, "MOST", 5)
    scene, _ = scene_and_frame()
    events = Events()
    for i in range(9):
        events.note(at(float(i), (0.05, 1, 1), (WARN * (i % 2), 0, 0)), scene)
    assert [e.stamp_s for e in events.all] == [4.0, 5.0, 6.0, 7.0, 8.0]
    assert events.lost == 3
    assert events.at(2) is None
    assert events.at(3).stamp_s == 4.0


def test_an_event_keeps_the_poses_of_its_moment_in_bounds(monkeypatch):
    scene, _ = scene_and_frame()
    events, poses = Events(), np.arange(14.0).reshape(2, 7)
    monkeypatch.setattr(event_list, "BYTES", 2 * poses.nbytes)
    for i in range(4):
        tick = replace(at(float(i), (0.05, 1, 1), (WARN * (i % 2), 0, 0)), poses=poses + i)
        events.note(tick, scene)
    assert [e.stamp_s for e in events.all] == [2.0, 3.0]
    then = events.all[-1].sight.frame(("a", "b"))
    np.testing.assert_array_equal(then.poses, poses + 3)
    assert (then.pairs.lower[0], then.pairs.level[0]) == (0.05, WARN)
    events.note(at(4.0, (1, 1), (0, 0), (("c", "a"), ("b", "c"))), scene)
    assert events.all[-1].sight is None  # beyond its range, so there is nothing to look at


def test_pictures_of_events_are_bounded_and_end_with_the_session(monkeypatch):
    monkeypatch.setattr(event_list, "PICTURES", 2)
    scene, _ = scene_and_frame()
    events = Events()
    for i in range(4):
        events.note(at(float(i), (0.05, 1, 1), (WARN * (i % 2), 0, 0)), scene)
    for event in events.all:
        events.keep(event, b"%d" % event.number)
    assert events.pictures == {1: b"1", 2: b"2"}
    last = events.all[-1]
    events.clear()
    events.keep(last, b"late")
    assert not events.pictures


def test_a_tick_with_an_event_is_kept_so_that_one_can_look_back_at_it():
    session = Session()
    for stamp_s, keep in ((0.0, False), (0.01, False), (0.02, True), (0.03, False)):
        session.add(at(stamp_s, (1, 1, 1), (0, 0, 0)), keep=keep)
    assert [frame.stamp_s for frame in session.frames] == [0.0, 0.02]


def test_the_clash_matrix_has_each_listed_pair_once_and_no_html_of_others():
    scene, frame = scene_and_frame()
    named = dict(zip("abc", ("<i>a", "b", "c"), strict=True))
    bodies = tuple(Body(named[name], True, None, False, "") for name in "abc")
    names = tuple(tuple(named[x] for x in pair) for pair in frame.pairs.names)
    told = at(0.0, (0.05, 1, 0.01), (WARN, 0, STOP), names).pairs
    html = matrix(told, replace(scene, bodies=bodies))
    assert [html.count(f">{glyph}<") for glyph in "▲●■·"] == [1, 1, 1, 0]
    assert "<i>" not in html
    assert "pick:&lt;i&gt;a - b" in html and "pick:c - &lt;i&gt;a" in html
    fewer = at(0.0, (0.05, 1), (WARN, 0), names[:2]).pairs
    html = matrix(fewer, replace(scene, bodies=bodies), names[1])
    assert html.count(">·</td>") == 1
    (marked,) = re.findall("pm-chosen[^>]*>", html)
    assert "pick:c - &lt;i&gt;a" in marked


def test_many_parts_leave_a_matrix_of_the_most_urgent():
    names = tuple(("hub", f"{i}") for i in range(300))
    level = np.zeros(300, int)
    level[250] = STOP
    told = at(0.0, np.full(300, 0.5), level, names).pairs
    scene, _ = scene_and_frame()
    bodies = tuple(Body(name, True, None, False, "") for name in ("hub", *map(str, range(300))))
    html = matrix(told, replace(scene, bodies=bodies))
    assert "pick:hub - 250" in html
    assert html.count("<tr>") <= PARTS + 2


def test_a_click_goes_through_what_a_section_cuts_away():
    plane = Plane(np.array([0, 0, 1.0]), np.array([0, 0, 1.0]))
    above, down = np.array([0.5, 0, 3.0]), np.array([0, 0.1, -1.0])
    ray = kept(above, down, plane)
    np.testing.assert_allclose(ray.origin, (0.5, 0.2, 1.0))
    assert np.isinf(ray.end)
    assert kept(above, -down, plane).end < 0.0
    below = np.array([0.5, 0, -3.0])
    assert np.isinf(kept(below, down, plane).end)
    assert kept(below, -down, plane).end == 4.0  # what is beyond the plane is cut away
    assert np.isinf(kept(above, down, None).end)
