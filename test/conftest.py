"""What tests of several folders need: profiles of property tests, and processes that use DDS.

Property tests draw the same examples each time and have no deadline, however busy the machine is.
`pytest --hypothesis-profile=search` draws new examples instead.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from deadlines import DEADLINE_S, START_DEADLINE_S
from hypothesis import settings

settings.register_profile("search", deadline=None, print_blob=True)
settings.register_profile("repeatable", settings.get_profile("search"), derandomize=True)
settings.load_profile("repeatable")


if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that starts the tests in the background ignores SIGINT. Programs would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)

FIRST = ("test_hard_cases.py", "test_process.py", "test_refit.py")
"""Files that come first: if the cache is empty, they compile much that all tests use."""


SHORT = ("display", "ros")
"""Folders whose test files take little time unless their tests start processes."""
TAIL = 0.2
"""The share of the other files that comes after the last file whose tests start processes."""


def pytest_collection_modifyitems(items):
    """Mix the files whose tests start processes with the other files.

    Workers are given whole files, in this order. A worker that waits for a process leaves its
    processor to others; if all wait at once, the processor idles. The last files should be short.
    """
    processes = {item.path for item in items if "ros_environment" in item.fixturenames}
    others = {item.path for item in items} - processes
    rank = {}
    for paths, share in ((processes, 1.0 - TAIL), (others, 1.0)):
        in_order = sorted(paths, key=lambda path: (path.parent.name in SHORT, path))
        rank |= {path: share * i / len(paths) for i, path in enumerate(in_order)}
    rank |= {path: FIRST.index(path.name) - len(FIRST) for path in rank if path.name in FIRST}
    items.sort(key=lambda item: rank[item.path])


def _claim_domain():
    """Return the first DDS domain that is free on this machine, and a socket that reserves it.

    The socket takes the port of a domain's first participant; our participants do without it. Only
    odd domains up to 49 are tried: `domain` + 1 is for demos, and `domain` + 50 for displays.
    """
    for domain in range(1, 50, 2):
        claim = socket.socket(type=socket.SOCK_DGRAM)
        try:
            claim.bind(("", 7400 + 250 * domain + 10))
        except OSError:
            claim.close()
        else:
            return domain, claim
    pytest.fail("somebody is in each of the DDS domains that are for tests")


@pytest.fixture(scope="session")
def ros_environment(tmp_path_factory):
    """A DDS domain of our own, limited to this machine, with logs in a temporary folder."""
    pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
    domain, claim = _claim_domain()
    os.environ.update(
        ROS_DOMAIN_ID=str(domain),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
        FASTDDS_BUILTIN_TRANSPORTS="UDPv4",  # shared memory of a killed peer would stay behind
        ROS_LOG_DIR=str(tmp_path_factory.mktemp("ros_log")),
        PATH=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        PYTHONSAFEPATH="1",
        PYTHONFAULTHANDLER="1",
    )
    with claim:
        yield


def _executable(name):
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if p]
    for prefix in [*prefixes, sys.prefix]:
        path = Path(prefix) / "lib" / "proximity_monitor" / name
        if path.is_file():
            return path
    pytest.fail(f"lib/proximity_monitor/{name} is not installed: install the package first")


class Process:
    """A running command, and what it prints."""

    def __init__(self, command, log, environment):
        self.log = log
        with log.open("w") as out:
            self.popen = subprocess.Popen(
                [str(part) for part in command],
                stdout=out,
                stderr=subprocess.STDOUT,
                env=os.environ | environment,
            )

    def ended(self, timeout_s=START_DEADLINE_S):
        code = self.popen.wait(timeout_s)
        assert code >= 0, f"ended by signal {-code}:\n{self.text}"
        return code

    def stop(self, kind=signal.SIGINT):
        """Signal the process; return its exit code and how many seconds it took to end."""
        began = time.monotonic()
        if self.popen.poll() is None:
            self.popen.send_signal(kind)
        try:
            code = self.popen.wait(DEADLINE_S)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            raise
        return code, time.monotonic() - began

    @property
    def text(self):
        return self.log.read_text()


@contextmanager
def _launching(folder):
    """Yield a function that starts executables with ROS parameters; end those still running."""
    numbers = count()
    with ExitStack() as stack:

        def start(name, /, *arguments, environment=None, **parameters):
            given = [part for k, v in parameters.items() for part in ("-p", f"{k}:={v}")]
            command = [_executable(name), "--ros-args", *given, *arguments]
            log = folder / f"{next(numbers)}_{name}.log"
            process = Process(command, log, environment or {})
            stack.callback(process.stop, signal.SIGTERM)
            return process

        yield start


@pytest.fixture(scope="module")
def launch_for_all(ros_environment, tmp_path_factory):
    """Like `launch`, for executables that all tests of a file share: they end with the file."""
    with _launching(tmp_path_factory.mktemp("processes")) as start:
        yield start


@pytest.fixture
def launch(ros_environment, tmp_path_factory):
    """Start an executable that ends with the test, so that later tests have all the cores."""
    with _launching(tmp_path_factory.mktemp("processes")) as start:
        yield start


@pytest.fixture
def run(ros_environment, tmp_path):
    """Start any command; it is killed when the test ends."""
    started = []

    def start(*command):
        started.append(Process(command, tmp_path / f"run_{len(started)}.log", {}))
        return started[-1]

    yield start
    for process in started:
        process.stop(signal.SIGKILL)


@pytest.fixture
def executable(ros_environment):
    """A function that returns the path of an installed executable, given its name."""
    return _executable


@pytest.fixture(scope="session")
def rclpy_context(ros_environment):
    import rclpy

    rclpy.init(args=[])
    yield
    rclpy.try_shutdown()


@pytest.fixture
def as_matrix():
    def matrix(position, quaternion=(0.0, 0.0, 0.0, 1.0)):
        """Return the (4, 4) pose for a quaternion (x, y, z, w), by Rodrigues' formula."""
        *axis, w = np.array(quaternion) / np.linalg.norm(quaternion)
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        made = np.eye(4)
        made[:3, :3] = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
        made[:3, 3] = position
        return made

    return matrix
