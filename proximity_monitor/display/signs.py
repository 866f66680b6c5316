"""How a clearance is shown: its number with unit, its sign, its colour.

Every state has its own glyph, word and line pattern, so that nothing depends on colour alone. The
colours are from the palette of Okabe and Ito, which most people can tell apart. Contact is a dark
purple, because pink looks grey to people who do not see green.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from proximity_monitor.display import fresh
from proximity_monitor.display.order import margin_of
from proximity_monitor.display.state import (
    BOUNDED,
    OVERLAPPING,
    STALE,
    STOP,
    UNKNOWN,
    WARN,
    Pairs,
    SceneInfo,
    Thresholds,
    Unit,
)

DECIMALS = {"m": 5, "mm": 3, "in": 4}
"""Digits after the point, for a resolution of 1 to 10 µm: assemblies are made no finer."""


class Sign(NamedTuple):
    """The sign of a state: a glyph, a word and a colour."""

    glyph: str
    word: str
    colour: str
    """A colour of the style sheet; it turns grey once the news is old."""

    @property
    def kind(self) -> str:
        """The state of pairs with this sign, one of `order.KINDS`."""
        word = self.word.rstrip("?").lower()
        return {"overlap": "contact", "unwatched": "stale"}.get(word, word)


CLEAR_SIGN = Sign("●", "clear", fresh.fading(fresh.GREEN))
WARN_SIGN = Sign("▲", "warn", fresh.fading("#e69f00"))
WARN_UNPROVED_SIGN = Sign("△", "warn?", WARN_SIGN.colour)
STOP_SIGN = Sign("■", "STOP", fresh.fading("#d55e00"))
STOP_UNPROVED_SIGN = Sign("□", "STOP?", STOP_SIGN.colour)
CONTACT_SIGN = Sign("✖", "CONTACT", fresh.fading("#9008ac"))
OVERLAP_SIGN = Sign("✖", "OVERLAP", CONTACT_SIGN.colour)
HIDDEN_SIGN = Sign("◍", "hidden", fresh.GREY)
STALE_SIGN = Sign("?", "stale", fresh.GREY)
UNWATCHED_SIGN = Sign("○", "unwatched", fresh.GREY)
SIGNS = (
    OVERLAP_SIGN, CONTACT_SIGN, STOP_SIGN, STOP_UNPROVED_SIGN, WARN_SIGN, WARN_UNPROVED_SIGN,
    STALE_SIGN, CLEAR_SIGN,
)  # fmt: skip
"""The signs of listed pairs, the worst first."""

_FAR = np.array([0x00, 0x72, 0xB2], float)
_CLEAR = np.array([0x00, 0x9E, 0x73], float)
_WARN = np.array([0xE6, 0x9F, 0x00], float)
_STOP = np.array([0xD5, 0x5E, 0x00], float)
_CONTACT = np.array([0x90, 0x08, 0xAC], float)
_STALE = np.array([0x7A, 0x7A, 0x85], float)


def sign(pairs: Pairs, row: int, scene: SceneInfo) -> Sign:
    """Return the sign of a pair."""
    level, status = pairs.level[row], pairs.status[row]
    if level == STALE or status == UNKNOWN:
        return STALE_SIGN
    if status == OVERLAPPING:
        return OVERLAP_SIGN
    if pairs.touching[row]:
        return CONTACT_SIGN
    if level == STOP:
        return STOP_UNPROVED_SIGN if unproved(pairs, row, scene) else STOP_SIGN
    if level == WARN:
        return WARN_UNPROVED_SIGN if unproved(pairs, row, scene) else WARN_SIGN
    return CLEAR_SIGN


def unproved(pairs: Pairs, row: int, scene: SceneInfo) -> bool:
    """Return whether a pair at warn or stop may be above that threshold: its bounds enclose it."""
    thresholds = scene.thresholds_of(pairs.names[row])
    threshold = thresholds.stop if pairs.level[row] == STOP else thresholds.warn
    return bool(pairs.lower[row] <= threshold < pairs.upper[row])


def all_unproved(pairs: Pairs, scene: SceneInfo) -> np.ndarray:
    """Return for each pair (k,) whether it is `unproved`; a clear or stale pair is not.

    Args:
        pairs: the pairs of a tick.
        scene: has the thresholds.
    """
    warn, stop = scene.warn_and_stop(pairs.names)
    threshold = np.where(pairs.level == STOP, stop, warn)
    near = (pairs.level == STOP) | (pairs.level == WARN)
    return near & (pairs.lower <= threshold) & (threshold < pairs.upper)


def mark(shown: Sign) -> str:
    """Return a sign with its word as HTML, which changes once the news is old."""
    bad = shown not in (CLEAR_SIGN, HIDDEN_SIGN, STALE_SIGN)
    then = f"was {shown.word}" if bad else STALE_SIGN.word
    return fresh.aging(f"{shown.glyph} {shown.word}", f"{STALE_SIGN.glyph} {then}")


def glyph(shown: Sign) -> str:
    """Return a sign without its word as HTML, which changes once the news is old."""
    return fresh.aging(shown.glyph, STALE_SIGN.glyph)


_PARAMETERS = {"patch": ("u", "v"), "curve": ("t",)}
"""Names of the parameters on an element, by its kind; a triangle's are weights of its corners."""


