"""Callbacks of a browser's inputs run between two steps of its page, in the thread of the steps."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple

import viser


class _Call(NamedTuple):
    act: Callable[..., object]
    given: tuple[Any, ...]
    field: str | None
    """The identifier of the field that a person changed; None: the call is not from a field."""
    held: dict[str, Any]
    """The value of each field when the call came, by identifier."""


class Turns:
    """Keeps the calls of a browser's buttons and fields until the page takes them up.

    viser runs coroutines in its server's thread, and all other callbacks through its executor. This
    class replaces that executor. In threads of their own, the callbacks could meet data that a step
    has changed only in part.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        """Take over the callbacks of a browser's GUI."""
        self._waiting: deque[_Call] = deque()
        self._fields = gui._gui_input_handle_from_uuid
        gui._thread_executor = self

    def submit(self, act: Callable[..., object], *given: Any) -> Future:
        """Keep a call. Any thread may call this; the returned future never gets a result."""
        target = getattr(given[0], "target", None) if given else None
        held = {name: each._impl.value for name, each in list(self._fields.items())}
        field = target._impl.uuid if hasattr(target, "value") else None
        self._waiting.append(_Call(act, given, field if field in held else None, held))
        return Future()

    def hear_all(self) -> None:
        """Give every field a callback, also a field that only other callbacks read.

        Call this when all fields exist.
        """
        for each in list(self._fields.values()):
            if not each._impl.update_cb and hasattr(each, "on_update"):
                each.on_update(_nothing)

    def take_up(self) -> None:
        """Run the calls that have come so far, in order. After an error, the rest stay."""
        known: dict[str, Any] = {}
        for _ in range(len(self._waiting)):
            call = self._waiting.popleft()
            later = {each.field for each in list(self._waiting)}
            values = {x: known.get(x, call.held[x]) for x in later if x in call.held}
            if call.field is not None:
                values[call.field] = call.held[call.field]
            known.update(self._act_with(values, call))
            last = None if call.field in later else self._fields.get(call.field)
            if last is not None and last._impl.value != known[call.field]:
                last.value = known[call.field]  # a step had sent the browser another value

    def _act_with(self, values: dict[str, Any], call: _Call) -> dict[str, Any]:
        """Run a call as if fields still had these values; return their values after it.

        Later calls or a step may have given them newer values, which are put back afterwards.
        This sets the state directly, because setting a field's `value` would run its callbacks.
        """
        states = {name: self._fields[name]._impl for name in values if name in self._fields}
        newer = {name: state.value for name, state in states.items()}
        for name, state in states.items():
            state.value = values[name]
        try:
            call.act(*call.given)
        finally:
            after = {name: state.value for name, state in states.items()}
            for name, state in states.items():
                if after[name] == values[name]:  # if it differs, the call has set it
                    state.value = newer[name]
        return after


def _nothing(_: viser.GuiEvent) -> None:
    pass
