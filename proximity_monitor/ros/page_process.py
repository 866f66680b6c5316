"""Runs the page in the browser as a child process of the demo.

The page is started by its module name, because only messages connect its node to this process.
"""

from __future__ import annotations

import importlib.util
import os
import re
import signal
import subprocess
import sys
import threading
import webbrowser
from collections import deque
from collections.abc import Callable

_MODULE = "proximity_monitor.display"
_ADDRESS = "display: "
_ERRORS = ("[ERROR]", "[FATAL]")
_RECORD = re.compile(r"\[(DEBUG|INFO|WARN|ERROR|FATAL)\]")
"""How a record of the ROS log begins; indented lines that follow belong to the record."""
_MOST_LINES = 100
"""Maximum number of lines of output, such as an uncaught traceback, that are kept for the end."""
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
        there, passes_on, in_record = False, False, False
        output: deque[str] = deque(maxlen=_MOST_LINES)  # since the last record
        for line in self._process.stdout:
            text = line.rstrip()
            if line.startswith(_ADDRESS):
                there, passes_on, in_record = True, False, True
                output.clear()
                address = text.removeprefix(_ADDRESS).strip()
                self._say(f"Drag the parts and see their clearances at {address}")
                if _has_desktop():
                    webbrowser.open(address)
            elif text:
                if _RECORD.match(line):
                    passes_on, in_record = line.startswith(_ERRORS), True
                    output.clear()
                elif not (in_record and line[0].isspace()):
                    in_record = False
                    output.append(text)
                if passes_on:
                    self._say(text)
        if not self._stopping:
            if not passes_on and len(output) > 1:
                self._say("\n".join(output))
            self._tell_end(there, output[-1] if output else "no message")

    def _tell_end(self, there: bool, reason: str) -> None:
        """Tell that the process has ended; `reason` does not hold if a signal ended it."""
        code = self._process.wait()
        if code < 0:
            try:
                name = signal.Signals(-code).name
            except ValueError:  # a real-time signal
                name = f"signal {-code}"
            how = f"killed by {name}"
            self._say(f"The page has ended: {how}" if there else f"No page: {how}")
        elif there:
            self._say(f"The page has ended (exit code {code}): {reason}")
        else:
            self._say(f"No page: {reason}")


def can_show_page() -> bool:
    """Return whether the page's library is installed."""
    return importlib.util.find_spec("viser") is not None


def _has_desktop() -> bool:
    """Return whether there is a screen; without one, a text browser might take this terminal."""
    return sys.platform == "darwin" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
