"""The panel that saves files."""

from __future__ import annotations

import struct
import threading
import zlib
from collections.abc import Callable

import numpy as np
import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.export import events_csv, pairs_csv, series_csv
from proximity_monitor.display.replay import replay_html
from proximity_monitor.display.shared import Shared, Shown

RENDER_S = 30.0
"""Seconds to wait for a browser's picture before giving up."""


class Save:
    """Five buttons; each sends a file to the browser that pressed it."""

    def __init__(
        self,
        gui: viser.GuiApi,
        shared: Shared,
        choice: Choice,
        shown: Callable[[], Shown | None],
        hide_gizmo: Callable[[bool], None],
    ) -> None:
        """Add the buttons at the current place of the GUI.

        Args:
            gui: takes the buttons.
            shared: the recorded session, its changes of state, and people's decisions.
            choice: the highlighted and ignored pairs.
            shown: returns the content of the page; None before the first frame.
            hide_gizmo: hides the gizmo while a picture is taken.
        """
        self._session = shared.session
        self._events = shared.events
        self._decisions = shared.decisions
        self._choice = choice
        self._shown = shown
        self._hide_gizmo = hide_gizmo
        with gui.add_folder("Save"):
            self._add(gui)

    def _add(self, gui: viser.GuiApi) -> None:
        table = gui.add_button("Pairs as CSV", icon=viser.Icon.TABLE)
        series = gui.add_button("Session as CSV", icon=viser.Icon.CHART_LINE)
        changes = gui.add_button("Events as CSV", icon=viser.Icon.LIST)
        picture = gui.add_button("Picture (PNG)", icon=viser.Icon.PHOTO)
        replay = gui.add_button("Replay with report (HTML)", icon=viser.Icon.MOVIE)
        gui.add_html(
            "<div class='pm pm-small pm-dim'>The replay is one file that plays in any browser,"
            " without a network.</div>"
        )
        table.on_click(sender(self._shown, "csv", self._table))
        series.on_click(sender(self._shown, "session.csv", self._series))
        changes.on_click(sender(self._shown, "events.csv", self._changes))
        picture.on_click(sender(self._shown, "png", self._picture))
        replay.on_click(sender(self._shown, "html", self._replay))

    def _table(self, shown: Shown, _: viser.ClientHandle) -> bytes:
        decisions = self._decisions.all
        return pairs_csv(shown.frame, shown.scene, self._session, decisions).encode()

    def _series(self, shown: Shown, _: viser.ClientHandle) -> bytes:
        return series_csv(self._session, shown.scene).encode()

    def _changes(self, shown: Shown, _: viser.ClientHandle) -> bytes:
        decisions = self._decisions.all
        return events_csv(self._events, self._session, shown.scene, decisions).encode()

    def _picture(self, _: Shown, client: viser.ClientHandle) -> bytes:
        self._hide_gizmo(True)
        try:
            camera = client.camera
            image = client.get_render(camera.image_height, camera.image_width, timeout=RENDER_S)
        finally:
            self._hide_gizmo(False)
        return png(image)

    def _replay(self, shown: Shown, client: viser.ClientHandle) -> bytes:
        camera = np.array([client.camera.position, client.camera.look_at])
        document = replay_html(shown.scene, shown.parts, self._session, self._choice, camera)
        return document.encode()


def sender(
    shown: Callable[[], Shown | None],
    suffix: str,
    make: Callable[[Shown, viser.ClientHandle], bytes],
) -> Callable[[viser.GuiEvent], None]:
    """Return a button's callback: a thread makes a file and sends it to the browser that asked.

    It needs a thread because it takes long, and because a picture waits for the page's steps.

    Args:
        shown: returns the content of the page; None before the first frame.
        suffix: ending of the file's name, after the scene's name.
        make: returns the file's content.
    """

    def send(content: Shown, client: viser.ClientHandle) -> None:
        try:
            file = make(content, client)
        except Exception as error:  # shown on the page, and logged when the thread ends
            client.add_notification("Not saved", why_not(error), color="red")
            raise
        name = f"{content.scene.name}.{suffix}"
        client.send_file_download(name, file, save_immediately=True)

    def on_click(event: viser.GuiEvent) -> None:
        content, client = shown(), event.client
        if content is not None and client is not None:
            threading.Thread(target=send, args=(content, client), daemon=True).start()

    return on_click


def why_not(error: Exception) -> str:
    """Return for people why a file or a picture could not be made, and what to do."""
    if isinstance(error, TimeoutError):  # a browser draws nothing in a tab that nobody sees
        return "the browser drew no picture in time: keep this tab in front, and try again"
    return f"{type(error).__name__}: {error}"


def png(image: np.ndarray) -> bytes:
    """Return an image (height, width, 3) of uint8 as a PNG file."""
    height, width, _ = image.shape
    rows = np.zeros((height, 1 + 3 * width), np.uint8)  # each row begins with filter 0: none
    rows[:, 1:] = image.reshape(height, -1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)  # 8 bits, RGB
    pixels = zlib.compress(rows.tobytes())
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        (chunk(b"IHDR", header), chunk(b"IDAT", pixels), chunk(b"IEND", b""))
    )
