"""Clicks on the page's own HTML: each becomes a text that a callback takes.

viser shows HTML as given and hears only its own elements. So there is a hidden text field behind
the HTML, and a pressed element types its word there. Words end with the time of the press, so that
pressing one twice changes the field twice. It listens to presses, not to clicks, because HTML that
is rewritten between press and release would swallow a click.
"""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from urllib.parse import unquote

import viser

from proximity_monitor.display.choice import PairName

_ID = "pm-bridge"
_STYLE = f"div:has(> #{_ID}) + * {{ display: none }}"
_TYPE = (
    "var t=event.target.closest('[data-word]');if(t){"
    f"var f=document.getElementById('{_ID}').parentElement.nextElementSibling"
    ".querySelector('input');"
    "Object.getOwnPropertyDescriptor(HTMLInputElement.prototype,'value').set"
    ".call(f,t.dataset.word+'#'+Date.now());"
    "f.dispatchEvent(new Event('input',{bubbles:true}))}"
)
PRESSES = f'onpointerdown="{_TYPE}"'
"""The attribute of an element within which presses are heard."""

OnWord = Callable[[str], None]


class Bridge:
    """The hidden field."""

    def __init__(self, gui: viser.GuiApi, on_word: OnWord) -> None:
        """Add the field at this place of the GUI; `on_word` gets each word."""
        gui.add_html(f'<style>{_STYLE}</style><span id="{_ID}"></span>')
        field = gui.add_text("pressed", "")

        @field.on_update
        def _(_) -> None:
            word, found, _ = field.value.rpartition("#")
            if found:
                on_word(word)


def word(text: str) -> str:
    """Return the attribute with which an element within `PRESSES` sends a word when pressed."""
    return f'data-word="{escape(text, quote=True)}"'


def pair_word(what: str, pair: PairName) -> str:
    """Return the same for a word about a pair; `as_pair` reads what follows `what` and a colon."""
    # Names may have hyphens: those that are left are between the two.
    a, b = (name.replace("%", "%25").replace("-", "%2D") for name in pair)
    return word(f"{what}:{a} - {b}")


def as_pair(text: str) -> PairName | None:
    """Return a pair's names from a pressed word; None: it is about no pair."""
    names = tuple(map(unquote, text.split(" - ")))
    return names if len(names) == 2 else None
