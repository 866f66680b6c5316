"""What the picture of one page shows, without a real browser."""

import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_alone import CORNERS, HERE, NAMES, SCENE, frame, words
from test_inspect import box

from proximity_monitor.display import part_view, portraits
from proximity_monitor.display.choice import Look
from proximity_monitor.display.event_picture import EventPicture
from proximity_monitor.display.inspection import SECTION, ZOOM
from proximity_monitor.display.picking import kept, part_under
from proximity_monitor.display.received import Part
from proximity_monitor.display.section import Plane
from proximity_monitor.display.state import STALE
from proximity_monitor.scene import Thresholds

LEVEL = Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))


@pytest.fixture
def page(alone):
    return alone


def cubes(*sizes):
    vertices, triangles = box()
    corners = vertices[triangles].reshape(-1, 3)
    return [Part(HERE, np.ones(4), corners * size) for size in sizes]


def test_only_what_encloses_a_volume_is_hatched(page):
    parts = cubes(1.0, 1.0)
    parts[0].solid = False
    page.tell(scene=replace(SCENE, name="solids"), parts=parts)
    page.all._inspect._plane = LEVEL
    page.tell(frame=frame(1.0))
    nodes = page.all._inspect._section._nodes
    lines = [{each.name.rsplit("/")[-1] for each in nodes[name]} for name in NAMES]
    assert "hatching" not in lines[0]
    assert {"outline", "hatching"} <= lines[1]


def test_a_button_of_the_gap_does_nothing_for_a_pair_that_is_not_listed(page):
    inspect = page.all._inspect
    page.choice.pair = ("a", "elsewhere")
    page.tell(frame=frame(1.0))
    for what in (ZOOM, SECTION):
        inspect.do(what)
        page.tell()
        assert inspect.plane() is None
        assert "a - elsewhere are not known" in words(inspect._note)
    page.choice.pair = None
    page.tell()
    assert words(inspect._note) == ""
    inspect.do(SECTION)
    assert inspect.plane() is not None


def test_a_picture_that_does_not_come_is_told_with_the_way_out():
    def late(*_):
        raise TimeoutError

    shown = EventPicture(None, None, SimpleNamespace(take=late), None)
    shown._tried = event = SimpleNamespace(sight=SimpleNamespace(frame=id), pair=NAMES)
    shown._take(event, None)
    assert "keep this tab in front, and try again" in shown._line(event)


def test_a_click_from_behind_a_section_meets_nothing_that_is_cut_away(page):
    far = np.array([99.0, 0, 0, 1, 0, 0, 0])
    above = np.array([0.0, 0, 3, 1, 0, 0, 0])
    page.tell(scene=replace(SCENE, name="cubes"), parts=cubes(1.0, 1.0))
    page.tell(frame=frame(1.0, poses=(above, far)))
    origin, up = np.array([0.1, 0.2, -9.0]), np.array([0.0, 0.0, 1.0])
    assert part_under(kept(origin, up, None), page.all._parts) == NAMES[0]
    assert part_under(kept(origin, up, LEVEL), page.all._parts) is None


def test_a_part_that_begins_to_deform_has_all_of_its_shape_at_once(page, monkeypatch):
    monkeypatch.setattr(part_view, "levels", lambda *_: ((9.0, 0.5),))
    monkeypatch.setattr(part_view.PartView, "_detailed", mesh_of)
    page.tell(scene=replace(SCENE, name="belts"), parts=cubes(1.0, 1.0))
    view = page.all._parts["b"]
    view.stand()
    before = view.mesh
    bent = cubes(1.0, 2.0)
    page.tell(parts=bent)  # one step before the scene says that b deforms
    page.tell(scene=replace(SCENE, name="belts", deforming=frozenset("b")))
    assert view.levels == ()
    assert view.mesh is not before
    drawn = view.mesh.vertices[view.mesh.faces].reshape(-1, 3)
    np.testing.assert_allclose(drawn, page.all._parts.scale * bent[1].corners)


