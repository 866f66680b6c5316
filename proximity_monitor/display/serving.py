"""The page's server: viser's, made safe for a machine that moves bodies."""

from __future__ import annotations

import asyncio
import contextlib
import http
import io
import socket
import threading
import time
import warnings
from collections.abc import Iterator
from types import SimpleNamespace
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server
import websockets.typing
from viser.infra import _async_message_buffer, _infra

from proximity_monitor.display.intake import Intake
from proximity_monitor.display.script import add_script

_STILL = SimpleNamespace(perf_counter=lambda: 0.0)
"""The clock for the stamps of viser's messages; viser takes nothing else from `time` there.

A browser uses the stamps to even out when it shows messages: after one late message, it delays the
next ones for seconds. With a clock that stands still, it shows each message on arrival."""

LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""The names by which a machine reaches only itself."""

_STARTING = threading.Lock()
"""Held while a server starts or stops, because that replaces functions of libraries for a time."""

_TURN_S, _LOOK_S = 0.01, 0.0005
"""Maximum seconds to wait for a sender's turn, and seconds between two checks for it."""


class _LoopEvent(asyncio.Event):
    """An asyncio event that other threads may set too: they let the event's loop do it.

    viser sets an event at each message, in the thread that sends the message. asyncio does not
    support that: `set` fails if a sender begins or ends to wait meanwhile, and a sender that is
    about to wait may miss the event, and with it every later one.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._of = loop
        self._asked = False

    def set(self) -> None:
        """Set the event: at once in the loop's thread, otherwise at the loop's next turn."""
        if asyncio._get_running_loop() is self._of:
            self._set()
        elif not self._asked:
            self._asked = True
            with contextlib.suppress(RuntimeError):  # the loop is closed: no sender is left
                self._of.call_soon_threadsafe(self._set)

    def _set(self) -> None:
        self._asked = False  # first, so that a thread that finds it true is not too late
        super().set()


class _Buffer(_async_message_buffer.AsyncMessageBuffer):
    """The messages for a browser, which any thread may add to."""

    def __init__(self, event_loop: asyncio.AbstractEventLoop, persistent_messages: bool) -> None:
        event = _LoopEvent(event_loop)
        super().__init__(event_loop, persistent_messages, message_event=event)


def serve(host: str, port: int, title: str) -> viser.ViserServer:
    """Start the server in its own threads.

    Args:
        host: the address to listen on.
        port: the first port to try; `server.get_port()` returns the one in use.
        title: the title above the panel.

    Raises:
        OSError: this machine has no such address.
    """
    # viser would wait for ever on an address that this machine does not have.
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    socket.create_server((host, 0), family=family).close()
    # A browser may leave during a step of its page; the next step notices it.
    warnings.filterwarnings("ignore", r"Queued a \w+ on a closed connection")
    _infra.AsyncMessageBuffer = _Buffer
    intake = Intake()
    with _STARTING, _guarded(intake), _silence():  # viser prints a banner
        server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    intake.server = server
    _infra.time = _STILL
    server.gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=False)
    light(server)
    return server


def light(server: viser.ViserServer) -> None:
    """Set lights that software renders quickly: no shadows, no environment map."""
    server.scene.configure_environment_map(hdri=None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_hemisphere(
        "/light", sky_color=(255, 255, 255), ground_color=(150, 155, 165), intensity=2.0
    )


def stop(server: viser.ViserServer) -> None:
    """End the server."""
    with _STARTING, _silence():
        server.stop()


def hand_over(client: viser.ClientHandle) -> None:
    """Send a browser the messages so far before any later ones, and wait until they are sent.

    Its sender is a Python thread too, and it sends nothing while an atomic block is open. If the
    next block begins before the sender has had its turn, the messages wait until that block ends.
    """
    client.flush()
    buffer, ends = client._websock_connection.get_message_buffer(), time.monotonic() + _TURN_S
    while buffer.message_from_id and not buffer.done and time.monotonic() < ends:
        time.sleep(_LOOK_S)


def _silence() -> contextlib.AbstractContextManager:
    return contextlib.redirect_stdout(io.StringIO())


@contextlib.contextmanager
def _guarded(intake: Intake) -> Iterator[None]:
    """Make a server that starts in this context refuse other sites' pages and illegal messages.

    A browser lets any page connect to any address of the browser's own machine. `Origin` names the
    page, and `Host` the name that it asked for. viser's server checks neither and has no setting
    for that, but takes `serve` from the module when it starts. Another site's page must not show
    this page in a frame either, because it could make a person click there unknowingly.
    """
    plain = websockets.asyncio.server.serve

    def checked(handler, host, port, *, process_request, **options):
        def look_at(connection, request):
            named = request.headers.get("Host")
            if foreign(request.headers.get("Origin"), named) or disguised(host, named):
                return connection.respond(http.HTTPStatus.FORBIDDEN, "foreign origin\n")
            response = process_request(connection, request)
            if response is not None:
                response.headers["X-Frame-Options"] = "DENY"
                response.headers["Content-Security-Policy"] = "frame-ancestors 'none'"
                add_script(response)
            return response

        class Checked(websockets.asyncio.server.ServerConnection):
            async def recv(self, decode: bool | None = None) -> websockets.typing.Data:
                while not intake.takes(message := await super().recv(decode)):
                    pass
                return message

        options |= {"process_request": look_at, "create_connection": Checked}
        return plain(handler, host, port, **options)

    websockets.asyncio.server.serve = checked
    try:
        yield
    finally:
        websockets.asyncio.server.serve = plain


def foreign(origin: str | None, host: str | None) -> bool:
    """Return whether a request comes from another site's page; programs send no origin."""
    return origin is not None and urlsplit(origin).netloc != host


def disguised(listening: str, host: str | None) -> bool:
    """Return whether a local request used a foreign name for this machine.

    After its page is loaded, another site can let its own name resolve to 127.0.0.1 (DNS
    rebinding). Then the page's origin and the requested host agree.
    """
    return listening in LOOPBACK and urlsplit(f"//{host}").hostname not in LOOPBACK
