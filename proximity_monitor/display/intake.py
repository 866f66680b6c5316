"""What a browser may send. All other messages are dropped before viser reads them.

viser accepts whatever browsers send: any value of any input, of any length. Here a message must be
of a kind that the page needs, its fields must have viser's types and be bounded, and an input
accepts only values that it could show.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec
import viser
from viser import _messages

BYTES = 20_000
"""Maximum bytes of a message; a picture that was asked for may be longer."""

TEXT = 2000
"""Maximum characters of a text: enough for the names of two parts and more, or for a comment."""

FAR = 1e9
"""Largest absolute value of a number."""

TURN = 1e-3
"""Minimum length of a quaternion; those of handles have unit length except for rounding."""

PICTURE = "GetRenderResponseMessage"
KINDS = {
    name: getattr(_messages, name)
    for name in (
        "CommandTriggerMessage",
        "FileTransferPartAck",
        PICTURE,
        "GuiFormDirtyMessage",
        "GuiFormSubmitMessage",
        "GuiUpdateMessage",
        "SceneNodeClickMessage",
        "ScenePointerMessage",
        "TransformControlsDragEndMessage",
        "TransformControlsDragStartMessage",
        "TransformControlsUpdateMessage",
        "ViewerCameraMessage",
    )
}


class Intake:
    """Checks the messages to one server."""

    def __init__(self) -> None:
        """Begin without a server; set `server` later, because its inputs are needed."""
        self.server: viser.ViserServer | None = None

    def takes(self, raw: bytes | str) -> bool:
        """Return whether a message may pass to viser."""
        try:
            told = msgspec.msgpack.decode(raw)
            kind = told.pop("type")
            msgspec.convert(told, KINDS[kind])
            known = told.keys() <= KINDS[kind].__dataclass_fields__.keys()
        except (msgspec.MsgspecError, RecursionError, AttributeError, KeyError, TypeError):
            return False
        if kind == PICTURE:
            return known
        if not known or len(raw) > BYTES or not bounded(told):
            if kind == "GuiUpdateMessage":
                self._put_back(told["uuid"])
            return False
        if kind == "TransformControlsUpdateMessage":
            return math.hypot(*told["wxyz"]) > TURN
        return kind != "GuiUpdateMessage" or self._legal(told["uuid"], told["updates"])

    def _legal(self, uuid: str, updates: dict[str, Any]) -> bool:
        found = self._input(uuid)
        return found is not None and updates.keys() == {"value"} and legal(found, updates["value"])

    def _put_back(self, uuid: str) -> None:
        """Send a browser the text that the server has, so that it stops showing a dropped one."""
        found = self._input(uuid)
        if isinstance(found, viser.GuiTextHandle):
            # Setting the handle's `value` to the value that it has would send nothing.
            known = _messages.GuiUpdateMessage(uuid, {"value": found.value})
            found._impl.gui_api._websock_interface.queue_message(known)

    def _input(self, uuid: str) -> Any:
        """Return an input of any page by its identifier; None: there is none."""
        if self.server is None:
            return None
        owners = (self.server, *self.server.get_clients().values())
        # viser has no public way from an input's identifier to the input.
        inputs = (owner.gui._gui_input_handle_from_uuid.get(uuid) for owner in owners)
        return next((each for each in inputs if each is not None), None)


def bounded(value: Any) -> bool:
    """Return whether all numbers and texts in a message are bounded; NaN is not."""
    match value:
        case dict():
            return all(bounded(key) and bounded(each) for key, each in value.items())
        case list():
            return all(map(bounded, value))
        case str() | bytes():
            return len(value) <= TEXT
        case int() | float():
            return -FAR <= value <= FAR
    return value is None


def legal(each: Any, value: Any) -> bool:
    """Return whether a bounded value is one that an input of the page can have."""
    match each:
        case viser.GuiDropdownHandle() | viser.GuiButtonGroupHandle():
            return isinstance(value, str) and value in each.options
        case viser.GuiTextHandle():
            return isinstance(value, str)
        case viser.GuiSliderHandle() | viser.GuiNumberHandle():
            low, high = each.min, each.max
            low, high = -math.inf if low is None else low, math.inf if high is None else high
            slack = 1e-9 * max(abs(low), abs(high)) if math.isfinite(low + high) else 0.0
            return _number(value) and low - slack <= value <= high + slack
        case viser.GuiVector2Handle() | viser.GuiVector3Handle():
            same = isinstance(value, list) and len(value) == len(each.value)
            return same and all(map(_number, value))
        case viser.GuiCheckboxHandle() | viser.GuiButtonHandle():
            return isinstance(value, bool)
    return False


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
