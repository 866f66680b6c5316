"""The script in the page's document: what viser has no setting for.

Without a graphics card, the page draws without smoothing edges. A browser without one draws on the
processor, where antialiasing takes about half of a picture's time. viser always asks for
antialiasing. So a script that runs before viser's own looks at what draws, and leaves antialiasing
out if it is software. With `?smooth` behind the page's address nothing is left out, for pictures.

After Enter, a pose that was typed is in force. Then the field loses the focus, because keys that
are pressed in a field, such as Ctrl+Z, change its text and nothing else.

The style sheet needs to know some of viser's elements by what they hold. With `:has()`, a browser
would compute the style of the whole panel at each tick, which took a sixth of its time. So the
script marks these elements with an attribute, `data-pm`.
"""

from __future__ import annotations

import gzip
from functools import lru_cache

from websockets.http11 import Response

from proximity_monitor.display.bridge import BRIDGE

GIZMO = "/gizmo"
"""The name of a part's handles in the scene."""

_SCRIPT = b"""<script>
if (!new URLSearchParams(location.search).has('smooth')) {
  const gl = document.createElement('canvas').getContext('webgl2');
  const known = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = gl?.getParameter(known ? known.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  if (/swiftshader|llvmpipe|softpipe|software|basic render/i.test(name)) {
    const ask = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, wanted) {
      return ask.call(this, kind, {...wanted, antialias: false});
    };
  }
}
addEventListener('submit', () => document.activeElement?.blur());
addEventListener('pointerdown', () => {
  const {nodePoseData, nodeRefFromName} = window.__viserMutable ?? {};
  const handles = nodeRefFromName?.['GIZMO'];
  if (!handles || nodePoseData['GIZMO']?.poseUpdateState !== 'needsUpdate') return;
  const at = layer => handles.traverse(each => { each.layers.mask = layer; });
  at(0);  // presses find nothing in no layer
  requestAnimationFrame(() => at(1));
}, true);
const titles = '.mantine-Paper-root > .mantine-Paper-root:has(> svg)';
addEventListener('keydown', event => {
  if (!['Enter', ' '].includes(event.key) || !event.target.matches?.(titles)) return;
  event.preventDefault();
  event.target.click();
});
const mark = (element, name) => {
  if (element && element.dataset.pm !== name) element.dataset.pm = name;
};
let seen;  // the highlighted pair when the list was last drawn
new MutationObserver(() => {
  for (const each of document.querySelectorAll(`${titles}:not([tabindex])`)) {
    each.tabIndex = 0;
    each.role = 'button';
    mark(each.parentElement, 'folder');
  }
  mark(document.querySelector('#BRIDGE')?.parentElement.nextElementSibling, 'hidden');
  const pill = document.querySelector('#pm-connection');
  mark(pill?.parentElement, 'pinned');
  mark(pill?.closest('.mantine-ScrollArea-content [style*=overflow]'), 'around-pinned');
  if (!document.querySelector('#pm-pairs')) return;
  const row = document.querySelector('#pm-pairs .pm-chosen');
  if (row?.dataset.pair !== seen) row?.scrollIntoView({block: 'nearest'});
  seen = row?.dataset.pair;
}).observe(document, {childList: true, subtree: true});
</script>
""".replace(b"GIZMO", GIZMO.encode()).replace(b"BRIDGE", BRIDGE.encode())
_HEAD = b"<head>\n"


def add_script(response: Response) -> None:
    """Put the script into a response that holds the page's document; leave others as they are."""
    if response.body and response.headers.get("Content-Type", "").startswith("text/html"):
        zipped = response.headers.get("Content-Encoding") == "gzip"
        response.body = _with_script(response.body, zipped)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))


@lru_cache(maxsize=2)
def _with_script(body: bytes, zipped: bool) -> bytes:
    document = gzip.decompress(body) if zipped else body
    made = document.replace(_HEAD, _HEAD + _SCRIPT, 1)
    return gzip.compress(made) if zipped else made
