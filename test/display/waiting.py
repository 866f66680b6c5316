"""Waits of the page's tests; each ends as soon as its condition holds."""

from __future__ import annotations

import threading
import time

from deadlines import DEADLINE_S

LOOK_S = 0.1


def until(condition, what, timeout_s=DEADLINE_S):
    """Call the condition until it returns something true, and return that."""
    deadline = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited for {what}"
        threading.Event().wait(LOOK_S)
    return found


def agree(check, timeout_s=DEADLINE_S):
    """Call `check` until none of its assertions fails, and return its result."""
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            return check()
        except AssertionError:
            if time.monotonic() > deadline:
                raise
        threading.Event().wait(LOOK_S)
