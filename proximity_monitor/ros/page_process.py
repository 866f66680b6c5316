"""Runs the page in the browser as a child process of the demo.

The page is started by its module name, because only messages connect its node to this process.
"""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import threading
import webbrowser
from collections.abc import Callable

_MODULE = "proximity_monitor.display"
_ADDRESS = "display: "
_ERRORS = ("[ERROR]", "[FATAL]")
_END_S = 10.0


class PageProcess:
    """Runs the display, and reports its address once it is known."""

    def __init__(self, say: Callable[[str], None]) -> None:
        """Start the display; another thread calls `say` with lines for the user."""
        self._say = say
        self._stopping = False
        self._process = subprocess.Popen(
            [sys.executable, "-m", _MODULE],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reading = threading.Thread(target=self._read)
        self._reading.start()

    def stop(self) -> None:
        """End the display."""
        self._stopping = True
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(_END_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._reading.join()

    def _read(self) -> None:
        last, there = "", False
        for line in self._process.stdout:
            last = line.strip() or last
            if line.startswith(_ERRORS):
                self._say(line.strip())
            elif line.startswith(_ADDRESS):
                there = True
                address = line.removeprefix(_ADDRESS).strip()
                self._say(f"Drag the parts and see their clearances at {address}")
                if _has_desktop():
                    webbrowser.open(address)
        if not self._stopping:
            code = self._process.wait()
            said = last if last and not last.startswith(_ADDRESS) else "no message"
            what = f"The page has ended (exit code {code})" if there else "No page"
            self._say(f"{what}: {said}")


def can_show_page() -> bool:
    """Return whether the page's library is installed."""
    return importlib.util.find_spec("viser") is not None


def _has_desktop() -> bool:
    """Return whether there is a screen; without one, a text browser might take this terminal."""
    return sys.platform == "darwin" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