def mesh_of(view, name):
    return view._meshed(view._api, name, view.whole.corners, view.whole.triangles, 1.0)


def taken(page, parts, then):
    """Ask for a picture of these parts, call `then` meanwhile; return the picture or the error."""
    found = []

    def take():
        try:
            found.append(page.all._portraits.take(frame(0.0), NAMES, parts))
        except Exception as error:
            found.append(str(error))

    thread = threading.Thread(target=take)
    thread.start()
    then()
    thread.join()
    return found[0]


def other_scene(page):
    other = replace(SCENE, name="other")
    page.tell(scene=other, frame=frame(9.0), parts=[Part(HERE, np.ones(4), CORNERS)] * 2)


def test_no_picture_is_of_a_scene_that_is_over(page):
    parts = page.all._parts

    def change():
        while page.all._portraits.sitting is None:
            pass
        other_scene(page)

    assert "the scene has changed" in taken(page, parts, change)
    assert "the scene has changed" in taken(page, parts, lambda: None)
    assert page.all._portraits.sitting is None


def test_a_picture_waits_for_a_step_that_did_not_fail(page, monkeypatch):
    portrait, rendered = page.all._portraits, []
    image = np.zeros((2, 2, 4), np.uint8)
    monkeypatch.setattr(portrait, "_render", lambda *_: rendered.append(1) or image)
    monkeypatch.setattr(portraits, "PATIENCE_S", 0.2)
    sound = page.all._labels.show

    def steps():
        while portrait.sitting is None:
            pass
        for _ in range(3):
            page.tell()

    monkeypatch.setattr(page.all._labels, "show", lambda *_, **__: 1 / 0)
    assert "did not show" in taken(page, page.all._parts, steps)
    assert not rendered
    monkeypatch.setattr(page.all._labels, "show", sound)
    assert taken(page, page.all._parts, steps).shape == (2, 2, 3)


def banded(page, name):
    """Wait until a part's bands are up to date; return the triangles of each, and the legend."""
    banding = page.all._inspect._banding
    ends = time.monotonic() + START_DEADLINE_S  # kernels may have to be compiled
    while True:
        page.tell()
        if banding._job is None and name in banding._made and not banding._behind_s:
            break
        banding._due_s = 0.0
        assert time.monotonic() < ends
        threading.Event().wait(0.01)
    coats = page.all._parts[name].coats
    return [len(coat.corners) // 3 for coat in coats], words(page.all._inspect._legend)


def test_bands_know_what_is_stale_or_of_one_pair_alone_and_the_limits_in_force(page):
    parts = cubes(1.0, 1.0)
    page.tell(scene=replace(SCENE, name="bands"), parts=parts, frame=frame(1.0))
    page.choice.looks = {"b": Look(bands=True)}
    page.tell(frame=frame(1.1, level=STALE))
    assert banded(page, "b")[0][:3] == [0, 0, 0]
    page.tell(frame=frame(1.2))
    counts, legend = banded(page, "b")
    assert counts[:2] == [0, 0] and counts[2] > 0 and counts[3] == 0
    assert "certain" in legend
    assert [coat.opaque for coat in page.all._parts["b"].coats] == [True, True, False, False]
    page.tell(frame=frame(51.2, poses=(HERE, 9.0 * np.eye(7)[0] + HERE)))
    banded(page, "b")
    page.choice.at_s, banding = 1.2, page.all._inspect._banding
    banding._due_s = np.inf
    page.tell()
    assert "50.0 s after the moment that is shown" in words(page.all._inspect._legend)
    page.choice.at_s, banding._due_s = None, 0.0
    wide = replace(SCENE, name="bands", thresholds=Thresholds(5.0, 4.0, 0.0))
    page.tell(scene=wide, frame=frame(1.3))
    assert banded(page, "b")[0][2:] == [0, 0]
    then = replace(frame(1.4), whole=False)
    page.tell(frame=then)
    assert banded(page, "b")[0][:3] == [0, 0, 0]
