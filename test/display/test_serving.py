"""Which clients the page's server answers, and when its messages arrive."""

import socket
import sys
import threading
import time
import warnings
from collections import deque
from concurrent.futures import ThreadPoolExecutor

import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

import viser
import websockets.asyncio.server
from deadlines import DEADLINE_S
from raw_browser import RawBrowser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from proximity_monitor.display import serving

PROTOCOL = [f"viser-v{viser.__version__}"]


@pytest.mark.parametrize(
    "listening, host, expected",
    [
        ("127.0.0.1", "127.0.0.1:8080", False),
        ("127.0.0.1", "localhost:9090", False),  # as through a tunnel
        ("::1", "[::1]:8080", False),
        ("localhost", "LOCALHOST", False),
        ("127.0.0.1", "example.org:8080", True),
        ("127.0.0.1", "127.0.0.1.example.org", True),
        ("127.0.0.1", None, True),
        ("0.0.0.0", "cell.example:8080", False),
    ],
)
def test_a_machine_s_own_page_has_only_its_own_names(listening, host, expected):
    assert serving.disguised(listening, host) is expected


def test_a_foreign_name_for_this_machine_is_refused():
    server = serving.serve("127.0.0.1", 0, "test")
    try:
        port = server.get_port()
        with connect(f"ws://127.0.0.1:{port}", subprotocols=PROTOCOL) as websocket:
            assert websocket.recv(timeout=60.0)
        # A browser sends this request if the name example.org resolves to 127.0.0.1.
        own = socket.create_connection(("127.0.0.1", port))
        named = f"example.org:{port}"
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://{named}", sock=own, origin=f"http://{named}")
    finally:
        serving.stop(server)


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="this machine has no IPv6")
def test_the_address_may_be_one_of_ipv6():
    server = serving.serve("::1", 0, "test")
    try:
        address = f"ws://[::1]:{server.get_port()}"
        with connect(address, subprotocols=PROTOCOL) as websocket:
            assert websocket.recv(timeout=60.0)
    finally:
        serving.stop(server)


def test_what_a_browser_no_longer_hears_is_not_warned_of():
    """A browser may leave while its page is being updated."""
    server = serving.serve("127.0.0.1", 0, "test")
    try:
        with warnings.catch_warnings(record=True) as told:
            browser = RawBrowser(server)
            words = browser.client.gui.add_html("here")
            browser.close()
            deadline = time.monotonic() + DEADLINE_S
            while server.get_clients():
                assert time.monotonic() < deadline, "the server to know that the browser has gone"
                time.sleep(0.005)
            words.content = "gone"
        assert told == []
    finally:
        serving.stop(server)


def test_no_message_is_held_back_by_a_browser_because_another_came_late(server, raw):
    """A browser delays messages by the differences of their stamps, so every stamp is 0."""
    for text in ("one", "two"):
        before = raw.messages
        raw.client.gui.add_html(text)
        deadline = time.monotonic() + DEADLINE_S
        while raw.messages == before:
            assert time.monotonic() < deadline, "the message to be heard"
            time.sleep(0.005)
        assert raw.last["messages"] and raw.last["timestampSec"] == 0.0


def test_what_is_handed_over_is_sent_before_the_next_block_ends(server, raw, monkeypatch):
    """While an atomic block is open, a sender sends nothing, however early it was woken."""
    monkeypatch.setattr(serving, "_TURN_S", DEADLINE_S)  # a busy machine may be late with a turn
    numbers = raw.client.gui.add_html("")
    for i in range(20):
        with raw.client.atomic():
            numbers.content = f"number {i}"
        serving.hand_over(raw.client)
        with raw.client.atomic():
            deadline = time.monotonic() + DEADLINE_S
            while f"number {i}" not in str(raw.last):
                assert time.monotonic() < deadline, "the number to be heard within the block"
                time.sleep(0.001)


def test_senders_are_woken_in_their_own_thread_whichever_thread_sends_a_message(server, raw, wait):
    """An asyncio event that another thread sets may fail, or its waiters may miss it."""
    woken_in = set()

    class Waiters(deque):
        def __iter__(self):
            woken_in.add(threading.current_thread())
            return super().__iter__()

    for add, connection in (
        (server.gui.add_html, server._websock_server),
        (raw.client.gui.add_html, raw.client._websock_connection),
    ):
        event = connection.get_message_buffer().message_event
        event._waiters = Waiters(event._waiters)
        wait(lambda event=event: event._waiters and not event.is_set(), "a sender to wait")
        woken_in.clear()
        before = raw.messages
        add("here")
        wait(lambda before=before: raw.messages > before, "the message to be heard")
        assert woken_in and threading.current_thread() not in woken_in


def test_servers_that_start_at_once_leave_no_function_of_a_library_changed():
    plain, out = websockets.asyncio.server.serve, sys.stdout

    def start_and_stop():
        for _ in range(3):
            serving.stop(serving.serve("127.0.0.1", 0, "test"))

    with ThreadPoolExecutor(3) as threads:
        for each in [threads.submit(start_and_stop) for _ in range(3)]:
            each.result()
    assert websockets.asyncio.server.serve is plain
    assert sys.stdout is out
