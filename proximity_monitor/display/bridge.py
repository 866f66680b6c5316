"""Presses on the page's own HTML: each becomes a word that a callback takes.

viser shows HTML as given and hears only its own elements. So a hidden text field stands behind the
HTML, and a pressed element types its word into that field. Each word ends with the time of the
press, so that two presses of one element change the field twice. The page listens to presses, not
to clicks, because HTML that is rewritten between press and release would swallow a click.
"""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from urllib.parse import unquote

import viser

from proximity_monitor.display.choice import PairName

BRIDGE = "pm-bridge"
"""The id of an element right before the hidden text field."""

_TYPE = (
    "var t=event.target.closest('[data-word]');if(t){"
    f"var f=document.getElementById('{BRIDGE}').parentElement.nextElementSibling"
    ".querySelector('input');"
    "Object.getOwnPropertyDescriptor(HTMLInputElement.prototype,'value').set"
    ".call(f,t.dataset.word+'#'+Date.now());"
    "f.dispatchEvent(new Event('input',{bubbles:true}))}"
)
PRESSES = f'onpointerdown="{_TYPE}"'
"""The attribute of an element; presses on elements within it are heard."""

OnWord = Callable[[str], None]


class Bridge:
    """The hidden text field."""

    def __init__(self, gui: viser.GuiApi, on_word: OnWord) -> None:
        """Add the field at the current place of the GUI; `on_word` gets each word."""
        gui.add_html(f'<span id="{BRIDGE}"></span>')
        field = gui.add_text("pressed", "")

        @field.on_update
        def _(_) -> None:
            word, found, _ = field.value.rpartition("#")
            if found:
                on_word(word)


def word(text: str) -> str:
    """Return the attribute that makes an element within `PRESSES` send a word when pressed."""
    return f'data-word="{escape(text, quote=True)}"'


def pair_word(what: str, pair: PairName) -> str:
    """Return that attribute for a word about a pair; `as_pair` reads the part after the colon."""
    # Names may have hyphens. They are escaped, so " - " appears only between the two names.
    a, b = (name.replace("%", "%25").replace("-", "%2D") for name in pair)
    return word(f"{what}:{a} - {b}")


def as_pair(text: str) -> PairName | None:
    """Return the names of a pair from a pressed word; None: the word names no pair."""
    names = tuple(map(unquote, text.split(" - ")))
    return names if len(names) == 2 else None
