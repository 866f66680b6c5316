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
    field: str | None
    """Whose value a person has changed; None: of something else."""
    held: dict[str, Any]
    """What each field held then."""


class Turns:
    """Keeps the calls of a browser's buttons and fields until the page takes them up.

    viser calls coroutines in the thread of its server, and all else by its executor, which here is
    this. In a thread of their own such calls would meet what a step has half changed.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        """Take the calls of a browser's GUI."""
        self._waiting: deque[_Call] = deque()
        self._fields = gui._gui_input_handle_from_uuid
        gui._thread_executor = self

    def submit(self, act: Callable[..., object], *given: Any) -> Future:
        """Keep a call. Any thread may call; what is returned tells nothing of the result."""
        target = getattr(given[0], "target", None) if given else None
        held = {name: each._impl.value for name, each in list(self._fields.items())}
        field = target._impl.uuid if hasattr(target, "value") else None
        self._waiting.append(_Call(act, given, field if field in held else None, held))
        return Future()

    def hear_all(self) -> None:
        """Hear of each field that changes, also of one that only others' calls read.

        Comes when all fields are there.
        """
        for each in list(self._fields.values()):
            if not each._impl.update_cb and hasattr(each, "on_update"):
                each.on_update(_nothing)

    def take_up(self) -> None:
        """Do what has come so far, in its order. An error leaves the rest for the next time."""
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
                last.value = known[call.field]  # a step had told the browser another one

    def _act_with(self, values: dict[str, Any], call: _Call) -> dict[str, Any]:
        """Do it as if fields still held these values; return what they hold after it.

        They may have got others since, by a later call or by a step, and have those again then.
        Setting a field's `value` would call all who listen to it.
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
                if after[name] == values[name]:  # else the page has changed it now
                    state.value = newer[name]
        return after


def _nothing(_: viser.GuiEvent) -> None:
    pass
