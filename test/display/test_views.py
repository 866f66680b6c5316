"""The nodes that show bodies and pairs in the scene graph, on a server without a browser."""

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.display import parts as parts_module
from proximity_monitor.display.choice import Choice, Look
from proximity_monitor.display.geometry import borders, smoothed
from proximity_monitor.display.lines import labelled, pattern, shown_rows
from proximity_monitor.display.part_view import DIM, Coat
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.received import Part
from proximity_monitor.display.section import Plane, Section
from proximity_monitor.display.state import (
    STALE,
    STOP,
    UNKNOWN,
    WARN,
    Body,
    Frame,
    Pairs,
    SceneInfo,
    Thresholds,
    Unit,
)
from proximity_monitor.display.view import View

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
POSE = np.array([0, 0, 0, 1.0, 0, 0, 0])


def drawn(view):
    """Return the corners of the triangles that a browser has of a part."""
    return view.mesh.vertices[view.mesh.faces].reshape(-1, 3)


def test_a_deforming_body_gets_its_new_shape_and_others_keep_theirs(server):
    bodies = tuple(Body(name, True, name, False, "") for name in "ab")
    scene = SceneInfo(
        "s",
        "",
        "w",
        Unit("mm", 0.001),
        bodies,
        frozenset("b"),
        1,
        Thresholds(1, 0, 0),
        {},
        True,
        {},
    )
    parts = [Part(POSE, np.ones(4), CORNERS) for _ in bodies]
    views = Parts(server, scene, parts)
    bent = CORNERS + np.array([0, 0, 0.5])
    views.reshape([Part(POSE, np.ones(4), bent) for _ in bodies], scene.deforming)
    np.testing.assert_array_equal(drawn(views["a"]), CORNERS)
    np.testing.assert_array_equal(drawn(views["b"]), bent)


def test_corners_are_shared_where_the_surface_is_smooth_and_creases_stay_sharp():
    """A strip of three squares: the first two lie in a plane, the third stands on the second."""
    corners, normals = [], []
    for at, along, normal in (
        ((0, 0, 0), (1, 0, 0), (0, 0, 1)), ((1, 0, 0), (1, 0, 0), (0.1, 0, 1)),
        ((2, 0, 0), (0, 0, 1), (-1, 0, 0)),
    ):  # fmt: skip
        a, u, v = np.array(at, float), np.array(along, float), np.array([0, 1.0, 0])
        corners += [a, a + u, a + u + v, a, a + u + v, a + v]
        normals += 6 * [np.array(normal) / np.linalg.norm(normal)]
    corners, normals = np.array(corners), np.array(normals)
    shared, triangles = smoothed(corners, normals)
    np.testing.assert_array_equal(shared[triangles.ravel()], corners)
    assert len(shared) == 4 + 2 + 4  # the first two share an edge
    edges = shared[borders(triangles)]
    assert len(edges) == 6 + 4
    crease = (np.abs(edges[..., 0] - 2.0) < 1e-12) & (np.abs(edges[..., 2]) < 1e-12)
    assert crease.all(axis=1).sum() == 2  # once for each side of the crease
    flat = np.zeros_like(normals)
    assert len(smoothed(corners, flat)[0]) == len(corners)


def test_edges_that_are_points_are_no_borders():
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 0, 1], [2, 2, 2]])
    assert borders(fan).tolist() == [[1, 2], [1, 3], [2, 3]]


def test_a_surface_that_deforms_may_get_other_triangles(server):
    body = Body("a", True, "a", False, "")
    scene = SceneInfo(
        "s", "", "w", Unit("m", 1.0), (body,), frozenset("a"), 0, Thresholds(1, 0, 0), {}, True, {}
    )
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    views = Parts(server, scene, [Part(POSE, np.ones(4), CORNERS, up)])
    assert not views["a"].mesh.flat_shading
    both = np.concatenate((CORNERS, CORNERS[[1, 0, 2]] * (1, -1, 1)))
    views.reshape([Part(POSE, np.ones(4), both, np.tile(up, (2, 1)))], scene.deforming)
    assert views["a"].mesh.vertices.shape == (4, 3)
    assert views["a"].mesh.faces.shape == (2, 3)


@pytest.mark.parametrize("size", [0.003, 0.5, 40.0])
def test_whatever_a_scene_measures_it_is_about_a_unit_on_the_page(server, size):
    body = Body("a", True, "a", False, "")
    scene = SceneInfo(
        "s", "", "w", Unit("m", 1.0), (body,), frozenset(), 0, Thresholds(1, 0, 0), {}, True, {}
    )
    parts = Parts(server, scene, [Part(POSE, np.ones(4), size * CORNERS)])
    assert 0.3 < parts.size < 4.0
    np.testing.assert_allclose(drawn(parts["a"]), parts.scale * size * CORNERS, rtol=1e-6)


