"""The page's server: viser's, made safe for a machine that moves bodies."""

from __future__ import annotations

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
from viser.infra import _infra

from proximity_monitor.display.intake import Intake

_STILL = SimpleNamespace(perf_counter=lambda: 0.0)
"""The clock whose time viser tells with each of its messages; that is all that it asks of it there.

By these times a browser evens out when it shows messages: if one has come late, it holds back those
that follow, for seconds. By a clock that stands still it shows each as soon as it has come."""

LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""The names under which only this machine can reach itself."""

_STARTING = threading.Lock()
"""While a server starts, functions of libraries are others: one at a time may change them."""

_TURN_S, _LOOK_S = 0.01, 0.0005
"""Seconds that a sender may take to have its turn, and between two looks whether it had."""


def serve(host: str, port: int, title: str) -> viser.ViserServer:
    """Start the server in threads of its own.

    Args:
        host: the address to listen on.
        port: the first port to try; `server.get_port()` returns the one in use.
        title: above the panel.

    Raises:
        OSError: there is no such address on this machine.
    """
    # viser would wait for ever on an address that is not ours.
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    socket.create_server((host, 0), family=family).close()
    # A browser may go in the middle of a step of its page; the next step knows.
    warnings.filterwarnings("ignore", r"Queued a \w+ on a closed connection")
    intake = Intake()
    with _STARTING, _guarded(intake), _silence():  # it prints a banner
        server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    intake.server = server
    _infra.time = _STILL
    server.gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=False)
    light(server)
    return server


def light(server: viser.ViserServer) -> None:
    """Light the scene so that software renders it quickly: no shadows, no environment map."""
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
    """Have what was told to a browser so far sent before what follows, and wait until it is.

    Its sender is a thread of Python too, and takes nothing while an atomic block is open: if the
    next one begins before it has had its turn, all of that waits for the end of the next one.
    """
    client.flush()
    buffer, ends = client._websock_connection.get_message_buffer(), time.monotonic() + _TURN_S
    while buffer.message_from_id and not buffer.done and time.monotonic() < ends:
        time.sleep(_LOOK_S)


def wake(server: viser.ViserServer) -> None:
    """Wake what sends to the browsers, in case it missed its call; comes after each step.

    viser sets an event of asyncio from other threads too, which asyncio does not provide for. If it
    is set after a sender has looked at it and before that sender waits, then the sender sleeps with
    the event set. Each later `set` does nothing, and that browser would never hear anything again.
    """
    connections = [client._websock_connection for client in server.get_clients().values()]
    buffers = [each.get_message_buffer() for each in (server._websock_server, *connections)]

    def set_again() -> None:
        for buffer in buffers:
            if buffer.message_event.is_set():
                buffer.message_event.clear()
                buffer.message_event.set()

    server.get_event_loop().call_soon_threadsafe(set_again)


def _silence() -> contextlib.AbstractContextManager:
    return contextlib.redirect_stdout(io.StringIO())


@contextlib.contextmanager
def _guarded(intake: Intake) -> Iterator[None]:
    """Make a server that starts in this context refuse other sites' pages and illegal messages.

    A browser lets every page connect to every address of its own machine. `Origin` names the page
    and `Host` the name that it asked for; viser's server checks neither and has no setting for it,
    but it takes `serve` from the module when it starts. Nor may another site's page show this one
    in a frame, where it would lead a person's clicks.
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
    """Return whether a request comes from the page of another site; programs name no origin."""
    return origin is not None and urlsplit(origin).netloc != host


def disguised(listening: str, host: str | None) -> bool:
    """Return whether a local request came under a name that others gave this machine.

    Another site can let its own name resolve to 127.0.0.1 once its page is loaded (DNS rebinding);
    then the page's origin and the host that it asks are the same.
    """
    return listening in LOOPBACK and urlsplit(f"//{host}").hostname not in LOOPBACK
