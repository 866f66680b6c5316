"""Fine motion: geared drags, drags that snap to steps, and single steps by buttons."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from proximity_monitor.display.geometry import (
    IDENTITY,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
)
from proximity_monitor.display.signs import DECIMALS
from proximity_monitor.display.state import Unit

GEARS = ("1 : 1", "1 : 10", "1 : 100", "1 : 1000")

SHIFTS = ("-X", "+X", "-Y", "+Y", "-Z", "+Z")
TURNS = tuple(f"{sign}R{axis}" for axis in "XYZ" for sign in "-+")


class Fine:
    """The panel for fine motion."""

    def __init__(self, gui: viser.GuiApi, on_step: Callable[[np.ndarray, np.ndarray], None]):
        """Add the panel at the current place of the GUI.

        Args:
            gui: takes the panel.
            on_step: gets a shift (3,) in metres and a rotation vector (3,), in the part's frame.
        """
        self._unit = Unit("m", 1.0)
        with gui.add_folder("Fine motion"):
            self._gear = gui.add_dropdown(
                "Drag", GEARS, hint="The part moves this share of the hand's way; key F: next"
            )
            self._snap = gui.add_checkbox(
                "Snap drags to the steps", False, hint="A drag moves and turns by whole steps"
            )
            self._step = gui.add_number("Step", 0.1, min=0.0, hint="Length of a step")
            self._turn = gui.add_number(
                "Turn step [deg]", 1.0, min=0.0, max=90.0, hint="Angle of a step"
            )
            shifts = gui.add_button_group("Step by", SHIFTS, hint="Along the part's own axes")
            turns = gui.add_button_group("Turn by", TURNS, hint="About the part's own axes")
        self._start = self._hand = IDENTITY  # the part's pose at first; the hand's last pose
        self._shift, self._turned = np.zeros(3), np.zeros(3)  # sums over the drag so far
        key = gui.add_command("Finer drags", hotkey="F")

        @shifts.on_click
        def _(_) -> None:
            axis, sign = divmod(SHIFTS.index(shifts.value), 2)
            on_step((2 * sign - 1) * self._steps()[0] * np.eye(3)[axis], np.zeros(3))

        @turns.on_click
        def _(_) -> None:
            axis, sign = divmod(TURNS.index(turns.value), 2)
            on_step(np.zeros(3), (2 * sign - 1) * self._steps()[1] * np.eye(3)[axis])

        @key.on_trigger
        def _(_) -> None:
            self._gear.value = GEARS[(GEARS.index(self._gear.value) + 1) % len(GEARS)]

    def begin(self, unit: Unit) -> None:
        """Take the unit of a scene; the smallest step is one of the last shown digit."""
        digits = DECIMALS.get(unit.symbol, 4)
        self._unit = unit
        self._step.label = f"Step [{unit.symbol}]"
        self._step.precision = digits
        self._step.min = self._step.step = 10.0**-digits
        self._step.value = 100.0 * 10.0**-digits

    def _steps(self) -> tuple[float, float]:
        step = max(self._step.value, self._step.min)  # a browser shows the least one later
        return step * self._unit.to_metre, np.radians(self._turn.value)

    def grip(self, start: np.ndarray, hand: np.ndarray) -> None:
        """Begin a drag of a part at a pose (7,), metres, with the handles at the pose `hand`."""
        self._start, self._hand = start, hand
        self._shift, self._turned = np.zeros(3), np.zeros(3)

    def followed(self, hand: np.ndarray) -> np.ndarray:
        """Return the pose (7,) to which a drag takes a part, from the pose of the handles.

        Each move of the hand is scaled by the gear that was set at the time. A drag turns about one
        axis, so its turns add up as rotation vectors, also beyond half a turn.

        Args:
            hand: (7,) present pose of the handles, metres.
        """
        gear, before, self._hand = 10.0 ** -GEARS.index(self._gear.value), self._hand, hand
        self._shift += gear * rotate(conjugate(self._start[3:]), hand[:3] - before[:3])
        self._turned += gear * to_rotation_vector(multiply(conjugate(before[3:]), hand[3:]))
        shift, turn = self._shift, self._turned
        if self._snap.value:
            step, angle = self._steps()
            shift = np.round(shift / step) * step
            size = np.linalg.norm(turn)
            if angle > 0.0 and size > 0.0:
                turn = turn * (np.round(size / angle) * angle / size)
        return stepped(self._start, shift, turn)


def stepped(pose: np.ndarray, shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return a pose (7,) shifted by (3,) and turned by a rotation vector (3,), in its own frame."""
    place = pose[:3] + rotate(pose[3:], shift)
    return np.concatenate((place, multiply(pose[3:], from_rotation_vector(turn))))
