"""Without a graphics card the page is drawn without antialiasing."""

import gzip
import urllib.request

import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from deadlines import DEADLINE_S

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
