"""What a browser asks for has its turn between two steps of its page, in their thread."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple

import viser


class _Call(NamedTuple):
    act: Callable[..., object]
    given: tuple[Any, ...]
    field: Any
    """Whose value a person has changed; None: of something else."""
    value: Any
    """What it was changed to."""


class Turns:
    """Keeps the calls of a browser's buttons and fields until the page takes them up.

    viser calls coroutines in the thread of its server, and all else by its executor, which here is
    this. In a thread of their own such calls would meet what a step has half changed.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        """Take the calls of a browser's GUI."""
        self._waiting: deque[_Call] = deque()
        gui._thread_executor = self

    def submit(self, act: Callable[..., object], *given: Any) -> Future:
        """Keep a call. Any thread may call; what is returned tells nothing of the result."""
        field = getattr(given[0], "target", None) if given else None
        field = field if hasattr(field, "value") else None
        self._waiting.append(_Call(act, given, field, getattr(field, "value", None)))
        return Future()

    def take_up(self) -> None:
        """Do what has come so far, in its order. An error leaves the rest for the next time."""
        for _ in range(len(self._waiting)):
            call = self._waiting.popleft()
            if call.field is None:
                call.act(*call.given)
            else:
                self._act_with_its_value(call)

    def _act_with_its_value(self, call: _Call) -> None:
        """Do it as if the field had still the value of that call: it may have got another since."""
        state = call.field._impl  # setting the field's `value` would call all who listen to it
        newer, state.value = state.value, call.value
        call.act(*call.given)
        if newer == call.value or state.value != call.value:
            return
        state.value = newer
        if not any(later.field is call.field for later in list(self._waiting)):
            call.field.value = call.value  # the page changed it, and told the browser so