@pytest.fixture
def few(monkeypatch):
    """Nine bodies of one shape are enough to be drawn as instances."""
    monkeypatch.setattr(parts_module, "MANY", 9)


def crowd(server):
    """Return nine bodies of one shape at different places and one of another, and a tick."""
    bodies = tuple(Body(f"b{i}", i > 0, f"b{i}", False, "1") for i in range(10))
    scene = SceneInfo(
        "s", "", "w", Unit("m", 1.0), bodies, frozenset(), 0, Thresholds(1, 0, 0), {}, True, {}
    )
    parts = [Part(POSE, np.ones(4), CORNERS * (1 if i < 9 else 2)) for i in range(10)]
    poses = np.tile(POSE, (9, 1)) + np.arange(1.0, 10.0)[:, None] * np.eye(7)[0]
    return Parts(server, scene, parts), Frame(0.0, poses, None)


def shown(api, name):
    """Return the x coordinates of the bodies that a node draws, and its opacity."""
    node = api._handle_from_node_name[name]
    drawn = node.batched_positions[node.batched_scales > 0.0] if node.visible else np.zeros((0, 3))
    return drawn[:, 0].tolist(), node.opacity


def test_many_of_one_shape_are_drawn_by_one_node_that_has_all_poses(server, few):
    parts, frame = crowd(server)
    parts.show(frame, {}, Choice(), ())
    assert shown(server.scene, "/instances/0") == (list(range(9)), None)
    assert parts["b9"].mesh is not None  # of another shape, so it stands alone
    assert all(parts[f"b{i}"].mesh is None for i in range(9))
    parts.show(frame, {"b3": POSE}, Choice(), ())
    assert shown(server.scene, "/instances/0")[0] == [0, 1, 2, 0, *range(4, 9)]
    assert [label.at[0] for label in parts.labels()][:4] == [0.5, 1.5, 2.5, 0.5]
    nowhere = frame.poses.copy()
    nowhere[0] = 0.0
    parts.show(Frame(1.0, nowhere, None), {}, Choice(), ())
    assert shown(server.scene, "/instances/0")[0] == [0, *range(2, 9)]


@pytest.mark.parametrize("why", ["look", "cut", "coat", "shape", "light"])
def test_what_is_set_apart_is_drawn_by_its_own_nodes_and_comes_back(server, few, why):
    parts, frame = crowd(server)
    api, view, choice, lit = server.scene, parts["b2"], Choice(), ()
    parts.show(frame, {}, choice, lit)
    if why == "look":
        choice.looks = {"b2": Look(0.5)}
    elif why == "cut":
        view.cut_away(True)
    elif why == "coat":
        view.coat(api, [Coat(CORNERS, (1, 2, 3))])
    elif why == "shape":
        parts.reshape([Part(POSE, np.ones(4), 3.0 * CORNERS)] * 10, {"b2"})
    else:
        lit = ("b2",)
    parts.show(frame, {}, choice, lit)
    rest = [0, 1, *range(3, 9)]
    assert shown(api, "/instances/0") == (rest, DIM if why == "light" else None)
    assert api._handle_from_node_name["/parts/2"].visible
    assert api._handle_from_node_name["/parts/2"].position[0] == 2.0
    assert view.mesh.opacity == (0.5 if why == "look" else None)
    assert view.mesh.visible == (why not in ("cut", "coat"))
    if why == "shape":
        return  # b2 has another shape now
    view.cut_away(False)
    view.coat(api, ())
    parts.show(frame, {}, Choice(), ())
    assert shown(api, "/instances/0") == (list(range(9)), None)
    assert not api._handle_from_node_name["/parts/2"].visible


def test_a_part_that_rests_may_get_other_coats(server, few):
    parts, frame = crowd(server)
    for colour in ((1, 2, 3), (4, 5, 6)):
        parts["b2"].coat(server.scene, [Coat(CORNERS.copy(), colour)])
        parts.show(frame, {}, Choice(), ())
    assert server.scene._handle_from_node_name["/parts/2/coat_0"].color == (4, 5, 6)


