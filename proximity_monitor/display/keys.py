"""Keys for what is otherwise pressed in the list or among the buttons; Ctrl+K lists all keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import viser

from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.inspection import SECTION, WHOLE, ZOOM


class Keys:
    """The keys of one page. A browser ignores them while a person types into a field."""

    def __init__(
        self,
        gui: viser.GuiApi,
        choice: Choice,
        listed: Callable[[], Sequence[PairName]],
        pick: Callable[[PairName | None], None],
        inspect: Callable[[str], None],
    ) -> None:
        """Add the keys.

        Args:
            gui: takes the keys.
            choice: holds the highlighted pair, and the moment that the page shows.
            listed: returns the pairs of the list, in its order.
            pick: highlights a pair; None: no pair.
            inspect: does what a button for seeing a gap does.
        """
        self._choice = choice
        self._listed = listed
        self._pick = pick

        def live() -> None:
            choice.at_s = None

        acts: tuple[tuple[str, str, Callable[[], None]], ...] = (
            ("Highlight the next pair of the list", "N", lambda: self._step(1)),
            ("Highlight the previous pair of the list", "P", lambda: self._step(-1)),
            ("Highlight no pair", "0", lambda: pick(None)),
            (ZOOM, "G", lambda: inspect(ZOOM)),
            (SECTION, "X", lambda: inspect(SECTION)),
            (WHOLE, "H", lambda: inspect(WHOLE)),
            ("Back to live", "L", live),
        )
        for label, key, act in acts:
            gui.add_command(label, hotkey=key).on_trigger(lambda _, act=act: act())

    def _step(self, by: int) -> None:
        """Highlight the pair so many rows below the highlighted one, around the list's end."""
        names = self._listed()
        if not names:
            return
        first = 0 if by > 0 else -1
        at = names.index(self._choice.pair) + by if self._choice.pair in names else first
        self._pick(names[at % len(names)])
