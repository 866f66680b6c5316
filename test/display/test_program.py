"""The display as a program: where it listens, whom it refuses, and how it ends."""

import signal
import socket

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from urllib.parse import urlsplit

import viser
import yaml
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from proximity_monitor import __main__ as command_line
from proximity_monitor import ending
from proximity_monitor.display import run
from proximity_monitor.display.serving import foreign


@pytest.fixture
def start(launch, wait):
    def start(**parameters):
        process = launch("display", monitor="nobody", **parameters)

        def said():
            assert process.popen.poll() is None, process.text
            return [x for x in process.text.splitlines() if x.startswith("display: ")]

        (line,) = wait(said, "the address", START_DEADLINE_S)
        return process, line.removeprefix("display: ")

    return start


@pytest.mark.long
def test_it_listens_on_this_machine_alone_refuses_foreign_pages_and_ends_on_a_signal(start):
    process, address = start(port=0)
    at = urlsplit(address)
    assert at.hostname == "127.0.0.1"
    socket_address = f"ws://{at.netloc}"
    protocol = [f"viser-v{viser.__version__}"]
    patient = {"subprotocols": protocol, "open_timeout": 60.0}
    with connect(socket_address, origin=address, **patient) as websocket:
        assert websocket.recv(timeout=60.0)
    with pytest.raises(InvalidStatus, match="403"):
        connect(socket_address, origin="http://example.org", **patient)
    process.popen.send_signal(signal.SIGINT)
    assert process.ended() == 0
    assert "Traceback" not in process.text


@pytest.mark.long
def test_a_port_that_is_taken_is_not_silently_another(start):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        process, address = start(port=port)
    assert urlsplit(address).port != port
    assert f"port {port} is taken" in process.text
    process.popen.send_signal(signal.SIGTERM)
    assert process.ended() == 0


def test_an_address_that_is_not_ours_is_refused(launch):
    process = launch("display", host="192.0.2.1", port=0)
    assert process.ended() == 1
    assert "192.0.2.1" in process.text
    assert "Traceback" not in process.text


@pytest.mark.parametrize("host", ["", "[a", "a: b", 'x"y', "::1", "null", "12"])
def test_any_host_is_taken_for_a_text(host, monkeypatch):
    """ROS reads the value of a parameter as YAML."""
    given = []
    monkeypatch.setattr(run, "main", lambda arguments: given.extend(arguments) or 0)
    monkeypatch.setattr(ending, "leave_with", lambda code: code)
    assert command_line.main(["display", "--host", host]) == 0
    (value,) = [each for each in given if each.startswith("host:=")]
    assert yaml.safe_load(value.removeprefix("host:=")) == host


@pytest.mark.parametrize(
    "origin, host, expected",
    [
        ("http://127.0.0.1:8080", "127.0.0.1:8080", False),
        ("https://cell.example", "cell.example", False),
        (None, "127.0.0.1:8080", False),
        ("http://127.0.0.1:9090", "127.0.0.1:8080", True),
        ("http://example.org", "127.0.0.1:8080", True),
        ("null", "127.0.0.1:8080", True),
    ],
)
def test_only_the_page_s_own_origin_is_not_foreign(origin, host, expected):
    assert foreign(origin, host) is expected
