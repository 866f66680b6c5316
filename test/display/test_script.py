"""The script in the page's document: antialiasing, and handles that come back."""

import gzip
import urllib.request

import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from deadlines import DEADLINE_S

from proximity_monitor.display.script import GIZMO
from proximity_monitor.display.style import STYLE

ANTIALIAS = """() => {
  const canvas = window.__viserMutable?.canvas;
  return canvas && String(canvas.getContext('webgl2').getContextAttributes().antialias);
}"""


@pytest.mark.parametrize("behind, expected", [("", "false"), ("?smooth", "true")])
def test_edges_are_smoothed_only_if_asked_for(browser, server, behind, expected):
    """The tests' Chromium draws in software."""
    page = browser.new_page()
    try:
        page.goto(f"http://127.0.0.1:{server.get_port()}/{behind}", timeout=1e3 * DEADLINE_S)
        drawn = page.wait_for_function(ANTIALIAS, timeout=1e3 * DEADLINE_S)
        assert drawn.json_value() == expected
    finally:
        page.close()


def test_styles_depend_on_no_descendants():
    """At each tick a browser would compute the whole panel's style anew."""
    assert ":has(" not in STYLE


# While `step` is set, pictures are drawn one by one, by calling it.
STEPPED = """(() => {
  const frame = requestAnimationFrame.bind(window);
  let waiting = [];
  window.hold = () => {
    window.step = () => {
      const now = waiting;
      waiting = [];
      now.forEach(draw => draw(performance.now()));
    };
  };
  window.requestAnimationFrame = draw => window.step ? -waiting.push(draw) : frame(draw);
})()"""
# Draws a picture; then where the handles stand, in the world's frame.
STANDS = """() => {
  step();
  return new Promise(done => setTimeout(() => {
    const at = window.__viserMutable.nodeRefFromName['/gizmo']?.matrix.elements.slice(12, 15);
    done(at ?? null);
  }, 50));
}"""
# Where the middle of the x handle is on the screen.
ON_HANDLE = """() => {
  const m = window.__viserMutable, node = m.nodeRefFromName['/gizmo'];
  let rod = null;
  node.traverse(each => { if (each.geometry?.type === 'CylinderGeometry') rod ??= each; });
  rod.updateWorldMatrix(true, false);
  m.camera.updateMatrixWorld();
  const p = rod.position.clone().set(0, 0, 0).applyMatrix4(rod.matrixWorld).project(m.camera);
  const r = m.canvas.getBoundingClientRect();
  return [r.left + (p.x + 1) * r.width / 2, r.top + (1 - p.y) * r.height / 2];
}"""


def test_handles_that_come_back_are_not_gripped_before_they_are_drawn(browser, server, wait):
    dragged = []
    gizmo = server.scene.add_transform_controls(GIZMO, scale=100.0, fixed=True, visible=False)
    gizmo.position = (0.5, 0.3, 0.2)
    gizmo.on_update(lambda event: dragged.append(event.target.position))
    page = browser.new_page()
    try:
        page.add_init_script(STEPPED)
        page.goto(f"http://127.0.0.1:{server.get_port()}/", timeout=1e3 * DEADLINE_S)
        page.wait_for_function(ANTIALIAS, timeout=1e3 * DEADLINE_S)
        wait(lambda: page.evaluate("() => '/gizmo' in window.__viserMutable.nodePoseData"), "it")
        page.evaluate("() => hold()")
        gizmo.visible = True
        # Mounted, but not yet placed: one picture later it is.
        wait(lambda: page.evaluate(STANDS) == [0, 0, 0], "the handles at the origin")

        def pull():
            dragged.clear()
            x, y = page.evaluate(ON_HANDLE)
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + 40, y + 40, steps=4)
            page.mouse.up()
            page.wait_for_timeout(300)
            return list(dragged)

        assert pull() == []
        wait(lambda: page.evaluate(STANDS) == pytest.approx([0.5, 0.3, 0.2]), "their place")
        assert page.evaluate(STANDS)
        assert pull()
    finally:
        page.close()


@pytest.mark.parametrize("coding", ["gzip", "identity"])
def test_the_document_is_whole(server, coding):
    request = urllib.request.Request(f"http://127.0.0.1:{server.get_port()}/")
    request.add_header("Accept-Encoding", coding)
    with urllib.request.urlopen(request, timeout=DEADLINE_S) as response:
        assert response.headers.get_all("Content-Encoding") == [coding]
        body = response.read()
        assert response.headers.get_all("Content-Length") == [str(len(body))]
    document = (gzip.decompress(body) if coding == "gzip" else body).decode()
    head, _, rest = document.partition("<head>\n")
    assert rest.startswith("<script>\nif (!new URLSearchParams")
    assert document.rstrip().endswith("</html>") and "<!doctype html>" in head
