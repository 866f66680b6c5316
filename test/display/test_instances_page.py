"""Bodies that are drawn as instances of one mesh, in a real Chromium."""

import imageio.v3 as iio
import numpy as np
import pytest
import trimesh

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_hand import opened

from proximity_monitor.display import parts as parts_module
from proximity_monitor.display.choice import Choice, Look
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import Body, Frame, SceneInfo, Thresholds, Unit

SIDE = 3


@pytest.fixture
def boxes(server, monkeypatch):
    """Boxes of one shape in rows, and a camera that looks down on them."""
    monkeypatch.setattr(parts_module, "MANY", SIDE**2)
    bodies = tuple(Body(f"b{i}", True, f"b{i}", False, "1") for i in range(SIDE**2))
    scene = SceneInfo(
        "s", "", "w", Unit("m", 1.0), bodies, frozenset(), 0, Thresholds(1, 0, 0), {}, True, {}
    )
    corners = trimesh.creation.box((1.0, 1.0, 1.0)).triangles.reshape(-1, 3)
    parts = [Part(None, np.array([0.9, 0.1, 0.1, 1.0]), corners) for _ in bodies]
    server.initial_camera.position, server.initial_camera.look_at = (2.0, 1.9, 9.0), (2.0, 2.0, 0.0)
    return Parts(server, scene, parts)


def look(page, left, top, width, height):
    """Return the colours (n, 3) of the pixels of a rectangle."""
    clip = {"x": left, "y": top, "width": width, "height": height}
    return iio.imread(page.screenshot(clip=clip))[..., :3].astype(int).reshape(-1, 3)


def dark(page):
    """Return how many pixels are dark in the picture of the first box."""
    return int((look(page, 245, 295, 65, 60).max(axis=-1) < 110).sum())


def face(page, i):
    """Return the colour of the upper side of a box of the first row."""
    return np.median(look(page, 268 + 77 * i, 320, 8, 8), axis=0)


@pytest.mark.long
def test_instances_look_like_other_bodies_with_edges_and_what_has_no_pose_is_hidden(
    server, boxes, browser, wait
):
    grid = np.array([(2.0 * (i % SIDE), 2.0 * (i // SIDE), 0.0) for i in range(SIDE**2)])
    poses = np.column_stack((grid, np.tile((1.0, 0, 0, 0), (SIDE**2, 1))))
    boxes.show(Frame(0.0, poses, None), {}, Choice(), ())
    page = opened(browser, f"http://127.0.0.1:{server.get_port()}", 700, 500)
    wait(lambda: dark(page) > 50, "the edges")
    white, red = np.full(3, 255.0), face(page, 0)
    assert red[0] > red[1:].max() + 60
    alone = Choice(looks={"b0": Look(edges=False)})
    boxes.show(Frame(1.0, poses, None), {}, alone, ())
    wait(lambda: dark(page) < 15, "the edges of one to go")
    np.testing.assert_allclose(face(page, 0), face(page, 1), atol=8)
    np.testing.assert_allclose(face(page, 0), red, atol=8)
    poses[1] = 0.0
    boxes.show(Frame(2.0, poses, None), {}, alone, ())
    wait(lambda: np.allclose(face(page, 1), white), "a box to go")
    assert np.allclose(face(page, 0), red, atol=8)
    page.close()
