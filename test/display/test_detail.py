"""Parts that look small are drawn with fewer triangles, and look the same."""

import math
from dataclasses import replace

import imageio.v3 as iio
import numpy as np
import pytest
import trimesh

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from page_hand import opened

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.detail import FEWEST, PIXELS, levels
from proximity_monitor.display.geometry import IDENTITY, shared
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import Body, Frame, SceneInfo, Thresholds, Unit

COUNT = 20480
BALL = trimesh.creation.icosphere(subdivisions=5, radius=0.5).triangles.reshape(-1, 3)
SCENE = SceneInfo(
    "s", "", "w", Unit("m", 1.0), (Body("ball", True, "b", False, "1"),), frozenset(), 0,
    Thresholds(1, 0, 0), {}, True, {},
)  # fmt: skip

# How many triangles the ball is drawn with.
TRIANGLES = """() => {
  let sum = 0;
  window.__viserMutable?.scene?.traverse(each => {
    if (each.isInstancedMesh2) {
      const {index, drawRange} = each.geometry;
      sum += each.count * Math.min(index.count, drawRange.count) / 3;
    }
  });
  return sum;
}"""


def test_from_each_distance_on_triangles_look_small_and_enough_are_left():
    focal = 500.0
    found = levels(BALL, COUNT, focal)
    assert [share for _, share in found] == [1 / 4, 1 / 16, 1 / 64]
    radius = 0.5 * math.sqrt(3.0)  # half the diagonal of the bounding box
    for distance, share in found:
        pixels = math.pi * (focal * radius / (distance - radius)) ** 2
        assert pixels / (0.5 * share * COUNT) == pytest.approx(PIXELS)
        assert share * COUNT >= FEWEST
    assert levels(BALL[: 3 * FEWEST], FEWEST, focal) == ()
    assert levels(BALL[:0], 0, focal) == ()


def test_corners_that_are_equal_are_shared_whatever_the_sign_of_their_zeros():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, -0.0], [1, 1, 0], [-0.0, 1, 0]])
    first, triangles = shared(corners)
    assert len(first) == 4
    np.testing.assert_array_equal(corners[first][triangles].reshape(-1, 3), corners)


def test_a_body_that_deforms_shares_other_corners_when_they_part(server):
    scene = replace(SCENE, deforming=frozenset({"ball"}))
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0.0]])
    views = Parts(server, scene, [Part(IDENTITY, np.ones(4), square)])
    mesh = views["ball"].mesh
    for corners, count in ((square + 0.5, 4), (square + (np.arange(6) > 2)[:, None], 6)):
        views.reshape([Part(IDENTITY, np.ones(4), corners)], scene.deforming)
        assert len(mesh.vertices) == count
        np.testing.assert_array_equal(mesh.vertices[mesh.faces].reshape(-1, 3), corners)


def look(page):
    """Return the colours (80, 80, 3) in the middle of the picture."""
    clip = {"x": 410, "y": 210, "width": 80, "height": 80}
    return iio.imread(page.screenshot(clip=clip))[..., :3].astype(int)


def red(page):
    """Return how many pixels have the ball's colour."""
    seen = look(page)
    return int((seen[..., 0] > seen[..., 2] + 60).sum())


@pytest.mark.long
def test_a_far_ball_has_fewer_triangles_and_looks_the_same(server, browser, wait):
    camera = server.initial_camera
    camera.position, camera.look_at = (0.0, 1e-3, 5.6), (0.0, 0.0, 0.0)
    page = opened(browser, f"http://127.0.0.1:{server.get_port()}", 900, 500)
    pictures = []
    for focal in (1e9, 300.0):  # with the first, levels begin beyond any camera
        views = Parts(server, SCENE, [Part(None, np.ones(4) * (0.8, 0.2, 0.2, 1), BALL)], focal)
        views.show(Frame(0.0, IDENTITY[None], None), {}, Choice(), ())
        drawn = COUNT if focal > 1e6 else COUNT / 16
        wait(
            lambda drawn=drawn: page.evaluate(TRIANGLES) == pytest.approx(drawn, rel=0.05), "levels"
        )
        wait(lambda: red(page) > 2000, "the ball")
        pictures.append(look(page))
    differ = np.abs(np.subtract(*pictures)).max(axis=2)
    assert (differ > 40).sum() < 100  # along the outline
    assert (differ > 2).sum() < 250  # shaded by the whole ball's normals; else 3 times as many
    for client in server.get_clients().values():
        client.camera.position = (0.0, 1e-3, 2.0)
    wait(lambda: page.evaluate(TRIANGLES) == COUNT, "the whole of it from near")
    page.close()
