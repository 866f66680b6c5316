"""Clicks on the page's own HTML: each becomes a text that a callback takes.

viser shows HTML as given and hears only its own elements. So there is a hidden text field behind
the HTML, and a pressed element types its word there. Words end with the time of the press, so that
pressing one twice changes the field twice. It listens to presses, not to clicks, because HTML that
is rewritten between press and release would swallow a click.
"""

from __future__ import annotations

from collections.abc import Callable
from html import escape

import viser

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
