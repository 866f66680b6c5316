"""Clicks on the page's own HTML: each becomes a text that a callback takes.

viser shows HTML as it is given and hears only its own elements. So a text field that nobody sees
stands behind the HTML; what is pressed types its word there. Words end in the time of the click, so
that the same one twice is a change twice. Press and not click: HTML that is written anew between
the two would swallow the click.
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

OnWord = Callable[[str, viser.ClientHandle | None], None]


class Bridge:
    """The hidden field."""

    def __init__(self, gui: viser.GuiApi, on_word: OnWord) -> None:
        """Add the field where the GUI stands; `on_word` is told each word, and who pressed."""
        gui.add_html(f'<style>{_STYLE}</style><span id="{_ID}"></span>')
        field = gui.add_text("pressed", "")

        @field.on_update
        async def _(event: viser.GuiEvent) -> None:
            word, found, _ = field.value.rpartition("#")
            if found:
                on_word(word, event.client)


def word(text: str) -> str:
    """Return the attribute of an element that, when pressed within `PRESSES`, tells a word."""
    return f'data-word="{escape(text, quote=True)}"'