def number(metres: float, unit: Unit) -> str:
    """Return a length in the unit, without its symbol."""
    if math.isnan(metres):
        return "n/a"
    if math.isinf(metres):
        return "∞" if metres > 0.0 else "-∞"
    digits = DECIMALS.get(unit.symbol, 4)
    return f"{round(metres / unit.to_metre, digits) + 0.0:.{digits}f}"  # + 0.0: never "-0.000"


def length(metres: float, unit: Unit) -> str:
    """Return a length with its unit."""
    return f"{number(metres, unit)} {unit.symbol}"


def clearance(pairs: Pairs, row: int, unit: Unit) -> str:
    """Return a pair's clearance: one number, or both bounds if they differ in the shown digits.

    That of a stale pair is called the last one, because nothing is certain about the present one.
    """
    if pairs.status[row] == UNKNOWN:
        return "no pose"
    overlapping = bool(pairs.status[row] == OVERLAPPING)
    told = between(pairs.lower[row], pairs.upper[row], overlapping, unit)
    return f"last {told}" if pairs.level[row] == STALE else told


def between(lower: float, upper: float, overlapping: bool, unit: Unit) -> str:
    """Return a clearance with these bounds in metres; see `clearance`."""
    bounds = (-upper, -lower) if overlapping else (lower, upper)
    low, high = (number(x, unit) for x in bounds)
    both = high if low == high else f"{low} … {high}"
    return f"{both} {unit.symbol}{' deep' if overlapping else ''}"


def margin(pairs: Pairs, row: int, scene: SceneInfo) -> str:
    """Return a pair's margin for people; empty if the pair is stale."""
    found = margin_of(pairs, row, scene)
    return f"margin to {found.to}: at least {length(found.metres, scene.unit)}" if found.to else ""


def feature(told: str) -> str:
    """Return, for people, on what a closest point lies, such as ``patch 4, u 1.000, v 0.804``."""
    kind, index, *where = told.split()
    names = _PARAMETERS.get(kind, ())
    numbers = [f"{float(value):.3f}" for value in where]
    if len(names) == len(numbers):
        numbers = [f"{name} {value}" for name, value in zip(names, numbers, strict=True)]
    return ", ".join((f"{kind} {index}", *numbers))


def uncertain(pairs: Pairs, row: int) -> bool:
    """Return whether only bounds are known, because the budget cut the search."""
    return bool(pairs.status[row] == BOUNDED)


def ramp(lower: float, thresholds: Thresholds, *, touching: bool, stale: bool) -> np.ndarray:
    """Return the colour (3,), 0 to 255, of a clearance against its thresholds.

    `lower`, the certified lower bound, determines it. At or below `stop` it is the colour of stop.
    From there it runs to that of warn at `warn`, of clear at twice `warn`, and to blue at four
    times `warn`.
    """
    if stale or math.isnan(lower):
        return _STALE
    if touching:
        return _CONTACT
    warn = max(thresholds.warn, thresholds.stop, 1e-12)
    places = (thresholds.stop, warn, 2.0 * warn, 4.0 * warn)
    for near, far, first, last in zip(
        places, places[1:], (_STOP, _WARN, _CLEAR), (_WARN, _CLEAR, _FAR), strict=False
    ):
        if lower <= near:
            return first
        if lower < far:
            return first + (last - first) * ((lower - near) / (far - near))
    return _FAR