def test_an_opaque_coat_stays_opaque_on_a_transparent_part_unless_that_is_dimmed(server, few):
    parts, frame = crowd(server)
    node = server.scene._handle_from_node_name
    choice = Choice(looks={"b2": Look(0.5)})
    parts.show(frame, {}, choice, ())
    parts["b2"].coat(
        server.scene, [Coat(CORNERS, (1, 2, 3), opaque=True), Coat(CORNERS, (4, 5, 6))]
    )
    for lit, expected in (((), (None, 0.5)), (("b3",), (DIM, DIM)), ((), (None, 0.5))):
        parts.show(frame, {}, choice, lit)
        assert tuple(node[f"/parts/2/coat_{i}"].opacity for i in range(2)) == expected


def test_a_section_keeps_the_opaque_coats_of_a_transparent_part_opaque(server, few):
    parts, frame = crowd(server)
    choice = Choice(looks={"b2": Look(0.5)})
    parts.show(frame, {}, choice, ())
    view, node = parts["b2"], server.scene._handle_from_node_name
    view.coat(server.scene, [Coat(CORNERS, (1, 2, 3), opaque=True), Coat(CORNERS, (4, 5, 6))])
    section = Section(server.scene, parts)
    section.aim(Plane(parts.scale * (view.pose[:3] + np.array([0.5, 0, 0])), np.array([1.0, 0, 0])))
    seen = View.looking(np.array([9.0, 0, 0]), np.zeros(3))
    for now_s, (lit, expected) in enumerate((((), (None, 0.5)), (("b3",), (DIM, DIM)))):
        parts.show(frame, {}, choice, lit)
        section.show(seen, float(now_s))
        for i in range(2):
            left = node[f"/parts/2/cut_{i}"]
            assert (left.visible, left.opacity) == (True, expected[i])
            assert left.vertices[:, 0].max() == pytest.approx(0.5)
            assert not node[f"/parts/2/coat_{i}"].visible


def test_what_all_of_a_shape_look_like_their_instances_look_like(server, few):
    parts, frame = crowd(server)
    looks = {f"b{i}": Look(0.4) for i in range(10)}
    parts.show(frame, {}, Choice(looks=looks), ())
    assert shown(server.scene, "/instances/0") == (list(range(9)), 0.4)
    assert parts["b3"].opacity == 0.4
    assert parts["b9"].mesh.opacity == 0.4


def test_every_state_has_a_pattern_of_its_own_and_uncertainty_a_gap():
    drawn = {level: pattern(level, False) for level in (0, WARN, STALE)}
    assert len({len(each) for each in drawn.values()}) == 3
    for level in (0, WARN, STOP, STALE):
        gap = pattern(level, True)
        assert not ((gap[:, 0] < 0.5) & (gap[:, 1] > 0.5)).any()
        assert ((gap >= 0.0) & (gap <= 1.0)).all()
        assert (gap[:, 0] < gap[:, 1]).all()


def test_the_nearest_are_drawn_all_that_are_not_clear_and_never_what_is_ignored():
    names = tuple(("a", str(i)) for i in range(6))
    level = np.array([0, 0, 0, STOP, 0, STALE], np.int8)
    status = np.array([0, 0, 0, 0, 0, UNKNOWN], np.int8)
    lower = np.array([0.3, 0.1, 0.2, 0.9, 0.05, np.nan])
    told = Pairs(
        names, lower, lower, np.zeros((6, 2, 3)), status, level, np.zeros(6), np.zeros(6), ("",) * 6
    )
    assert shown_rows(told, Choice(lines=2)).tolist() == [4, 1, 3]
    ignored = frozenset({("a", "4"), ("a", "3")})
    assert shown_rows(told, Choice(lines=2, ignored=ignored)).tolist() == [1, 2]
    assert shown_rows(told, Choice(pair=("a", "0"))).tolist() == [0]
    assert shown_rows(told, Choice(pair=("a", "5"))).tolist() == []
    # The body at the gizmo has all its lines.
    assert shown_rows(told, Choice(lines=1, body="2")).tolist() == [4, 2, 3]


def test_labels_are_those_of_the_body_at_the_gizmo_then_the_nearest_and_all_that_is_not_clear():
    names = tuple((str(i), "own" if i > 4 else "a") for i in range(12))
    n, level = len(names), np.zeros(12, np.int8)
    level[[4, 11]] = STOP
    told = Pairs(
        names, np.arange(n) / n, np.arange(n) / n, np.zeros((n, 2, 3)), np.zeros(n, np.int8),
        level, np.zeros(n), np.zeros(n), ("",) * n,
    )  # fmt: skip
    rows = np.arange(n)
    assert labelled(told, rows, None).tolist() == [0, 1, 2, 4, 11]
    assert labelled(told, rows, "own").tolist() == [5, 6, 7, 8, 0, 1, 2, 4, 11]
