"""The states' colours as people see them, with and without colour blindness."""

import re
from itertools import combinations

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.display import banding, inks, signs
from proximity_monitor.display.lines import pattern

# Machado, Oliveira, Fernandes: A physiologically-based model for simulation of color vision
# deficiency (2009), severity 1.0, for linear light.
SEEN = {
    "all": np.eye(3),
    "no red": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "no green": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "no blue": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
# Linear sRGB to XYZ (IEC 61966-2-1), and the white of D65.
TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
STATES = {
    each.word.lower(): re.search("#[0-9a-f]{6}", each.colour)[0]
    for each in (
        signs.CLEAR_SIGN,
        signs.WARN_SIGN,
        signs.STOP_SIGN,
        signs.CONTACT_SIGN,
        signs.STALE_SIGN,
    )
}
LEAST = 15.0
"""Least difference in CIELAB units; a difference of about 2.3 is just noticed."""


def lab(colour, seen):
    """Return the CIELAB values of a colour (0 to 255) as seen with `seen`, a matrix of `SEEN`."""
    c = np.asarray(colour, float) / 255.0
    light = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(np.array(seen) @ light, 0.0, 1.0) / TO_XYZ.sum(axis=1)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def apart(colours, seen):
    """Return the least difference between any two colours, and the names of the two."""
    labs = {name: lab(colour, seen) for name, colour in colours.items()}
    return min((float(np.linalg.norm(labs[a] - labs[b])), a, b) for a, b in combinations(labs, 2))


def rgb(text):
    return [int(text[i : i + 2], 16) for i in (1, 3, 5)]


@pytest.mark.parametrize("who", SEEN)
def test_the_colours_of_the_states_are_told_apart(who):
    assert apart({name: rgb(text) for name, text in STATES.items()}, SEEN[who]) > (LEAST, "")


@pytest.mark.parametrize("who", SEEN)
def test_the_bands_are_told_apart(who):
    assert apart(dict(enumerate(banding.COLOURS)), SEEN[who]) > (LEAST, "")


def drawn(colour):
    """Return the colour in which three.js draws a line of a sent colour: the ACES film curve."""
    v = inks._INTO @ (np.asarray(colour, float) / 255.0 / 0.6)
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    light = np.clip(inks._OUT_OF @ v, 0.0, 1.0)
    return 255.0 * np.where(
        light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055
    )


def test_the_film_curve_is_the_one_that_a_browser_was_seen_to_draw():
    np.testing.assert_allclose(drawn((213, 94, 0)), (226, 181, 45), atol=1.0)
    np.testing.assert_allclose(drawn((0, 158, 115)), (98, 208, 192), atol=1.0)


@pytest.mark.parametrize("who", SEEN)
def test_lines_are_told_apart_as_they_are_drawn(who):
    colours = {name: drawn(inks.sent(rgb(text))) for name, text in STATES.items()}
    assert apart(colours, SEEN[who]) > (LEAST, "")
    for name, colour in colours.items():
        assert np.linalg.norm(lab(colour, SEEN["all"]) - lab(rgb(STATES[name]), SEEN["all"])) < 6.0


def test_no_state_differs_by_colour_alone():
    all_signs = [each for name, each in vars(signs).items() if name.endswith("_SIGN")]
    assert len(all_signs) == 10
    assert len({each.word for each in all_signs}) == len(all_signs)
    # Contact and overlap are one state.
    assert len({each.glyph for each in all_signs}) == len(all_signs) - 1
    lines = {pattern(level, False).tobytes() for level in range(4)}
    assert len(lines) == 3  # clear and stop differ by their widths
